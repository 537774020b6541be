"""Every setting of the schema, changed by itself, changes something that can be observed, or is refused by name."""

import copy
import warnings

import gymnasium as gym
import numpy as np
import pytest

from shared_control_env.envs import settings as configuration
from shared_control_env.envs.settings import Settings
from shared_control_env.envs.settings.checks import NOT_DRAWN
from shared_control_env.wrappers import DriverModel
from tests import extras


@pytest.fixture(scope="module", autouse=True)
def _extras():
    with extras.added():
        yield


# A scenario in which every section has something to do: a lane change in traffic that changes lanes and brakes, under
# two faults, with the predictive driver at the wheel and the law that needs alpha_a.
BUSY = {
    "duration": 1.5,
    "ego": {"lateral_offset": 0.5},
    "lane_change": {"onset": 0.2, "duration": 3.0, "lane": 1},
    "vehicles": [
        {"lane": 0, "position": 14.0, "speed": 9.0, "brake": {"onset": 0.3, "deceleration": 2.0}},
        {"lane": 1, "position": 14.0, "speed": 11.0, "behaviour": "idm", "desired_speed": 13.0},
        {"lane": 1, "position": -9.0, "speed": 16.0, "lane_change": {"onset": 0.3, "duration": 2.0, "lane": 0}},
    ],
    "faults": [
        {"kind": "bias", "channel": "steering", "onset": 0.2, "ramp": 0.5, "duration": 3.0, "size": 0.1, "period": 0.4},
        {"kind": "coloured_noise", "channel": "acceleration", "onset": 0.1, "size": 1.0, "seed": 3},
        {"kind": "oscillation", "channel": "acceleration", "onset": 0.1, "size": 1.0},
    ],
    "degradations": [],
    "randomise": [{"setting": "task.target_speed", "low": 12.0, "high": 14.0}],
    "authority": {"law": "proportional"},
    "driver_lag": {"T_h": 0.1},
}

