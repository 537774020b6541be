import copy
import json
import pickle
import subprocess
import sys
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env

import shared_control_env  # noqa: F401
from shared_control_env.core.feedback.observation import DRIVER_V0
from shared_control_env.core.feedback.reward import STANDARD as TERMS
from shared_control_env.envs import CurveEnv, TwoLaneEnv
from shared_control_env.registration import ENVIRONMENTS
from shared_control_env.wrappers import AuthorityLimiter, DriverModel, open_slots

IDS = list(ENVIRONMENTS)


def assert_same(a, b, path="info"):
    """Equal to the bit, nested dicts included."""
    assert type(a) is type(b), path
    if isinstance(a, dict):
        assert a.keys() == b.keys(), path
        for key in a:
            assert_same(a[key], b[key], f"{path}[{key!r}]")
    else:
        np.testing.assert_array_equal(a, b, err_msg=path)


def rollout(env, seed, steps=60):
    env.action_space.seed(seed)
    trace = [env.reset(seed=seed)]
    for _ in range(steps):
        trace.append(env.step(env.action_space.sample()))
        if trace[-1][2] or trace[-1][3]:
            break
    return trace


def assert_same_trace(first, second):
    assert len(first) == len(second)
    for a, b in zip(first, second, strict=True):
        for i, (x, y) in enumerate(zip(a, b, strict=True)):
            assert_same(x, y, f"item {i}")


@pytest.mark.parametrize("name", IDS)
def test_check_env_without_a_warning(name):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gym.make(name, render_mode="rgb_array").unwrapped)


@pytest.mark.parametrize("name", IDS)
def test_same_seed_same_rollout_info_included(name):
    first = rollout(gym.make(name), 3)
    other = gym.make(name, render_mode="rgb_array", config={"duration": 3.0})
    other.reset(seed=9)
    env = gym.make(name)
    env.reset(seed=1)
    env.step(env.action_space.sample())
    other.step(other.action_space.sample())  # another environment alive, and stepped in between
    assert_same_trace(first, rollout(env, 3))


@pytest.mark.parametrize("name", IDS)
def test_closed_loop_repeats_with_another_environment_alive(name):
    def closed_loop(seed):
        return rollout(DriverModel(gym.make(name)), seed, steps=120)

    first = closed_loop(0)
    bystander = DriverModel(gym.make(IDS[0]))
    bystander.reset(seed=5)
    bystander.step(0)
    assert_same_trace(first, closed_loop(0))


def test_interleaved_environments_do_not_touch_each_other():
    envs = [gym.make(name) for name in (IDS[0], IDS[1], IDS[0])]
    alone = [rollout(gym.make(env.spec.id), 2, steps=30) for env in envs]
    for env in envs:
        env.action_space.seed(2)
    together = [[env.reset(seed=2)] for env in envs]
    for _ in range(30):
        for env, trace in zip(envs, together, strict=True):
            trace.append(env.step(env.action_space.sample()))
    for a, b in zip(alone, together, strict=True):
        assert_same_trace(a, b)


@pytest.mark.parametrize("name", IDS)
def test_made_by_id_with_the_limiter_applied(name):
    env = gym.make(name)
    assert "AuthorityLimiter" in str(env)
    assert open_slots(env) == ("driver",)
    assert env.action_space == gym.spaces.Box(-1.0, 1.0, (2,), np.float32)
    assert env.observation_space == gym.spaces.Box(-1.0, 1.0, (DRIVER_V0.size,), np.float32)


def test_made_by_module_and_id_in_a_fresh_process():
    code = "import gymnasium as gym; print(gym.make('shared_control_env:SharedControl/TwoLane-v1').spec.id)"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "SharedControl/TwoLane-v1"


def test_spawned_workers_make_it():
    name = "shared_control_env:SharedControl/Curve-v1"
    envs = gym.vector.AsyncVectorEnv([lambda: gym.make(name)] * 2, context="spawn")
    observations, _ = envs.reset(seed=[1, 2])
    assert observations.shape == (2, DRIVER_V0.size)
    envs.step(np.zeros((2, 2), dtype=np.float32))
    envs.close()


