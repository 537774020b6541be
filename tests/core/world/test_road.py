import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shared_control_env.core.world.road import curvature_at, locate, point_at, reference_line, wrap_angle

LINES = {
    "straight": reference_line([(300.0, 0.0)], lead_in=50.0),
    "left": reference_line([(300.0, 1 / 60)], lead_in=50.0),
    "right": reference_line([(250.0, -1 / 50)], lead_in=50.0),
    "s-curve": reference_line([(40.0, 0.0), (60.0, 1 / 60), (60.0, -1 / 60), (40.0, 0.0)], lead_in=50.0),
}


@pytest.mark.parametrize("line", LINES.values(), ids=LINES)
@given(s=st.floats(-40.0, 190.0), d=st.floats(-5.0, 8.0))
def test_locate_inverts_point_at(line, s, d):
    x, y, psi = point_at(line, s, d)
    s_found, d_found, psi_found, _ = locate(line, x, y)
    assert s_found == pytest.approx(s, abs=1e-8)
    assert d_found == pytest.approx(d, abs=1e-9)
    assert wrap_angle(psi_found - psi) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("line", LINES.values(), ids=LINES)
def test_line_is_continuous_and_of_unit_speed(line):
    s = np.linspace(-49.0, 190.0, 24_001)
    points = np.array([point_at(line, value, 0.0) for value in s])
    speed = np.hypot(*np.diff(points[:, :2], axis=0).T) / np.diff(s)
    np.testing.assert_allclose(speed, 1.0, atol=1e-5)
    heading = np.arctan2(np.diff(points[:, 1]), np.diff(points[:, 0]))
    middle = 0.5 * (points[1:, 2] + points[:-1, 2])
    np.testing.assert_allclose(np.cos(heading - middle), 1.0, atol=1e-6)


def test_long_arcs_are_split():
    line = reference_line([(360.0, 1 / 60)])
    assert len(line) == 4
    assert np.abs(line[:, 4] * line[:, 5]).max() <= np.pi / 2


def test_curvature_of_a_shifted_lane():
    line = LINES["left"]
    assert curvature_at(line, 10.0, 0.0) == pytest.approx(1 / 60)
    assert curvature_at(line, 10.0, 4.0) == pytest.approx(1 / 56)
    assert curvature_at(line, -10.0, 4.0) == 0.0
