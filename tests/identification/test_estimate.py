"""Estimates of an arm in a closed loop: bias of each method, coverage of the intervals, and the diagnostics."""

import numpy as np
import pytest
from scipy.signal import lfilter

from shared_control_env.identification.data import Drives
from shared_control_env.identification.diagnostics import diagnose, fit, ljung_box, variance_accounted_for
from shared_control_env.identification.estimate import box_jenkins, instrumental
from shared_control_env.identification.model import Arm, respond

DT = 0.05


def loop(arm, n=20, T=200, remnant=0.005, rho=0.85, seed=0):
    """A toy loop: the driver wants to take the disturbance of a double lag away; its remnant moves the car too."""
    rng = np.random.default_rng(seed)
    phi = np.exp(-DT / arm.T_h)
    v, y, fault = np.zeros((n, T)), np.zeros((n, T)), np.zeros((n, T))
    for i in range(n):
        fault[i, rng.integers(20, 60) :] = rng.choice([-1.0, 1.0]) * rng.uniform(0.03, 0.07)
        noise = lfilter([1.0], [1.0, -rho], rng.normal(size=T) * remnant * np.sqrt(1.0 - rho**2))
        own = side = heading = 0.0
        for k in range(T):
            y[i, k] = own + noise[k]
            v[i, k] = -0.9 * fault[i, k] - 0.05 * side - 0.4 * heading
            heading += DT * 5.0 * (y[i, k] + fault[i, k])
            side += DT * 15.0 * heading
            own = phi * own + arm.K_h * (1.0 - phi) * v[i, k]
    outside = np.stack([fault, np.zeros_like(fault)], axis=2)
    return Drives(
        "toy", tuple(f"{i}" for i in range(n)), v, y, outside, np.full(n, T), np.ones((n, T), bool), DT, "", ()
    )


def equation_error(drives):
    """ARX: what an identification without a model of the remnant does."""
    x = np.stack([drives.y[:, :-1].ravel(), drives.v[:, :-1].ravel()], axis=1)
    phi, b = np.linalg.lstsq(x, drives.y[:, 1:].ravel(), rcond=None)[0]
    return b / (1.0 - phi), -DT / np.log(phi)


def test_the_equation_error_is_biased_by_a_coloured_remnant_and_these_methods_are_not():
    drives = loop(Arm(1.0, 0.2), n=60)
    arx, estimate, cross = equation_error(drives), box_jenkins(drives), instrumental(drives)
    assert arx[1] > 0.22
    assert estimate.K_h.value == pytest.approx(1.0, abs=0.02)
    assert estimate.T_h.value == pytest.approx(0.2, abs=0.012)
    assert estimate.rho.value == pytest.approx(0.85, abs=0.02)
    assert cross.T_h.value == pytest.approx(0.2, abs=0.02)
    assert cross.K_h.value == pytest.approx(1.0, abs=0.03)


def test_a_delay_is_found():
    drives = loop(Arm(1.0, 0.2), n=30, remnant=0.001)
    late = respond(drives.v, Arm(1.1, 0.18, 0.12), DT)
    noise = np.random.default_rng(3).normal(size=late.shape) * 1e-4
    found = box_jenkins(drives._replace(y=late + noise), delay=True)
    assert found.delay.value == pytest.approx(0.12, abs=0.003)
    assert found.T_h.value == pytest.approx(0.18, abs=0.005)
    assert found.delay.low < 0.12 < found.delay.high


@pytest.mark.parametrize("n", [8, 20])
def test_intervals_cover_the_truth_in_a_toy_loop(n):
    arm, hits = Arm(1.1, 0.17), np.zeros(2)
    for seed in range(100):
        estimate = box_jenkins(loop(arm, n=n, T=150, seed=seed), resamples=400)
        hits += [value.low <= true <= value.high for value, true in ((estimate.K_h, arm.K_h), (estimate.T_h, arm.T_h))]
    assert (hits >= 90).all(), hits


