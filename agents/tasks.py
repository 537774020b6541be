"""What is learned: the tasks with their rewards, and all that is drawn in training."""

from __future__ import annotations

from typing import Any, NamedTuple

from shared_control_env.envs.scenarios import DRAWN_V0, SCENARIOS
from shared_control_env.registration import ENVIRONMENTS

# An effort of 9 % of the limits counts as much as a lateral error of 0.1 m, or a speed error of 0.2 m/s. Progress
# counts next to nothing: with more a driver learns to push against an automation that is right to slow down. A
# failure, discounted by 0.98 a step, outweighs braking hard for as long as it takes, and a last metre kept for safety.
_REWARD = {
    "progress": 0.01,
    "lane": 4.0,
    "speed": 0.8,
    "effort": 1.3,
    "comfort": 0.005,
    "conflict": 0.01,
    "failure": 800.0,
}

# The predictive driver leaves the lane more often than it collides, and an allocator can only choose how much it has to
# do: more for the lane, less for the effort, and less for a failure, which is seldom the allocator's doing.
_ALLOCATOR_REWARD = {**_REWARD, "lane": 8.0, "effort": 0.4, "failure": 600.0}


def _lag(gains: tuple[float, float], times: tuple[float, float]) -> tuple[dict[str, Any], ...]:
    """Draws of the driver's response: K_h and T_h [s]."""
    ranges = {"driver_lag.K_h": gains, "driver_lag.T_h": times}
    return tuple({"setting": name, "low": low, "high": high} for name, (low, high) in ranges.items())


class Task(NamedTuple):
    """A task.

    Attributes:
        description: in a line.
        reward: weights of the terms of :mod:`core.feedback.reward`.
        lag: draws of the driver's response.
    """

    description: str
    reward: dict[str, float]
    lag: tuple[dict[str, Any], ...]


# Around the five responses that the paper identified. A driver who learns is drawn well beyond them: one who is not
# sure of what the hands will do keeps a margin. The predictive driver takes the paper's lag for granted, and with so
# much of others an allocator would mostly see it fail.
TASKS = {
    "driver": Task("compensate under the fuzzy limiter", _REWARD, _lag((0.75, 1.4), (0.1, 0.32))),
    "allocator": Task(
        "decide alpha_a beside the predictive driver", _ALLOCATOR_REWARD, _lag((0.9, 1.25), (0.12, 0.24))
    ),
}
"""Tasks by name."""

HELD_OUT_DEGRADATIONS = ("intermittent", "delay", "coloured_noise", "sign_error")
"""Degradations left out of training."""

TRAINED_DEGRADATIONS = tuple(name for name in ("none", *DRAWN_V0) if name not in HELD_OUT_DEGRADATIONS)
"""Degradations of training: none, and those of version 0 of the environments but for what is held out."""

VALIDATION_SEED = 900_000
"""Training uses seeds below; from here on the best policy is chosen."""

HELD_OUT_SEED = 3_000_000
"""From here on policies are compared with others; neither training nor the choice of the best has seen these."""


def training_config(id: str, task: str) -> dict[str, Any]:
    """Settings of training: every degradation but those held out, the lag drawn too, and the task's reward.

    Args:
        id: of a registered environment, which keeps its own draws.
        task: key of :data:`TASKS`.
    """
    return {
        "authority": {"law": "proportional"},
        "faults": [],
        "degradations": list(TRAINED_DEGRADATIONS),
        "randomise": [*SCENARIOS[ENVIRONMENTS[id]].settings.get("randomise", []), *TASKS[task].lag],
        "reward": dict(TASKS[task].reward),
    }
