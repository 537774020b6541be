"""The vehicle ahead, as used by drivers and allocators."""

from __future__ import annotations

from math import inf

import numpy as np

from shared_control_env.core.records import NEAR_S, NEAR_SPEED, PRECEDING, PRESENT


def lead_of(scene: np.ndarray) -> tuple[float, float]:
    """Bumper-to-bumper gap to the vehicle ahead in the lane [m], and the speed of that vehicle [m/s].

    Args:
        scene: record of :data:`core.records.SCENE`.

    Returns:
        Gap and speed; infinity and 0 if there is no vehicle ahead.
    """
    near = scene["neighbours"][PRECEDING].tolist()
    if not near[PRESENT]:
        return inf, 0.0
    return near[NEAR_S] - float(scene["z"][0]) - float(scene["bodies"]), near[NEAR_SPEED]
