"""Speed of many environments: the kernel on one core and on all cores, and highway-env in processes."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from time import perf_counter
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

from benchmarks.environments import highway_config
from benchmarks.timing import Timing, time_block
from shared_control_env.core.compile.cold_start import cores

SIZES = (1, 64, 1024, 4096)
"""Numbers of environments."""

ITERATIONS = 2
"""Number of Gauss-Newton iterations of the automation in these timings."""

BLOCK = 16_384
"""Number of environment steps in a timing, large enough that waking a thread or filling a cache has no effect."""


class Scaling(NamedTuple):
    """Time of one environment's step on one core and on all cores.

    Attributes:
        one: time on one core.
        all: time on all cores; None for one core or one environment.
        ratio: speed of all cores relative to one core, median of the rounds; 1 if there is no ``all`` [-].
    """

    one: Timing
    all: Timing | None
    ratio: float


INTERNAL = {"internal_model": {"active": True}}

VARIANTS: dict[str, tuple[dict[str, Any], dict[str, Any], str]] = {
    "a person at the wheel, against the same driver without": (
        {**INTERNAL, "persons": ["hands_on"]},
        INTERNAL,
        "0.6 x",
    ),
    "brush tyres, against linear ones": ({"vehicle": {"tyre": "fiala"}}, {}, ""),
    "actuators, against none": ({"actuator": {"steering_lag": 0.1, "acceleration_lag": 0.1}}, {}, ""),
}
"""Settings that cost time, the settings that they are timed against, and the target of the ratio, by what they are."""


def variant(config: dict[str, Any], base: dict[str, Any], repeats: int) -> tuple[Timing, float]:
    """Time the kernel with its driver under some settings, in turn with others, on one core.

    Args:
        config: the settings.
        base: the settings to compare them with.
        repeats: number of measured blocks of each.

    Returns:
        Time of an environment's step, and the speed relative to the base, median of the pairs [-].
    """
    ours, others = (block("SharedControl/TwoLane-v1", 256, 1, True, each) for each in (config, base))
    pairs = [(ours(), others()) for _ in range(repeats)]
    return Timing.of([own for own, _ in pairs]), float(np.median([other / own for own, other in pairs]))


def kernel(num_envs: int, driver: bool, repeats: int, id: str = "SharedControl/TwoLane-v1") -> Scaling:
    """Time the kernel with random driver commands, or with the driver's program in the kernel.

    A round times every core alone, and all cores together after each of them. On a shared machine the cores differ, and
    their speeds change within seconds. All environments advance equally far in their episodes.

    Args:
        num_envs: number of environments.
        driver: whether the predictive driver is bound.
        repeats: number of rounds.
        id: id of the environment.
    """
    ours = cores()
    alone = block(id, num_envs, 1, driver)
    everywhere = block(id, num_envs, len(ours), driver) if min(len(ours), num_envs) > 1 else None
    one, every, ratios = [], [], []
    for _ in range(repeats):
        for core in ours:
            one.append(_on_core(core, alone))
            if everywhere is not None:
                every.append(everywhere())
        if everywhere is not None:
            ratios.append(_rate(every[-len(ours) :]) / _rate(one[-len(ours) :]))
    return Scaling(Timing.of(one), Timing.of(every) if every else None, float(np.median(ratios)) if ratios else 1.0)


def _rate(seconds: list[float]) -> float:
    """Mean rate in steps per second, from times per step."""
    return float(np.mean(1.0 / np.array(seconds)))


def block(
    id: str,
    num_envs: int,
    threads: int,
    driver: bool,
    config: Mapping[str, Any] = {},
    iterations: int | None = ITERATIONS,
    commands: float = 0.1,
    steps: int | None = None,
) -> Callable[[], float]:
    """A timed block of steps of new environments; a first block runs at once, unmeasured.

    Args:
        id: id of the environment.
        num_envs: number of environments.
        threads: number of threads.
        driver: whether the predictive driver is bound.
        config: settings.
        iterations: number of the automation's iterations; None for the default.
        commands: standard deviation of the driver's commands, as shares of the limits, held over the block [-].
        steps: number of steps of a block; None for :data:`BLOCK` steps of environments.

    Returns:
        Function that returns the time of an environment's step [s].
    """
    if iterations is not None:
        config = {**config, "solver": {"iterations": iterations}}
    env = gym.make_vec(id, num_envs=num_envs, threads=threads, driver=driver, config=dict(config))
    env.reset(seed=0)
    actions = commands * np.random.default_rng(0).normal(size=(num_envs, 2)).clip(-1, 1)
    count = max(2, BLOCK // num_envs) if steps is None else steps

    def run() -> float:
        begin = perf_counter()
        for _ in range(count):
            env.step(actions)
        return (perf_counter() - begin) / (count * num_envs)

    run()
    return run


def _on_core(core: int, run: Callable[[], float]) -> float:
    """Time a block on one core, if the operating system supports the choice of a core."""
    if not hasattr(os, "sched_setaffinity"):
        return run()
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {core})
    try:
        return run()
    finally:
        os.sched_setaffinity(0, allowed)


def highway_processes(repeats: int) -> Timing:
    """Time of one environment's step of highway-env, with one process per core.

    Args:
        repeats: number of measured blocks.
    """
    n = len(cores())

    def make() -> gym.Env:
        import highway_env

        gym.register_envs(highway_env)
        return gym.make("highway-v0", config=highway_config())

    envs = gym.vector.AsyncVectorEnv([make] * n, context="spawn")
    envs.reset(seed=0)
    envs.action_space.seed(0)

    def run() -> int:
        for _ in range(50):
            envs.step(0.1 * envs.action_space.sample())
        return 50 * n

    timing = time_block(run, repeats)
    envs.close()
    return timing


def metadrive(repeats: int) -> Timing | None:
    """Time of a step of MetaDrive with little traffic and no rendering; None if it is not installed.

    Args:
        repeats: number of measured blocks.
    """
    if find_spec("metadrive") is None:
        return None
    from metadrive import MetaDriveEnv  # type: ignore[import-not-found]

    env = MetaDriveEnv({"use_render": False, "traffic_density": 0.05, "log_level": 50})
    env.reset()

    def run() -> int:
        for _ in range(100):
            _, _, terminated, truncated, _ = env.step([0.0, 0.2])
            if terminated or truncated:
                env.reset()
        return 100

    timing = time_block(run, repeats)
    env.close()
    return timing


def bytes_per_environment() -> int:
    """Memory of one environment's state [B]."""
    return gym.make_vec("SharedControl/TwoLane-v1", num_envs=64).unwrapped.bytes_per_environment  # type: ignore[attr-defined]