# What each setting needs beside it to act, and the value to try where the rule below finds none.
RESTING = {
    "person": {"active": True, "engaged": False, "seed": 5, "response": 0.3},
    "internal_model": {"active": True},
    "duration": 3.0,
    "lane_change": None,
    "ego": {"lateral_offset": 0.3},
    "vehicles": [{"lane": 0, "position": 30.0, "speed": 12.0}],
    "faults": [{"channel": "steering", "onset": 0.5, "ramp": 1.5, "size": 0.15}],
    "randomise": [],
}
BESIDE = {
    "ego.lane": {"road": {"lanes": 3}},
    "longitudinal_risk.sigma_x": {"longitudinal_risk": {"preset": "paper"}},
    "longitudinal_risk.preset": {},
    "law_tolerances.tolerance_a": {"authority": {"law": "paper"}},
    "law_tolerances.tolerance_delta": {"authority": {"law": "paper"}},
    "safe_area.look_ahead": {"vehicles": [], "randomise": []},
    "authority.operators": {},
    "misperception": {"faults": [{"kind": "lane_offset", "onset": 0.1, "size": 2.0}]},
    "degradations": {"duration": 4.0, "vehicles": [], "faults": [], "randomise": []},
    "task.target_speed": {"randomise": []},
    "reward.conflict": {"authority": {"law": "none"}},
    "task.standstill_gap": {"task": {"time_headway": 1.2}, "randomise": []},
    "task.closing_time": {"task": {"time_headway": 1.2}, "randomise": []},
    "authority.strict": {
        "authority": {"law": "paper"},
        "longitudinal_risk": {"preset": "paper"},
        "lane_change": None,
        "vehicles": [],
        "faults": [{"kind": "loss_of_effectiveness", "onset": 0.0, "size": 0.5}],
        "driver_lag": {"K_h": 0.0},
    },
    **{
        f"person.{name}": {"person": {"active": True, "seed": 5}}
        for name in ("engaged", "delay", "weber", "noise_time", "arm_noise", "seed")
    },
    **{
        f"person.{name}": RESTING
        for name in ("lane_position", "heading", "headway", "felt_steering", "felt_acceleration", "display")
    },
    "person.response": RESTING,
    "person.response_spread": RESTING,
    "vehicle.mu": {"vehicle": {"tyre": extras.TYRE}},
    "model.mu": {"vehicle": {"tyre": extras.TYRE}},
    "internal_model.K_h": {"internal_model": {"active": True}},
    "internal_model.T_h": {"internal_model": {"active": True}},
}
VALUES = {
    "road.segments": [{"length": 30.0, "curvature": 0.0}, {"length": 100.0, "curvature": 0.01}],
    "other_vehicles_type": "highway_env.vehicle.kinematics.Vehicle",
    "centering_position": [0.5, 0.5],
    "vehicles": [],
    "faults": [],
    "degradations": ["step_bias"],
    "fault_at": "actuator",
    "misperception": "shared",
    "randomise": [],
    "lane_change": None,
    "policy_frequency": 10,
    "simulation_frequency": 40,
    "offscreen_rendering": False,
    "road.lanes": 3,
    "ego.lane": 2,
    "duration": 1.0,
    "law_tolerances.tolerance_a": 3.0,
    "law_tolerances.tolerance_delta": 0.3,
    "longitudinal_risk.b": 1.0,
    "task.target_speed": 5.0,
    "vehicle.l_r": 1.1,
    "vehicle.C_r": 70_000.0,
    "vehicle.tyre": extras.TYRE,
    "vehicle.mu": 0.2,
    "model.m": 1500.0,
    "model.I_z": 2000.0,
    "model.l_f": 1.1,
    "model.l_r": 1.2,
    "model.C_f": 50_000.0,
    "model.C_r": 90_000.0,
    "model.mu": 0.1,
    "model.tyre": extras.TYRE,
    "actuator.acceleration_lag": 0.3,
    "actuator.steering_lag": 0.3,
    "actuator.acceleration_rate": 1.0,
    "actuator.steering_rate": 0.05,
    "persons": ["attentive"],
    "recording": {"file": "example", "ego": None, "drawn": False},
    "observation.type": extras.OBSERVATION,
    "reward_terms": [{"term": extras.TERM, "weight": 1.0}],
    "person.lane_position": 0.2,
    "person.heading": 0.003,
    "person.headway": 3.0,
    "person.felt_steering": 0.005,
    "person.felt_acceleration": 0.2,
    "person.display": 0.99,
    "person.seed": 6,
    "internal_model.K_h": 0.7,
    "internal_model.T_h": 0.3,
}
# Refused beside these settings, by name; what is told is checked too.
REFUSED = {
    "other_vehicles_type": "knows no plans",
    "neighbour_vehicles_connected_lanes": "would not act",
    "driver_lag.direct": "a direct driver has an arm",
    "recording": "would not act: the recording",
}
# Acts on the clock or on a window alone.
NOT_SEEN = {"real_time_rendering", "offscreen_rendering"}


def leaves(section, path=""):
    for name, field in section.model_fields.items():
        kind = field.annotation
        if hasattr(kind, "model_fields"):
            yield from leaves(kind, f"{path}{name}.")
        else:
            yield f"{path}{name}"


LEAVES = list(leaves(Settings))


def nested(path, value):
    first, _, rest = path.partition(".")
    return {first: nested(rest, value) if rest else value}


def tried(call):
    """What a call gives, and the ValueError that it raises instead."""
    try:
        return call(), None
    except ValueError as error:
        return None, error


def other(value):
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return value + 1
    if isinstance(value, float):
        return 0.7 * value if value else 0.5
    raise AssertionError(value)


def observed(config):
    """All that a seeded episode shows: length, observations, rewards, infos, two pictures."""
    env = DriverModel(gym.make("SharedControl/TwoLane-v1", render_mode="rgb_array", config=config))
    trace = [env.reset(seed=1), env.render()]
    done = False
    while not done:
        trace.append(env.step(0))
        done = trace[-1][2] or trace[-1][3]
    trace.append(env.render())
    env.close()
    return flat(trace)


def flat(value):
    if isinstance(value, dict):
        return b"".join(flat(value[key]) for key in sorted(value))
    if isinstance(value, list | tuple):
        return b"".join(flat(item) for item in value)
    return np.asarray(value).tobytes()


