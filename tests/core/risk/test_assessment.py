"""The prediction of the risk assessment against the plant, and the roles of the neighbours over a lane change."""

import gymnasium as gym
import numpy as np
import pytest

from shared_control_env.core.parameters import DegradationParameters, Parameters, VehicleParameters
from shared_control_env.core.records import (
    FAULT_MEMORY,
    FOLLOWER,
    HEADING,
    NEAR_D,
    NEAR_ROW,
    NEAR_S,
    NEAR_SPEED,
    PRESENT,
    SIGNALS,
    SPEED,
    pack,
    record_dtype,
)
from shared_control_env.core.world.lane_change import change_weight
from shared_control_env.core.world.tyre import address_of
from shared_control_env.core.world.vehicle import plant_step
from shared_control_env.wrappers import DriverModel
from tests import compiled
from tests.scenes import STRAIGHT, random_state, scene_of, traffic

NO_FAULTS = np.empty(0, record_dtype(DegradationParameters)), np.empty(0, FAULT_MEMORY)


@pytest.mark.parametrize("tyre", ["linear", "fiala"])
def test_the_predicted_yaw_rate_is_that_of_the_plant_under_the_same_command(tyre):
    car = VehicleParameters(tyre=address_of(tyre))
    parameters, rng = pack(Parameters(vehicle=car, model=car)), np.random.default_rng(0)
    for _ in range(50):
        scene, signals = scene_of(random_state(rng), parameters, traffic()), np.zeros((), SIGNALS)
        u = rng.uniform(-1.0, 1.0, 2) * [5.0, 0.5]
        signals["u_a_des"] = u
        compiled.monitor(scene, traffic(), STRAIGHT, *NO_FAULTS, parameters, signals)
        state = scene["state"].copy()
        plant_step(state, u[0], u[1], 0.05, car)
        assert signals["prediction"][5] == pytest.approx(state[5], abs=1e-9)


@pytest.mark.parametrize("name", ["TwoLane", "Bend"])
def test_in_the_loop_too(name):
    """With nobody at the wheel and no limit, the command that is assessed drives the car."""
    alone = {"authority": {"law": "none"}, "driver_lag": {"K_h": 0.0}}
    env = gym.make(f"SharedControl/{name}-v1", config=alone)
    env.reset(seed=1)
    predicted = None
    for _ in range(60):
        _, _, terminated, _, info = env.step(np.zeros(2))
        if predicted is not None:
            assert info["z"][5] == pytest.approx(predicted, abs=1e-9)
        if terminated:
            break
        predicted = info["prediction"][5]


@pytest.mark.parametrize(("internal", "bound"), [(False, 0.02), (True, 0.01)])
def test_alpha_a_does_not_oscillate_in_case_1(internal, bound):
    """With one implicit step of the controllers as prediction it changed by 0.043 and 0.177 in the mean step."""
    config = {"authority": {"law": "proportional"}, "internal_model": {"active": internal}}
    env = DriverModel(gym.make("SharedControl/TwoLane-v1", config=config))
    env.reset(seed=0)
    alphas, ended = [], False
    while not ended:
        _, _, terminated, truncated, info = env.step(0)
        alphas.append(info["alpha_a"])
        ended = terminated or truncated
    assert np.abs(np.diff(alphas)).mean() < bound
    assert min(alphas) < 0.5


def test_the_follower_of_the_lane_changed_to_keeps_its_role():
    """From the first to the last step of the change, in all of 60 seeds, unless it is no longer behind."""
    env = gym.make_vec("SharedControl/LaneChange-v1", num_envs=60, driver=True)
    env.reset(seed=0)
    kernel = env.unwrapped
    changes = [episode.lane_change for episode in kernel.episodes]
    onset = np.array([change.onset for change in changes])
    end = onset + [change.duration for change in changes]
    running, seen = np.ones(60, dtype=bool), np.zeros(60, dtype=int)
    for _ in range(kernel.episodes[0].steps):
        _, _, terminations, truncations, infos = env.step(None)
        during = running & (infos["t"] > onset) & (infos["t"] < end)
        near = infos["neighbours"][:, FOLLOWER]
        assert (near[during, PRESENT] == 1.0).all()
        assert (near[during, NEAR_ROW] == 2.0).all()
        assert (near[during, NEAR_S] < infos["z"][during, 0]).all()
        assert (np.abs(near[during, NEAR_D] - 4.0) < 2.0).all()
        seen += during
        running &= ~(terminations | truncations)
        if not running.any():
            break
    assert seen.min() > 30


def test_the_weights_pass_over_smoothly():
    times = np.arange(0.0, 8.0, 0.01)
    weights = np.array([change_weight(t, 1.0, 4.0) for t in times])
    assert (weights[(times <= 1.0) | (times >= 5.0)] == 0.0).all()
    np.testing.assert_allclose(weights[(times >= 2.0) & (times <= 4.0)], 1.0, atol=1e-12)
    assert np.abs(np.diff(weights)).max() < 0.016  # 1.5 / 1 s over 0.01 s
    np.testing.assert_allclose(weights[100:501], weights[100:501][::-1], atol=1e-9)
    assert change_weight(3.0, np.inf, 4.0) == 0.0


def test_a_neighbour_has_one_speed_and_an_absent_one_none():
    """A vehicle that heads across the road counts with its speed along the road, in the scene and in r_x."""
    others = traffic((20.0, 0.0, 10.0), (15.0, 4.0, 12.0))
    others[0, HEADING] = 0.4
    parameters, signals = pack(Parameters()), np.zeros((), SIGNALS)
    signals["predicted_neighbours"] = 7.0  # what an earlier step left
    scene = scene_of(np.array([0.0, 0.0, 0.0, 15.0, 0.0, 0.0]), parameters, others)
    compiled.monitor(scene, others, STRAIGHT, *NO_FAULTS, parameters, signals)
    np.testing.assert_allclose(signals["predicted_neighbours"][2, [0, 2]], [1.0, 10.0 * np.cos(0.4)], atol=1e-12)
    assert scene["neighbours"][2, NEAR_SPEED] == pytest.approx(10.0 * np.cos(0.4))
    np.testing.assert_array_equal(signals["predicted_neighbours"][FOLLOWER], 0.0)
    assert others[1, SPEED] == signals["predicted_neighbours"][1, 2]
