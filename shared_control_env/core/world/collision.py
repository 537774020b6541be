"""Collisions between vehicles: overlap of two rectangles."""

from __future__ import annotations

from math import cos, hypot, sin

import numpy as np

from shared_control_env.core.compile.jit import jit
from shared_control_env.core.records import BODY_LENGTH, BODY_WIDTH, HEADING, X, Y


@jit
def _separated(row: np.ndarray, other: np.ndarray, dx: float, dy: float, c: float, s: float) -> bool:
    """Whether an axis of the first vehicle separates both; c, s: absolute cosine and sine of the angle between them."""
    ct, st = cos(row[HEADING]), sin(row[HEADING])
    along, across = abs(dx * ct + dy * st), abs(dy * ct - dx * st)
    return along > 0.5 * (row[BODY_LENGTH] + c * other[BODY_LENGTH] + s * other[BODY_WIDTH]) or across > 0.5 * (
        row[BODY_WIDTH] + s * other[BODY_LENGTH] + c * other[BODY_WIDTH]
    )


@jit
def overlap(first: np.ndarray, second: np.ndarray) -> bool:
    """Whether two vehicles' rectangles overlap, by the separating axes of both.

    Args:
        first, second: the vehicles' rows of the traffic array, columns as in :mod:`records`, shape (8,).
    """
    dx, dy = second[X] - first[X], second[Y] - first[Y]
    reach = hypot(first[BODY_LENGTH], first[BODY_WIDTH]) + hypot(second[BODY_LENGTH], second[BODY_WIDTH])
    if hypot(dx, dy) > 0.5 * reach:
        return False
    turn = second[HEADING] - first[HEADING]
    c, s = abs(cos(turn)), abs(sin(turn))
    return not (_separated(first, second, dx, dy, c, s) or _separated(second, first, dx, dy, c, s))


@jit
def find_collisions(vehicles: np.ndarray, crashed: np.ndarray) -> bool:
    """Mark every vehicle that overlaps another.

    Args:
        vehicles: traffic array, columns as in :mod:`records`, shape (n, 8).
        crashed: set to True for each vehicle that overlaps another, shape (n,).

    Returns:
        Whether any vehicle was marked.
    """
    found = False
    n = vehicles.shape[0]
    for i in range(n):
        for j in range(i + 1, n):
            if overlap(vehicles[i], vehicles[j]):
                crashed[i] = crashed[j] = found = True
    return found
