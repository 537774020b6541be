"""The registered scenarios: the paper's two cases."""

from __future__ import annotations

from typing import Any

from shared_control_env.envs.cases import CURVE, TWO_LANE
from shared_control_env.envs.config import merge
from shared_control_env.envs.shared_control import SharedControlEnv


class TwoLaneEnv(SharedControlEnv):
    """Case 1: lane keeping behind a slower vehicle on a straight two-lane road; the steering degrades."""

    @classmethod
    def default_config(cls) -> dict[str, Any]:
        """Settings of Case 1."""
        return merge(super().default_config(), TWO_LANE.settings)


class CurveEnv(SharedControlEnv):
    """Case 2: following a vehicle round a curve of 60 m radius; the acceleration degrades."""

    @classmethod
    def default_config(cls) -> dict[str, Any]:
        """Settings of Case 2."""
        return merge(super().default_config(), CURVE.settings)
