import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

from shared_control_env.core.control.driver_lag import advance_lag
from shared_control_env.core.parameters import DriverLagParameters
from shared_control_env.identification.model import Arm, respond

DT = 0.05


def test_without_a_delay_it_is_the_lag_of_the_loop():
    v, arm, u = np.random.default_rng(0).normal(size=80), DriverLagParameters(1.15, 0.21), np.zeros(2)
    expected = []
    for value in v:
        expected.append(u[1])
        advance_lag(u, np.array([0.0, value]), np.zeros(2), DT, arm)
    np.testing.assert_allclose(respond(v, Arm(1.15, 0.21), DT), expected, atol=1e-14)


@given(st.floats(0.1, 2.0), st.floats(0.02, 1.0), st.floats(0.0, 0.4), st.integers(0, 1000))
def test_a_delay_of_any_length_is_that_of_the_continuous_lag(K_h, T_h, delay, seed):
    """Against the exact response of K/(T s + 1) to a staircase that is delayed in continuous time."""
    v = np.random.default_rng(seed).normal(size=30)
    t = DT * np.arange(30)
    expected = np.zeros(30)
    for k, step in enumerate(np.diff(v, prepend=0.0)):
        since = t - (k * DT + delay)
        expected += np.where(since > 0.0, K_h * step * (1.0 - np.exp(-np.maximum(since, 0.0) / T_h)), 0.0)
    np.testing.assert_allclose(respond(v, Arm(K_h, T_h, delay), DT), expected, atol=1e-9)


def test_scipys_zero_order_hold():
    v, K, T = np.random.default_rng(1).normal(size=50), 0.95, 0.15
    continuous = [np.array([[value]]) for value in (-1.0 / T, K / T, 1.0, 0.0)]
    _, expected, _ = signal.dlsim(signal.cont2discrete(continuous, DT, method="zoh"), v)
    np.testing.assert_allclose(respond(v, Arm(K, T), DT), expected[:, 0], atol=1e-12)


def test_rows_are_trials():
    v = np.random.default_rng(2).normal(size=(3, 40))
    arm = Arm(1.0, 0.2, 0.07)
    np.testing.assert_array_equal(respond(v, arm, DT)[1], respond(v[1], arm, DT))
    assert respond(v, arm, DT)[:, 0] == pytest.approx(0.0)
