"""Registration of the environments with Gymnasium."""

from __future__ import annotations

import gymnasium as gym

from shared_control_env.envs.scenarios import SCENARIOS, register

ENVIRONMENTS = {scenario.id: name for name, scenario in SCENARIOS.items()}
"""Ids of the environments that the package registers, and their keys in ``envs.scenarios.SCENARIOS``."""


def register_environments() -> None:
    """Register every id that is not yet registered."""
    for id, name in ENVIRONMENTS.items():
        if id not in gym.registry:
            register(name)
