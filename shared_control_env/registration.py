"""Registration of the environments with Gymnasium."""

from __future__ import annotations

import gymnasium as gym
from gymnasium.envs.registration import WrapperSpec

ENVIRONMENTS = {
    "SharedControl/TwoLane-v0": "shared_control_env.envs.scenarios:TwoLaneEnv",
    "SharedControl/Curve-v0": "shared_control_env.envs.scenarios:CurveEnv",
}
"""Ids and classes. Each is made with the authority limiter applied: the action is the driver's."""


def register_environments() -> None:
    """Register every id that is not registered yet."""
    limiter = WrapperSpec("AuthorityLimiter", "shared_control_env.wrappers:AuthorityLimiter", kwargs={})
    for name, entry_point in ENVIRONMENTS.items():
        if name not in gym.registry:
            gym.register(id=name, entry_point=entry_point, additional_wrappers=(limiter,))
