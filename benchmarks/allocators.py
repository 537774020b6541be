"""What each allocator of the catalogue costs a step: in the kernel where it runs there, and called from Python."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from benchmarks.timing import Timing, time_block
from shared_control_env.controllers.allocators import Allocator, in_kernel
from shared_control_env.envs.environments import environment_class
from shared_control_env.envs.scenarios import SCENARIOS
from shared_control_env.evaluation.catalogue import AUTHORITIES
from shared_control_env.vector.environment import SharedControlVectorEnv
from shared_control_env.wrappers import AuthorityLimiter

SCENARIO, N, STEPS = "lane_keeping", 256, 20
"""Scenario of the timings, number of environments in the kernel, and number of steps of a measurement."""

CONFIG = {
    "authority": {"law": "proportional"},
    "degradations": [],
    "randomise": [],
    "faults": [{"onset": 0.2, "size": 0.05}],
}
"""A small bias, so that no rule ends early, and nothing is drawn."""


class Cost(NamedTuple):
    """Cost of an allocator.

    Attributes:
        name: key of :data:`AUTHORITIES`.
        kernel: time of a whole step of one environment in the kernel; None for an allocator that runs in Python.
        call: time of one decision, called from Python.
    """

    name: str
    kernel: Timing | None
    call: Timing


def costs(repeats: int) -> Iterator[Cost]:
    """Costs of all allocators.

    Args:
        repeats: number of repeats of the timings.
    """
    for name, entry in AUTHORITIES.items():
        allocator = entry.make()
        kernel = in_the_kernel(allocator, repeats) if in_kernel(allocator) else None
        yield Cost(name, kernel, from_python(allocator, repeats))


def in_the_kernel(allocator: Allocator, repeats: int) -> Timing:
    """Time of a step of one environment on one core, with a driver who does nothing.

    Args:
        allocator: allocator with a compiled form.
        repeats: number of repeats.
    """
    envs = SharedControlVectorEnv(SCENARIOS[SCENARIO], N, config=CONFIG, limiter=allocator, threads=1)
    envs.reset(seed=0)
    actions = np.zeros((N, 2), np.float32)

    def block() -> int:
        for _ in range(STEPS):
            envs.step(actions)
        return N * STEPS

    timing = time_block(block, repeats)
    envs.close()
    return timing


def from_python(allocator: Allocator, repeats: int) -> Timing:
    """Time of one decision of an allocator that the single environment binds.

    Args:
        allocator: the allocator.
        repeats: number of repeats.
    """
    env = AuthorityLimiter(environment_class(SCENARIO)(CONFIG), allocator)
    env.reset(seed=0)
    for _ in range(10):
        env.step(np.zeros(2))

    def block() -> int:
        for _ in range(200):
            env.decide()
        return 200

    return time_block(block, repeats)
