"""The learning tasks with their rewards, and everything that is drawn at random in training."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from typing import Any, NamedTuple

from shared_control_env.envs.scenarios import DRAWN_V1, SCENARIOS
from shared_control_env.evaluation.catalogue import DRIVERS
from shared_control_env.registration import ENVIRONMENTS

# An effort of 9 % of the limits counts as much as a lateral error of 0.1 m, or a speed error of 0.2 m/s. Progress
# counts very little: with more, a driver learns to oppose an automation that rightly slows down. A failure, discounted
# by 0.98 per step, outweighs hard braking for as long as necessary, and a safety margin of one metre.
_REWARD = {
    "progress": 0.01,
    "lane": 4.0,
    "speed": 0.8,
    "effort": 1.3,
    "comfort": 0.005,
    "conflict": 0.01,
    "failure": 800.0,
}

# An allocator only chooses how much the person has to do. The weight of the lane is therefore larger, and that of the
# effort smaller. The weight of a failure is smaller too, since the allocator seldom causes it.
_ALLOCATOR_REWARD = {**_REWARD, "lane": 8.0, "effort": 0.4, "failure": 600.0}


def _lag(gains: tuple[float, float], times: tuple[float, float]) -> tuple[dict[str, Any], ...]:
    """Random draws of the driver's response: K_h [-] and T_h [s]."""
    ranges = {"driver_lag.K_h": gains, "driver_lag.T_h": times}
    return tuple({"setting": name, "low": low, "high": high} for name, (low, high) in ranges.items())


class Task(NamedTuple):
    """A learning task.

    Attributes:
        description: description in one line.
        reward: weights of the terms of :mod:`core.feedback.reward`.
        draws: random draws of the driver's response, entries of ``config["randomise"]``.
        config: further settings, such as the persons at the wheel.
    """

    description: str
    reward: dict[str, float]
    draws: tuple[Mapping[str, Any], ...]
    config: Mapping[str, Any] = {}


# The lags are drawn around the five responses that the paper identified. A learning driver is drawn well beyond them:
# a driver who is unsure of its own response keeps a margin. An allocator learns beside the catalogue's population of
# persons, most of whom rest their hands: beside the paper's predictive driver it would learn about that driver's
# instability.
_POPULATION = DRIVERS["population"]

TASKS = {
    "driver": Task("compensate under the fuzzy limiter", _REWARD, _lag((0.75, 1.4), (0.1, 0.32))),
    "allocator": Task(
        "decide alpha_a beside a population of persons", _ALLOCATOR_REWARD, _POPULATION.draws, _POPULATION.config
    ),
}
"""Tasks by name."""

HELD_OUT_DEGRADATIONS = ("intermittent", "delay", "coloured_noise", "sign_error")
"""Degradations left out of training."""

TRAINED_DEGRADATIONS = tuple(name for name in ("none", *DRAWN_V1) if name not in HELD_OUT_DEGRADATIONS)
"""Degradations of training: none, and those of version 1 of the environments except the held-out ones."""

VALIDATION_SEED = 900_000
"""Training uses seeds below this one; seeds from here on are used to choose the best policy."""

HELD_OUT_SEED = 3_000_000
"""Seeds from here on are used to compare policies; neither training nor the choice of the best policy uses them."""


def training_config(id: str, task: str) -> dict[str, Any]:
    """Settings of training: all degradations except the held-out ones, the task's driver, and the task's reward.

    Args:
        id: id of a registered environment, whose own random draws are kept.
        task: key of :data:`TASKS`.
    """
    return {
        **deepcopy(dict(TASKS[task].config)),
        "authority": {"law": "proportional"},
        "faults": [],
        "degradations": list(TRAINED_DEGRADATIONS),
        "randomise": [*SCENARIOS[ENVIRONMENTS[id]].settings.get("randomise", []), *map(dict, TASKS[task].draws)],
        "reward": dict(TASKS[task].reward),
    }
