"""The two slots of the action: the driver's command, and the automation's authority."""

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy as np
from gymnasium import spaces

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


def checked_slot(slot: str, value: Any) -> np.ndarray:
    """A slot's value as an array within its bounds.

    Raises:
        ValueError: if the shape is wrong or an entry is not finite. Values beyond the bounds are clipped, as
            highway-env's ContinuousAction does.
    """
    low, high, size = _BOUNDS[slot]
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.full(0, np.nan)
    if array.shape != (size,) or not all(map(isfinite, array.tolist())):
        raise ValueError(
            f"action[{slot!r}] = {value!r} must be {size} finite number(s) in [{low:g}, {high:g}], shape ({size},)"
        )
    return array.clip(low, high, out=array)
