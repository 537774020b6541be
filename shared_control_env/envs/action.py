"""The action and its two slots: the driver's command, and the automation's authority."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import spaces
from highway_env.envs.common.action import ActionType

from shared_control_env.envs.vehicles import EgoVehicle

if TYPE_CHECKING:
    from shared_control_env.envs.shared_control import SharedControlEnv

DRIVER, AUTHORITY = "driver", "authority"
"""Names of the slots."""

SLOT_SPACES: dict[str, spaces.Box] = {
    DRIVER: spaces.Box(-1.0, 1.0, shape=(2,), dtype=np.float32),
    AUTHORITY: spaces.Box(0.0, 1.0, shape=(1,), dtype=np.float32),
}
"""``driver``: desired acceleration and steering u_h,des over their limits; ``authority``: alpha_a."""

_BOUNDS = {name: (float(s.low[0]), float(s.high[0]), s.shape[0]) for name, s in SLOT_SPACES.items()}


def checked_slot(slot: str, value: Any) -> np.ndarray:
    """A slot's value as an array within its bounds.

    Raises:
        ValueError: if the shape is wrong or an entry is not finite. Values beyond the bounds are clipped, as
            highway-env's ContinuousAction does.
    """
    low, high, size = _BOUNDS[slot]
    array = np.array(value, dtype=np.float64)
    if array.shape != (size,) or not all(map(isfinite, array.tolist())):
        raise ValueError(
            f"action[{slot!r}] = {value!r} must be {size} finite number(s) in [{low:g}, {high:g}], shape ({size},)"
        )
    return array.clip(low, high, out=array)


class SlotAction(ActionType):
    """Action of the bare environment, a dict of both slots."""

    env: SharedControlEnv

    def space(self) -> spaces.Dict:
        """Dict with a Box for each slot."""
        return spaces.Dict({slot: spaces.Box(s.low, s.high, dtype=np.float32) for slot, s in SLOT_SPACES.items()})

    @property
    def vehicle_class(self) -> type[EgoVehicle]:
        """Class of the vehicle that carries the action out."""
        return EgoVehicle

    def decode(self, action: Any) -> tuple[np.ndarray, float]:
        """The driver's desired command and the automation's authority.

        Args:
            action: dict with the keys ``driver`` and ``authority``.

        Returns:
            ``u_h,des = [a, delta]`` [m/s^2, rad], shape (2,), and alpha_a.

        Raises:
            ValueError: if a slot is missing, unknown, of the wrong shape or not finite.
        """
        if not isinstance(action, dict) or set(action) != set(SLOT_SPACES):
            raise ValueError(
                f"action = {action!r} must be a dict with the keys {sorted(SLOT_SPACES)}; the wrappers "
                "AuthorityLimiter and DriverModel bind one each"
            )
        command = checked_slot(DRIVER, action[DRIVER])
        command *= self.env.command_limits
        return command, float(checked_slot(AUTHORITY, action[AUTHORITY])[0])