def test_infos_stack_without_object_arrays():
    envs = gym.vector.SyncVectorEnv([lambda: DriverModel(gym.make(IDS[0]))] * 2)
    envs.reset(seed=0)
    _, _, _, _, infos = envs.step(np.zeros(2, dtype=np.int64))

    def check(value, path):
        if isinstance(value, dict):
            for key, item in value.items():
                check(item, f"{path}/{key}")
        else:
            assert value.dtype != object, path

    check(infos, "infos")


def test_spec_round_trip():
    env = gym.make(IDS[0], config={"duration": 2.0, "faults": [], "authority": {"law": "none"}})
    text = env.spec.to_json()
    json.loads(text)
    again = gym.make(EnvSpec.from_json(text))
    assert again.spec == env.spec
    assert again.unwrapped.config == env.unwrapped.config
    assert_same_trace(rollout(env, 0), rollout(again, 0))


def test_spec_of_the_closed_loop_round_trips():
    env = DriverModel(gym.make(IDS[0]))
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert isinstance(again, DriverModel)
    assert_same_trace(rollout(env, 0, 20), rollout(again, 0, 20))


def test_pickles_and_copies():
    env = TwoLaneEnv({"duration": 2.0})
    action = {"driver": np.zeros(2), "authority": np.ones(1)}
    env.reset(seed=0)
    env.step(action)
    expected = [copy.deepcopy(env), pickle.loads(pickle.dumps(env))]
    outcome = env.step(action)
    for twin in expected:
        for a, b in zip(twin.step(action), outcome, strict=True):
            assert_same(a, b)


@pytest.mark.parametrize("traffic", [{}, {"other_vehicles_type": "highway_env.vehicle.behavior.IDMVehicle"}])
def test_the_vehicles_of_a_copy_are_those_it_drives(traffic):
    env, ahead = (TwoLaneEnv({"duration": 2.0, **traffic}) for _ in range(2))
    action = {"driver": np.array([0.1, 0.05]), "authority": np.zeros(1)}
    for each, steps in ((env, 1), (ahead, 2)):
        each.reset(seed=0)
        for _ in range(steps):
            each.step(action)
    for twin in (copy.deepcopy(env), pickle.loads(pickle.dumps(env))):
        before = [vehicle.position.copy() for vehicle in env.road.vehicles]
        assert twin._reward(action) == env._reward(action) != 0.0
        twin.step(action)
        decided = [copy.deepcopy(each).automation.act(each.scene).command for each in (twin, ahead)]
        np.testing.assert_array_equal(*decided)  # the automation goes on from its last command
        for vehicle, moved in zip(twin.road.vehicles, ahead.road.vehicles, strict=True):
            np.testing.assert_array_equal(vehicle.position, moved.position)
        for vehicle, position in zip(env.road.vehicles, before, strict=True):
            np.testing.assert_array_equal(vehicle.position, position)  # the copy moves no vehicle of the original


def test_a_collision_that_the_user_sets_ends():
    env = TwoLaneEnv({"vehicles": []})
    env.reset(seed=0)
    env.vehicle.crashed = True
    _, _, terminated, _, info = env.step({"driver": np.zeros(2), "authority": np.ones(1)})
    assert terminated
    assert info["crashed"]


def test_observations_are_bounded_and_new():
    env = gym.make(IDS[0])
    env.action_space.seed(0)
    previous, _ = env.reset(seed=0)
    for _ in range(100):
        observation, _, terminated, _, _ = env.step(env.action_space.sample())
        assert env.observation_space.contains(observation)
        assert observation is not previous
        previous = observation
        if terminated:
            break