@pytest.fixture(scope="module")
def plainly():
    return {}


@pytest.mark.parametrize("path", LEAVES)
def test_it_acts_or_is_refused(path, plainly):
    beside = {**BUSY, **BESIDE.get(path, {})}
    before = configuration.merge(configuration.plain(Settings()), beside)
    value = VALUES[path] if path in VALUES else other_value(path, before)
    changes = configuration.merge(before, nested(path, value))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of cars that would be unstable at 40 m/s
        if path in REFUSED:
            with pytest.raises(ValueError, match=REFUSED[path]):
                observed(changes)
            return
        key = str(BESIDE.get(path))
        if key not in plainly:
            plainly[key] = observed(before)
        if path in NOT_SEEN:
            return
        assert observed(changes) != plainly[key], f"{path} = {value!r} changes nothing"


def other_value(path, config):
    value = configuration.changes.at(config, tuple(path.split(".")))
    if isinstance(value, str):
        choices = {"authority.law": "none", "authority.operators": "min-max", "longitudinal_risk.preset": "paper"}
        return choices[path]
    return other(value)


@pytest.mark.parametrize("path", [path for path in LEAVES if path.split(".")[0] not in NOT_DRAWN])
def test_it_can_be_drawn_or_is_refused(path):
    config = configuration.merge(configuration.plain(Settings()), {**BUSY, "randomise": []})
    config = configuration.merge(config, BESIDE.get(path, {}))
    present = configuration.changes.at(config, tuple(path.split(".")))
    if not is_number(VALUES.get(path, present)):
        with pytest.raises(ValueError, match=r"no number|must have|valid string"):
            configuration.check({**config, "randomise": [{"setting": path, "low": 0.0, "high": 1.0}]})
        return
    value = VALUES[path] if path in VALUES else other(present)
    config["randomise"] = [{"setting": path, "choices": [value]}]
    env, error = tried(lambda: gym.make("SharedControl/TwoLane-v1", config=config))
    if error is None:
        _, error = tried(lambda: env.reset(seed=0))
    if error is not None:
        assert path.split(".")[-1] in str(error) or "Hz" in str(error)
        return
    found = configuration.changes.at(configuration.plain(env.unwrapped.episode), tuple(path.split(".")))
    assert found == value


def is_number(value):
    return isinstance(value, int | float) and not isinstance(value, bool)


@pytest.mark.parametrize("path", LEAVES)
def test_assigned_to_the_config_it_counts_from_the_next_reset_on(path):
    busy = {**BUSY, **BESIDE.get(path, {})}
    env = gym.make("SharedControl/TwoLane-v1", config=busy).unwrapped
    config = configuration.merge(configuration.plain(Settings()), BUSY)
    value = VALUES[path] if path in VALUES else other_value(path, config)
    *sections, last = path.split(".")
    place = env.config
    for name in sections:
        place = place[name]
    place[last] = value
    _, error = tried(lambda: env.reset(seed=0))
    if error is not None:
        assert last in str(error) or path in REFUSED
        return
    assert configuration.changes.at(env.config, tuple(path.split("."))) == value
    assert configuration.changes.at(configuration.plain(env.settings), tuple(path.split("."))) == value


def test_configure_in_the_middle_of_an_episode_waits_for_the_next():
    steady, changed = (gym.make("SharedControl/TwoLane-v1") for _ in range(2))
    for env in (steady, changed):
        env.reset(seed=0)
    changed.unwrapped.configure({"simulation_frequency": 100, "duration": 1.0, "authority": {"law": "none"}})
    for _ in range(40):
        a, b = steady.step(np.zeros(2)), changed.step(np.zeros(2))
        assert flat(a) == flat(b)
    changed.reset(seed=0)
    assert changed.unwrapped.episode.duration == 1.0


EVERY = [
    "SharedControl/LaneKeeping-v1",
    "SharedControl/LaneChange-v1",
    "SharedControl/Bend-v1",
    "SharedControl/CutIn-v1",
]


