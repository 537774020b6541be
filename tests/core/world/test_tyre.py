"""Tyres and the car on them: against a symbolic copy of the equations, an exact integration, and what physics allows."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from shared_control_env.core.compile.jit import jit
from shared_control_env.core.parameters import VehicleParameters
from shared_control_env.core.world import tyre
from shared_control_env.core.world import vehicle as dynamics

C, MU, LOAD = 60_000.0, 0.9, 5000.0
CAR = VehicleParameters(tyre=tyre.address_of("fiala"))
G = dynamics.GRAVITY
fiala = jit(tyre.fiala)


def symbolic_force(slip, mu, load):
    """The brush model in CasADi, in the form with the sliding slip."""
    sliding = 3.0 * mu * load / C
    inside = -C * slip + C**2 / (3.0 * mu * load) * ca.fabs(slip) * slip - C**3 / (27.0 * (mu * load) ** 2) * slip**3
    return ca.if_else(ca.fabs(slip) < sliding, inside, -mu * load * ca.sign(slip))


def test_the_brush_model_is_that_of_casadi_with_its_derivative():
    slip = ca.SX.sym("slip")
    force = symbolic_force(slip, MU, LOAD)
    both = ca.Function("both", [slip], [force, ca.jacobian(force, slip)])
    sliding = 3.0 * MU * LOAD / C
    for value in np.r_[np.linspace(-2.0, 2.0, 41) * sliding, 0.0, 1e-12]:
        expected = [float(each) for each in both(value)]
        np.testing.assert_allclose(fiala(value, C, MU, LOAD), expected, rtol=1e-12, atol=1e-9)


def test_the_slope_is_the_derivative_and_c_at_zero():
    for slip in np.linspace(-0.4, 0.4, 33):
        numeric = (fiala(slip + 1e-6, C, MU, LOAD)[0] - fiala(slip - 1e-6, C, MU, LOAD)[0]) / 2e-6
        assert fiala(slip, C, MU, LOAD)[1] == pytest.approx(numeric, abs=0.5)
    assert fiala(0.0, C, MU, LOAD) == (0.0, -C)


def test_the_force_opposes_the_slip_grows_with_it_and_stays_within_the_friction():
    slips = np.linspace(0.0, 1.5, 400)
    forces = np.array([fiala(slip, C, MU, LOAD)[0] for slip in slips])
    assert (np.diff(forces) <= 1e-9).all()
    assert forces.min() == pytest.approx(-MU * LOAD)
    np.testing.assert_array_equal([fiala(-slip, C, MU, LOAD)[0] for slip in slips], -forces)
    low = [fiala(slip, C, 0.5, LOAD)[0] for slip in slips]
    assert (np.abs(low) <= np.abs(forces) + 1e-9).all()


def right_hand_side(z, a, delta, car=CAR):
    """Eq. 11 with brush tyres and the friction ellipse, in CasADi."""
    psi, v_x, v_y, r = z[2], z[3], z[4], z[5]
    mu = car.mu * np.sqrt(1.0 - (a / (car.mu * G)) ** 2)
    load = 0.5 * car.m * G / (car.l_f + car.l_r)
    F_f = 2.0 * symbolic_force((v_y + car.l_f * r) / v_x - delta, mu, load * car.l_r)
    F_r = 2.0 * symbolic_force((v_y - car.l_r * r) / v_x, mu, load * car.l_f)
    return ca.vertcat(
        v_x * ca.cos(psi) - v_y * ca.sin(psi),
        v_x * ca.sin(psi) + v_y * ca.cos(psi),
        r,
        r * v_y + a,
        -r * v_x + (F_f * np.cos(delta) + F_r) / car.m,
        (car.l_f * F_f - car.l_r * F_r) / car.I_z,
    )


def exact(z, a, delta, duration):
    state = ca.SX.sym("z", 6)
    slope = ca.Function("slope", [state], [right_hand_side(state, a, delta)])
    rhs = lambda _, z: np.array(slope(z)).ravel()
    return solve_ivp(rhs, (0.0, duration), z, method="LSODA", rtol=1e-10, atol=1e-11).y[:, -1]


def drive(z, a, delta, duration, h, step=dynamics.plant_step, car=CAR):
    z = np.array(z, dtype=float)
    for _ in range(round(duration / h)):
        step(z, a, delta, h, car)
    return z


@pytest.mark.parametrize(
    ("speed", "delta", "bound"),
    [(5.0, 0.3, 0.02), (15.0, 0.03, 0.02), (15.0, 0.3, 0.1), (30.0, 0.01, 0.02), (30.0, 0.05, 0.02)],
)
def test_the_plant_agrees_with_an_exact_integration(speed, delta, bound):
    """Steady, at the limit of friction, and while it slides (0.3 rad at 15 m/s, where v_y errs by 0.07 m/s).

    Positions in m, angles in rad, speeds in m/s.
    """
    start = [0.0, 0.0, 0.0, speed, 0.0, 0.0]
    error = np.abs(drive(start, -2.0, delta, 1.0, 0.05) - exact(start, -2.0, delta, 1.0))
    assert error.max() < bound


def test_the_plant_converges_with_second_order():
    start = [0.0, 0.0, 0.0, 15.0, 0.0, 0.0]
    reference = exact(start, -1.0, 0.1, 0.5)
    steps = np.array([1 / 80, 1 / 160, 1 / 320, 1 / 640])
    errors = [np.abs(drive(start, -1.0, 0.1, 0.5, h, dynamics.extrapolated_step) - reference).max() for h in steps]
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(2.0, abs=0.3)


@pytest.mark.parametrize("mu", [0.3, 0.5, 0.9])
def test_no_command_accelerates_the_car_more_than_the_road_allows(mu):
    """Full steering held for half a second each, with full braking or acceleration, until the car spins past 90 deg.

    The force per mass, averaged over a step of the environment, stays within mu g, and comes near it.
    """
    car, rng, largest = CAR._replace(mu=mu), np.random.default_rng(0), 0.0
    for _ in range(200):
        z = np.array([0.0, 0.0, 0.0, rng.uniform(5.0, 35.0), 0.0, 0.0])
        for k in range(40):
            if k % 10 == 0:
                a, delta = rng.uniform(-5.0, 5.0), rng.choice([-0.5, 0.5])
            before = z.copy()
            dynamics.plant_step(z, a, delta, 0.05, car)
            if z[3] < 1.0:
                break
            lateral = (z[4] - before[4]) / 0.05 + 0.5 * (before[3] * before[5] + z[3] * z[5])
            longitudinal = (z[3] - before[3]) / 0.05 - 0.5 * (before[4] * before[5] + z[4] * z[5])
            largest = max(largest, np.hypot(lateral, longitudinal))
    assert 0.95 * mu * G < largest <= 1.1 * mu * G


def test_braking_takes_grip_from_the_steering():
    start = [0.0, 0.0, 0.0, 20.0, 0.0, 0.0]
    wet = CAR._replace(mu=0.5)
    coasting = drive(start, 0.0, 0.2, 0.5, 0.05, car=wet)
    braking = drive(start, -5.0, 0.2, 0.5, 0.05, car=wet)
    assert 20.0 - braking[3] == pytest.approx(0.5 * dynamics.LONGITUDINAL_SHARE * 0.5 * G, abs=0.5)
    assert abs(braking[2]) < 0.75 * abs(coasting[2])


def test_at_small_slip_the_tyre_is_the_linear_one():
    start = [0.0, 0.0, 0.0, 15.0, 0.0, 0.0]
    for delta in (1e-4, 1e-3):
        linear = drive(start, 0.0, delta, 1.0, 0.05, car=VehicleParameters())
        brush = drive(start, 0.0, delta, 1.0, 0.05)
        np.testing.assert_allclose(brush[[1, 2, 5]], linear[[1, 2, 5]], rtol=10.0 * delta)


def test_a_sliding_car_comes_to_rest_and_stays_there():
    z = drive([0.0, 0.0, 0.0, 6.0, 4.0, 2.0], -4.0, 0.4, 6.0, 0.05)
    np.testing.assert_allclose(z[3:], 0.0, atol=1e-6)
    again = drive(z, -5.0, -0.3, 1.0, 0.05)
    np.testing.assert_allclose(again, z, atol=1e-6)
    assert np.isfinite(drive([0.0, 0.0, 0.0, 0.0, 8.0, 0.0], 0.0, 0.0, 5.0, 0.05)).all()


def test_a_car_that_slides_sideways_is_braked_by_friction_alone():
    """Where v_x passes 0 the lateral velocity goes on: it falls by mu g at most."""
    z = np.array([0.0, 0.0, 0.0, 1.0, 8.0, 0.0])
    for _ in range(40):
        before = z.copy()
        dynamics.plant_step(z, -3.0, 0.0, 0.05, CAR)
        slowed = np.hypot(*before[3:5]) - np.hypot(*z[3:5])
        assert slowed <= 1.05 * CAR.mu * G * 0.05


def test_started_from_rest_it_follows_kinematic_steering():
    z = drive([0.0] * 6, 1.0, 0.2, 1.0, 0.05)
    assert z[3] == pytest.approx(1.0, abs=0.02)
    assert z[5] == pytest.approx(z[3] * 0.2 / (CAR.l_f + CAR.l_r), rel=0.05)
