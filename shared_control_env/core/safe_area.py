"""The safe area C by constrained Delaunay triangulation (Table I), in the road frame (s, d).

The driving region is the rectangle of road ahead, from the ego to d_o behind the preceding vehicle or
to a fixed look-ahead; vehicles inside are holes. Its triangles are searched from the ego's to the
final region; the sequence found is C, and its left and right edges are the upper and lower boundary.
Working in the road frame makes a curve a rectangle too; it neglects the bending of the road within
one vehicle length (5 cm at a radius of 60 m).
"""

from __future__ import annotations

from math import hypot
from typing import NamedTuple

import numpy as np

from shared_control_env.core import delaunay
from shared_control_env.core.jit import jit, jit_allocating, jit_inlined
from shared_control_env.core.records import MAX_CHAIN, Record

REACHED, BLOCKED = 0, 1
"""Outcomes of the search: the final region was found, or no passage as wide as the vehicle leads to it."""

_ON_LINE = 1e-9
"""Distance under which a vertex lies on the rear or front line of the region [m]."""


class Scratch(NamedTuple):
    """What a search through n triangles works in; longer arrays do as well.

    Attributes:
        neighbours: :func:`adjacency`, (n, 3).
        distance: length of the shortest way into each triangle [m], (n,).
        at: where that way enters it, (s, d) [m], (n, 2).
        parent: the triangle it is entered from, or -1, (n,).
        entry: the edge it is entered by, or -1, (n,).
        done: 1 where its distance is final, (n,).
        sequence: triangles of the way found, from front to rear, (n,).
        stack: triangles and edges yet to look at, (3 n, 2).
        ring: outline of the triangles that can be entered, (s, d) [m], (3 n + 2, 2).
    """

    neighbours: np.ndarray
    distance: np.ndarray
    at: np.ndarray
    parent: np.ndarray
    entry: np.ndarray
    done: np.ndarray
    sequence: np.ndarray
    stack: np.ndarray
    ring: np.ndarray


@jit_allocating
def new_scratch(n: int) -> Scratch:
    """Scratch for n triangles."""
    return Scratch(
        np.empty((n, 3), dtype=np.int64),
        np.empty(n),
        np.empty((n, 2)),
        np.empty(n, dtype=np.int64),
        np.empty(n, dtype=np.int64),
        np.empty(n, dtype=np.int8),
        np.empty(n, dtype=np.int64),
        np.empty((3 * n, 2), dtype=np.int64),
        np.empty((3 * n + 2, 2)),
    )


def triangulate(start: float, end: float, low: float, high: float, holes: np.ndarray) -> np.ndarray:
    """Constrained Delaunay triangles of a rectangle less its holes (Table I, step 1), by shapely.

    For more holes than :func:`delaunay.triangulate` takes, and to test that one.

    Shapely raises when holes overlap or cross the shell, so their union is subtracted first.

    Args:
        start, end: extent along the road [m], end > start.
        low, high: extent across [m], high > low.
        holes: corners of the vehicles, shape (n, 4, 2) [m].

    Returns:
        Triangles, shape (m, 3, 2); m = 0 when the holes cover the region.
    """
    import shapely  # seldom needed, and slow to import

    region = shapely.box(start, low, end, high)
    if holes.shape[0]:
        region = region.difference(shapely.union_all(shapely.polygons(holes)))
    triangles = shapely.constrained_delaunay_triangles(region)
    return shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3].copy()


@jit_inlined
def triangulate_compiled(region: np.ndarray, holes: np.ndarray, count: int, work: Record) -> int:
    """:func:`delaunay.triangulate`, with no triangles at all where that gives up, so that the area is blocked.

    Args:
        region, holes, count, work: as there.

    Returns:
        Number of triangles in ``work.triangles``.
    """
    return max(0, delaunay.triangulate(region, holes, count, work))


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
def whole_region(region: np.ndarray, area: Record) -> None:
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
def search_triangles(
    triangles: np.ndarray, start: float, end: float, d: float, min_width: float, scratch: Scratch, area: Record
) -> None:
    """Sequence of triangles from the ego to the final region, and its boundaries (Table I, steps 2-4).

    The table says only to search adjacent triangles until the final one is found. Readings: the fewest
    triangles, or the shortest way. The fewest depends on which diagonal a rectangle happens to get,
    so the shortest way through the midpoints of the shared edges is taken (Dijkstra). A way narrower
    than the vehicle is none. Without a way to the front line the outcome is BLOCKED, and the area is
    the union of all triangles that can be entered; where corners lie on a circle these depend on the diagonals.

    Args:
        triangles: shape (m, 3, 2), in any order and orientation.
        start, end: rear and front line of the region [m].
        d: lateral position of the ego on the rear line [m].
        min_width: narrowest passage [m].
        scratch: for as many triangles.
        area: record of :data:`records.SAFE_AREA`, written.
    """
    orient(triangles)
    adjacency(triangles, scratch.neighbours)
    first, rear_edge = _edge_on_line(triangles, start, d)
    area.start = start
    if first < 0:
        _start_chains(area, start, d)
        area.end, area.outcome = start, BLOCKED
        return
    goal, front_edge = _search(triangles, first, rear_edge, start, end, d, min_width, scratch)
    if goal >= 0:
        area.outcome = REACHED
        _trace_sequence(triangles, goal, front_edge, scratch, area)
    else:
        area.outcome = BLOCKED
        _trace_reachable(triangles, first, scratch, area)
    area.end = max(area.lower[MAX_CHAIN - 1, 0], area.upper[MAX_CHAIN - 1, 0])


