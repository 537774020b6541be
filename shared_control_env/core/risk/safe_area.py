"""The safe area C in the road frame (s, d): its form without vehicles in the region, and geometric queries.

The driving region is the rectangle of road ahead, from the ego to d_o behind the preceding vehicle or to a fixed
look-ahead. Vehicles inside the region are holes. The region is triangulated (:mod:`triangulation`), and its triangles
are searched from that of the ego to the final region (:mod:`corridor`). The sequence of triangles found is C; its left
and right edges are the upper and lower boundary. In the road frame the region is a rectangle on a curve as well. This
neglects the curvature of the road within one vehicle length (5 cm at a radius of 60 m).
"""

from __future__ import annotations

import numpy as np

from shared_control_env.core.compile.jit import jit, jit_inlined
from shared_control_env.core.records import MAX_CHAIN, SafeArea

REACHED, BLOCKED = 0, 1
"""Outcomes of the search: the final region was found, or no passage as wide as the vehicle leads to it."""

ON_LINE = 1e-9
"""Distance below which a vertex counts as lying on the rear or front line of the region [m]."""


@jit
def is_whole(count: int, region: np.ndarray, min_width: float) -> bool:
    """Whether the safe area is the whole driving region, so that no triangulation is needed.

    Args:
        count: number of vehicles in the region.
        region: start, end along the road and low, high across the road [m], shape (4,).
        min_width: smallest width of a passage [m].
    """
    return count == 0 and region[3] - region[2] >= min_width


@jit_inlined
def whole_region(region: np.ndarray, area: SafeArea) -> None:
    """Make the whole driving region the safe area, for regions where :func:`is_whole` holds.

    Args:
        region: start, end along the road and low, high across the road [m], shape (4,).
        area: record of :data:`records.SAFE_AREA`, written.
    """
    for k in range(MAX_CHAIN):
        s = region[0] if k == 0 else region[1]
        area.lower[k, 0], area.lower[k, 1] = s, region[2]
        area.upper[k, 0], area.upper[k, 1] = s, region[3]
    area.start, area.end, area.outcome = region[0], region[1], REACHED


@jit
def _on_open_end(area: SafeArea, s: float) -> float:
    """Path length clamped to the open ends of the area: the line behind the ego, and the front line if it was reached.

    Both are lines across the road and not boundaries; the boundaries are extended straight beyond them. Points beyond
    a blocked end remain outside the area.
    """
    if area.outcome == REACHED:
        s = min(s, area.end - ON_LINE)
    return max(s, area.start)


@jit_inlined
def _scan_chain(chain: np.ndarray, s: float, d: float) -> tuple[int, float, float, float]:
    """Compare a point with a chain of vertices.

    Returns:
        Number of the chain's segments above the point, for the even-odd rule; squared distance from the chain to the
        point [m^2]; s and d components of the vector from the nearest point of the chain [m].
    """
    above, best, best_s, best_d = 0, np.inf, 0.0, 0.0
    for k in range(MAX_CHAIN - 1):
        es, ed = chain[k + 1, 0] - chain[k, 0], chain[k + 1, 1] - chain[k, 1]
        ds, dd = s - chain[k, 0], d - chain[k, 1]
        square = es * es + ed * ed
        if square == 0.0 and k > 0:
            break
        if (ds >= 0.0) != (s >= chain[k + 1, 0]) and (ed * ds > dd * es) == (es > 0.0):
            above += 1
        along = ds * es + dd * ed
        if along >= square:
            ds, dd = ds - es, dd - ed
        elif along > 0.0:
            along /= square
            ds, dd = ds - along * es, dd - along * ed
        if ds * ds + dd * dd < best:
            best, best_s, best_d = ds * ds + dd * dd, ds, dd
    return above, best, best_s, best_d


@jit
def boundary_offset(area: SafeArea, s: float, d: float) -> tuple[float, float, float]:
    """Squared distance from a point to the nearer boundary of C, and the vector between them; zeros outside C.

    Args:
        area: record of :data:`records.SAFE_AREA`.
        s, d: position of the point in the road frame [m].

    Returns:
        Squared distance [m^2]; s and d components of the vector from the boundary to the point [m].
    """
    s = _on_open_end(area, s)
    above_lower, square, ds, dd = _scan_chain(area.lower, s, d)
    above_upper, square_upper, ds_upper, dd_upper = _scan_chain(area.upper, s, d)
    if (above_lower + above_upper) % 2 == 0:
        return 0.0, 0.0, 0.0
    if square_upper < square:
        return square_upper, ds_upper, dd_upper
    return square, ds, dd


@jit
def boundary_distance(area: SafeArea, s: float, d: float) -> float:
    """Distance r_b from a point to the nearer boundary of C [m]; 0 outside C.

    Args:
        area: record of :data:`records.SAFE_AREA`.
        s, d: position of the point in the road frame [m].
    """
    return boundary_offset(area, s, d)[0] ** 0.5


@jit
def free_rectangle(area: SafeArea, distance: float) -> tuple[float, float, float, float]:
    """A rectangle in C whose points are farther than a distance from both boundaries, found from their extremes alone.

    Args:
        area: record of :data:`records.SAFE_AREA`.
        distance: the distance [m].

    Returns:
        ``start, end, low, high`` in the road frame [m]. Beyond an open end of C the boundaries are extended, as in
        :func:`boundary_offset`, so that start is -inf or end is inf there.
    """
    low, high = -np.inf, np.inf
    for k in range(MAX_CHAIN):
        low, high = max(low, area.lower[k, 1]), min(high, area.upper[k, 1])
    first, last = area.upper[0, 0], area.upper[MAX_CHAIN - 1, 0]
    start = -np.inf if first <= area.start else first
    end = np.inf if area.outcome == REACHED and last > area.end - ON_LINE else last
    margin = distance + ON_LINE
    return start, end, low + margin, high - margin


@jit
def _crossing(chain: np.ndarray, s: float, side: float) -> float:
    """Smallest value of ``side * d`` at which a chain crosses path length s; inf if it does not."""
    least = np.inf
    for k in range(MAX_CHAIN - 1):
        s1, d1, s2, d2 = chain[k, 0], chain[k, 1], chain[k + 1, 0], chain[k + 1, 1]
        if k > 0 and s1 == s2 and d1 == d2:
            break  # a shorter chain repeats its last vertex
        if (s1 <= s) != (s2 <= s):
            least = min(least, side * (d1 + (d2 - d1) * (s - s1) / (s2 - s1)))
    return least


@jit
def lateral_bounds(area: SafeArea, s: float) -> tuple[float, float]:
    """Lateral extent of C at path length s, from the highest lower boundary to the lowest upper boundary.

    Args:
        area: record of :data:`records.SAFE_AREA`.
        s: path length [m]; clamped to the ends of the area.

    Returns:
        ``low, high``: lateral positions [m].
    """
    s = min(max(s, area.start), area.end - ON_LINE)
    return -_crossing(area.lower, s, -1.0), _crossing(area.upper, s, 1.0)
