import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from shared_control_env.core.risk.prediction import ctra, turn_integrals

finite = lambda low, high: st.floats(low, high, allow_nan=False)


def predict(x, y, psi, v, a, r, tau):
    return np.array(ctra(x, y, psi, v, a, r, tau))


def integrate(psi, v, a, r, tau):
    if v + a * tau < 0.0:
        tau = -v / a
    speed = lambda t: v + a * t
    dx = quad(lambda t: speed(t) * np.cos(psi + r * t), 0.0, tau, epsabs=1e-12)[0]
    dy = quad(lambda t: speed(t) * np.sin(psi + r * t), 0.0, tau, epsabs=1e-12)[0]
    return dx, dy


@given(finite(-3, 3), finite(0, 40), finite(-5, 5), finite(-2, 2), finite(0, 2))
def test_matches_numerical_integration(psi, v, a, r, tau):
    xi = predict(1.0, -2.0, psi, v, a, r, tau)
    np.testing.assert_allclose(xi[:2] - [1.0, -2.0], integrate(psi, v, a, r, tau), atol=1e-9)


@pytest.mark.parametrize("theta", [0.0, 1e-12, 1e-6, 9.9e-3, 1.01e-2, 0.5, -1e-7, -0.3, 3.0])
def test_integrals_are_smooth_through_zero(theta):
    expected = [
        quad(f, 0.0, 1.0, epsabs=1e-14)[0]
        for f in (
            lambda u: np.cos(theta * u),
            lambda u: np.sin(theta * u),
            lambda u: u * np.cos(theta * u),
            lambda u: u * np.sin(theta * u),
        )
    ]
    np.testing.assert_allclose(turn_integrals(theta), expected, rtol=1e-12, atol=1e-13)


def test_printed_form_away_from_zero():
    v, a, r, tau, psi = 12.0, 1.5, 0.4, 0.5, 0.2
    dx = (
        (v * r + a * r * tau) * np.sin(psi + tau * r)
        + a * np.cos(psi + tau * r)
        - v * r * np.sin(psi)
        - a * np.cos(psi)
    ) / r**2
    dy = (
        (-v * r - a * r * tau) * np.cos(psi + tau * r)
        + a * np.sin(psi + tau * r)
        + v * r * np.cos(psi)
        - a * np.sin(psi)
    ) / r**2
    np.testing.assert_allclose(predict(0, 0, psi, v, a, r, tau)[:2], [dx, dy], rtol=1e-12)


def test_braking_stops_and_does_not_reverse():
    xi = predict(0.0, 0.0, 0.0, 1.0, -5.0, 0.3, 2.0)
    assert xi[3] == 0.0
    assert xi[0] == pytest.approx(0.1, abs=1e-3)
    assert xi[2] == pytest.approx(0.3 * 0.2)
    np.testing.assert_array_equal(predict(1.0, 2.0, 0.5, 0.0, -1.0, 0.1, 1.0)[:4], [1.0, 2.0, 0.5, 0.0])
