"""The highway-env-derived environments."""

from shared_control_env.envs.scenarios import CurveEnv, TwoLaneEnv
from shared_control_env.envs.shared_control import SharedControlEnv

__all__ = ["CurveEnv", "SharedControlEnv", "TwoLaneEnv"]
