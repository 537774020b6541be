import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from shared_control_env.core.parameters import VehicleParameters, critical_speed
from shared_control_env.core.world import vehicle as dynamics
from tests.compiled import change_through_step, step_with_derivatives

VEHICLE = VehicleParameters()


def drive(z, a, delta, duration, h, step=dynamics.extrapolated_step):
    z = np.array(z, dtype=float)
    for _ in range(round(duration / h)):
        step(z, a, delta, h, VEHICLE)
    return z


def exact(z, a, delta, duration, kappa=0.0):
    def rhs(_, z):
        return dynamics.derivative(z, a, delta, kappa, VEHICLE)

    return solve_ivp(rhs, (0.0, duration), z, method="Radau", rtol=1e-11, atol=1e-12).y[:, -1]


def test_critical_speed_is_that_of_the_spec():
    assert critical_speed(VEHICLE) == pytest.approx(43.8, abs=0.05)
    assert critical_speed(VEHICLE._replace(l_f=1.0, l_r=1.2)) == np.inf


def test_critical_speed_is_where_the_linear_model_loses_stability():
    v = critical_speed(VEHICLE)
    assert _largest_real_part(0.99 * v) < 0.0 < _largest_real_part(1.01 * v)


def _largest_real_part(v):
    f = lambda q: dynamics.derivative(np.array([0, 0, 0, v, *q]), 0.0, 0.0, 0.0, VEHICLE)[4:]
    jacobian = np.array([(f(e) - f(-e)) / 2e-6 for e in 1e-6 * np.eye(2)]).T
    return np.linalg.eigvals(jacobian).real.max()


@pytest.mark.parametrize(("step", "order"), [(dynamics.extrapolated_step, 2.0)])
@pytest.mark.parametrize("speed", [5.0, 15.0, 35.0])
def test_convergence_order(step, order, speed):
    z = [0.0, 0.0, 0.0, speed, 0.0, 0.0]
    reference = exact(z, 0.5, 0.02, 1.0)
    steps = np.array([1 / 320, 1 / 640, 1 / 1280, 1 / 2560])
    errors = [np.abs(drive(z, 0.5, 0.02, 1.0, h, step) - reference).max() for h in steps]
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope == pytest.approx(order, abs=0.25)


def implicit_step(z, a, delta, kappa, h):
    """State after one step."""
    return step_with_derivatives(z, a, delta, kappa, h, VEHICLE)[0]


def test_implicit_step_is_first_order():
    z0 = np.array([0.0, 0.3, 0.05, 15.0, 0.1, 0.05])
    reference = exact(z0, -1.0, 0.03, 0.5, kappa=1 / 60)
    errors = []
    for n in (100, 200, 400, 800):
        z = z0.copy()
        for _ in range(n):
            z = implicit_step(z, -1.0, 0.03, 1 / 60, 0.5 / n)
        errors.append(np.abs(z - reference).max())
    slope = -np.polyfit(np.log([100, 200, 400, 800]), np.log(errors), 1)[0]
    assert slope == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("speed", [1.0, 5.0, 15.0, 40.0])
def test_plant_step_is_accurate_at_the_step_of_the_environment(speed):
    delta = 0.1 if speed < 10.0 else 0.01
    z = drive([0.0, 0.0, 0.0, speed, 0.0, 0.0], 0.5, delta, 2.0, 0.05, dynamics.plant_step)
    # Measured: 1.4 mm at 40 m/s, less below. Positions in m, angles in rad, speeds in m/s.
    np.testing.assert_allclose(z, exact([0.0, 0.0, 0.0, speed, 0.0, 0.0], 0.5, delta, 2.0), atol=2e-3)


def test_braking_to_standstill_stays_there():
    z = drive([0.0, 0.0, 0.0, 3.0, 0.0, 0.0], -3.0, 0.3, 2.0, 0.05, dynamics.plant_step)
    np.testing.assert_array_equal(z[3:], 0.0)
    stopped = z.copy()
    z = drive(z, -5.0, -0.3, 1.0, 0.05, dynamics.plant_step)
    np.testing.assert_array_equal(z, stopped)


