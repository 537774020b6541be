"""What is learned: the tasks with their rewards, and all that is drawn in training."""

from __future__ import annotations

from typing import Any, NamedTuple

from shared_control_env.core.parameters import RewardParameters
from shared_control_env.envs.cases import CASES
from shared_control_env.envs.degradations import DEGRADATIONS
from shared_control_env.registration import ENVIRONMENTS

# An effort of 9 % of the limits counts as much as a lateral error of 0.1 m, or a speed error of 0.2 m/s. Progress
# counts next to nothing: with more a driver learns to push against an automation that is right to slow down. A
# failure, discounted by 0.98 a step, outweighs braking hard for as long as it takes, and a last metre kept for safety.
_REWARD = RewardParameters(progress=0.01, lane=4.0, speed=0.8, effort=1.3, comfort=0.005, conflict=0.01, failure=800.0)

# The predictive driver leaves the lane more often than it collides, and an allocator can only choose how much it has to
# do: more for the lane, less for the effort, and less for a failure, which is seldom the allocator's doing.
_ALLOCATOR_REWARD = _REWARD._replace(lane=8.0, effort=0.4, failure=600.0)


class Task(NamedTuple):
    """A task.

    Attributes:
        description: in a line.
        reward: weights of the terms of :mod:`core.reward`.
    """

    description: str
    reward: RewardParameters


TASKS = {
    "driver": Task("compensate under the fuzzy limiter", _REWARD),
    "allocator": Task("decide alpha_a beside the predictive driver", _ALLOCATOR_REWARD),
}
"""Tasks by name."""

HELD_OUT_DEGRADATIONS = ("intermittent", "delay", "coloured_noise", "sign_error")
"""Degradations left out of training."""

VALIDATION_SEED = 900_000
"""Training uses seeds below; from here on the best policy is chosen."""

HELD_OUT_SEED = 3_000_000
"""From here on policies are compared with others; neither training nor the choice of the best has seen these."""

LAG_RANGES = (
    {"setting": "driver_lag.K_h", "low": 0.75, "high": 1.4},
    {"setting": "driver_lag.T_h", "low": 0.1, "high": 0.32},
)
"""The driver's response in training, well around the five that the paper identified: one who is not sure of what the
hands will do keeps a margin."""


def training_config(id: str, task: str) -> dict[str, Any]:
    """Settings of training: every degradation but those held out, the lag drawn too, and the task's reward.

    Args:
        id: of a registered environment, which keeps its own draws.
        task: key of :data:`TASKS`.
    """
    return {
        "authority": {"law": "proportional"},
        "faults": [],
        "degradations": [name for name in DEGRADATIONS if name not in HELD_OUT_DEGRADATIONS],
        "randomise": [*CASES[ENVIRONMENTS[id]].settings.get("randomise", []), *LAG_RANGES],
        "reward": TASKS[task].reward._asdict(),
    }
