import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shared_control_env.core.authority.laws import LAWS, apply_law, limit_channel
from shared_control_env.core.parameters import LawParameters

command = st.floats(-5.0, 5.0)


def actual(law, u_des, u_f, alpha):
    u_act = np.empty(2)
    apply_law(
        LAWS.index(law), np.array(u_des), np.array(u_f), np.broadcast_to(alpha, 2).copy(), LawParameters(), False, u_act
    )
    return u_act


@given(command, command, st.floats(0.0, 1.0))
def test_eq_10_never_exceeds_the_desired_command(u_des, u_f, alpha):
    assert abs(limit_channel(u_des, u_f, alpha, 0.01, False)) <= abs(u_des)


@given(command, command, st.floats(0.0, 1.0))
def test_eq_10_is_odd(u_des, u_f, alpha):
    assert limit_channel(-u_des, -u_f, alpha, 0.01, False) == -limit_channel(u_des, u_f, alpha, 0.01, False)


def test_eq_10_lines():
    assert limit_channel(2.0, 2.0, 0.3, 0.01, False) == 2.0  # healthy: passed whatever alpha is
    assert limit_channel(2.0, 0.5, 0.3, 0.01, False) == 0.5  # weaker than the authority allows
    assert limit_channel(2.0, 5.0, 0.3, 0.01, False) == pytest.approx(0.6)  # stronger
    assert limit_channel(2.0, -1.0, 0.3, 0.01, False) == pytest.approx(0.6)  # of the other sign
    assert limit_channel(0.0, 0.3, 0.8, 0.001, False) == 0.0  # on a straight


def test_the_second_line_as_printed_ends_below_full_authority():
    assert limit_channel(2.0, 0.5, 1.0, 0.01, False) == 0.5  # nothing jumps as alpha reaches 1
    assert limit_channel(2.0, 0.5, 1.0, 0.01, True) == 2.0  # the third line
    for alpha in (0.3, 0.999):
        assert limit_channel(2.0, 0.5, alpha, 0.01, True) == limit_channel(2.0, 0.5, alpha, 0.01, False)


def test_the_other_laws():
    np.testing.assert_array_equal(actual("none", [1.0, 0.0], [3.0, 0.3], 0.5), [3.0, 0.3])
    np.testing.assert_array_equal(actual("proportional", [1.0, 0.0], [3.0, 0.3], 0.5), [1.5, 0.15])
    np.testing.assert_array_equal(actual("driver_only", [1.0, 0.0], [3.0, 0.3], 0.5), [0.0, 0.0])


def test_each_channel_has_its_own_authority():
    np.testing.assert_array_equal(actual("proportional", [1.0, 0.0], [3.0, 0.3], [1.0, 0.5]), [3.0, 0.15])
    np.testing.assert_allclose(actual("paper", [1.0, 0.1], [3.0, 0.4], [0.2, 0.5]), [0.2, 0.05])


def test_eq_10_acts_on_each_channel_by_itself():
    np.testing.assert_allclose(actual("paper", [1.0, 0.1], [1.0, 0.4], 0.5), [1.0, 0.05])