def test_steps_at_a_limit_do_not_count():
    drives = loop(Arm(1.0, 0.2), n=12)
    clipped = drives._replace(y=drives.y.clip(-0.03, 0.03))
    counted = clipped._replace(counts=np.abs(drives.y) < 0.03)
    assert box_jenkins(clipped).K_h.high < 0.6
    assert box_jenkins(counted).K_h.low < 1.0 < box_jenkins(counted).K_h.high


def test_padding_does_not_count():
    drives = loop(Arm(1.0, 0.2), n=10)
    wide = drives._replace(
        v=np.pad(drives.v, ((0, 0), (0, 50)), constant_values=9.0),
        y=np.pad(drives.y, ((0, 0), (0, 50)), constant_values=-9.0),
        outside=np.pad(drives.outside, ((0, 0), (0, 50), (0, 0))),
        counts=np.pad(drives.counts, ((0, 0), (0, 50))),
    )
    first, second = box_jenkins(drives), box_jenkins(wide)
    np.testing.assert_allclose(first.K_h, second.K_h, rtol=1e-6)
    np.testing.assert_allclose(first.T_h, second.T_h, rtol=1e-5)


@pytest.mark.parametrize("offset", [0.01, 0.05])
def test_a_wheel_that_does_not_stand_straight_changes_nothing(offset):
    drives = loop(Arm(1.0, 0.2), n=20)
    first, second = box_jenkins(drives), box_jenkins(drives._replace(y=drives.y + offset))
    assert second.found
    assert second.offset.value - first.offset.value == pytest.approx(offset, abs=1e-5)
    np.testing.assert_allclose(second.K_h, first.K_h, rtol=1e-3)
    np.testing.assert_allclose(second.T_h, first.T_h, rtol=1e-3)


def test_an_estimate_at_the_end_of_the_search_is_no_result():
    drives = loop(Arm(1.0, 0.2), n=8)
    wrong = drives._replace(y=30.0 * drives.v)
    assert not box_jenkins(wrong).found
    assert not box_jenkins(wrong, delay=True).found


def test_a_drive_without_a_step_that_counts_is_left_out():
    drives = loop(Arm(1.0, 0.2), n=10)
    counts = drives.counts.copy()
    counts[3] = False
    assert np.isfinite(diagnose(drives._replace(counts=counts), box_jenkins(drives))).all()
    counts[:] = False
    counts[:, :15] = True  # too few for a test of whiteness
    nothing = diagnose(drives._replace(counts=counts), box_jenkins(drives))
    assert np.isnan(nothing).all()


def test_without_an_instrument_there_is_no_cross_check():
    drives = loop(Arm(1.0, 0.2), n=6)
    assert not instrumental(drives._replace(outside=np.zeros_like(drives.outside))).found


def test_a_right_model_is_white_and_a_wrong_one_is_not():
    drives = loop(Arm(1.0, 0.2), n=20)
    right = diagnose(drives, box_jenkins(drives))
    assert right.white > 0.85
    assert right.crossed < 0.12
    assert 40.0 < right.fit < 100.0
    # A second, slow lag that the model does not have.
    slow = lfilter([0.1], [1.0, -0.9], drives.y, axis=1)
    wrong = diagnose(drives._replace(y=slow), box_jenkins(drives._replace(y=slow)))
    assert wrong.white < 0.5 or wrong.crossed > 0.2


def test_measures_of_fit():
    y = np.array([0.0, 1.0, 2.0, 3.0])
    assert fit(y, y) == 100.0
    assert fit(y, np.full(4, 1.5)) == pytest.approx(0.0)
    assert variance_accounted_for(y, y + 5.0) == 100.0


def test_ljung_box_is_uniform_for_white_noise_and_small_for_coloured():
    rng = np.random.default_rng(0)
    p = [ljung_box(rng.normal(size=300)) for _ in range(300)]
    assert 0.02 < np.mean(np.array(p) < 0.05) < 0.09
    assert ljung_box(lfilter([1.0], [1.0, -0.5], rng.normal(size=300))) < 1e-6
