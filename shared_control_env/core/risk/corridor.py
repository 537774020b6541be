"""Search through the triangles of the driving region, and the boundaries of the result (Table I, steps 2-4)."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from shared_control_env.core.compile.jit import jit, jit_inlined
from shared_control_env.core.records import MAX_CHAIN, SafeArea
from shared_control_env.core.risk.safe_area import BLOCKED, ON_LINE, REACHED


class Scratch(NamedTuple):
    """Scratch arrays of a search through n triangles; the arrays may be longer than needed.

    Attributes:
        neighbours: list of adjacent triangles, see :func:`adjacency`, shape (n, 3).
        distance: length of the shortest path into each triangle [m], shape (n,).
        at: point (s, d) at which the shortest path enters each triangle [m], shape (n, 2).
        parent: index of the triangle from which the path comes, or -1, shape (n,).
        entry: index of the edge at which the path enters, or -1, shape (n,).
        done: 1 for each triangle whose distance is final, else 0, shape (n,).
        sequence: triangles of the path found, from front to rear, shape (n,).
        stack: triangles and edges that remain to be examined, shape (3 n, 2).
        ring: outline (s, d) of the triangles that can be entered [m], shape (3 n + 2, 2).
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


def new_scratch(n: int) -> Scratch:
    """Scratch arrays for n triangles.

    Args:
        n: number of triangles.
    """
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