def test_starting_from_standstill_follows_kinematic_steering():
    delta = 0.2
    z = drive([0.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1.0, delta, 1.0, 0.05, dynamics.plant_step)
    assert z[3] == pytest.approx(1.0, abs=0.01)
    # At 1 m/s tyres slip little: r = v tan(delta) / L within the small-angle form of Eq. 11.
    wheelbase = VEHICLE.l_f + VEHICLE.l_r
    assert z[5] == pytest.approx(z[3] * delta / wheelbase, rel=0.03)


def test_stable_at_every_speed_under_the_environments_step():
    for speed in np.linspace(0.0, 40.0, 41):
        z = drive([0.0, 0.0, 0.0, speed, 0.5, 0.5], 0.0, 0.0, 10.0, 0.05, dynamics.plant_step)
        assert np.abs(z[4:]).max() < (0.05 if speed <= 35.0 else 0.5)  # slow to settle near 43.8 m/s


def test_steady_cornering_matches_theory():
    v, delta = 15.0, 0.01
    z = np.array([0.0, 0.0, 0.0, v, 0.0, 0.0])
    for _ in range(200):
        dynamics.plant_step(z, -z[5] * z[4], delta, 0.05, VEHICLE)
    p = VEHICLE
    wheelbase = p.l_f + p.l_r
    gradient = p.m * (p.l_r * p.C_r - p.l_f * p.C_f) / (2.0 * p.C_f * p.C_r * wheelbase)
    assert z[5] == pytest.approx(v * delta / (wheelbase + gradient * v**2), rel=2e-3)


def test_left_and_right_mirror():
    left = drive([0.0, 0.0, 0.1, 12.0, 0.2, 0.1], 1.0, 0.1, 1.0, 0.05, dynamics.plant_step)
    right = drive([0.0, 0.0, -0.1, 12.0, -0.2, -0.1], 1.0, -0.1, 1.0, 0.05, dynamics.plant_step)
    np.testing.assert_array_equal(left * [1, -1, -1, 1, -1, -1], right)


def test_jacobian_matches_finite_differences():
    rng = np.random.default_rng(0)
    for _ in range(200):
        z = rng.normal(size=6) * [1.0, 1.0, 0.3, 0.0, 0.5, 0.3] + [0, 0, 0, rng.uniform(0.5, 35.0), 0, 0]
        a, delta, kappa = rng.uniform(-5, 5), rng.uniform(-0.5, 0.5), rng.uniform(-0.02, 0.02)
        step = lambda q, kappa=kappa: implicit_step(q[:6], q[6], q[7], kappa, 0.05)
        q = np.r_[z, a, delta]
        numeric = np.array([(step(q + e) - step(q - e)) / 2e-6 for e in 1e-6 * np.eye(8)]).T
        _, A, B = step_with_derivatives(z, a, delta, kappa, 0.05, VEHICLE)
        np.testing.assert_allclose(np.c_[A, B], numeric, atol=1e-7)


@pytest.mark.parametrize(("turn", "accuracy"), [(0.01, 1e-15), (0.1, 1e-15), (0.5, 1e-15), (1.0, 1.5e-11)])
def test_the_direction_that_a_step_hands_on_is_that_of_its_heading(turn, accuracy):
    for psi in np.linspace(-3.0, 3.0, 61):
        for sign in (-1.0, 1.0):
            found = dynamics.turned((math.cos(psi), math.sin(psi)), sign * turn)
            exactly = math.cos(psi + sign * turn), math.sin(psi + sign * turn)
            np.testing.assert_allclose(found, exactly, rtol=0.0, atol=accuracy)


def test_a_state_changes_by_a_step_as_its_derivatives_say():
    rng = np.random.default_rng(1)
    z, x = np.array([0.0, 0.4, 0.1, 12.0, 0.3, 0.2]), rng.normal(size=6)
    _, A, _ = step_with_derivatives(z, 1.0, 0.05, 0.01, 0.05, VEHICLE)
    np.testing.assert_allclose(change_through_step(x, z, 1.0, 0.05, 0.01, 0.05, VEHICLE), A @ x, rtol=1e-12, atol=1e-14)


def test_road_frame_and_cartesian_frame_agree_on_an_arc():
    kappa, h = 1.0 / 60.0, 1e-4
    road = np.array([0.0, 0.5, 0.05, 12.0, 0.0, 0.2])
    plane = np.array([0.0, 0.5, 0.05, 12.0, 0.0, 0.2])
    for _ in range(10_000):
        dynamics.step_in_place(road, 0.3, 0.04, kappa, h, VEHICLE)
        dynamics.step_in_place(plane, 0.3, 0.04, 0.0, h, VEHICLE)
    centre = np.array([0.0, 60.0])
    radius = np.hypot(*(plane[:2] - centre))
    angle = np.arctan2(plane[0], 60.0 - plane[1])
    assert road[1] == pytest.approx(60.0 - radius, abs=2e-3)
    assert road[0] == pytest.approx(60.0 * angle, abs=2e-3)
    assert road[2] == pytest.approx(plane[2] - angle, abs=1e-4)
