"""The compiled constrained Delaunay triangulation against shapely's, and against the definition."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
import shapely

from shared_control_env.core.compile.jit import jit
from shared_control_env.core.records import SAFE_AREA
from shared_control_env.core.risk import corridor
from shared_control_env.core.risk import triangulation as delaunay
from shared_control_env.core.risk.safe_area import REACHED
from tests import compiled

LAYOUTS = 10_000
MIN_WIDTH = 1.8

REGION = np.array([0.0, 40.0, 0.0, 4.0])


def rectangle(s: float, d: float, length: float, width: float, heading: float = 0.0) -> np.ndarray:
    """Corners of a vehicle, in the order of :func:`scene.holes_in_region`."""
    c, q = np.cos(heading), np.sin(heading)
    corners = 0.5 * np.array([[length, width], [length, -width], [-length, -width], [-length, width]])
    return corners @ np.array([[c, q], [-q, c]]) + (s, d)


def stack(*holes: np.ndarray) -> np.ndarray:
    return np.array(holes).reshape(-1, 4, 2)


def triangulate(region: np.ndarray, holes: np.ndarray) -> np.ndarray:
    work = np.zeros((), delaunay.WORKSPACE)
    count = compiled.triangulate_array(region, holes, len(holes), work)
    assert count >= 0
    return work["triangles"][:count].copy()


def free_region(region: np.ndarray, holes: np.ndarray) -> shapely.Geometry:
    start, end, low, high = region
    return shapely.box(start, low, end, high).difference(shapely.union_all(shapely.polygons(holes)))


@jit
def search_with(triangles, start, end, d, min_width, scratch, area) -> None:
    corridor.search_triangles(triangles, start, end, d, min_width, scratch, area[()])


def search(triangles: np.ndarray, start: float, end: float, d: float, min_width: float, area: np.ndarray) -> None:
    search_with(triangles, start, end, d, min_width, corridor.new_scratch(len(triangles)), area)


def boundaries(triangles: np.ndarray, region: np.ndarray, d: float, min_width: float) -> np.ndarray:
    """Both boundaries and the outcome as one row."""
    area = np.zeros((), SAFE_AREA)
    search(triangles.copy(), region[0], region[1], d, min_width, area)
    return np.concatenate((area["lower"].ravel(), area["upper"].ravel(), [area["outcome"]]))


def random_layouts(seed: int, count: int) -> Iterator[tuple[np.ndarray, np.ndarray, float]]:
    """Region, holes and lateral position of the ego."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        start, length, width = rng.uniform(0.0, 1e3), rng.uniform(10.0, 80.0), rng.choice([4.0, 8.0])
        low = rng.choice([-2.0, -6.0, -1.75])
        holes = []
        for _ in range(rng.integers(0, 7)):
            heading = rng.uniform(-np.pi, np.pi) if rng.random() < 0.15 else rng.uniform(-0.2, 0.2)
            s, d = start + rng.uniform(-4.0, length + 4.0), low + rng.uniform(-1.5, width + 1.5)
            if holes and rng.random() < 0.15:  # beside, behind or over the last vehicle
                s, d = holes[-1][0, :] + rng.uniform(-1.0, 1.0, 2) * (12.0, 2.6)
            holes.append(rectangle(s, d, rng.uniform(4.0, 12.0), rng.uniform(1.6, 2.6), heading))
        region = np.array([start, start + length, low, low + width])
        yield region, stack(*holes), low + rng.uniform(0.5, width - 0.5)


def areas(triangles: np.ndarray) -> np.ndarray:
    u, v = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    return 0.5 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])


