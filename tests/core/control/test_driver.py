"""The driver's program against the same cost, written down by itself: a rollout of the linear model under Eq. 16."""

import numpy as np
import pytest

from shared_control_env.controllers.driver import PredictiveDriver
from shared_control_env.core import entries
from shared_control_env.core.control.driver import DRIVERS, SHARE_OF_DESIRED, SLACK_LINEAR, SLACK_QUADRATIC, SLACKS
from shared_control_env.core.parameters import InternalModelParameters, Parameters
from shared_control_env.core.records import pack
from tests.compiled import step_with_derivatives
from tests.scenes import random_state, scene_of, traffic

BOUNDS = np.array([5.0, np.pi / 6])


def build(parameters, scene, u_last, u_h_act):
    w = parameters.driver
    n, rows = 2 * w.H_c + SLACKS, 2 * w.H_p + 1
    P, q, A = np.zeros((n, n)), np.zeros(n), np.zeros((rows + n, n))
    low, high = np.zeros(rows + n), np.zeros(rows + n)
    work = np.zeros((), DRIVERS)
    entries.build_program(scene.reshape(1), u_last, u_h_act, pack(parameters), work, P, q, A, low, high)
    return P, q, A, low, high


def linear_model(parameters, scene, u):
    """``z+ = A z + B u + affine`` at the scene's state and a command, at every stage."""
    z, stages = scene["z"], []
    for i in range(parameters.driver.H_p):
        f, A, B = step_with_derivatives(z, u[0], u[1], scene["kappa"][i], 0.05, parameters.vehicle)
        stages.append((A, B, f - A @ z - B @ u))
    return stages


def rollout(parameters, scene, U, u_last, u_h_act):
    """Cost of the desired commands U, shape (H_c, 2), and the states, by the definition of the problem."""
    w, internal = parameters.driver, parameters.internal_model
    felt = scene["felt"]
    phi = np.exp(-0.05 / internal.T_h)
    stages = linear_model(parameters, scene, felt + u_h_act if internal.active else u_last)
    z, arm, cost, states = scene["z"].copy(), u_h_act.copy(), 0.0, []
    Q = np.array([w.Q_a, w.Q_delta])
    for i, (A, B, affine) in enumerate(stages):
        desired = U[min(i, w.H_c - 1)]
        u = felt + arm if internal.active else desired
        if internal.active and 1 <= i <= w.H_c:
            cost += Q @ u**2
        arm = phi * arm + internal.K_h * (1.0 - phi) * (desired - felt)
        z, before = A @ z + B @ u + affine, z
        states.append(z)
        cost += w.W * (z[1] - scene["y_target"]) ** 2 + w.H * (z[3] - scene["v_target"]) ** 2
        cost += w.N * ((z[5] - before[5]) / 0.05) ** 2
    cost += (SHARE_OF_DESIRED if internal.active else 1.0) * np.sum(Q * U**2)
    return cost, np.array(states)


@pytest.mark.parametrize("active", [False, True])
@pytest.mark.parametrize("horizons", [(10, 3), (6, 6), (1, 1), (30, 10)])
@pytest.mark.parametrize("seed", range(8))
def test_cost_and_rows_are_those_of_the_rollout(active, horizons, seed):
    rng = np.random.default_rng(seed)
    H_p, H_c = horizons
    model = InternalModelParameters(active, float(rng.uniform(0.5, 1.5)), float(rng.uniform(0.05, 0.5)))
    parameters = Parameters(internal_model=model)
    parameters = parameters._replace(driver=parameters.driver._replace(H_p=H_p, H_c=min(H_c, H_p)))
    scene = scene_of(random_state(rng) + [0, 0, 0, 5.0, 0, 0], pack(parameters), traffic((30.0, 0.0, 10.0)))
    scene["felt"] = rng.uniform(-0.3, 0.3, 2) * BOUNDS
    u_last, u_h_act = rng.uniform(-0.3, 0.3, (2, 2)) * BOUNDS
    P, q, A, low, high = build(parameters, scene, u_last, u_h_act)
    n = 2 * parameters.driver.H_c

    def both(x):
        cost, states = rollout(parameters, scene, x[:n].reshape(-1, 2) * BOUNDS, u_last, u_h_act)
        slack = SLACK_LINEAR * x[n:].sum() + SLACK_QUADRATIC * (x[n:] ** 2).sum()
        return 0.5 * x @ P @ x + q @ x - slack, cost, states

    zero, constant, at_zero = both(np.zeros(n + SLACKS))
    assert zero == 0.0
    for _ in range(5):
        x = np.append(rng.uniform(-1.0, 1.0, n), rng.uniform(0.0, 1.0, SLACKS))
        value, cost, states = both(x)
        assert value == pytest.approx(cost - constant, rel=1e-9, abs=1e-9)
        rows = A @ x
        moved = states[:, 1] - at_zero[:, 1]
        np.testing.assert_allclose(rows[:H_p], moved - x[n], atol=1e-10)
        np.testing.assert_allclose(rows[H_p : 2 * H_p], moved + x[n], atol=1e-10)
        np.testing.assert_allclose(rows[-n - SLACKS :], x)
        assert rows[2 * H_p] == pytest.approx(states[-1, 0] - at_zero[-1, 0] - x[n + 1], abs=1e-9)
        assert high[2 * H_p] == pytest.approx(float(scene["area"]["end"]) - 2.5 - at_zero[-1, 0], abs=1e-9)


def test_without_the_internal_model_the_arm_and_what_is_felt_do_not_matter():
    rng = np.random.default_rng(3)
    scene = scene_of(random_state(rng))
    first = build(Parameters(), scene, np.array([0.5, 0.02]), np.zeros(2))
    scene["felt"] = [1.0, 0.1]
    again = build(Parameters(), scene, np.array([0.5, 0.02]), np.array([2.0, 0.2]))
    for a, b in zip(first, again, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("active", [False, True])
def test_the_driver_brakes_for_the_end_of_the_safe_area(active):
    """Eq. 15 keeps (x, y) in C: with 1 m of free road the driver brakes as hard as it can, with 55 m not at all."""
    parameters = Parameters(internal_model=InternalModelParameters(active))
    commands = []
    for free in (1.0, 9.0, 55.0):
        driver = PredictiveDriver(parameters)
        scene = scene_of(np.array([0.0, 0.0, 0.0, 15.0, 0.0, 0.0]), pack(parameters))
        scene["area"]["end"] = free
        commands.append(driver.act(np.zeros(1), scene)[0])
    assert commands[0] == pytest.approx(-5.0, abs=1e-3)
    assert commands[0] - 1e-3 <= commands[1] < commands[2] - 1.0
    assert commands[2] == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("active", [False, True])
def test_a_car_that_cannot_stop_in_time_still_keeps_to_the_sides(active):
    """The end of C has a slack of its own: the car steers back into its lane as on a free road, or nearly so."""
    parameters = Parameters(internal_model=InternalModelParameters(active))
    state = np.array([0.0, 1.0, 0.02, 15.0, 0.0, 0.0])
    steering = []
    for free in (0.5, 55.0):
        driver = PredictiveDriver(parameters)
        scene = scene_of(state, pack(parameters))
        scene["area"]["end"] = free
        steering.append(driver.act(np.zeros(1), scene)[1])
    assert steering[1] < -0.1
    assert steering[0] < 0.6 * steering[1]
