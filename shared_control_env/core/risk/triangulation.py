"""Constrained Delaunay triangulation of a rectangle minus convex holes, compiled (Table I, step 1).

The holes are rotated rectangles. They may overlap, touch, or cross the border of the rectangle. The first step finds
the boundary of the free region, as a set of directed edges with the free region on their left. The holes are convex,
so each hole covers one interval of any side; the parts of the sides that no hole covers bound the free region.

The second step puts triangles on the edges of the boundary, one after the other (gift wrapping). The apex of a triangle
is the visible vertex that sees the edge under the largest angle, which is the vertex with the empty circumcircle. Each
triangle replaces its edge by its two other edges. The edges therefore always bound the region that is not yet
triangulated, and triangles cannot overlap, regardless of ties and rounding.

All lengths are compared with one tolerance, 1e-9 m. It is far above the rounding error of coordinates of 1e3 m
(1e-13 m), so touching and coincident edges are recognised. It is far below any length that matters.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np

from shared_control_env.core.compile.jit import jit, jit_inlined
from shared_control_env.core.records import record_dtype

MAX_HOLES = 8
"""Largest number of holes in a region."""

MAX_VERTICES = 160
"""Largest number of vertices, hidden corners included; eight bars laid as a grid across the border have 132."""

MAX_TRIANGLES = MAX_VERTICES + 2 * MAX_HOLES
"""Largest number of triangles: by Euler's formula n_vertices - 2, plus two for every hole."""

MAX_FRONT = 2 * MAX_VERTICES
"""Largest number of edges of the front, the boundary of the region that is not yet triangulated."""

FAILED = -1
"""Returned instead of a number of triangles if a capacity is exceeded or if no triangle fits an edge."""


class Workspace:
    """Scratch and result of one triangulation.

    Attributes:
        sides: end points (s, d) of the sides of the region and of the holes [m].
        vertices: positions (s, d) of the vertices [m].
        n_vertices: number of vertices.
        pieces: pieces of the sides that no hole covers, as indices of their first and last vertex.
        n_pieces: number of pieces.
        front: boundary of the region that is not yet triangulated, as indices of the first and last vertex of each
            edge.
        n_front: number of edges of the front.
        cotangents: cotangents of the angles under which the vertices of the front see an edge [-].
        covered: intervals of one side that holes cover, in [0, 1] [-].
        cutters: sides that bound these intervals, or -1 at the ends of the side.
        triangles: the result, counter-clockwise vertices (s, d) [m].
    """

    sides: Annotated[np.ndarray, (4 * MAX_HOLES + 4, 2, 2)]
    vertices: Annotated[np.ndarray, (MAX_VERTICES, 2)]
    n_vertices: int
    pieces: Annotated[np.ndarray, (MAX_FRONT, 2), np.int64]
    n_pieces: int
    front: Annotated[np.ndarray, (MAX_FRONT, 2), np.int64]
    n_front: int
    cotangents: Annotated[np.ndarray, (MAX_FRONT,)]
    covered: Annotated[np.ndarray, (MAX_HOLES, 2)]
    cutters: Annotated[np.ndarray, (MAX_HOLES, 2), np.int64]
    triangles: Annotated[np.ndarray, (MAX_TRIANGLES, 3, 2)]


WORKSPACE = record_dtype(Workspace)

_TOLERANCE = 1e-9
"""Distance below which two points coincide, and below which a point lies on a line [m]."""

_TIE = 1e-9
"""Relative difference of the cotangents below which four points count as cocircular [-]."""


@jit
def triangulate(region: np.ndarray, holes: np.ndarray, n_holes: int, work: Workspace) -> int:
    """Constrained Delaunay triangulation of a rectangle minus its holes (Table I, step 1).

    The vertices are those of the difference polygon, including points on its straight sides where holes touch. The
    diagonals among cocircular points are not unique. The choice among them depends on the order of the holes and of
    their corners, and not on rounding.

    Args:
        region: start, end along the road and low, high across the road [m], shape (4,).
        holes: corners (s, d) [m] of convex quadrilaterals of positive area, in order around each of them,
            shape (>= n_holes, 4, 2).
        n_holes: number of holes.
        work: record of :data:`WORKSPACE`; the triangles are written to ``work.triangles``.

    Returns:
        Number of triangles; 0 if the holes cover the region. FAILED in three cases: there are more than MAX_HOLES
        holes; the free region has more than MAX_VERTICES vertices; or sides whose distance is about the tolerance
        (neither touching nor clearly apart) leave the boundary of the free region open.
    """
    if n_holes > MAX_HOLES:
        return FAILED
    _lay_sides(region, holes, n_holes, work)
    if not _find_pieces(4 * (n_holes + 1), work) or not _close_boundary(work):
        return FAILED
    front, vertices, triangles = work.front, work.vertices, work.triangles
    count = 0
    while work.n_front > 0:
        work.n_front -= 1
        a, b = front[work.n_front, 0], front[work.n_front, 1]
        c = _apex(work, a, b)
        if c < 0 or count == MAX_TRIANGLES or work.n_front + 2 > MAX_FRONT:
            return FAILED
        for k in range(2):
            triangles[count, 0, k] = vertices[a, k]
            triangles[count, 1, k] = vertices[b, k]
            triangles[count, 2, k] = vertices[c, k]
        count += 1
        _put_edge(work, a, c)
        _put_edge(work, c, b)
    return count


