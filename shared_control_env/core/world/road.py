"""The road's reference line: straights and arcs, and the road frame ``(s, d)`` along it.

A line is an array of segments, one row ``[s0, x0, y0, psi0, kappa, length, ...]`` per segment. A row holds the path
length and the pose at the start of the segment [m, m, m, rad], the curvature (positive to the left) [1/m] and the
length [m]; then the width of a lane and the offsets of the road's right and left edge, each at the start of the segment
[m] and as its slope along it [-]. Rows with an infinite ``s0`` only fill up the array; they are not segments. ``d`` is
the offset to the left of the line. The centre of a lane is the line shifted by the lane's ``d``.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, ceil, cos, hypot, pi, sin

import numpy as np

from shared_control_env.core.compile.jit import jit

S0, X0, Y0, PSI0, KAPPA, LENGTH, WIDTH, WIDTH_SLOPE, RIGHT, RIGHT_SLOPE, LEFT, LEFT_SLOPE = range(12)
"""Indices in a segment's row."""

COLUMNS = 12
"""Length of a segment's row."""

_ROUNDING = 1e-6
"""Margin of a comparison of distances [m]."""

MAX_ARC = pi / 2
"""Largest angle of one arc segment [rad]: the angles of highway-env's CircularLane wrap after half a turn."""


def reference_line(
    segments: Sequence[tuple[float, float]], lead_in: float = 0.0, lane_width: float = 4.0, lanes: int = 2
) -> np.ndarray:
    """Chain ``(length, curvature)`` pairs into a line that passes the origin along x at s = 0.

    Args:
        segments: pairs of length [m] and curvature [1/m], starting at s = 0.
        lead_in: length of a straight segment before s = 0 [m].
        lane_width: width of a lane [m].
        lanes: number of lanes; the line is the centre of the rightmost.

    Returns:
        Reference line, shape (n, 12); arcs longer than :data:`MAX_ARC` are split.
    """
    chained = np.array([(lead_in, 0.0), *segments] if lead_in else segments)
    line = np.empty((sum(pieces_of(length, kappa) for length, kappa in chained), COLUMNS))
    chain(chained, -lead_in, lane_width, lanes, line)
    return line


@jit
def pieces_of(length: float, kappa: float) -> int:
    """Number of rows of a segment: arcs longer than :data:`MAX_ARC` are split.

    Args:
        length: length of the segment [m].
        kappa: its curvature [1/m].
    """
    return max(1, ceil(abs(kappa) * length / MAX_ARC))


@jit
def chain(segments: np.ndarray, s: float, lane_width: float, lanes: int, line: np.ndarray) -> None:
    """Write the reference line of a chain of segments; rows that are left over get an infinite ``s0``.

    Args:
        segments: length [m] and curvature [1/m] of each segment, shape (m, 2).
        s: path length at which the first one starts; its x coordinate is the same [m].
        lane_width: width of a lane [m].
        lanes: number of lanes.
        line: written, at least as many rows as the segments have pieces, shape (n, 12).
    """
    for i in range(line.shape[0]):
        for j in range(COLUMNS):
            line[i, j] = 0.0
        line[i, S0] = np.inf
    x, y, psi = s, 0.0, 0.0
    n = 0
    for i in range(segments.shape[0]):
        kappa, pieces = segments[i, 1], pieces_of(segments[i, 0], segments[i, 1])
        length = segments[i, 0] / pieces
        for _ in range(pieces):
            row = line[n]
            row[S0], row[X0], row[Y0], row[PSI0], row[KAPPA], row[LENGTH] = s, x, y, psi, kappa, length
            row[WIDTH], row[RIGHT], row[LEFT] = lane_width, -0.5 * lane_width, lanes * lane_width - 0.5 * lane_width
            x, y, psi = point_at(line, s + length, 0.0)
            s += length
            n += 1


@jit
def segment_at(line: np.ndarray, s: float) -> int:
    """Index of the segment that contains a path length; the first and the last segment extend beyond the line.

    Args:
        line: reference line, shape (n, 12).
        s: path length [m].
    """
    i = 0
    while i + 1 < line.shape[0] and s >= line[i + 1, S0]:
        i += 1
    return i