def twin_edges(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """For each edge from a to b the index of its reverse, or -1."""
    reverse = (a[:, None, 0] == b[None, :, 0]) & (a[:, None, 1] == b[None, :, 1])
    reverse &= reverse.T
    assert (np.count_nonzero(reverse, axis=1) <= 1).all(), "an edge has more than two triangles"
    return np.where(reverse.any(axis=1), reverse.argmax(axis=1), -1)


def check_definition(triangles: np.ndarray, free: shapely.Geometry) -> bool:
    """Assert that this is a constrained Delaunay triangulation of the free region; whether it is the only one.

    Triangles that share edges pairwise, bound nothing but the free region's border and lie in the free
    region cover it once.
    """
    area = areas(triangles)
    assert (area > 0.0).all()
    assert abs(area.sum() - free.area) <= 1e-9 * free.area
    if not len(triangles):
        return True
    shapely.prepare(free)
    lies_in = shapely.covers(free, shapely.polygons(0.999 * triangles + 0.001 / 3.0 * triangles.sum(1)[:, None]))
    assert (lies_in | (area < 1e-6)).all()
    a, b, c = (triangles[:, order].reshape(-1, 2) for order in ([0, 1, 2], [1, 2, 0], [2, 0, 1]))
    twins = twin_edges(a, b)
    inner = twins >= 0
    assert abs(np.hypot(*(b - a)[~inner].T).sum() - free.length) <= 1e-9 * free.length
    # Opposite angles add up to at most pi where neither vertex lies in the other triangle's circle.
    cotangents = ((a - c) * (b - c)).sum(1) / np.repeat(2.0 * area, 3)
    one, other = cotangents[inner], cotangents[twins[inner]]
    excess, scale = one + other, 1.0 + abs(one) + abs(other)
    assert (excess > -1e-8 * scale).all()
    return bool((excess > 1e-8 * scale).all())


def reference_triangles(free: shapely.Geometry) -> np.ndarray:
    triangles = shapely.constrained_delaunay_triangles(free)
    return shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3].copy()


