"""The highway-env-derived environments.

They are imported when they are first asked for: the vectorised environment needs the settings alone, and
highway-env takes longer to import than everything else.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from shared_control_env.envs.scenarios import (
        BendEnv,
        CurveEnv,
        CurveWithLeadEnv,
        CutInEnv,
        DenseTrafficEnv,
        LaneChangeEnv,
        LaneKeepingEnv,
        LeadBrakingEnv,
        SCurveEnv,
        TwoLaneEnv,
    )
    from shared_control_env.envs.shared_control import SharedControlEnv

__all__ = [
    "BendEnv",
    "CurveEnv",
    "CurveWithLeadEnv",
    "CutInEnv",
    "DenseTrafficEnv",
    "LaneChangeEnv",
    "LaneKeepingEnv",
    "LeadBrakingEnv",
    "SCurveEnv",
    "SharedControlEnv",
    "TwoLaneEnv",
]


def __getattr__(name: str) -> Any:
    if name in __all__:
        return getattr(import_module("shared_control_env.envs.scenarios"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
