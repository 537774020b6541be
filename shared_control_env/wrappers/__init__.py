"""Wrappers, each of which binds one slot of the action."""

from shared_control_env.wrappers.authority_limiter import AuthorityLimiter
from shared_control_env.wrappers.driver_model import DriverModel
from shared_control_env.wrappers.slots import open_slots

__all__ = ["AuthorityLimiter", "DriverModel", "open_slots"]
