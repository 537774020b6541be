"""Registration of the environments with Gymnasium."""

from __future__ import annotations

import gymnasium as gym

ENVIRONMENTS = {
    "SharedControl/TwoLane-v0": "two_lane",
    "SharedControl/Curve-v0": "curve",
}
"""Ids and entry points. Each is made with the authority limiter applied: the action is the driver's."""


def register_environments() -> None:
    """Register every id that is not registered yet."""
    for name, entry_point in ENVIRONMENTS.items():
        if name not in gym.registry:
            gym.register(
                id=name,
                entry_point=f"shared_control_env.wrappers.limited:{entry_point}",
                vector_entry_point=f"shared_control_env.vector.environment:{entry_point}",
            )
