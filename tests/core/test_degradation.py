import numpy as np
import pytest

from shared_control_env.core.degradation import bias, degrade
from shared_control_env.core.parameters import Limits

LIMITS = Limits()


@pytest.mark.parametrize("k", range(45))
def test_case_1_is_the_printed_profile(k):
    printed = 0.0 if k < 10 else 0.3 * (k - 10) / 20 if k <= 30 else 0.3
    assert bias(np.array([1, 0.5, 1.0, 0.3]), k * 0.05) == pytest.approx(printed, abs=1e-12)


@pytest.mark.parametrize("k", range(20))
def test_case_2_is_the_printed_profile(k):
    printed = 0.0 if k <= 5 else 3.0 * (k - 5) / 5 if k <= 10 else 3.0
    assert bias(np.array([0, 0.25, 0.25, 3.0]), k * 0.05) == pytest.approx(printed, abs=1e-12)


def test_step_where_the_ramp_is_zero():
    fault = np.array([1, 1.0, 0.0, -0.2])
    assert bias(fault, 0.999) == 0.0
    assert bias(fault, 1.0) == -0.2


def test_faults_add_on_their_channel_and_clip():
    faults = np.array([[0, 0.0, 0.0, 3.0], [0, 0.0, 0.0, 4.0], [1, 0.0, 0.0, 0.1]])
    u_f = np.empty(2)
    degrade(np.array([1.0, 0.05]), 1.0, faults, LIMITS, u_f)
    np.testing.assert_allclose(u_f, [5.0, 0.15])


def test_no_fault_changes_nothing():
    u_f = np.empty(2)
    degrade(np.array([-1.0, 0.2]), 3.0, np.empty((0, 4)), LIMITS, u_f)
    np.testing.assert_array_equal(u_f, [-1.0, 0.2])