def test_observation_does_not_know_the_fault():
    healthy = TwoLaneEnv({"faults": []})
    faulty = TwoLaneEnv({"authority": {"law": "driver_only"}})
    healthy.configure({"authority": {"law": "driver_only"}})
    action = {"driver": np.array([0.1, 0.05]), "authority": np.array([0.5])}
    for env in (healthy, faulty):
        env.reset(seed=0)
    for _ in range(60):
        a, b = healthy.step(action), faulty.step(action)
        np.testing.assert_array_equal(a[0], b[0])
    assert b[4]["fault_active"]
    assert not a[4]["fault_active"]
    assert b[4]["fault"][1] == pytest.approx(0.3)


def test_info_arrays_are_not_aliased():
    env = gym.make(IDS[0])
    env.reset(seed=0)
    _, _, _, _, info = env.step(np.zeros(2, dtype=np.float32))
    kept = copy.deepcopy(info)
    env.step(np.ones(2, dtype=np.float32))
    assert_same(info, kept)


def test_info_carries_every_signal_as_plain_values():
    env = DriverModel(gym.make(IDS[0]))
    _, reset_info = env.reset(seed=0)
    _, _, _, _, info = env.step(0)
    assert reset_info.keys() == info.keys()
    for name in ("u_a_des", "u_a_f", "u_a_act", "u_h_des", "u_h_act", "u"):
        assert info[name].shape == (2,)
    for name in ("r_x", "r_y", "alpha_a", "t"):
        assert type(info[name]) is float
    assert info["prediction"].shape == (6,)
    assert type(info["fault_active"]) is bool
    assert list(info["rewards"]) == list(TERMS)
    assert info["safe_area_lower"].shape == info["safe_area_upper"].shape


def test_signals_of_info_obey_the_closed_loop():
    env = DriverModel(gym.make(IDS[0], config={"authority": {"law": "none"}}))
    env.reset(seed=0)
    phi, held = np.exp(-0.05 / 0.2), np.zeros(2)
    for _ in range(60):
        _, _, _, _, info = env.step(0)
        np.testing.assert_allclose(info["u_h_act"], held, atol=1e-12)
        np.testing.assert_allclose(info["u"], info["u_a_act"] + info["u_h_act"], atol=1e-12)
        np.testing.assert_array_equal(info["u_a_act"], info["u_a_f"])
        held = phi * info["u_h_act"] + (1.0 - phi) * (info["u_h_des"] - info["u_a_act"])


def test_episode_ends_by_whole_steps():
    env = gym.make(IDS[0], config={"duration": 0.3, "faults": []})
    env.reset(seed=0)
    ends = [env.step(np.zeros(2, dtype=np.float32))[2:4] for _ in range(6)]
    assert ends == [(False, False)] * 5 + [(False, True)]


def test_driving_on_past_the_end_stays_truncated():
    env = gym.make(IDS[0], config={"duration": 0.1, "faults": []}, render_mode="rgb_array")
    env.reset(seed=0)
    ends = [env.step(np.zeros(2, dtype=np.float32))[3] for _ in range(5)]
    assert ends == [False, True, True, True, True]
    assert env.render().any()


def test_leaving_the_lane_is_counted_and_leaving_the_road_ends():
    env = TwoLaneEnv({"faults": [], "authority": {"law": "driver_only"}, "vehicles": []})
    env.reset(seed=0)
    steer = {"driver": np.array([0.0, 0.1]), "authority": np.zeros(1)}
    terminated = False
    seen_outside_lane = False
    while not terminated:
        _, reward, terminated, truncated, info = env.step(steer)
        seen_outside_lane |= not info["in_lane"] and not terminated
        assert not truncated
    assert seen_outside_lane
    assert info["lane_departures"] == 1
    assert not info["on_road"]
    assert not info["crashed"]
    assert reward < -40.0


def test_a_collision_ends():
    env = TwoLaneEnv({"authority": {"law": "driver_only"}, "vehicles": [{"lane": 0, "position": 20.0, "speed": 0.0}]})
    env.reset(seed=0)
    done = False
    while not done:
        _, _, terminated, truncated, info = env.step({"driver": np.zeros(2), "authority": np.zeros(1)})
        done = terminated or truncated
    assert info["crashed"]
    assert terminated


