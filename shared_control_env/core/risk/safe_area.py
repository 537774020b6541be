"""The safe area C in the road frame (s, d): what it is where nothing is in the way, and questions about it.

The driving region is the rectangle of road ahead, from the ego to d_o behind the preceding vehicle or
to a fixed look-ahead; vehicles inside are holes. Its triangles (:mod:`triangulation`) are searched from the ego's to
the final region (:mod:`corridor`); the sequence found is C, and its left and right edges are the upper and lower
boundary. Working in the road frame makes a curve a rectangle too; it neglects the bending of the road within
one vehicle length (5 cm at a radius of 60 m).
"""

from __future__ import annotations

import numpy as np

from shared_control_env.core.compile.jit import jit, jit_inlined
from shared_control_env.core.records import MAX_CHAIN, SafeArea

REACHED, BLOCKED = 0, 1
"""Outcomes of the search: the final region was found, or no passage as wide as the vehicle leads to it."""

ON_LINE = 1e-9
"""Distance under which a vertex lies on the rear or front line of the region [m]."""


@jit
def is_whole(count: int, region: np.ndarray, min_width: float) -> bool:
    """Whether the safe area is the whole driving region, whatever its triangles.

    Args:
        count: vehicles in the region.
        region: start, end along the road and low, high across it [m], shape (4,).
        min_width: narrowest passage that counts as one [m].
    """
    return count == 0 and region[3] - region[2] >= min_width


@jit_inlined
def whole_region(region: np.ndarray, area: SafeArea) -> None:
    """Safe area where :func:`is_whole`: the driving region itself.

    Args:
        region: start, end along the road and low, high across it [m], shape (4,).
        area: record of :data:`records.SAFE_AREA`, written.
    """
    for k in range(MAX_CHAIN):
        s = region[0] if k == 0 else region[1]
        area.lower[k, 0], area.lower[k, 1] = s, region[2]
        area.upper[k, 0], area.upper[k, 1] = s, region[3]
    area.start, area.end, area.outcome = region[0], region[1], REACHED


@jit
def _on_open_end(area: SafeArea, s: float) -> float:
    """Path length clamped to the area's open ends: behind the ego, and at the final region where that was reached.

    Both are lines across the road, not boundaries; the boundaries count as going straight on there.
    What lies beyond a blocked end stays outside.
    """
    if area.outcome == REACHED:
        s = min(s, area.end - ON_LINE)
    return max(s, area.start)


@jit_inlined
def _scan_chain(chain: np.ndarray, s: float, d: float) -> tuple[int, float, float, float]:
    """Segments of a chain above a point, for the even-odd rule; its squared distance, and the vector from there."""
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
    """Squared distance from a point to the nearer boundary of C, and the vector from there; zeros outside C.

    Args:
        area: record of :data:`records.SAFE_AREA`.
        s, d: the point [m].

    Returns:
        Squared distance [m^2]; s and d components of the vector [m].
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
    """Distance r_b from a point to the nearer boundary of C [m]; 0 outside C. Arguments as :func:`boundary_offset`."""
    return boundary_offset(area, s, d)[0] ** 0.5


@jit
def lateral_bounds(area: SafeArea, s: float) -> tuple[float, float]:
    """Lateral extent of C at path length s: the lowest upper and the highest lower boundary there.

    Args:
        area: record of :data:`records.SAFE_AREA`.
        s: path length [m]; beyond either end the end counts.

    Returns:
        ``low, high`` [m].
    """
    s = min(max(s, area.start), area.end - ON_LINE)
    low, high = -np.inf, np.inf
    for k in range(MAX_CHAIN - 1):
        s1, d1, s2, d2 = area.lower[k, 0], area.lower[k, 1], area.lower[k + 1, 0], area.lower[k + 1, 1]
        if (s1 <= s) != (s2 <= s):
            low = max(low, d1 + (d2 - d1) * (s - s1) / (s2 - s1))
        s1, d1, s2, d2 = area.upper[k, 0], area.upper[k, 1], area.upper[k + 1, 0], area.upper[k + 1, 1]
        if (s1 <= s) != (s2 <= s):
            high = min(high, d1 + (d2 - d1) * (s - s1) / (s2 - s1))
    return low, high
