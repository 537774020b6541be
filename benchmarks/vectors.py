"""Steps of many environments: the kernel on one core and on all, and highway-env in processes."""

from __future__ import annotations

import os
from importlib.util import find_spec

import gymnasium as gym
import numpy as np

from benchmarks.environments import highway_config
from benchmarks.timing import Timing, time_block

SIZES = (1, 64, 1024, 4096)
"""Numbers of environments."""

ITERATIONS = 2
"""Gauss-Newton iterations of the automation in these timings."""


def kernel(num_envs: int, threads: int, driver: bool, repeats: int) -> Timing:
    """Time of one environment's step; random driver commands, or the driver's program in the kernel."""
    config = {"solver": {"iterations": ITERATIONS}}
    env = gym.make_vec("SharedControl/TwoLane-v0", num_envs=num_envs, threads=threads, driver=driver, config=config)
    env.reset(seed=0)
    actions = 0.1 * np.random.default_rng(0).normal(size=(num_envs, 2)).clip(-1, 1)
    steps = max(2, 4096 // num_envs)

    def block() -> int:
        for _ in range(steps):
            env.step(actions)
        return steps * num_envs

    timing = time_block(block, repeats)
    env.close()
    return timing


def highway_processes(repeats: int) -> Timing:
    """highway-env in one process a core, time of one environment's step."""
    n = os.cpu_count() or 1

    def make() -> gym.Env:
        import highway_env

        gym.register_envs(highway_env)
        return gym.make("highway-v0", config=highway_config())

    envs = gym.vector.AsyncVectorEnv([make] * n, context="spawn")
    envs.reset(seed=0)
    envs.action_space.seed(0)

    def block() -> int:
        for _ in range(50):
            envs.step(0.1 * envs.action_space.sample())
        return 50 * n

    timing = time_block(block, repeats)
    envs.close()
    return timing


def metadrive(repeats: int) -> Timing | None:
    """MetaDrive with little traffic and no rendering, where it is installed."""
    if find_spec("metadrive") is None:
        return None
    from metadrive import MetaDriveEnv  # type: ignore[import-not-found]

    env = MetaDriveEnv({"use_render": False, "traffic_density": 0.05, "log_level": 50})
    env.reset()

    def block() -> int:
        for _ in range(100):
            _, _, terminated, truncated, _ = env.step([0.0, 0.2])
            if terminated or truncated:
                env.reset()
        return 100

    timing = time_block(block, repeats)
    env.close()
    return timing


def bytes_per_environment() -> int:
    """Memory of one environment's state [B]."""
    return gym.make_vec("SharedControl/TwoLane-v0", num_envs=64).unwrapped.bytes_per_environment  # type: ignore[attr-defined]
