import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from shared_control_env.core.parameters import LateralRiskParameters
from shared_control_env.core.records import SAFE_AREA
from shared_control_env.core.risk import corridor
from shared_control_env.core.risk import safe_area as sa
from shared_control_env.core.risk.lateral import boundary_field, continuous_field, lateral_risk
from shared_control_env.core.risk.triangulation import triangulate_any

REGION = np.array([0.0, 40.0, -2.0, 6.0])
FIELD = LateralRiskParameters()


def find(holes, region=REGION, d=0.0, width=2.0):
    area = np.zeros(1, SAFE_AREA)[0]
    triangles = triangulate_any(np.array(region), np.asarray(holes, dtype=float).reshape(-1, 4, 2))
    corridor.search_triangles(triangles, region[0], region[1], d, width, corridor.new_scratch(len(triangles)), area)
    return area


def rectangle(s, d, length=5.0, width=2.0, psi=0.0):
    c, n = np.cos(psi), np.sin(psi)
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [length / 2, width / 2]
    return corners @ np.array([[c, n], [-n, c]]) + [s, d]


def polygon(area):
    return shapely.Polygon(np.vstack([area["lower"], area["upper"][::-1]])).buffer(0)


vehicles = st.lists(
    st.builds(
        rectangle,
        st.floats(-3.0, 45.0),
        st.floats(-4.0, 8.0),
        st.floats(4.0, 12.0),
        st.floats(1.6, 2.6),
        st.floats(-0.3, 0.3),
    ),
    max_size=6,
)


@given(vehicles)
@settings(max_examples=150)
def test_triangles_partition_the_free_region_and_are_delaunay(holes):
    triangles = triangulate_any(np.array(REGION), np.array(holes).reshape(-1, 4, 2))
    free = shapely.box(0.0, -2.0, 40.0, 6.0).difference(shapely.union_all([shapely.Polygon(h) for h in holes]))
    shapes = [shapely.Polygon(t) for t in triangles]
    assert sum(s.area for s in shapes) == pytest.approx(free.area, abs=1e-6)
    if shapes:
        assert shapely.union_all(shapes).symmetric_difference(free).area < 1e-6
    corridor.orient(triangles)
    neighbours = np.empty((len(triangles), 3), dtype=np.int64)
    corridor.adjacency(triangles, neighbours)
    for i in range(len(triangles)):
        for edge in range(3):
            j = neighbours[i, edge]
            if j >= 0:
                shared = {tuple(triangles[i, edge]), tuple(triangles[i, (edge + 1) % 3])}
                (apex,) = (p for p in map(tuple, triangles[j]) if p not in shared)
                assert in_circle(triangles[i], np.array(apex)) <= 1e-6


def in_circle(triangle, point):
    """Positive inside the circumcircle of a counter-clockwise triangle, scaled to its size."""
    rows = triangle - point
    determinant = np.linalg.det(np.c_[rows, (rows**2).sum(axis=1)])
    return determinant / max(1.0, np.abs(rows).max()) ** 4


@given(vehicles, st.floats(-1.9, 5.9))
@settings(max_examples=150)
def test_safe_area_lies_in_the_free_region(holes, d):
    area = find(holes, d=d)
    free = shapely.box(0.0, -2.0, 40.0, 6.0).difference(shapely.union_all([shapely.Polygon(h) for h in holes]))
    cut = any((area[side][-1] != area[side][-2]).any() for side in ("lower", "upper"))
    # A boundary of MAX_CHAIN vertices may be cut, and the outline across the cut is not the region's.
    assert cut or polygon(area).difference(free.buffer(1e-6)).area < 1e-6
    assert np.isfinite(area["lower"]).all()
    assert np.isfinite(area["upper"]).all()
    if area["outcome"] == sa.REACHED:
        assert area["lower"][-1, 0] == pytest.approx(40.0)
        assert area["upper"][-1, 0] == pytest.approx(40.0)


@given(vehicles, st.floats(0.5, 39.5), st.floats(-2.5, 6.5))
@settings(max_examples=200)
def test_boundary_distance_equals_shapelys(holes, s, d):
    area = find(holes)
    if area["outcome"] != sa.REACHED:
        return
    r_b = sa.boundary_distance(area, s, d)
    point = shapely.Point(s, d)
    shape = polygon(area)
    chains = [shapely.LineString(area[side]) for side in ("lower", "upper")]
    expected = min(point.distance(chain) for chain in chains) if shape.contains(point) else 0.0
    assert r_b == pytest.approx(expected, abs=1e-9)