@pytest.mark.parametrize("name", EVERY)
@pytest.mark.parametrize("make", [gym.make, lambda name, config: gym.make_vec(name, num_envs=2, config=config)])
def test_what_is_set_by_name_is_not_drawn(name, make):
    env = make(name, config={"ego": {"speed": 11.5}})
    for seed in range(3):
        speed = env.reset(seed=seed)[1]["speed"]
        assert np.all(np.asarray(speed) == 11.5)
    drawn = {entry["setting"] for entry in env.unwrapped.config["randomise"]}
    assert "ego.speed" not in drawn
    assert drawn  # the rest still is


def test_a_setting_both_set_and_drawn_is_refused_by_name():
    draws = [{"setting": "ego.speed", "low": 10.0, "high": 12.0}]
    with pytest.raises(ValueError, match=r"'randomise'\]\[0\] draws 'ego.speed', which is set to 20.0 too"):
        gym.make("SharedControl/TwoLane-v1", config={"ego": {"speed": 20.0}, "randomise": draws})


def test_a_whole_section_set_by_name_is_not_drawn():
    env = gym.make("SharedControl/LaneKeeping-v1", config={"vehicles": []})
    env.reset(seed=0)
    assert not any(entry["setting"].startswith("vehicles") for entry in env.unwrapped.config["randomise"])
    env = gym.make("SharedControl/LaneChange-v1", config={"lane_change": None})
    env.reset(seed=0)
    assert env.unwrapped.episode.lane_change is None


def test_a_whole_config_that_was_edited_acts_or_is_refused():
    name = "SharedControl/CutIn-v1"
    config = copy.deepcopy(gym.make(name).unwrapped.config)
    again = gym.make(name, config=config)
    np.testing.assert_array_equal(again.reset(seed=4)[0], gym.make(name).reset(seed=4)[0])
    config["ego"]["speed"] = 20.0
    with pytest.raises(ValueError, match=r"draws 'ego\.speed', which is set to 20\.0 too"):
        gym.make(name, config=config)
    config["randomise"] = []
    assert gym.make(name, config=config).reset(seed=4)[1]["speed"] == 20.0


def test_a_setting_cannot_be_taken_away():
    env = gym.make("SharedControl/Bend-v1").unwrapped
    del env.config["randomise"]
    with pytest.raises(ValueError, match="config lacks 'randomise'"):
        env.reset(seed=0)


DRAWS = {
    "no choices": ({"setting": "ego.speed", "choices": []}, "choices"),
    "both": ({"setting": "ego.speed", "low": 1.0, "high": 2.0, "choices": [1.0]}, "must have either"),
    "half": ({"setting": "ego.speed", "low": 1.0}, "must have either"),
    "two ways": ({"setting": "ego.speed", "median": 1.0, "spread": 0.1, "low": 1.0}, "must have either"),
    "a seed": ({"setting": "person.seed", "low": 0, "high": 9}, "cannot be drawn"),
    "another spelling": ({"setting": "vehicles.00.speed", "low": 9.0, "high": 10.0}, "no setting '00'"),
    "a frequency": ({"setting": "policy_frequency", "choices": [10, 20]}, "cannot be drawn"),
    "too wide": ({"setting": "ego.speed", "median": 30.0, "spread": 1.0}, "draws a value that is not allowed"),
}


@pytest.mark.parametrize(("entry", "message"), DRAWS.values(), ids=list(DRAWS))
def test_what_cannot_be_drawn_is_refused(entry, message):
    with pytest.raises(ValueError, match=message):
        gym.make("SharedControl/TwoLane-v1", config={"randomise": [entry]})


def test_a_setting_is_drawn_once_and_one_left_at_its_default_too():
    twice = [{"setting": "ego.speed", "low": 9.0, "high": 10.0}] * 2
    with pytest.raises(ValueError, match="as entry 0 does"):
        gym.make("SharedControl/TwoLane-v1", config={"randomise": twice})
    fault = {
        "faults": [{"onset": 0.5, "size": 0.1}],
        "randomise": [{"setting": "faults.0.ramp", "low": 0.5, "high": 1.0}],
    }
    env = gym.make("SharedControl/TwoLane-v1", config=fault)
    env.reset(seed=0)
    assert 0.5 <= env.unwrapped.episode.faults[0].ramp <= 1.0


