"""Wrappers, each of which binds one slot of the action: ``AuthorityLimiter`` and ``DriverModel``.

They are imported when they are first asked for, since they need highway-env, which takes long to import.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from shared_control_env.wrappers.authority_limiter import AuthorityLimiter
    from shared_control_env.wrappers.driver_model import DriverModel
    from shared_control_env.wrappers.slot_wrapper import open_slots

__all__ = ["AuthorityLimiter", "DriverModel", "open_slots"]

_PLACES = {"AuthorityLimiter": "authority_limiter", "DriverModel": "driver_model", "open_slots": "slot_wrapper"}


def __getattr__(name: str) -> Any:
    """One of :data:`__all__`."""
    if name in _PLACES:
        return getattr(import_module(f"{__name__}.{_PLACES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
