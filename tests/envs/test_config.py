"""Bad input is refused before anything moves, with the field, the value and the allowed range."""

import gymnasium as gym
import numpy as np
import pytest

import shared_control_env  # noqa: F401
from shared_control_env.envs import TwoLaneEnv

BAD = [
    ({"duratoin": 5.0}, "duration"),
    ({"authority": {"lwa": "paper"}}, "'law'"),
    ({"vehicle": {"mas": 1.0}}, r"\['mas'\]"),
    ({"authority": {"law": "papr"}}, "'paper'"),
    ({"authority": "paper"}, "must be a dict"),
    ({"duration": "long"}, r"config\['duration'\] = 'long'"),
    ({"duration": True}, r"config\['duration'\] = True"),
    ({"duration": -1.0}, r"config\['duration'\] = -1.0: .*greater than 0"),
    ({"duration": float("nan")}, "finite"),
    ({"duration": 0.01}, "at least one step"),
    ({"simulation_frequency": 10}, "multiple of"),
    ({"simulation_frequency": 30}, r"'simulation_frequency'\] = 30"),
    ({"vehicle": {"m": -5.0}}, r"\['vehicle'\]\['m'\] = -5.0"),
    ({"vehicle": {"C_f": 90_000.0, "C_r": 20_000.0}}, "critical speed"),
    ({"limits": {"delta_max": 2.0}}, r"\['delta_max'\] = 2.0"),
    ({"driver_lag": {"T_h": 0.0}}, r"\['T_h'\] = 0.0"),
    ({"automation": {"H_c": 0}}, r"\['H_c'\] = 0"),
    ({"longitudinal_risk": {"preset": "grade"}}, "'graded'"),
    ({"faults": [{"channel": "stering", "onset": 0.5, "ramp": 1.0, "size": 0.3}]}, "'steering'"),
    ({"faults": [{"channel": "steering", "onset": -0.5, "ramp": 1.0, "size": 0.3}]}, "onset"),
    ({"faults": [{"channel": "steering", "onset": 0.5, "ramp": 1.0}]}, r"\['size'\] is missing"),
    ({"faults": [{"channel": "steering", "onset": 0.5, "ramp": 1.0, "size": 0.3, "onst": 1}]}, "'onset'"),
    ({"faults": [{"channel": "steering", "onst": 0.5, "ramp": 1.0, "size": 0.3}]}, "did you mean 'onset'"),
    ({"faults": [{"kind": "loss_of_efectiveness", "onset": 0.5}]}, "did you mean 'loss_of_effectiveness'"),
    ({"faults": [{"kind": "saturation", "onset": 0.5, "size": 1.5}]}, r"\['size'\] = 1.5 must lie in \[0, 1\]"),
    ({"faults": [{"kind": "delay", "onset": 0.5, "size": 1.5}]}, r"\[0, 1\] for delay"),
    ({"faults": [{"kind": "white_noise", "onset": 0.5, "size": -1.0}]}, r"\[0, 3.14159\] for white_noise"),
    ({"faults": [{"kind": "bias", "onset": 0.5, "size": 0.1, "duty": 2.0}]}, r"\['duty'\] = 2.0"),
    ({"degradations": ["stuk"]}, "did you mean 'stuck'"),
    ({"randomise": [{"setting": "ego.sped", "low": 1.0, "high": 2.0}]}, "no setting 'sped'; did you mean 'speed'"),
    ({"randomise": [{"setting": "vehicles.7.speed", "low": 1.0, "high": 2.0}]}, "no setting '7'; valid are 0, 1, 2"),
    ({"randomise": [{"setting": "ego.speed", "low": 3.0, "high": 2.0}]}, "either low <= high, or median"),
    ({"randomise": [{"setting": "ego.speed", "low": 1.0, "high": 2.0, "choices": [1.0]}]}, "either low <= high, or"),
    ({"lane_change": {"onset": 1.0, "lane": 2}}, r"\['lane_change'\]\['lane'\] = 2 must lie in \[0, 1\]"),
    ({"lane_change": {"onset": 1.0, "duration": 0.0, "lane": 1}}, "duration"),
    ({"vehicles": [{"lane": 0, "position": 20.0, "speed": 9.0, "behaviour": "idn"}]}, "did you mean 'idm'"),
    ({"vehicles": [{"lane": 0, "position": 20.0, "speed": 9.0, "brake": {"onset": 1.0}}]}, "deceleration"),
    ({"vehicles": [{"lane": 0, "position": 2.0, "speed": 10.0}]}, "overlaps"),
    ({"vehicles": [{"lane": 5, "position": 20.0, "speed": 10.0}]}, r"\['lane'\] = 5 must lie in \[0, 1\]"),
    ({"vehicles": [{"lane": 1, "position": -80.0, "speed": 10.0}]}, "not on the road"),
    ({"ego": {"lane": 3}}, r"\['lane'\] = 3"),
    ({"ego": {"lateral_offset": 3.0}}, "within the lane"),
    ({"road": {"segments": [{"length": 600.0, "curvature": 1 / 60}]}}, "meet itself"),
    ({"road": {"segments": [{"length": 10.0, "curvature": 0.3}]}}, "too sharp"),
    ({"road": {"segments": []}}, "segments"),
    ({"other_vehicles_type": "highway_env.vehicle.behavior.IDM"}, "other_vehicles_type"),
]


