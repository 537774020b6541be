"""The paper's two cases as settings."""

from __future__ import annotations

from typing import Any, NamedTuple


class Case(NamedTuple):
    """A registered scenario.

    Attributes:
        settings: changes to the default settings.
        environment: module and class of the single environment.
    """

    settings: dict[str, Any]
    environment: str


TWO_LANE = Case(
    settings={
        "vehicles": [
            {"lane": 0, "position": 38.0, "speed": 12.0},  # preceding
            {"lane": 1, "position": 30.0, "speed": 15.0},  # leader
            {"lane": 1, "position": -5.0, "speed": 12.0},  # follower
        ],
        # delta_f = delta_des + 0.3 (k - 10) / 20 for 10 <= k <= 30, then + 0.3.
        "faults": [{"channel": "steering", "onset": 0.5, "ramp": 1.0, "size": 0.3}],
    },
    environment="shared_control_env.envs.scenarios:TwoLaneEnv",
)
"""Case 1 (Section VI-B, Table VI): lane keeping behind a slower vehicle on a straight road; the steering degrades."""

CURVE = Case(
    settings={
        "road": {"segments": [{"length": 300.0, "curvature": 1.0 / 60.0}]},
        "ego": {"speed": 12.0},
        "vehicles": [{"lane": 0, "position": 15.0, "speed": 12.0}],
        # a_f = a_des + 3 (k - 5) / 5 for 5 < k <= 10, then + 3.
        "faults": [{"channel": "acceleration", "onset": 0.25, "ramp": 0.25, "size": 3.0}],
        "screen_height": 632,
    },
    environment="shared_control_env.envs.scenarios:CurveEnv",
)
"""Case 2 (Section VI-C): following a vehicle round a curve of 60 m radius; the acceleration degrades."""
