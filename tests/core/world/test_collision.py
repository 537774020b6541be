import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from shared_control_env.core.world.collision import find_collisions, overlap

row = st.builds(
    lambda x, y, psi, length, width: np.array([x, y, psi, 0, 0, 0, length, width], dtype=float),
    st.floats(-8, 8),
    st.floats(-8, 8),
    st.floats(-4, 4),
    st.floats(1, 12),
    st.floats(1, 3),
)


def body(r):
    c, s = np.cos(r[2]), np.sin(r[2])
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * r[6:8] / 2
    return shapely.Polygon(corners @ np.array([[c, s], [-s, c]]) + r[:2])


@given(row, row)
@settings(max_examples=500)
def test_overlap_equals_shapelys(first, second):
    a, b = body(first), body(second)
    clear = a.distance(b) > 1e-9
    deep = a.intersection(b).area > 1e-9
    assert overlap(first, second) == overlap(second, first)
    if clear or deep:
        assert overlap(first, second) == deep


def test_find_collisions_marks_both():
    rows = np.zeros((3, 8))
    rows[:, 0], rows[:, 6], rows[:, 7] = [0.0, 4.0, 20.0], 5.0, 2.0
    crashed = np.zeros(3, dtype=bool)
    assert find_collisions(rows, crashed)
    np.testing.assert_array_equal(crashed, [True, True, False])