@jit
def width_at(line: np.ndarray, s: float) -> float:
    """Width of a lane at a path length [m].

    Args:
        line: reference line, shape (n, 12).
        s: path length [m].
    """
    row = line[segment_at(line, s)]
    return row[WIDTH] + row[WIDTH_SLOPE] * (s - row[S0])


@jit
def edges_at(line: np.ndarray, s: float) -> tuple[float, float]:
    """Offsets of the right and the left edge of the road at a path length [m].

    Args:
        line: reference line, shape (n, 12).
        s: path length [m].
    """
    row = line[segment_at(line, s)]
    along = s - row[S0]
    return row[RIGHT] + row[RIGHT_SLOPE] * along, row[LEFT] + row[LEFT_SLOPE] * along


@jit
def curvature_at(line: np.ndarray, s: float, d: float) -> float:
    """Curvature of the shifted reference line [1/m].

    Args:
        line: reference line, shape (n, 12).
        s: path length along the unshifted line [m].
        d: shift to the left [m].
    """
    kappa = line[segment_at(line, s), KAPPA]
    return kappa / (1.0 - kappa * d)


@jit
def point_at(line: np.ndarray, s: float, d: float) -> tuple[float, float, float]:
    """Cartesian position [m] and heading [rad] of the road at ``(s, d)``.

    Args:
        line: reference line, shape (n, 12).
        s, d: path length and offset to the left [m].

    Returns:
        ``x, y, psi_road``: position [m] and road heading [rad].
    """
    row = line[segment_at(line, s)]
    along, kappa, psi0 = s - row[S0], row[KAPPA], row[PSI0]
    psi = psi0 + kappa * along
    half = 0.5 * kappa * along
    chord = along * (sin(half) / half if abs(half) > 1e-9 else 1.0)
    x = row[X0] + chord * cos(psi0 + half) - d * sin(psi)
    y = row[Y0] + chord * sin(psi0 + half) + d * cos(psi)
    return x, y, psi


@jit
def _project(row: np.ndarray, x: float, y: float) -> tuple[float, float]:
    """Path length from a segment's start, and offset to the left, of a point; the segment extends beyond its ends."""
    c, sn = cos(row[PSI0]), sin(row[PSI0])
    along = c * (x - row[X0]) + sn * (y - row[Y0])
    across = -sn * (x - row[X0]) + c * (y - row[Y0])
    kappa = row[KAPPA]
    if kappa == 0.0:
        return along, across
    radius = 1.0 / kappa
    side = 1.0 if radius > 0.0 else -1.0
    angle = atan2(along * side, (radius - across) * side)
    return angle * radius, radius - side * hypot(along, radius - across)


@jit
def locate(line: np.ndarray, x: float, y: float) -> tuple[float, float, float, float]:
    """Road-frame coordinates of a point, by projection onto the nearest segment.

    Args:
        line: reference line, shape (n, 12).
        x, y: Cartesian position [m].

    Returns:
        ``s, d`` [m], and the heading [rad] and curvature [1/m] of the line at s.
    """
    n = 0
    closest, start = 0, np.inf
    while n < line.shape[0] and line[n, S0] != np.inf:
        away = (x - line[n, X0]) ** 2 + (y - line[n, Y0]) ** 2
        if away < start:
            closest, start = n, away
        n += 1
    along, across = _project(line[closest], x, y)
    best = abs(across) + max(0.0, -along, along - line[closest, LENGTH])
    nearest, s, d = closest, line[closest, S0] + along, across
    for i in range(n):
        # No point of a segment is further from its start than its length, so that most need no projection.
        reach = best + line[i, LENGTH] + _ROUNDING
        if i == closest or (x - line[i, X0]) ** 2 + (y - line[i, Y0]) ** 2 > reach * reach:
            continue
        along, across = _project(line[i], x, y)
        distance = abs(across) + max(0.0, -along, along - line[i, LENGTH])
        if distance < best or (distance == best and i < nearest):  # of several, the first
            best, nearest = distance, i
            s, d = line[i, S0] + along, across
    row = line[nearest]
    return s, d, row[PSI0] + row[KAPPA] * (s - row[S0]), row[KAPPA]


@jit
def wrap_angle(angle: float) -> float:
    """Wrap an angle to [-pi, pi).

    Args:
        angle: angle [rad].
    """
    return (angle + pi) % (2.0 * pi) - pi