@pytest.mark.parametrize(("config", "message"), BAD, ids=[str(c)[:60] for c, _ in BAD])
def test_refused(config, message):
    with pytest.raises(ValueError, match=message):
        TwoLaneEnv(config)
    env = TwoLaneEnv()
    before = env.config
    with pytest.raises(ValueError, match=message):
        env.reset(options={"config": config})
    assert env.config == before


def test_refused_by_gym_make_too():
    with pytest.raises(ValueError, match="did you mean 'duration'"):
        gym.make("SharedControl/TwoLane-v1", config={"duratoin": 5.0})


def test_supercritical_within_the_models_range_warns():
    with pytest.warns(UserWarning, match="critical speed"):
        TwoLaneEnv({"vehicle": {"l_f": 1.3, "l_r": 1.0}})


def test_merge_is_deep_and_keeps_the_rest():
    env = TwoLaneEnv({"driver_lag": {"K_h": 1.2}})
    assert env.config["driver_lag"] == {"K_h": 1.2, "T_h": 0.2, "direct": False}
    assert len(env.config["vehicles"]) == 3
    assert TwoLaneEnv().config["driver_lag"]["K_h"] == 1.0


def test_whole_numbers_serve_as_floats():
    assert TwoLaneEnv({"duration": 5}).config["duration"] == 5.0


@pytest.mark.parametrize(
    "action",
    [
        {"driver": np.array([np.nan, 0.0]), "authority": np.ones(1)},
        {"driver": np.array([0.0, np.inf]), "authority": np.ones(1)},
        {"driver": np.zeros(3), "authority": np.ones(1)},
        {"driver": np.zeros(2), "authority": np.array([np.nan])},
        {"driver": np.zeros(2)},
        {"driver": np.zeros(2), "authority": np.ones(1), "horn": 1},
        np.zeros(3),
        None,
    ],
    ids=str,
)
def test_malformed_actions_move_nothing(action):
    env = TwoLaneEnv()
    env.reset(seed=0)
    state, signals, memory = env.vehicle.array.copy(), env.signals.copy(), env.memory.copy()
    with pytest.raises(ValueError, match="action"):
        env.step(action)
    np.testing.assert_array_equal(env.vehicle.array, state)
    assert env.signals == signals
    assert env.memory == memory
    assert env.steps == 0


@pytest.mark.parametrize("action", [np.array([np.nan, 0.0]), np.zeros(3), np.zeros((1, 2))])
def test_malformed_actions_of_the_limited_environment(action):
    env = gym.make("SharedControl/TwoLane-v1", disable_env_checker=True)
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"action\['driver'\]"):
        env.step(action)


def test_actions_beyond_the_bounds_are_clipped():
    env = TwoLaneEnv()
    env.reset(seed=0)
    info = env.step({"driver": np.array([7.0, -9.0]), "authority": np.array([2.0])})[4]
    np.testing.assert_allclose(info["u_h_des"], [5.0, -np.pi / 6])
    assert info["alpha_a"] == 1.0


def test_wrong_types_of_the_outer_arguments():
    with pytest.raises(ValueError, match="config = 'none' must be a dict"):
        TwoLaneEnv("none")
    with pytest.raises(ValueError, match="render_mode = 'rgb' must be one of"):
        TwoLaneEnv(render_mode="rgb")
    with pytest.raises(ValueError, match="options = 'x' must be a dict"):
        TwoLaneEnv().reset(options="x")


def test_unknown_options():
    with pytest.raises(ValueError, match="options"):
        TwoLaneEnv().reset(options={"conifg": {}})
