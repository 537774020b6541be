import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import special

from shared_control_env.core.parameters import LongitudinalRiskParameters
from shared_control_env.core.risk import longitudinal as lr

GRADED, PAPER = LongitudinalRiskParameters(), LongitudinalRiskParameters(graded=False)
speed, distance = st.floats(0.0, 40.0), st.floats(-100.0, 100.0)


def test_i0e_equals_scipys():
    x = np.r_[np.linspace(0.0, 20.0, 2001), np.geomspace(1.0, 1e4, 500)]
    np.testing.assert_allclose([lr.i0e(v) for v in x], special.i0e(x), rtol=1e-12)
    assert lr.i0e(-3.0) == lr.i0e(3.0)


@pytest.mark.parametrize(("dv", "value"), [(3.0, 6.22), (0.0, 0.0), (-3.0, -0.31)])
def test_the_chosen_reading_gives_the_specs_values(dv, value):
    assert lr.relative_speed_field(dv, 1.0, 10.0) == pytest.approx(value, abs=5e-3)
    unscaled = 10.0 * (np.exp(dv) - 1.0) / (2.0 * np.pi * special.i0(dv))
    assert lr.relative_speed_field(dv, 1.0, 10.0) == pytest.approx(unscaled, rel=1e-12)


def test_large_relative_speeds_do_not_overflow():
    assert np.isfinite([lr.relative_speed_field(dv, dx, 10.0) for dv in (-800.0, 800.0) for dx in (-1.0, 1.0)]).all()


@given(st.floats(-30.0, 30.0), st.floats(0.1, 100.0), st.floats(1.0, 20.0))
def test_field_is_positive_exactly_when_closing(dv, dx, d_s):
    for sign in (1.0, -1.0):
        field = lr.dynamic_field(sign * dv, sign * dx, d_s, GRADED)
        assert field >= 0.0 if dv > 0.0 else field <= 0.0


def test_ratio_of_the_fields_is_that_of_eq_7():
    v_e, v_o, dx = 13.5, 12.0, 14.0
    d_s = lr.safe_distance(v_e, v_o, GRADED)
    ratio = lr.dynamic_field(v_e - v_o, dx, d_s, GRADED) / lr.dynamic_field(v_e - v_o, d_s, d_s, GRADED)
    assert lr.pair_risk(v_e, v_o, dx, GRADED) == pytest.approx(ratio, rel=1e-12)


def test_paper_preset_is_a_step_at_the_safe_distance():
    v_e, v_o = 20.0, 15.0
    d_s = lr.safe_distance(v_e, v_o, PAPER)
    assert lr.pair_risk(v_e, v_o, d_s - 0.01, PAPER) == 1.0
    assert lr.pair_risk(v_e, v_o, d_s + 1.0, PAPER) < 1e-3


@given(speed, speed, distance)
def test_pair_risk_is_in_the_unit_interval_and_falls_with_distance(v_e, v_o, dx):
    for p in (GRADED, PAPER):
        risk = lr.pair_risk(v_e, v_o, dx, p)
        assert 0.0 <= risk <= 1.0
        assert lr.pair_risk(v_e, v_o, dx * 1.1, p) <= risk


def test_weights_and_absent_neighbours():
    near = np.array([[1.0, -1.0, 30.0], [1.0, 1.0, 0.0], [1.0, 1.0, 0.0]])
    assert lr.longitudinal_risk(0.0, 15.0, near, 5.0, False, GRADED) == pytest.approx(1.0)
    for i, weight in enumerate((0.1, 0.2, 0.7)):
        only = near.copy()
        only[:, 0] = 0.0
        only[i, 0] = 1.0
        assert lr.longitudinal_risk(0.0, 15.0, only, 5.0, False, GRADED) == pytest.approx(weight)


def test_bumper_to_bumper_is_nearer_than_centres():
    neighbours = np.array([[0, 0, 0], [0, 0, 0], [1.0, 15.0, 12.0]])
    to_bumper = GRADED._replace(bumper_to_bumper=True)
    centres = lr.longitudinal_risk(0.0, 13.5, neighbours, 5.0, False, GRADED)
    assert lr.longitudinal_risk(0.0, 13.5, neighbours, 5.0, False, to_bumper) > centres


def test_weights_of_a_lane_change_are_the_papers():
    near = np.array([[1.0, -1.0, 30.0], [1.0, 1.0, 0.0], [1.0, 1.0, 0.0]])
    for i, weight in enumerate((0.8, 0.1, 0.1)):
        only = near.copy()
        only[:, 0] = np.arange(3) == i
        assert lr.longitudinal_risk(0.0, 15.0, only, 5.0, True, GRADED) == pytest.approx(weight)
