"""The highway-env-derived environments, such as ``TwoLaneEnv``: one class a scenario (:mod:`envs.scenarios`).

They are imported when they are first asked for: the vectorised environment needs the settings alone, and
highway-env takes longer to import than everything else.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any


def __getattr__(name: str) -> Any:
    """``SharedControlEnv``, or the class of a scenario."""
    if name == "SharedControlEnv":
        return import_module("shared_control_env.envs.shared_control").SharedControlEnv
    if name.endswith("Env"):
        return getattr(import_module("shared_control_env.envs.environments"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
