"""What is learned: the environment of a task, with all that is drawn in it."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
from stable_baselines3.common.vec_env import VecEnv, VecFrameStack, VecMonitor

from agents.history import HISTORY
from shared_control_env.envs.cases import CASES
from shared_control_env.envs.degradations import DEGRADATIONS
from shared_control_env.registration import ENVIRONMENTS
from shared_control_env.vector.stable_baselines import StableBaselinesVecEnv

TASKS = ("driver", "allocator")
"""``driver``: compensate under the fuzzy limiter; ``allocator``: decide alpha_a beside the predictive driver."""

HELD_OUT_KINDS = ("intermittent", "delay", "coloured_noise", "sign_error")
"""Degradations left out of training."""

HELD_OUT_SEED = 1_000_000
"""Training uses seeds below, evaluation from here on."""

LAG_RANGES = (
    {"setting": "driver_lag.K_h", "low": 0.9, "high": 1.25},
    {"setting": "driver_lag.T_h", "low": 0.12, "high": 0.24},
)
"""The driver's response in training, around the five that the paper identified."""


def training_config(scenario_config: dict[str, Any]) -> dict[str, Any]:
    """Settings of training: every degradation but those held out, and the lag drawn too.

    Args:
        scenario_config: settings of the scenario, which keeps its own draws.
    """
    degradations = [name for name in DEGRADATIONS if name not in HELD_OUT_KINDS]
    return {
        "authority": {"law": "proportional"},
        "faults": [],
        "degradations": degradations,
        "randomise": [*scenario_config.get("randomise", []), *LAG_RANGES],
    }


def make_environment(id: str, task: str, num_envs: int, seed: int) -> VecEnv:
    """Environments of a task for Stable-Baselines3, with the history stacked and episodes monitored.

    Args:
        id: of a registered environment.
        task: one of :data:`TASKS`.
        num_envs: how many.
        seed: of the first one; the others follow.
    """
    bound: Any = {"limiter": task == "driver", "driver": task == "allocator"}
    config = training_config(CASES[ENVIRONMENTS[id]].settings)
    env = gym.make_vec(id, num_envs=num_envs, autoreset_mode="same_step", config=config, **bound)
    stacked = VecMonitor(VecFrameStack(StableBaselinesVecEnv(env), HISTORY))
    stacked.seed(seed)
    return stacked
