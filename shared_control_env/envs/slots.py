"""The two slots of the action: the driver's command, and the automation's authority."""

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy as np
from gymnasium import logger, spaces

from shared_control_env.controllers.arrays import as_numbers
from shared_control_env.core.feedback.observation import Observation

DRIVER, AUTHORITY = "driver", "authority"
"""Names of the slots."""

SLOT_SPACES: dict[str, spaces.Box] = {
    DRIVER: spaces.Box(-1.0, 1.0, shape=(2,), dtype=np.float32),
    AUTHORITY: spaces.Box(0.0, 1.0, shape=(1,), dtype=np.float32),
}
"""Space of each slot. ``driver``: u_h,des, desired acceleration and steering as shares of their limits [-]; u_h,act if
``config["driver_lag"]["direct"]`` says so.
``authority``: alpha_a [-]; two numbers are taken too, as authorities over acceleration and over steering."""

TAKEN = {DRIVER: (2,), AUTHORITY: (1, 2)}
"""How many numbers each slot takes."""

NOT_DIRECT = (
    "config['driver_lag']['direct'] = True does not go with the predictive driver, which decides on u_h,des; it needs "
    "an open driver's slot, or a driver of your own that gives u_h,act"
)
"""Error message for a direct driver's slot that the predictive driver fills."""

BOUNDS = {name: (float(s.low[0]), float(s.high[0]), s.shape[0]) for name, s in SLOT_SPACES.items()}


def space_of(slots: tuple[str, ...]) -> spaces.Space:
    """A new action space: a Dict for several slots, a Box for one, ``Discrete(1)`` for none.

    Without an open slot, the only action is ``0``, and the environment runs by itself.

    Args:
        slots: names of the slots, keys of :data:`SLOT_SPACES`.
    """
    boxes: dict[str, spaces.Space] = {}
    for slot in slots:
        boxes[slot] = spaces.Box(SLOT_SPACES[slot].low, SLOT_SPACES[slot].high, dtype=np.float32)
    if not boxes:
        return spaces.Discrete(1)
    return spaces.Dict(boxes) if len(boxes) > 1 else boxes[slots[0]]


def observation_space(observation: Observation) -> spaces.Box:
    """Space of an observation: a Box of shape (n,) in [-1, 1].

    Args:
        observation: the observation type.
    """
    return spaces.Box(-1.0, 1.0, shape=(observation.size,), dtype=np.float32)


SLACK = 1e-3
"""Largest excess of a value over its bounds that counts as rounding [-]."""


class Clipping:
    """Warns once if values exceed their bounds for many steps in a row; such values may be in another unit.

    Args:
        num_envs: number of environments.

    Attributes:
        in_a_row: for each slot name, whether any value exceeded its bounds in the previous step.
    """

    PATIENCE = 20
    """Number of steps in a row after which the warning is given."""

    def __init__(self, num_envs: int = 1) -> None:
        self._steps = {slot: np.zeros(num_envs, dtype=int) for slot in SLOT_SPACES}
        self.in_a_row = dict.fromkeys(SLOT_SPACES, False)
        self._told = False

    def clear(self, ended: Any = slice(None)) -> None:
        """Reset the step counts of environments.

        Args:
            ended: index, slice or mask of the environments whose episodes have ended; all by default.
        """
        for slot, steps in self._steps.items():
            if self.in_a_row[slot]:
                steps[ended] = 0

    def note(self, slot: str, values: np.ndarray, beyond: bool) -> None:
        """Count the steps in a row whose values exceed their bounds, and warn if there are too many.

        Args:
            slot: name of the slot.
            values: values of the slot before clipping, shape (num_envs, size) [-].
            beyond: whether any value exceeds its bounds.
        """
        if not beyond:
            if self.in_a_row[slot]:
                self._steps[slot][:] = 0
                self.in_a_row[slot] = False
            return
        low, high, _ = BOUNDS[slot]
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


def checked_slot(slot: str, value: Any, clipping: Clipping) -> list[float]:
    """The numbers of a slot, clipped to its bounds.

    Values beyond the bounds are clipped, as highway-env's ContinuousAction does.

    Args:
        slot: name of the slot.
        value: numbers of the slot's shape [-].
        clipping: counts the values beyond the bounds.

    Raises:
        ValueError: if the shape is wrong or an entry is not finite.
    """
    low, high, size = BOUNDS[slot]
    array = as_numbers(value)
    values = array.tolist()
    if array.ndim != 1 or array.size not in TAKEN[slot] or not all(map(isfinite, values)):
        raise ValueError(
            f"action[{slot!r}] = {value!r} must be {size} finite number(s) in [{low:g}, {high:g}], shape ({size},)"
        )
    smallest, largest = min(values), max(values)
    beyond = smallest < low - SLACK or largest > high + SLACK
    if beyond or clipping.in_a_row[slot]:
        clipping.note(slot, array[None], beyond)
    if smallest < low or largest > high:
        return [min(max(number, low), high) for number in values]
    return values