@pytest.mark.parametrize("config", [[], 0, "", False])
def test_what_is_no_config_is_refused(config):
    for make in (gym.make, lambda name, config: gym.make_vec(name, num_envs=1, config=config)):
        with pytest.raises(ValueError, match="must be a dict"):
            make("SharedControl/TwoLane-v1", config=config)


@pytest.mark.parametrize("key", ["duration", "randomise"])
def test_the_kernels_config_says_that_it_is_read_only(key):
    env = gym.make_vec("SharedControl/TwoLane-v1", num_envs=1)
    with pytest.raises(TypeError, match="read only"):
        env.unwrapped.config[key] = 1.0
    with pytest.raises(TypeError, match="read only"):
        env.unwrapped.config["ego"]["speed"] = 1.0
    with pytest.raises(TypeError, match="read only"):
        env.unwrapped.config["vehicles"][0]["speed"] = 1.0
    with pytest.raises(TypeError, match="read only"):
        env.unwrapped.config["faults"].append({})


def test_the_kernel_refuses_to_draw_what_all_share():
    draws = [{"setting": "duration", "low": 1.0, "high": 2.0}]
    with pytest.raises(ValueError, match=r"'duration' is shared by all"):
        gym.make_vec("SharedControl/TwoLane-v1", num_envs=2, config={"randomise": draws})
    env = gym.make("SharedControl/TwoLane-v1", config={"randomise": draws, "faults": []})
    env.reset(seed=0)
    steps = 0
    truncated = False
    while not truncated:
        truncated = env.step(np.zeros(2))[3]
        steps += 1
    assert steps == env.unwrapped.episode.steps
    assert 20 <= steps <= 40


def test_whole_numbers_are_drawn_with_both_ends():
    draws = [{"setting": "automation.H_p", "low": 5, "high": 7}]
    env = gym.make("SharedControl/TwoLane-v1", config={"randomise": draws})
    seen = set()
    for seed in range(40):
        env.reset(seed=seed)
        seen.add(env.unwrapped.episode.automation.H_p)
    assert seen == {5, 6, 7}


SHARED = {
    "fault sizes": ({"faults": [{"kind": "stuck", "onset": 1.0, "size": 0.5}]}, "size'\\] = 0.5 would not act"),
    "duty": ({"faults": [{"onset": 1.0, "size": 0.1, "duty": 0.2}]}, "needs a 'period'"),
    "frequency": ({"faults": [{"onset": 1.0, "size": 0.1, "frequency": 2.0}]}, "bias has none"),
    "noise seed": ({"faults": [{"onset": 1.0, "size": 0.1, "seed": 2}]}, "draws nothing"),
    "perceptual channel": (
        {"faults": [{"kind": "lane_offset", "channel": "both", "onset": 1.0, "size": 0.1}]},
        "acts on no channel",
    ),
    "desired speed": ({"vehicles": [{"lane": 0, "position": 20.0, "speed": 9.0, "desired_speed": 3.0}]}, "'idm'"),
    "change to the own lane": (
        {"vehicles": [{"lane": 0, "position": 20.0, "speed": 9.0, "lane_change": {"onset": 1.0, "lane": 0}}]},
        "in that lane",
    ),
    "width of the other field": ({"longitudinal_risk": {"sigma_x": 3.0}}, "preset 'paper'"),
    "weights of a change": ({"longitudinal_risk": {"w_f_change": 0.3}}, "no config\\['lane_change'\\]"),
    "tolerance of another law": (
        {"authority": {"law": "none"}, "law_tolerances": {"tolerance_a": 1.0}},
        "the law is 'none'",
    ),
    "field of the driver": ({"driver": {"R": 1.0}}, "'R'\\] is not a setting"),
}


@pytest.mark.parametrize(("config", "message"), SHARED.values(), ids=list(SHARED))
def test_what_would_not_act_is_refused(config, message):
    with pytest.raises(ValueError, match=message):
        gym.make("SharedControl/TwoLane-v1", config=config)
