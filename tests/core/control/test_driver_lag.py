import numpy as np
import pytest
from scipy import signal

from shared_control_env.core.control.driver_lag import advance_lag
from shared_control_env.core.parameters import IDENTIFIED_DRIVERS, DriverLagParameters


@pytest.mark.parametrize("lag", [DriverLagParameters(), *IDENTIFIED_DRIVERS.values()])
def test_equals_scipys_zero_order_hold(lag):
    rng = np.random.default_rng(0)
    inputs = rng.normal(size=50)
    continuous = [np.array([[value]]) for value in (-1.0 / lag.T_h, lag.K_h / lag.T_h, 1.0, 0.0)]
    _, expected, _ = signal.dlsim(signal.cont2discrete(continuous, 0.05, method="zoh"), inputs)
    u, outputs = np.zeros(2), []
    for value in inputs:
        outputs.append(u[0])
        advance_lag(u, np.array([value, 0.0]), np.zeros(2), 0.05, lag)
    np.testing.assert_allclose(outputs, expected[:, 0], atol=1e-12)


def test_input_is_what_the_automation_lacks():
    u = np.zeros(2)
    for _ in range(200):
        advance_lag(u, np.array([1.0, 0.1]), np.array([0.4, 0.1]), 0.05, DriverLagParameters(K_h=1.2))
    np.testing.assert_allclose(u, [0.72, 0.0], atol=1e-12)


def test_hands_off():
    u = np.zeros(2)
    advance_lag(u, np.array([5.0, 0.5]), np.zeros(2), 0.05, DriverLagParameters(K_h=0.0))
    np.testing.assert_array_equal(u, 0.0)
