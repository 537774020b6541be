"""Registration of the environments with Gymnasium."""

from __future__ import annotations

import gymnasium as gym

ENVIRONMENTS = {
    "SharedControl/TwoLane-v0": "two_lane",
    "SharedControl/Curve-v0": "curve",
    "SharedControl/LaneKeeping-v0": "lane_keeping",
    "SharedControl/Bend-v0": "bend",
    "SharedControl/SCurve-v0": "s_curve",
    "SharedControl/LaneChange-v0": "lane_change",
    "SharedControl/CutIn-v0": "cut_in",
    "SharedControl/LeadBraking-v0": "lead_braking",
    "SharedControl/DenseTraffic-v0": "dense_traffic",
    "SharedControl/CurveWithLead-v0": "curve_with_lead",
}
"""Ids, and keys in ``envs.cases.CASES``. Each is made with the limiter applied: the action is the driver's."""


def register_environments() -> None:
    """Register every id that is not registered yet."""
    for name, entry_point in ENVIRONMENTS.items():
        if name not in gym.registry:
            gym.register(
                id=name,
                entry_point=f"shared_control_env.wrappers.limited:{entry_point}",
                vector_entry_point=f"shared_control_env.vector.environment:{entry_point}",
            )