def same_triangles(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two sets of triangles are one, their moments compared."""
    if len(one) != len(other):
        return False
    if not len(one):
        return True
    moments = []
    for triangles in (one, other):
        local = triangles - one[0, 0]
        moments.append(np.hstack((local.sum(1), (local * local).sum(1))))
    gaps = abs(moments[0][:, None] - moments[1][None]).max(2)
    return len(set(gaps.argmin(1).tolist())) == len(one) and bool((gaps.min(1) < 1e-6).all())


def same_vertices(one: np.ndarray, other: np.ndarray) -> bool:
    return {tuple(v) for v in one.reshape(-1, 2).tolist()} == {tuple(v) for v in other.reshape(-1, 2).tolist()}


def test_random_layouts_agree_with_shapely() -> None:
    unique = 0
    for region, holes, d in random_layouts(1, LAYOUTS):
        triangles, free = triangulate(region, holes), free_region(region, holes)
        reference = reference_triangles(free)
        if check_definition(triangles, free):
            unique += 1
            assert same_triangles(triangles, reference)
        got, expected = (boundaries(x, region, d, MIN_WIDTH) for x in (triangles, reference))
        assert abs(got - expected).max() < 1e-9
    # Only the rectangle that no vehicle reaches has two triangulations here.
    assert unique > 0.8 * LAYOUTS


def test_touching_and_coincident_sides_agree_with_shapely() -> None:
    """Boxes and diamonds on a grid, in coordinates without rounding: ties everywhere, but the same vertices."""
    rng = np.random.default_rng(2)
    for _ in range(500):
        start, low = rng.choice([0.0, 1000.25]), rng.choice([0.0, -1.75])
        region = np.array([start, start + 16.0, low, low + 8.0])
        holes = []
        for _ in range(rng.integers(1, delaunay.MAX_HOLES + 1)):
            at = region[[0, 2]] + rng.integers((-2, -2), (36, 18)) / 2
            half = rng.integers((1, 1), (7, 4)) / 2
            box = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]]) * half
            diamond = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]]) * 2.0 * half[0]
            holes.append(at + (box if rng.random() < 0.7 else diamond))
        triangles, free = triangulate(region, stack(*holes)), free_region(region, stack(*holes))
        reference = reference_triangles(free)
        check_definition(triangles, free)
        assert len(triangles) == len(reference)
        assert same_vertices(triangles, reference)


CENTRED = rectangle(20.0, 2.0, 5.0, 2.0)

SCENARIOS = {
    "no hole": (stack(), 2),
    "hole outside": (stack(rectangle(60.0, 2.0, 5.0, 2.0)), 2),
    "hole covers all": (stack(rectangle(20.0, 2.0, 60.0, 10.0, 0.1)), 0),
    "two holes cover all": (stack(rectangle(10.0, 2.0, 24.0, 5.0), rectangle(31.0, 2.0, 20.0, 5.0)), 0),
    "hole is the region": (stack(rectangle(20.0, 2.0, 40.0, 4.0)), 0),
    "hole crosses a corner": (stack(rectangle(0.5, 0.5, 5.0, 2.0, 0.3)), 5),
    "hole blocks the way": (stack(rectangle(20.0, 2.0, 2.0, 8.0, 0.1)), 4),
    "hole on the border": (stack(rectangle(20.0, 1.0, 5.0, 2.0)), 6),
    "hole on the border's far side": (stack(rectangle(20.0, -1.0, 5.0, 2.0)), 4),
    "centred hole": (stack(CENTRED), 8),
    "two identical holes": (stack(CENTRED, CENTRED), 8),
    "hole in a hole": (stack(CENTRED, rectangle(20.0, 2.0, 4.0, 1.0, 0.1)), 8),
    "holes share a side": (stack(CENTRED, rectangle(25.0, 2.0, 5.0, 2.0)), 10),
    "holes share a part of a side": (stack(CENTRED, rectangle(25.0, 2.5, 5.0, 2.0)), 12),
    "holes share a corner": (stack(CENTRED, rectangle(25.0, 3.25, 5.0, 0.5)), 12),
    "holes overlap in line": (stack(CENTRED, rectangle(24.0, 2.0, 5.0, 2.0)), 12),
    "holes cross": (stack(rectangle(20.0, 2.0, 5.0, 1.0, 0.1), rectangle(20.0, 2.0, 1.0, 3.0, 0.1)), 16),
}


@pytest.mark.parametrize("name", SCENARIOS)
def test_particular_layouts(name: str) -> None:
    holes, count = SCENARIOS[name]
    triangles, free = triangulate(REGION, holes), free_region(REGION, holes)
    assert len(triangles) == count
    assert len(triangles) == len(reference_triangles(free))
    check_definition(triangles, free)
    reversed_corners = triangulate(REGION, holes[:, ::-1].copy())
    check_definition(reversed_corners, free)
    assert len(reversed_corners) == count


def test_centred_vehicle_is_passed_on_one_side() -> None:
    """Cocircular corners at either end: the diagonals decide on the side, as a slight shift does in shapely's."""
    region, d = np.array([0.0, 40.0, 0.0, 8.0]), 2.0
    got = boundaries(triangulate(region, stack(rectangle(20.0, 4.0, 5.0, 2.0))), region, d, MIN_WIDTH)
    gaps = []
    for shift, heading in ((1e-7, 0.0), (-1e-7, 0.0), (0.0, 1e-7), (0.0, -1e-7)):
        free = free_region(region, stack(rectangle(20.0, 4.0 + shift, 5.0, 2.0, heading)))
        gaps.append(abs(got - boundaries(reference_triangles(free), region, d, MIN_WIDTH)).max())
    assert got[-1] == REACHED
    assert min(gaps) < 1e-6


def test_a_grid_of_holes_fits_the_workspace() -> None:
    bars = [rectangle(5.0 + 4.0 * k, 4.0, 2.0, 12.0) for k in range(4)]
    bars += [rectangle(11.0, 1.0 + 2.0 * k, 30.0, 1.0, 0.02) for k in range(4)]
    region = np.array([0.0, 22.0, 0.0, 8.0])
    check_definition(triangulate(region, stack(*bars)), free_region(region, stack(*bars)))


def test_too_many_holes_fail() -> None:
    holes = np.repeat(CENTRED[None], delaunay.MAX_HOLES + 1, axis=0)
    work = np.zeros((), delaunay.WORKSPACE)
    assert compiled.triangulate_array(REGION, holes, len(holes), work) == delaunay.FAILED


def test_repeats_to_the_bit_whatever_the_workspace_held() -> None:
    work = np.zeros((), delaunay.WORKSPACE)
    for region, holes, _ in random_layouts(3, 50):
        count = compiled.triangulate_array(region, holes, len(holes), work)
        np.testing.assert_array_equal(work["triangles"][:count], triangulate(region, holes))