@jit_inlined
def orient(triangles: np.ndarray) -> None:
    """Make every triangle counter-clockwise, in place; shape (m, 3, 2)."""
    for i in range(triangles.shape[0]):
        a, b, c = triangles[i, 0], triangles[i, 1], triangles[i, 2]
        if (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) < 0.0:
            for k in range(2):
                b[k], c[k] = c[k], b[k]


@jit
def _left_and_right(triangles: np.ndarray, i: int, edge: int) -> tuple[float, float, float, float]:
    """Ends of an edge as seen when leaving a counter-clockwise triangle over it: left s, d, right s, d."""
    right, left = triangles[i, edge], triangles[i, (edge + 1) % 3]
    return left[0], left[1], right[0], right[1]


@jit
def _same_edge(triangles: np.ndarray, i: int, edge: int, j: int) -> int:
    """Which edge of triangle j is the given edge of triangle i, or -1."""
    ls, ld, rs, rd = _left_and_right(triangles, i, edge)
    for other in range(3):
        a, b = triangles[j, other], triangles[j, (other + 1) % 3]
        if a[0] == ls and a[1] == ld and b[0] == rs and b[1] == rd:
            return other
    return -1


@jit_inlined
def adjacency(triangles: np.ndarray, neighbours: np.ndarray) -> None:
    """Adjacency (Table I, step 3) as a list: ``[i, edge]`` is the triangle over that edge, or -1.

    The table's matrix D(i, j) is 1 where j is in row i.

    Args:
        triangles: counter-clockwise, shape (m, 3, 2).
        neighbours: integers, written, shape (>= m, 3).
    """
    n = triangles.shape[0]
    for i in range(n):
        for edge in range(3):
            neighbours[i, edge] = -1
            for j in range(n):
                if _same_edge(triangles, i, edge, j) >= 0:
                    neighbours[i, edge] = j


@jit_inlined
def _edge_on_line(triangles: np.ndarray, line: float, d: float) -> tuple[int, int]:
    """Triangle and edge on the line s = line that hold, or are nearest to, the lateral position d; or -1, -1."""
    triangle, found, nearest = -1, -1, np.inf
    for i in range(triangles.shape[0]):
        for edge in range(3):
            ls, ld, rs, rd = _left_and_right(triangles, i, edge)
            if abs(ls - line) < _ON_LINE and abs(rs - line) < _ON_LINE:
                gap = max(0.0, min(ld, rd) - d, d - max(ld, rd))
                if gap < nearest:
                    triangle, found, nearest = i, edge, gap
    return triangle, found


@jit
def _edge_distance(triangles: np.ndarray, i: int, edge: int, s: float, d: float) -> float:
    """Distance from a point to an edge."""
    a, b = triangles[i, edge], triangles[i, (edge + 1) % 3]
    es, ed = b[0] - a[0], b[1] - a[1]
    along = ((s - a[0]) * es + (d - a[1]) * ed) / (es * es + ed * ed)
    along = min(max(along, 0.0), 1.0)
    return hypot(s - a[0] - along * es, d - a[1] - along * ed)


