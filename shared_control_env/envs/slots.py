"""The two slots of the action: the driver's command, and the automation's authority."""

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy as np
from gymnasium import logger, spaces

from shared_control_env.controllers.arrays import as_array

DRIVER, AUTHORITY = "driver", "authority"
"""Names of the slots."""

SLOT_SPACES: dict[str, spaces.Box] = {
    DRIVER: spaces.Box(-1.0, 1.0, shape=(2,), dtype=np.float32),
    AUTHORITY: spaces.Box(0.0, 1.0, shape=(1,), dtype=np.float32),
}
"""``driver``: desired acceleration and steering u_h,des over their limits; ``authority``: alpha_a."""

_BOUNDS = {name: (float(s.low[0]), float(s.high[0]), s.shape[0]) for name, s in SLOT_SPACES.items()}


def space_of(slots: tuple[str, ...]) -> spaces.Space:
    """A new space for some slots: a dict of several, one's own Box, or ``Discrete(1)``, to go on, for none."""
    boxes: dict[str, spaces.Space] = {}
    for slot in slots:
        boxes[slot] = spaces.Box(SLOT_SPACES[slot].low, SLOT_SPACES[slot].high, dtype=np.float32)
    if not boxes:
        return spaces.Discrete(1)
    return spaces.Dict(boxes) if len(boxes) > 1 else boxes[slots[0]]


SLACK = 1e-3
"""How far a value may be beyond its bounds by rounding."""


class Clipping:
    """Warns once of values that are beyond their bounds step after step, since they are in another unit, perhaps.

    Args:
        num_envs: of how many environments.

    Attributes:
        in_a_row: whether any value of a slot was beyond its bounds in the step before, by the slot's name.
    """

    PATIENCE = 20
    """Steps in a row after which it is told."""

    def __init__(self, num_envs: int = 1) -> None:
        self._steps = {slot: np.zeros(num_envs, dtype=int) for slot in SLOT_SPACES}
        self.in_a_row = dict.fromkeys(SLOT_SPACES, False)
        self._told = False

    def clear(self, ended: Any = slice(None)) -> None:
        """Forget the steps so far, of the environments whose episodes have ended."""
        for slot, steps in self._steps.items():
            if self.in_a_row[slot]:
                steps[ended] = 0

    def note(self, slot: str, values: np.ndarray, beyond: bool) -> None:
        """Note the values of one step.

        Args:
            slot: name of the slot.
            values: shape (num_envs, size).
            beyond: whether any of them is beyond its bounds.
        """
        if not beyond:
            if self.in_a_row[slot]:
                self._steps[slot][:] = 0
                self.in_a_row[slot] = False
            return
        low, high, _ = _BOUNDS[slot]
        steps = self._steps[slot]
        steps += 1
        steps[((values >= low - SLACK) & (values <= high + SLACK)).all(axis=1)] = 0
        self.in_a_row[slot] = True
        if not self._told and steps.max() >= self.PATIENCE:
            self._told = True
            logger.warn(
                f"action[{slot!r}] has been beyond [{low:g}, {high:g}] and clipped for {self.PATIENCE} steps in a row. "
                "Actions are shares of the limits, as action_space says; a command in m/s^2 and rad becomes one by "
                "env.unwrapped.action_of(command), or drives through wrappers.DriverModel."
            )


def checked_slot(slot: str, value: Any, clipping: Clipping) -> np.ndarray:
    """A slot's value as an array within its bounds.

    Args:
        slot: name of the slot.
        value: numbers of the slot's shape.
        clipping: told of values beyond the bounds, which are clipped, as highway-env's ContinuousAction does.

    Raises:
        ValueError: if the shape is wrong or an entry is not finite.
    """
    low, high, size = _BOUNDS[slot]
    try:
        array = np.array(value if isinstance(value, np.ndarray) else as_array(value), dtype=np.float64)
    except (TypeError, ValueError):
        array = np.full(0, np.nan)
    values = array.tolist()
    if array.shape != (size,) or not all(map(isfinite, values)):
        raise ValueError(
            f"action[{slot!r}] = {value!r} must be {size} finite number(s) in [{low:g}, {high:g}], shape ({size},)"
        )
    beyond = min(values) < low - SLACK or max(values) > high + SLACK
    if beyond or clipping.in_a_row[slot]:
        clipping.note(slot, array[None], beyond)
    return array.clip(low, high, out=array)
