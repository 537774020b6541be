import copy

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shared_control_env.controllers import Automation, Driver, PredictiveDriver
from shared_control_env.core.parameters import InternalModelParameters, Parameters
from shared_control_env.core.records import pack
from shared_control_env.wrappers import DriverModel
from tests.scenes import random_state, scene_of, traffic

PARAMETERS = pack(Parameters())


def kkt(driver):
    """Residuals of the last program from OSQP's own primal and dual solution."""
    result = driver._solver.solve(raise_error=False)
    x, y = result.x, result.y
    Ax = driver.A @ x
    primal = np.maximum(0.0, np.maximum(driver.low - Ax, Ax - driver.high)).max()
    stationarity = np.abs(driver.P @ x + driver.q + driver.A.T @ y).max()
    slack = np.minimum(Ax - driver.low, driver.high - Ax)
    complementarity = np.abs(y * np.clip(slack, 0.0, 1e3)).max()
    scale = max(1.0, np.abs(driver.q).max(), np.abs(driver.A.T @ y).max())
    return primal, stationarity / scale, complementarity / scale


@given(st.integers(0, 100_000))
@settings(max_examples=100)
def test_kkt_residuals(seed):
    rng = np.random.default_rng(seed)
    driver = PredictiveDriver()
    scene = scene_of(random_state(rng), PARAMETERS)
    solution = driver.solve(scene)
    assert solution.found
    primal, stationarity, complementarity = kkt(driver)
    assert primal <= 1e-4
    assert stationarity <= 1e-4
    assert complementarity <= 1e-2


def test_always_feasible_even_outside_the_lane():
    for y in (-5.0, -2.5, 2.5, 5.0):
        driver = PredictiveDriver()
        solution = driver.solve(scene_of(np.array([0.0, y, 0.0, 15.0, 0.0, 0.0]), PARAMETERS))
        assert solution.found
        assert np.sign(solution.command[1]) == -np.sign(y)


def test_rows_of_the_safe_area_bind():
    # Fast towards the lane's edge: the tracking cost alone would let the position leave C.
    values = Parameters()._replace(driver=Parameters().driver._replace(W=1e-6, H=0.1))
    state = np.array([0.0, 1.0, 0.2, 15.0, 0.0, 0.0])
    free, bound = PredictiveDriver(values), PredictiveDriver(values)
    scene = scene_of(state, PARAMETERS)
    inside = bound.solve(scene).command
    scene["area"]["upper"][:, 1] = 50.0
    outside = free.solve(scene).command
    assert inside[1] < outside[1] - 0.02


def test_agrees_with_the_automation_in_the_middle_of_the_lane():
    rng = np.random.default_rng(0)
    for _ in range(50):
        state = random_state(rng) * [1, 0.1, 0.1, 0.5, 0.05, 0.1] + [0, 0, 0, 8.0, 0, 0]
        scene = scene_of(state, PARAMETERS)
        automation, driver = Automation(PARAMETERS), PredictiveDriver()
        automation.reset()
        difference = automation.act(scene).command - driver.solve(scene).command
        assert np.abs(difference / [5.0, np.pi / 6]).max() < 0.05


def test_holds_the_last_feasible_command_when_the_solver_fails(monkeypatch):
    driver = PredictiveDriver()
    scene = scene_of(np.array([0.0, 0.5, 0.0, 15.0, 0.0, 0.0]), PARAMETERS)
    first = driver.act(np.zeros(25), scene)
    driver._solver.update_settings(max_iter=1)
    scene["z"][1] = -0.5
    held = driver.act(np.zeros(25), scene)
    np.testing.assert_array_equal(held, first)
    assert not driver.solution.found
    assert driver.failures == 1


def test_episodes_do_not_depend_on_those_before():
    rng = np.random.default_rng(0)
    scenes = [scene_of(random_state(rng), PARAMETERS) for _ in range(20)]
    driver = PredictiveDriver()
    first = [driver.act(np.zeros(25), scene) for scene in scenes]
    driver.reset()
    np.testing.assert_array_equal(first, [driver.act(np.zeros(25), scene) for scene in scenes])


def test_copies_set_up_their_own_workspace():
    driver = PredictiveDriver()
    scene = scene_of(np.array([0.0, 0.5, 0.0, 15.0, 0.0, 0.0]), PARAMETERS)
    driver.act(np.zeros(25), scene)
    twin = copy.deepcopy(driver)
    np.testing.assert_allclose(twin.act(np.zeros(25), scene), driver.act(np.zeros(25), scene), atol=1e-3)


def test_protocol():
    assert isinstance(PredictiveDriver(), Driver)
    assert not isinstance(object(), Driver)


def test_solution_reports_status_iterations_residuals_and_time():
    scene = scene_of(np.array([0.0, 0.5, 0.0, 15.0, 0.0, 0.0]), PARAMETERS, traffic((30.0, 0.0, 12.0)))
    for solution in (PredictiveDriver().solve(scene), Automation(PARAMETERS).act(scene)):
        assert solution.found
        assert solution.iterations > 0
        assert 0.0 <= solution.primal_residual < 1e-3
        assert 0.0 <= solution.dual_residual < 1.0
        assert solution.time > 0.0


@pytest.mark.parametrize("speed", [0.0, 0.1])
def test_driver_starts_off(speed):
    driver = PredictiveDriver()
    scene = scene_of(np.array([0.0, 0.0, 0.0, speed, 0.0, 0.0]), PARAMETERS)
    assert driver.solve(scene).command[0] > 1.0
    driver._last = np.array([-5.0, 0.0])
    assert driver.solve(scene).command[0] > 1.0


KNOWING = Parameters(internal_model=InternalModelParameters(active=True))


def test_the_driver_with_the_internal_model_brakes_for_the_end_of_the_safe_area():
    """In the middle of the lane at the target speed there is nothing to do, but for the end of C."""
    commands = []
    for end in (1.0, 4.0, 55.0):
        scene = scene_of(np.array([0.0, 0.0, 0.0, 15.0, 0.0, 0.0]), pack(KNOWING))
        scene["area"]["end"] = end
        commands.append(PredictiveDriver(KNOWING).solve(scene).command[0])
    assert commands[2] == pytest.approx(0.0, abs=0.02)
    assert commands[0] < commands[2] - 1.0
    assert commands[1] < commands[2] - 1.0


def test_the_driver_with_the_internal_model_undoes_what_it_feels():
    """It asks for the command that cancels the automation's, where the paper's driver asks for nothing."""
    scene = scene_of(np.array([0.0, 0.0, 0.0, 15.0, 0.0, 0.0]), pack(KNOWING))
    scene["felt"] = [0.0, 0.05]
    assert PredictiveDriver(KNOWING).solve(scene).command[1] < -0.02
    assert PredictiveDriver().solve(scene).command[1] == pytest.approx(0.0, abs=1e-4)


def test_its_arm_is_the_one_of_the_loop():
    env = DriverModel(gym.make("SharedControl/Bend-v1", config={"internal_model": {"active": True}}))
    env.reset(seed=0)
    for _ in range(60):
        info = env.step(0)[4]
        np.testing.assert_allclose(env.driver._arm, info["u_h_act"], atol=1e-12)