@jit
def clearance(
    triangles: np.ndarray,
    neighbours: np.ndarray,
    i: int,
    entry: int,
    leave: int,
    start: float,
    end: float,
    stack: np.ndarray,
) -> float:
    """Width of the passage through a triangle from one edge to another [m].

    The way bends around the vertex that both edges share. Its width is the distance from there to the nearest
    boundary on the other side, looked for through the open edges (Demyen & Buro, Efficient
    Triangulation-Based Pathfinding, AAAI 2006), and at most the length of either edge.

    Args:
        triangles, neighbours: as of :func:`adjacency`.
        i: the triangle.
        entry, leave: its two edges.
        start, end: rear and front line, which are open.
        stack: of a :class:`Scratch`, written.
    """
    ls, ld, rs, rd = _left_and_right(triangles, i, entry)
    width = hypot(ls - rs, ld - rd)
    ls, ld, rs, rd = _left_and_right(triangles, i, leave)
    width = min(width, hypot(ls - rs, ld - rd))
    across = 3 - entry - leave
    s, d = triangles[i, (across + 2) % 3, 0], triangles[i, (across + 2) % 3, 1]
    stack[0, 0], stack[0, 1] = i, across
    size = 1
    while size > 0:
        size -= 1
        t, edge = stack[size, 0], stack[size, 1]
        distance = _edge_distance(triangles, t, edge, s, d)
        if distance >= width:
            continue
        j = neighbours[t, edge]
        if j < 0:
            ls, ld, rs, rd = _left_and_right(triangles, t, edge)
            on_rear = abs(ls - start) < _ON_LINE and abs(rs - start) < _ON_LINE
            on_front = abs(ls - end) < _ON_LINE and abs(rs - end) < _ON_LINE
            if not on_rear and not on_front:
                width = distance
            continue
        back = _same_edge(triangles, t, edge, j)
        for k in range(1, 3):
            stack[size, 0], stack[size, 1] = j, (back + k) % 3
            size += 1
    return width


@jit_inlined
def _search(
    triangles: np.ndarray,
    first: int,
    rear_edge: int,
    start: float,
    end: float,
    d: float,
    min_width: float,
    scratch: Scratch,
) -> tuple[int, int]:
    """Dijkstra from the ego's triangle through the midpoints of the edges crossed; fills ``scratch``.

    Returns:
        The triangle in which the front line is reached and its edge there, or -1.
    """
    n, neighbours = triangles.shape[0], scratch.neighbours
    distance, at, parent, entry, done = scratch.distance, scratch.at, scratch.parent, scratch.entry, scratch.done
    for j in range(n):
        distance[j], parent[j], entry[j], done[j] = np.inf, -1, -1, 0
    distance[first], entry[first], at[first, 0], at[first, 1] = 0.0, rear_edge, start, d
    goal, front_edge, goal_distance = -1, -1, np.inf
    for _ in range(n):
        i, best = -1, np.inf
        for j in range(n):
            if done[j] == 0 and distance[j] < best:
                i, best = j, distance[j]
        if i < 0:
            break
        done[i] = 1
        for edge in range(3):
            if edge == entry[i]:
                continue
            ls, ld, rs, rd = _left_and_right(triangles, i, edge)
            on_front = abs(ls - end) < _ON_LINE and abs(rs - end) < _ON_LINE
            j = neighbours[i, edge]
            if j < 0 and not on_front:
                continue
            ms, md = 0.5 * (ls + rs), 0.5 * (ld + rd)
            way = distance[i] + hypot(ms - at[i, 0], md - at[i, 1])
            if way >= (goal_distance if j < 0 else distance[j]):
                continue
            if clearance(triangles, neighbours, i, entry[i], edge, start, end, scratch.stack) < min_width:
                continue
            if j < 0:
                goal, front_edge, goal_distance = i, edge, way
            else:
                distance[j], parent[j], entry[j] = way, i, _same_edge(triangles, i, edge, j)
                at[j, 0], at[j, 1] = ms, md
    return goal, front_edge


@jit
def _start_chains(area: Record, s: float, d: float) -> None:
    """Set both boundaries to a single point, the form of an empty area."""
    for k in range(MAX_CHAIN):
        area.lower[k, 0], area.lower[k, 1] = s, d
        area.upper[k, 0], area.upper[k, 1] = s, d


@jit
def _append(chain: np.ndarray, n: int, s: float, d: float) -> int:
    """Append a vertex unless it repeats the last or the chain is full; return the new length."""
    if (n > 0 and chain[n - 1, 0] == s and chain[n - 1, 1] == d) or n == MAX_CHAIN:
        return n
    chain[n, 0], chain[n, 1] = s, d
    return n + 1


@jit
def _finish_chains(area: Record, n_lower: int, n_upper: int) -> None:
    """Repeat the last vertices to the arrays' ends; a chain that filled its array may be cut: blocked there."""
    if n_lower == MAX_CHAIN or n_upper == MAX_CHAIN:
        area.outcome = BLOCKED
    for k in range(n_lower, MAX_CHAIN):
        area.lower[k, 0], area.lower[k, 1] = area.lower[n_lower - 1, 0], area.lower[n_lower - 1, 1]
    for k in range(n_upper, MAX_CHAIN):
        area.upper[k, 0], area.upper[k, 1] = area.upper[n_upper - 1, 0], area.upper[n_upper - 1, 1]