def total_reward(env, command, duration=10.0):
    env.reset(seed=0)
    total, done = 0.0, False
    while not done:
        _, reward, terminated, truncated, _ = env.step({"driver": command(env), "authority": np.zeros(1)})
        total += reward
        done = terminated or truncated
    return total


def test_neither_standing_still_nor_turning_nor_driving_off_pays():
    config = {"faults": [], "authority": {"law": "driver_only"}, "vehicles": []}
    brake = total_reward(TwoLaneEnv(config), lambda env: np.array([-1.0, 0.0]))
    stand = total_reward(TwoLaneEnv({**config, "ego": {"speed": 0.0}}), lambda env: np.zeros(2))
    off = total_reward(TwoLaneEnv(config), lambda env: np.array([0.0, 0.2]))
    circle = total_reward(
        TwoLaneEnv({**config, "ego": {"speed": 2.0}, "road": {"lanes": 5}}), lambda env: np.array([0.0, 1.0])
    )
    drive = DriverModel(AuthorityLimiter(TwoLaneEnv({"vehicles": []})))
    drive.reset(seed=0)
    good = sum(drive.step(0)[1] for _ in range(200))
    assert max(brake, stand, off, circle) < 0.0
    assert good > 150.0


@pytest.mark.parametrize("cls", [TwoLaneEnv, CurveEnv])
def test_highway_envs_own_traffic_drives_along(cls):
    env = cls({"other_vehicles_type": "highway_env.vehicle.behavior.IDMVehicle", "driver_lag": {"K_h": 0.0}})
    env.reset(seed=0)
    for _ in range(60):
        _, _, terminated, _, info = env.step({"driver": np.zeros(2), "authority": np.ones(1)})
        assert not terminated
    assert np.isfinite(info["r_x"])


def test_options_change_the_config_from_this_episode_on():
    env = gym.make(IDS[0])
    env.reset(seed=0, options={"config": {"ego": {"speed": 10.0}}})
    assert env.unwrapped.vehicle.speed == 10.0
    env.reset()
    assert env.unwrapped.vehicle.speed == 10.0


def test_faster_simulation_than_policy():
    coarse = TwoLaneEnv({"duration": 2.0})
    fine = TwoLaneEnv({"duration": 2.0, "simulation_frequency": 100})
    action = {"driver": np.array([0.2, 0.01]), "authority": np.ones(1)}
    for env in (coarse, fine):
        env.reset(seed=0)
        for _ in range(20):
            env.step(action)
    np.testing.assert_allclose(coarse.vehicle.array, fine.vehicle.array, atol=5e-3)


def test_gymnasium_step_api_after_reset_seed_of_action_space():
    env = gym.make(IDS[0])
    env.action_space.seed(7)
    first = env.action_space.sample()
    env.action_space.seed(7)
    env.reset(seed=0)
    env.reset()
    np.testing.assert_array_equal(env.action_space.sample(), first)


def test_highway_env_is_imported_without_pandas_and_pyplot_which_work_all_the_same():
    code = (
        "import sys, gymnasium as gym, shared_control_env\n"
        "gym.make('SharedControl/TwoLane-v1').reset(seed=0)\n"
        "print([name for name in ('pandas', 'matplotlib.pyplot') if name in sys.modules])\n"
        "import pandas.testing, matplotlib.pyplot as plt\n"
        "from highway_env.envs.common import observation\n"
        "assert observation.pd.DataFrame is pandas.DataFrame and plt.figure\n"
        "env = gym.make('highway-v0'); env.reset(seed=0); env.step(1)\n"
    )
    result = subprocess.run([sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    assert result.stdout.strip() == "[]"


@pytest.mark.parametrize("name", ENVIRONMENTS)
@pytest.mark.filterwarnings("ignore:.*is out of date")
def test_the_version_before_names_this_one(name):
    with pytest.raises(gym.error.DeprecatedEnv, match=f"Please use `{name}` instead"):
        gym.make(name.replace("-v1", "-v0"))