@jit
def search_triangles(
    triangles: np.ndarray, start: float, end: float, d: float, min_width: float, scratch: Scratch, area: SafeArea
) -> None:
    """Find the sequence of triangles from the ego to the final region, and its boundaries (Table I, steps 2-4).

    The table only says that adjacent triangles are searched until the final triangle is found. Readings: the smallest
    number of triangles, or the shortest path. The smallest number depends on the arbitrary choice of the diagonal of a
    rectangle, so the shortest path through the midpoints of the shared edges is used (Dijkstra). A passage narrower
    than the vehicle does not count.

    If no path reaches the front line, the outcome is BLOCKED, and the area is the union of all triangles that can be
    entered. Where corners are cocircular, these triangles depend on the choice of the diagonals.

    Args:
        triangles: vertices (s, d) [m], in any order and orientation, shape (m, 3, 2); made counter-clockwise in place.
        start, end: path lengths of the rear and the front line of the region [m].
        d: lateral position of the ego on the rear line [m].
        min_width: smallest width of a passage [m].
        scratch: scratch arrays for at least m triangles.
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
    """Make every triangle counter-clockwise, in place.

    Args:
        triangles: vertices (s, d) [m], overwritten, shape (m, 3, 2).
    """
    for i in range(triangles.shape[0]):
        a, b, c = triangles[i, 0], triangles[i, 1], triangles[i, 2]
        if (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) < 0.0:
            for k in range(2):
                b[k], c[k] = c[k], b[k]


@jit
def _length(s: float, d: float) -> float:
    """Length of a vector [m]. Coordinates of a road cannot overflow, which the slower hypot guards against."""
    return sqrt(s * s + d * d)


@jit
def _left_and_right(triangles: np.ndarray, i: int, edge: int) -> tuple[float, float, float, float]:
    """Left end (s, d) and right end (s, d) of an edge, as seen on leaving a counter-clockwise triangle over it."""
    right, left = triangles[i, edge], triangles[i, (edge + 1) % 3]
    return left[0], left[1], right[0], right[1]


@jit
def _same_edge(triangles: np.ndarray, i: int, edge: int, j: int) -> int:
    """Index of the edge of triangle j that is the given edge of triangle i, or -1."""
    ls, ld, rs, rd = _left_and_right(triangles, i, edge)
    for other in range(3):
        a, b = triangles[j, other], triangles[j, (other + 1) % 3]
        if a[0] == ls and a[1] == ld and b[0] == rs and b[1] == rd:
            return other
    return -1


@jit_inlined
def adjacency(triangles: np.ndarray, neighbours: np.ndarray) -> None:
    """Adjacency of the triangles (Table I, step 3) as a list.

    Entry ``[i, edge]`` is the index of the triangle on the other side of that edge of triangle i, or -1. The matrix
    D(i, j) of the table is 1 where row i contains j.

    Args:
        triangles: counter-clockwise vertices (s, d) [m], shape (m, 3, 2).
        neighbours: integers, written, shape (>= m, 3).
    """
    n = triangles.shape[0]
    for i in range(n):
        neighbours[i, 0] = neighbours[i, 1] = neighbours[i, 2] = -1
    for i in range(n):
        for edge in range(3):
            if neighbours[i, edge] >= 0:
                continue  # found from the other side
            for j in range(i + 1, n):
                other = _same_edge(triangles, i, edge, j)
                if other >= 0:
                    neighbours[i, edge], neighbours[j, other] = j, i
                    break


@jit_inlined
def _edge_on_line(triangles: np.ndarray, line: float, d: float) -> tuple[int, int]:
    """Triangle and edge on the line s = line that contain the lateral position d or are nearest to it; or -1, -1."""
    triangle, found, nearest = -1, -1, np.inf
    for i in range(triangles.shape[0]):
        for edge in range(3):
            ls, ld, rs, rd = _left_and_right(triangles, i, edge)
            if abs(ls - line) < ON_LINE and abs(rs - line) < ON_LINE:
                gap = max(0.0, min(ld, rd) - d, d - max(ld, rd))
                if gap < nearest:
                    triangle, found, nearest = i, edge, gap
    return triangle, found


@jit
def _edge_distance(triangles: np.ndarray, i: int, edge: int, s: float, d: float) -> float:
    """Distance from a point (s, d) to an edge [m]."""
    a, b = triangles[i, edge], triangles[i, (edge + 1) % 3]
    es, ed = b[0] - a[0], b[1] - a[1]
    along = ((s - a[0]) * es + (d - a[1]) * ed) / (es * es + ed * ed)
    along = min(max(along, 0.0), 1.0)
    return _length(s - a[0] - along * es, d - a[1] - along * ed)


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

    The path bends around the vertex that both edges share. The width is the distance from this vertex to the nearest
    boundary on the other side, and at most the length of either edge. The search for the boundary continues through the
    edges that are shared with another triangle (Demyen & Buro, Efficient Triangulation-Based Pathfinding, AAAI 2006).

    Args:
        triangles: counter-clockwise vertices (s, d) [m], shape (m, 3, 2).
        neighbours: list of adjacent triangles, see :func:`adjacency`, shape (>= m, 3).
        i: index of the triangle.
        entry, leave: indices of the edges at which the path enters and leaves the triangle.
        start, end: path lengths of the rear and the front line [m]; these two lines are not boundaries.
        stack: stack of a :class:`Scratch`, overwritten.
    """
    ls, ld, rs, rd = _left_and_right(triangles, i, entry)
    width = _length(ls - rs, ld - rd)
    ls, ld, rs, rd = _left_and_right(triangles, i, leave)
    width = min(width, _length(ls - rs, ld - rd))
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
            on_rear = abs(ls - start) < ON_LINE and abs(rs - start) < ON_LINE
            on_front = abs(ls - end) < ON_LINE and abs(rs - end) < ON_LINE
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
    """Dijkstra's search from the ego's triangle through the midpoints of the crossed edges; fills ``scratch``.

    Returns:
        Triangle in which the path reaches the front line, and the edge of the triangle on that line; or -1, -1.
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
            on_front = abs(ls - end) < ON_LINE and abs(rs - end) < ON_LINE
            j = neighbours[i, edge]
            if j < 0 and not on_front:
                continue
            ms, md = 0.5 * (ls + rs), 0.5 * (ld + rd)
            way = distance[i] + _length(ms - at[i, 0], md - at[i, 1])
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
def _start_chains(area: SafeArea, s: float, d: float) -> None:
    """Set both boundaries to a single point, which represents an empty area."""
    for k in range(MAX_CHAIN):
        area.lower[k, 0], area.lower[k, 1] = s, d
        area.upper[k, 0], area.upper[k, 1] = s, d


@jit
def _append(chain: np.ndarray, n: int, s: float, d: float) -> int:
    """Append a vertex unless it repeats the last vertex or the chain is full; return the new length."""
    if (n > 0 and chain[n - 1, 0] == s and chain[n - 1, 1] == d) or n == MAX_CHAIN:
        return n
    chain[n, 0], chain[n, 1] = s, d
    return n + 1


@jit
def _finish_chains(area: SafeArea, n_lower: int, n_upper: int) -> None:
    """Repeat the last vertex of each chain up to the end of its array.

    A chain that fills its array may have been cut off; the outcome is then BLOCKED.
    """
    if n_lower == MAX_CHAIN or n_upper == MAX_CHAIN:
        area.outcome = BLOCKED
    for k in range(n_lower, MAX_CHAIN):
        area.lower[k, 0], area.lower[k, 1] = area.lower[n_lower - 1, 0], area.lower[n_lower - 1, 1]
    for k in range(n_upper, MAX_CHAIN):
        area.upper[k, 0], area.upper[k, 1] = area.upper[n_upper - 1, 0], area.upper[n_upper - 1, 1]


@jit_inlined
def _trace_sequence(triangles: np.ndarray, goal: int, front_edge: int, scratch: Scratch, area: SafeArea) -> None:
    """Write the boundaries of the sequence: the left and right ends of every crossed edge, from rear to front."""
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
        # Entering over an edge mirrors leaving over it: the left end on leaving lies to the right on entering.
        rs, rd, ls, ld = _left_and_right(triangles, i, entry[i])
        n_lower = _append(area.lower, n_lower, rs, rd)
        n_upper = _append(area.upper, n_upper, ls, ld)
    ls, ld, rs, rd = _left_and_right(triangles, goal, front_edge)
    n_lower = _append(area.lower, n_lower, rs, rd)
    n_upper = _append(area.upper, n_upper, ls, ld)
    _finish_chains(area, n_lower, n_upper)


@jit_inlined
def _trace_reachable(triangles: np.ndarray, first: int, scratch: Scratch, area: SafeArea) -> None:
    """Write the outline of all entered triangles, from the right end of the rear edge around to its left end.

    The outline is split into the lower and the upper boundary at the vertex that is furthest ahead.
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