@jit_inlined
def _lay_sides(region: np.ndarray, holes: np.ndarray, n_holes: int, work: Workspace) -> None:
    """Write the sides of the region and then of the holes, four each, with the free region on their left.

    All corners become vertices, at which coincident sides can be split. Corners inside holes do no harm.
    """
    sides = work.sides
    work.n_vertices = 0
    for k in range(4):
        s, d = region[1 if k == 1 or k == 2 else 0], region[3 if k >= 2 else 2]
        sides[k, 0, 0], sides[k, 0, 1] = s, d
        sides[(k + 3) % 4, 1, 0], sides[(k + 3) % 4, 1, 1] = s, d
        _vertex(work, s, d)
    for i in range(n_holes):
        clockwise = _offset(holes[i, 0], holes[i, 1], holes[i, 2]) < 0.0
        for k in range(4):
            s, d = holes[i, k if clockwise else 3 - k, 0], holes[i, k if clockwise else 3 - k, 1]
            side, before = 4 * i + 4 + k, 4 * i + 4 + (k + 3) % 4
            sides[side, 0, 0], sides[side, 0, 1] = s, d
            sides[before, 1, 0], sides[before, 1, 1] = s, d
            _vertex(work, s, d)


@jit
def _offset(a: np.ndarray, b: np.ndarray, p: np.ndarray) -> float:
    """Approximate distance of p to the left of the line from a to b [m]; exactly 0 if p is a or b.

    The magnitude is too small by a factor of up to sqrt(2), since the sum of absolute values replaces the square root.
    """
    es, ed = b[0] - a[0], b[1] - a[1]
    return (es * (p[1] - a[1]) - ed * (p[0] - a[0])) / (abs(es) + abs(ed))


@jit
def _vertex(work: Workspace, s: float, d: float) -> int:
    """Index of the vertex at a point, which is added unless it exists; -1 if there is no room for another vertex."""
    vertices, n = work.vertices, work.n_vertices
    for i in range(n):
        if abs(vertices[i, 0] - s) < _TOLERANCE and abs(vertices[i, 1] - d) < _TOLERANCE:
            return i
    if n == MAX_VERTICES:
        return -1
    vertices[n, 0], vertices[n, 1] = s, d
    work.n_vertices = n + 1
    return n


@jit
def _inside(sides: np.ndarray, e: int, polygon: int) -> tuple[float, float, int, int]:
    """Part of a side that lies inside the region (polygon 0) or inside a hole, by Cyrus-Beck clipping.

    Of coincident sides, the side with the lower index remains. None remains if there are holes on both of its sides.

    Returns:
        Start and end of the part, in [0, 1], and the sides at which the part is cut, or -1. For an empty part the end
        is not greater than the start.
    """
    first, last, first_cut, last_cut = 0.0, 1.0, -1, -1
    inward = 1.0 if polygon == 0 else -1.0
    for k in range(4 * polygon, 4 * polygon + 4):
        at_0 = inward * _offset(sides[k, 0], sides[k, 1], sides[e, 0])
        at_1 = inward * _offset(sides[k, 0], sides[k, 1], sides[e, 1])
        if abs(at_0) < _TOLERANCE and abs(at_1) < _TOLERANCE:
            es, ed = sides[e, 1, 0] - sides[e, 0, 0], sides[e, 1, 1] - sides[e, 0, 1]
            ks, kd = sides[k, 1, 0] - sides[k, 0, 0], sides[k, 1, 1] - sides[k, 0, 1]
            if polygon == 0 or (es * ks + ed * kd > 0.0 and k > e):
                return 0.0, 0.0, -1, -1
        elif at_0 <= 0.0 and at_1 <= 0.0:
            return 0.0, 0.0, -1, -1
        elif at_0 < 0.0:
            if at_0 / (at_0 - at_1) > first:
                first, first_cut = at_0 / (at_0 - at_1), k
        elif at_1 < 0.0 and at_0 / (at_0 - at_1) < last:
            last, last_cut = at_0 / (at_0 - at_1), k
    return first, last, first_cut, last_cut


