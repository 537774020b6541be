"""The vehicle ahead, as drivers and allocators look at it."""

from __future__ import annotations

from math import inf

import numpy as np

from shared_control_env.core.records import NEAR_S, NEAR_SPEED, PRECEDING, PRESENT


def lead_of(scene: np.ndarray) -> tuple[float, float]:
    """Gap to the vehicle ahead in the lane, bumper to bumper [m], and its speed [m/s]; infinite and 0 without one.

    Args:
        scene: record of :data:`core.records.SCENE`.
    """
    near = scene["neighbours"][PRECEDING].tolist()
    if not near[PRESENT]:
        return inf, 0.0
    return near[NEAR_S] - float(scene["z"][0]) - float(scene["bodies"]), near[NEAR_SPEED]
