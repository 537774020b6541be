"""The environments derived from highway-env, such as ``TwoLaneEnv``: one class per scenario (:mod:`envs.scenarios`).

They are imported on first use. The vectorised environment needs only the settings, and importing highway-env takes
longer than importing everything else.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any


def __getattr__(name: str) -> Any:
    """``SharedControlEnv``, or the environment class of a scenario."""
    if name == "SharedControlEnv":
        return import_module("shared_control_env.envs.shared_control").SharedControlEnv
    if name.endswith("Env"):
        return getattr(import_module("shared_control_env.envs.environments"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
