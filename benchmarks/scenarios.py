"""Speed of every scenario with every driver in the kernel, and what its time goes into."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from math import exp
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

from benchmarks import parts
from benchmarks.timing import Timing, time_block
from benchmarks.vectors import INTERNAL, block
from shared_control_env.registration import ENVIRONMENTS

N = 512
"""Number of environments."""

STEPS = 201
"""Number of steps of a block: an episode and its reset, so that each block draws every environment's episode."""

REFERENCE = "SharedControl/TwoLane-v1", "nobody"
"""Scenario and driver that the others are compared with."""

TARGET = 0.6
"""Smallest speed of a scenario with nobody at the wheel, relative to the reference [-]."""

DRIVERS: Mapping[str, tuple[bool, dict[str, Any]]] = {
    "nobody": (False, {}),
    "mpc": (True, {}),
    "internal_model": (True, INTERNAL),
    "hands_on": (True, {**INTERNAL, "persons": ["hands_on"]}),
}
"""Whether the kernel drives, and settings, by driver."""


class Row(NamedTuple):
    """Speed of a scenario with a driver, on one core.

    Attributes:
        id: id of the environment.
        driver: name of the driver, a key of :data:`DRIVERS`.
        timing: time of an environment's step.
        speed: speed relative to :data:`REFERENCE`, median of the rounds [-].
    """

    id: str
    driver: str
    timing: Timing
    speed: float


def speeds(repeats: int) -> list[Row]:
    """Time every scenario with every driver, one after the other in each round.

    Args:
        repeats: number of rounds.
    """
    blocks = {
        (id, driver): block(id, N, 1, bound, config, iterations=None, commands=0.0, steps=STEPS)
        for id in ENVIRONMENTS
        for driver, (bound, config) in DRIVERS.items()
    }
    rounds = {key: [] for key in blocks}  # type: dict[tuple[str, str], list[float]]
    for _ in range(repeats):
        for key, run in blocks.items():
            rounds[key].append(run())
    reference = np.array(rounds[REFERENCE])
    return [Row(*key, Timing.of(times), float(np.median(reference / times))) for key, times in rounds.items()]


def mean_speed(rows: list[Row], driver: str) -> float:
    """Geometric mean of the relative speed over scenarios [-].

    Args:
        rows: result of :func:`speeds`.
        driver: name of the driver.
    """
    return exp(float(np.mean([np.log(row.speed) for row in rows if row.driver == driver])))


def shares(id: str, repeats: int) -> dict[str, Timing]:
    """Time of each part of a scenario's step.

    Args:
        id: id of the environment.
        repeats: number of repeats.

    Returns:
        Time of an environment's step by the name of the part; the drawing of episodes is shared among the steps of an
        episode without failures.
    """
    found = parts.times(repeats, id)
    env: Any = gym.make_vec(id, num_envs=N, threads=1).unwrapped
    env.reset(seed=0)
    everyone = np.ones(N, dtype=bool)

    def draw() -> int:
        env._draw(everyone)
        return N * env._setup.steps

    found["drawing of episodes"] = time_block(partial(draw), repeats)
    return found
