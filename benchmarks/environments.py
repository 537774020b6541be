"""Speed of the environments compared with highway-env's own environment."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import highway_env
import numpy as np

import shared_control_env
from benchmarks.timing import Timing, time_block
from shared_control_env.wrappers import DriverModel

STEPS = 200
"""Number of steps of one measured block."""


def stepper(env: gym.Env, action: Callable[[], object], steps: int) -> Callable[[], int]:
    """A block of steps that resets the environment when an episode ends.

    Args:
        env: the environment.
        action: function that gives the action of a step.
        steps: number of steps of the block.
    """
    env.reset(seed=0)

    def block() -> int:
        for _ in range(steps):
            _, _, terminated, truncated, _ = env.step(action())
            if terminated or truncated:
                env.reset()
        return steps

    return block


def highway_config() -> dict[str, Any]:
    """Settings of highway-env: 4 vehicles, ContinuousAction (dynamical), Kinematics, 20 Hz simulation and policy."""
    return {
        "vehicles_count": 3,
        "lanes_count": 2,
        "action": {"type": "ContinuousAction", "dynamical": True},
        "observation": {"type": "Kinematics"},
        "simulation_frequency": 20,
        "policy_frequency": 20,
        "duration": 10,
    }


def highway(repeats: int) -> Timing:
    """Time of a step of highway-env's own environment with :func:`highway_config`.

    Args:
        repeats: number of measured blocks.
    """
    gym.register_envs(highway_env)
    env = gym.make("highway-v0", config=highway_config())
    env.action_space.seed(0)
    return time_block(stepper(env, env.action_space.sample, 100), repeats)


def limited(repeats: int) -> Timing:
    """Time of a step of TwoLane-v1 with limiter, triangulation at every step, and random driver actions.

    Args:
        repeats: number of measured blocks.
    """
    gym.register_envs(shared_control_env)
    env = gym.make("SharedControl/TwoLane-v1")
    env.action_space.seed(0)
    return time_block(stepper(env, env.action_space.sample, STEPS), repeats)


def closed_loop(repeats: int) -> Timing:
    """Time of a step of TwoLane-v1 with the limiter and the OSQP driver bound.

    Args:
        repeats: number of measured blocks.
    """
    env = DriverModel(gym.make("SharedControl/TwoLane-v1"))
    return time_block(stepper(env, lambda: np.int64(0), STEPS), repeats)
