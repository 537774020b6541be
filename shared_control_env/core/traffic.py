"""Motion of the other vehicles."""

from __future__ import annotations

import numpy as np

from shared_control_env.core.jit import jit
from shared_control_env.core.records import HEADING, SPEED, YAW_RATE, X, Y
from shared_control_env.core.road import locate, point_at


@jit
def follow_lane(row: np.ndarray, line: np.ndarray, dt: float) -> None:
    """Move a vehicle at constant speed along the road, at its present offset from the reference line.

    ``s' = v / (1 - kappa d)``; the yaw rate is that of the path, ``r = v kappa / (1 - kappa d)``.

    Args:
        row: the vehicle, one row of :mod:`records`' traffic columns, overwritten, shape (8,).
        line: reference line.
        dt: time [s].
    """
    s, d, _, kappa = locate(line, row[X], row[Y])
    rate = row[SPEED] / (1.0 - kappa * d)
    row[X], row[Y], row[HEADING] = point_at(line, s + rate * dt, d)
    row[YAW_RATE] = rate * kappa
