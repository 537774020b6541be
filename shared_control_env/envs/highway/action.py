"""The action of the bare environment."""

from __future__ import annotations

from collections.abc import Mapping
from math import nan
from typing import Any

from gymnasium import spaces
from highway_env.envs.common.action import ActionType

from shared_control_env.envs.highway.vehicles import EgoVehicle
from shared_control_env.envs.slots import AUTHORITY, DRIVER, SLOT_SPACES, Clipping, checked_slot, space_of


class SlotAction(ActionType):
    """Action of the bare environment: a dict of both slots.

    Args:
        env: the environment.

    Attributes:
        clipping: counts the values beyond their bounds.
    """

    def __init__(self, env: Any) -> None:
        super().__init__(env)
        self.clipping = Clipping()

    def space(self) -> spaces.Space:
        """Dict with a Box for each slot."""
        return space_of(tuple(SLOT_SPACES))

    @property
    def vehicle_class(self) -> type[EgoVehicle]:
        """Class of the vehicle that executes the action."""
        return EgoVehicle

    def decode(self, action: Any) -> tuple[list[float], list[float]]:
        """Split an action into the driver's desired command and the automation's authority.

        Args:
            action: dict with the keys ``driver`` and ``authority``. With None for the authority, the fuzzy inference
                with the operators of the settings decides on it.

        Returns:
            u_h,des, ``[a, delta]`` as shares of their limits in [-1, 1] [-]; and one authority, or those over both
            channels [-], or NaN for the fuzzy inference.

        Raises:
            ValueError: if a slot is missing, unknown, of the wrong shape or not finite.
        """
        if not isinstance(action, Mapping) or action.keys() != SLOT_SPACES.keys():
            raise ValueError(
                f"action = {action!r} must be a dict with the keys {sorted(SLOT_SPACES)}; the wrappers "
                "AuthorityLimiter and DriverModel bind one each"
            )
        command, authority = checked_slot(DRIVER, action[DRIVER], self.clipping), action[AUTHORITY]
        return command, [nan] if authority is None else checked_slot(AUTHORITY, authority, self.clipping)
