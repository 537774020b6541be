"""The actuators: a first-order lag against its exact solution, and a rate that is never exceeded."""

import gymnasium as gym
import numpy as np
import pytest

from shared_control_env.core.parameters import ActuatorParameters
from shared_control_env.core.world.actuator import actuate

DT = 0.05


def responses(actuator, commands):
    realised, out = np.zeros(2), []
    for u in commands:
        actuate(np.asarray(u, dtype=float), DT, actuator, realised)
        out.append(realised.copy())
    return np.array(out)


def test_without_lag_and_limit_the_command_passes():
    commands = np.random.default_rng(0).normal(size=(50, 2))
    np.testing.assert_array_equal(responses(ActuatorParameters(), commands), commands)


def test_a_step_is_answered_by_an_exponential():
    t = DT * np.arange(1, 41)
    out = responses(ActuatorParameters(acceleration_lag=0.3, steering_lag=0.1), [[2.0, -0.2]] * 40)
    np.testing.assert_allclose(out[:, 0], 2.0 * (1.0 - np.exp(-t / 0.3)), atol=1e-12)
    np.testing.assert_allclose(out[:, 1], -0.2 * (1.0 - np.exp(-t / 0.1)), atol=1e-12)


def test_the_rate_is_limited_in_both_directions():
    commands = np.random.default_rng(1).uniform(-1.0, 1.0, (200, 2)) * [5.0, 0.5]
    out = responses(ActuatorParameters(0.0, 0.05, 10.0, 0.6), commands)
    change = np.abs(np.diff(out, axis=0, prepend=0.0)).max(axis=0)
    np.testing.assert_allclose(change, [10.0 * DT, 0.6 * DT], rtol=1e-9)


@pytest.mark.parametrize("foreign", [False, True])
def test_the_car_does_what_the_actuators_make_of_the_command(foreign):
    """In the kernel and with highway-env's own vehicles: u_realised follows u, and the first step is soft."""
    config = {"actuator": {"steering_lag": 0.2, "acceleration_rate": 8.0}, "simulation_frequency": 40}
    if foreign:
        config["other_vehicles_type"] = "highway_env.vehicle.kinematics.Vehicle"
    env = gym.make("SharedControl/TwoLane-v1", config=config)
    _, info = env.reset(seed=0)
    realised = np.zeros(2)
    actuator = ActuatorParameters(steering_lag=0.2, acceleration_rate=8.0)
    for _ in range(30):
        info = env.step(np.array([0.4, 0.05]))[4]
        for _ in range(2):
            actuate(info["u"], 0.025, actuator, realised)
        np.testing.assert_allclose(info["u_realised"], realised, atol=1e-12)
    assert not np.allclose(info["u_realised"], info["u"], atol=1e-4)


@pytest.mark.parametrize("field", ["acceleration_lag", "steering_lag", "acceleration_rate", "steering_rate"])
def test_what_cannot_be_is_refused_by_name_and_range(field):
    for value in (-0.1, -1e-9):
        with pytest.raises(ValueError, match=rf"\['actuator'\]\['{field}'\] = {value}.*smallest is"):
            gym.make("SharedControl/TwoLane-v1", config={"actuator": {field: value}})
    with pytest.raises(ValueError, match=r"\['mu'\] = 0.0.*smallest is 0.05"):
        gym.make("SharedControl/Bend-v1", config={"vehicle": {"mu": 0.0}})