@jit_inlined
def _covered_parts(n_sides: int, e: int, work: Workspace) -> int:
    """Write the parts of a side that other holes cover to ``work.covered``, sorted by start; return their number."""
    covered, cutters = work.covered, work.cutters
    count = 0
    for hole in range(1, n_sides // 4):
        if hole == e // 4:
            continue
        first, last, first_cut, last_cut = _inside(work.sides, e, hole)
        if first >= last:
            continue
        i = count
        while i > 0 and covered[i - 1, 0] > first:
            for k in range(2):
                covered[i, k], cutters[i, k] = covered[i - 1, k], cutters[i - 1, k]
            i -= 1
        covered[i, 0], covered[i, 1] = first, last
        cutters[i, 0], cutters[i, 1] = first_cut, last_cut
        count += 1
    return count


@jit_inlined
def _find_pieces(n_sides: int, work: Workspace) -> bool:
    """Find the pieces of all sides that lie in the region and that no hole covers; False if there is no room."""
    work.n_pieces = 0
    covered, cutters = work.covered, work.cutters
    for e in range(n_sides):
        at, end, at_cut, end_cut = 0.0, 1.0, -1, -1
        if e >= 4:
            at, end, at_cut, end_cut = _inside(work.sides, e, 0)
        if at >= end:
            continue
        for i in range(_covered_parts(n_sides, e, work)):
            if covered[i, 0] >= end:
                break
            if covered[i, 0] > at and not _add_piece(work, e, at_cut, cutters[i, 0]):
                return False
            if covered[i, 1] > at:
                at, at_cut = covered[i, 1], cutters[i, 1]
        if at < end and not _add_piece(work, e, at_cut, end_cut):
            return False
    return True


@jit
def _add_piece(work: Workspace, e: int, first_cut: int, last_cut: int) -> bool:
    """Add the piece of a side between two other sides, or up to its ends (-1); False if there is no room."""
    a = _cut_vertex(work, e, first_cut, 0)
    b = _cut_vertex(work, e, last_cut, 1)
    if a < 0 or b < 0 or work.n_pieces == MAX_FRONT:
        return False
    if a != b:
        work.pieces[work.n_pieces, 0], work.pieces[work.n_pieces, 1] = a, b
        work.n_pieces += 1
    return True


@jit
def _cut_vertex(work: Workspace, e: int, cut: int, end: int) -> int:
    """Vertex where another side cuts a side; where that other side is -1, the vertex at end 0 or 1 of the side.

    The point is computed in the same way for both sides. Otherwise two almost parallel sides would give different
    points. The point is computed along the side of lower index, so that it lies exactly on the border of the region.
    """
    sides = work.sides
    if cut < 0:
        return _vertex(work, sides[e, end, 0], sides[e, end, 1])
    lower, upper = min(e, cut), max(e, cut)
    at_0 = _offset(sides[upper, 0], sides[upper, 1], sides[lower, 0])
    at_1 = _offset(sides[upper, 0], sides[upper, 1], sides[lower, 1])
    t = at_0 / (at_0 - at_1)
    s = sides[lower, 0, 0] + t * (sides[lower, 1, 0] - sides[lower, 0, 0])
    d = sides[lower, 0, 1] + t * (sides[lower, 1, 1] - sides[lower, 0, 1])
    return _vertex(work, s, d)


@jit_inlined
def _close_boundary(work: Workspace) -> bool:
    """Make the pieces the front, split at the vertices that lie on them; False if there is no room."""
    work.n_front = 0
    for i in range(work.n_pieces):
        a, b = work.pieces[i, 0], work.pieces[i, 1]
        for _ in range(work.n_vertices):
            if a == b:
                break
            if work.n_front == MAX_FRONT:
                return False
            nearest = _next_on_piece(work.vertices, work.n_vertices, a, b)
            _put_edge(work, a, nearest)
            a = nearest
    return True


@jit
def _next_on_piece(vertices: np.ndarray, n_vertices: int, a: int, b: int) -> int:
    """First vertex on the straight way from vertex a to vertex b, b included."""
    es, ed = vertices[b, 0] - vertices[a, 0], vertices[b, 1] - vertices[a, 1]
    nearest, least = b, es * es + ed * ed
    for i in range(n_vertices):
        if i in (a, b) or abs(_offset(vertices[a], vertices[b], vertices[i])) > _TOLERANCE:
            continue
        along = es * (vertices[i, 0] - vertices[a, 0]) + ed * (vertices[i, 1] - vertices[a, 1])
        if 0.0 < along < least:
            nearest, least = i, along
    return nearest


@jit
def _put_edge(work: Workspace, a: int, b: int) -> None:
    """Add an edge to the front, or remove the reversed edge if the front holds it, since both enclose nothing."""
    front, n = work.front, work.n_front
    for i in range(n):
        if front[i, 0] == b and front[i, 1] == a:
            front[i, 0], front[i, 1] = front[n - 1, 0], front[n - 1, 1]
            work.n_front = n - 1
            return
    front[n, 0], front[n, 1] = a, b
    work.n_front = n + 1


@jit_inlined
def _apex(work: Workspace, a: int, b: int) -> int:
    """Visible vertex on the left of an edge that sees the edge under the largest angle, or -1.

    Angles are compared by their cotangents, which decrease from inf to -inf as the angle grows. The test of visibility
    takes the most time, so it is made for the largest angle first.
    """
    front, cotangents = work.front, work.cotangents
    _rate(work, a, b)
    for _ in range(work.n_front):
        best = -1
        least = np.inf
        for i in range(work.n_front):
            if cotangents[i] < least:
                best, least = i, cotangents[i] - _TIE * (1.0 + abs(cotangents[i]))
        if best < 0 or _visible(work.vertices, front, work.n_front, a, b, front[best, 0]):
            return front[best, 0] if best >= 0 else -1
        cotangents[best] = np.inf
    return -1


@jit
def _rate(work: Workspace, a: int, b: int) -> None:
    """Write the cotangents of the angles under which the vertices of the front see an edge to ``work.cotangents``.

    Each edge of the front stands for its first vertex. The cotangent is inf unless the vertex lies to the left.
    """
    front, vertices = work.front, work.vertices
    a_s, a_d, b_s, b_d = vertices[a, 0], vertices[a, 1], vertices[b, 0], vertices[b, 1]
    on_line = _TOLERANCE * (abs(b_s - a_s) + abs(b_d - a_d))
    for i in range(work.n_front):
        c_s, c_d = vertices[front[i, 0], 0], vertices[front[i, 0], 1]
        us, ud, vs, vd = a_s - c_s, a_d - c_d, b_s - c_s, b_d - c_d
        area = us * vd - ud * vs
        work.cotangents[i] = (us * vs + ud * vd) / area if area > on_line else np.inf


@jit
def _visible(vertices: np.ndarray, front: np.ndarray, n_front: int, a: int, b: int, c: int) -> bool:
    """Whether no edge of the front crosses the line of sight from vertex c to a or to b.

    An edge that only touches a line of sight does not cross it: the touching vertex sees a and b under a larger angle.
    """
    least = min(vertices[a, 0], vertices[b, 0], vertices[c, 0])
    most = max(vertices[a, 0], vertices[b, 0], vertices[c, 0])
    for i in range(n_front):
        u, v = vertices[front[i, 0]], vertices[front[i, 1]]
        if (u[0] <= least and v[0] <= least) or (u[0] >= most and v[0] >= most):
            continue
        if _crosses(u, v, vertices[a], vertices[c]) or _crosses(u, v, vertices[b], vertices[c]):
            return False
    return True


@jit
def _crosses(u: np.ndarray, v: np.ndarray, p: np.ndarray, q: np.ndarray) -> bool:
    """Whether two segments cross, with the ends of each clearly on both sides of the other."""
    at_p, at_q = _offset(u, v, p), _offset(u, v, q)
    if not ((at_p > _TOLERANCE and at_q < -_TOLERANCE) or (at_p < -_TOLERANCE and at_q > _TOLERANCE)):
        return False
    at_u, at_v = _offset(p, q, u), _offset(p, q, v)
    return (at_u > _TOLERANCE and at_v < -_TOLERANCE) or (at_u < -_TOLERANCE and at_v > _TOLERANCE)


def triangulate_any(region: np.ndarray, holes: np.ndarray) -> np.ndarray:
    """Constrained Delaunay triangulation of a rectangle minus its holes (Table I, step 1), by shapely.

    It serves regions with more holes than :func:`triangulate` accepts, and tests of that function. Shapely raises an
    error when holes overlap or cross the shell, so the union of the holes is subtracted from the rectangle first.

    Args:
        region: start, end along the road and low, high across the road [m], shape (4,).
        holes: corners (s, d) of the vehicles [m], shape (n, 4, 2).

    Returns:
        Triangles, vertices (s, d) [m], shape (m, 3, 2); m = 0 if the holes cover the region.
    """
    import shapely  # rarely needed, and slow to import

    start, end, low, high = region.tolist()
    free = shapely.box(start, low, end, high)
    if holes.shape[0]:
        free = free.difference(shapely.union_all(shapely.polygons(holes)))
    triangles = shapely.constrained_delaunay_triangles(free)
    return shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3].copy()