def test_empty_lane_is_the_lane():
    area = find([], region=[10.0, 50.0, -2.0, 2.0])
    np.testing.assert_array_equal(np.unique(area["lower"], axis=0), [[10.0, -2.0], [50.0, -2.0]])
    np.testing.assert_array_equal(np.unique(area["upper"], axis=0), [[10.0, 2.0], [50.0, 2.0]])
    assert area["outcome"] == sa.REACHED
    assert sa.lateral_bounds(area, 30.0) == (-2.0, 2.0)
    assert sa.boundary_distance(area, 20.0, 0.5) == 1.5
    assert sa.boundary_offset(area, 20.0, 0.5) == (2.25, 0.0, -1.5)


def test_front_end_is_open_but_a_blocked_end_is_not():
    area = find([], region=[0.0, 20.0, -2.0, 2.0])
    assert sa.boundary_distance(area, 60.0, 0.0) == pytest.approx(2.0)
    blocked = find([rectangle(12.5, 0.0, width=6.0)], region=[0.0, 20.0, -2.0, 2.0])
    assert blocked["outcome"] == sa.BLOCKED
    assert blocked["end"] == pytest.approx(10.0)
    assert lateral_risk(blocked, 5.0, 0.0, FIELD) == 0.0
    assert lateral_risk(blocked, 16.0, 0.0, FIELD) == 1.0


def test_a_gap_narrower_than_the_vehicle_is_no_passage():
    region = [0.0, 40.0, -2.0, 2.0]
    assert find([rectangle(20.0, 1.2)], region)["outcome"] == sa.REACHED  # leaves 2.2 m
    assert find([rectangle(20.0, 0.8)], region)["outcome"] == sa.BLOCKED  # leaves 1.8 m
    assert find([rectangle(20.0, 0.0)], region)["outcome"] == sa.BLOCKED  # 1 m on both sides


def test_passes_a_vehicle_on_the_free_side():
    area = find([rectangle(20.0, 0.0)])
    assert area["outcome"] == sa.REACHED
    low, high = sa.lateral_bounds(area, 20.0)
    assert (low, high) == pytest.approx((1.0, 6.0))


def test_a_covered_start_is_blocked():
    area = find([rectangle(0.0, 2.0, length=20.0, width=12.0)])
    assert area["outcome"] == sa.BLOCKED
    assert lateral_risk(area, 5.0, 0.0, FIELD) == 1.0


def test_mirror():
    holes = np.array([rectangle(15.0, 1.4, psi=0.1), rectangle(30.0, -1.5, psi=-0.05)])
    region = [0.0, 40.0, -2.0, 2.0]
    area, mirrored = find(holes, region, d=0.3), find(holes * [1.0, -1.0], region, d=-0.3)
    np.testing.assert_allclose(mirrored["upper"], area["lower"] * [1.0, -1.0], atol=1e-12)
    np.testing.assert_allclose(mirrored["lower"], area["upper"] * [1.0, -1.0], atol=1e-12)


def test_field_as_printed():
    cut = FIELD.d_c + 0.5 * FIELD.v_w
    assert boundary_field(cut + 1e-9, FIELD) == 0.0
    assert boundary_field(cut, FIELD) / FIELD.alpha_f == pytest.approx(0.039, abs=5e-4)
    assert boundary_field(0.0, FIELD) == FIELD.alpha_f


def test_controllers_field_is_the_printed_one_less_its_value_at_the_cut_off():
    area = find([rectangle(20.0, 0.0, psi=0.2)])
    rng = np.random.default_rng(0)
    cut = FIELD.d_c + 0.5 * FIELD.v_w
    smooth = 0
    for s, d in zip(rng.uniform(1, 39, 500), rng.uniform(-2, 6, 500), strict=True):
        value, *gradient = continuous_field(area, s, d, FIELD)
        r_b = sa.boundary_distance(area, s, d)
        printed = boundary_field(r_b, FIELD)
        floor = boundary_field(cut, FIELD)
        assert value == pytest.approx(max(0.0, printed - floor), abs=1e-9)
        if 0.01 < r_b < cut - 0.01:
            h = 1e-6
            numeric = [
                continuous_field(area, s + h, d, FIELD)[0] - continuous_field(area, s - h, d, FIELD)[0],
                continuous_field(area, s, d + h, FIELD)[0] - continuous_field(area, s, d - h, FIELD)[0],
            ]
            smooth += np.allclose(gradient, np.array(numeric) / (2 * h), rtol=1e-3, atol=1e-3)
    assert smooth > 150  # all but those beside a ridge, where two boundaries are equally near