@jit_inlined
def _trace_sequence(triangles: np.ndarray, goal: int, front_edge: int, scratch: Scratch, area: Record) -> None:
    """Boundaries of the sequence: left and right ends of every edge it crosses, from rear to front."""
    parent, entry, sequence = scratch.parent, scratch.entry, scratch.sequence
    length = 0
    i = goal
    while i >= 0:
        sequence[length] = i
        length += 1
        i = parent[i]
    n_lower = n_upper = 0
    for k in range(length - 1, -1, -1):
        i = sequence[k]
        # Entering over an edge mirrors leaving over it: its left end lies to the right of the way.
        rs, rd, ls, ld = _left_and_right(triangles, i, entry[i])
        n_lower = _append(area.lower, n_lower, rs, rd)
        n_upper = _append(area.upper, n_upper, ls, ld)
    ls, ld, rs, rd = _left_and_right(triangles, goal, front_edge)
    n_lower = _append(area.lower, n_lower, rs, rd)
    n_upper = _append(area.upper, n_upper, ls, ld)
    _finish_chains(area, n_lower, n_upper)


@jit_inlined
def _trace_reachable(triangles: np.ndarray, first: int, scratch: Scratch, area: Record) -> None:
    """Outline of all triangles entered, from the right end of the rear edge around to its left end.

    The outline is split at its vertex furthest ahead into the lower and the upper boundary.
    """
    neighbours, parent, entry = scratch.neighbours, scratch.parent, scratch.entry
    stack, ring = scratch.stack, scratch.ring
    corner = (entry[first] + 1) % 3
    ring[0, 0], ring[0, 1] = triangles[first, corner, 0], triangles[first, corner, 1]
    size = 1
    stack[0, 0], stack[0, 1] = first, 2
    stack[1, 0], stack[1, 1] = first, 1
    depth = 2
    while depth > 0:
        depth -= 1
        i = stack[depth, 0]
        edge = (entry[i] + stack[depth, 1]) % 3
        j = neighbours[i, edge]
        if j >= 0 and parent[j] == i and _same_edge(triangles, i, edge, j) == entry[j]:
            for turn in (2, 1):
                stack[depth, 0], stack[depth, 1] = j, turn
                depth += 1
        else:
            corner = (edge + 1) % 3
            ring[size, 0], ring[size, 1] = triangles[i, corner, 0], triangles[i, corner, 1]
            size += 1
    furthest = 0
    for k in range(size):
        if ring[k, 0] > ring[furthest, 0]:
            furthest = k
    n_lower = n_upper = 0
    for k in range(furthest + 1):
        n_lower = _append(area.lower, n_lower, ring[k, 0], ring[k, 1])
    for k in range(size - 1, furthest - 1, -1):
        n_upper = _append(area.upper, n_upper, ring[k, 0], ring[k, 1])
    _finish_chains(area, n_lower, n_upper)


@jit
def _on_open_end(area: Record, s: float) -> float:
    """Path length clamped to the area's open ends: behind the ego, and at the final region where that was reached.

    Both are lines across the road, not boundaries; the boundaries count as going straight on there.
    What lies beyond a blocked end stays outside.
    """
    if area.outcome == REACHED:
        s = min(s, area.end - _ON_LINE)
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
def boundary_offset(area: Record, s: float, d: float) -> tuple[float, float, float]:
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
def boundary_distance(area: Record, s: float, d: float) -> float:
    """Distance r_b from a point to the nearer boundary of C [m]; 0 outside C. Arguments as :func:`boundary_offset`."""
    return boundary_offset(area, s, d)[0] ** 0.5


@jit
def lateral_bounds(area: Record, s: float) -> tuple[float, float]:
    """Lateral extent of C at path length s: the lowest upper and the highest lower boundary there.

    Args:
        area: record of :data:`records.SAFE_AREA`.
        s: path length [m]; beyond either end the end counts.

    Returns:
        ``low, high`` [m].
    """
    s = min(max(s, area.start), area.end - _ON_LINE)
    low, high = -np.inf, np.inf
    for k in range(MAX_CHAIN - 1):
        s1, d1, s2, d2 = area.lower[k, 0], area.lower[k, 1], area.lower[k + 1, 0], area.lower[k + 1, 1]
        if (s1 <= s) != (s2 <= s):
            low = max(low, d1 + (d2 - d1) * (s - s1) / (s2 - s1))
        s1, d1, s2, d2 = area.upper[k, 0], area.upper[k, 1], area.upper[k + 1, 0], area.upper[k + 1, 1]
        if (s1 <= s) != (s2 <= s):
            high = min(high, d1 + (d2 - d1) * (s - s1) / (s2 - s1))
    return low, high
