"""What is drawn at the start of an episode."""

import gymnasium as gym
import numpy as np
import pytest

from shared_control_env.core.parameters import Limits
from shared_control_env.envs import TwoLaneEnv
from shared_control_env.envs.degradations import DEGRADATIONS, draw_degradation
from shared_control_env.envs.episode import draw_episode, is_random
from shared_control_env.envs.scenarios import SCENARIOS
from shared_control_env.envs.settings import Settings, check, merge, plain
from shared_control_env.registration import ENVIRONMENTS

DRAWN = [name for name, case in SCENARIOS.items() if case.settings.get("randomise")]


def settings_of(name):
    return check(merge(plain(Settings()), SCENARIOS[name].settings))


def at(settings, path):
    value = plain(settings)
    for key in path.split("."):
        value = value[int(key)] if isinstance(value, list) else value[key]
    return value


def test_every_registered_id_has_its_case():
    assert {id: SCENARIOS[name].id for id, name in ENVIRONMENTS.items()} == {id: id for id in ENVIRONMENTS}


@pytest.mark.parametrize("name", ["two_lane", "curve"])
def test_the_papers_cases_draw_nothing(name):
    settings, rng = settings_of(name), np.random.default_rng(0)
    before = rng.bit_generator.state
    assert not is_random(settings)
    assert draw_episode(settings, rng) is settings
    assert rng.bit_generator.state == before


@pytest.mark.parametrize("name", DRAWN)
def test_draws_lie_in_the_published_ranges_and_fill_them(name):
    settings, rng = settings_of(name), np.random.default_rng(1)
    episodes = [draw_episode(settings, rng) for _ in range(60)]
    for entry in settings.randomise:
        values = np.array([at(episode, entry.setting) for episode in episodes])
        if entry.choices:
            assert set(values) <= set(entry.choices)
            assert len(set(values)) > len(entry.choices) / 2
        else:
            assert entry.low <= values.min() <= values.max() <= entry.high
            assert np.ptp(values) > 0.7 * (entry.high - entry.low)
    assert not any(is_random(episode) for episode in episodes)


@pytest.mark.parametrize("name", DEGRADATIONS)
def test_every_degradation_can_be_drawn_and_is_accepted(name):
    rng = np.random.default_rng(2)
    for _ in range(20):
        config = merge(plain(Settings()), {"faults": draw_degradation(name, Limits(), rng)})
        assert len(check(config).faults) == (0 if name == "none" else 1)


def test_draws_take_the_same_numbers_whatever_the_degradation():
    generators = [np.random.default_rng(3) for _ in DEGRADATIONS]
    for name, rng in zip(DEGRADATIONS, generators, strict=True):
        draw_degradation(name, Limits(), rng)
    assert len({rng.random() for rng in generators}) == 1


@pytest.mark.parametrize("name", ["SharedControl/LaneKeeping-v1", "SharedControl/DenseTraffic-v1"])
def test_same_seed_same_episodes_and_another_seed_others(name):
    def first_two(seed):
        env = gym.make(name)
        env.reset(seed=seed)
        first = env.unwrapped.episode
        env.reset()
        return first, env.unwrapped.episode

    assert first_two(4) == first_two(4)
    assert first_two(4)[0] != first_two(5)[0]
    assert first_two(4)[0] != first_two(4)[1]


def test_degradations_come_after_the_faults_that_are_given():
    fault = {"kind": "white_noise", "channel": "steering", "onset": 1.0, "size": 0.1}
    env = TwoLaneEnv({"faults": [fault], "degradations": ["stuck"]})
    env.reset(seed=0)
    faults = env.episode.faults
    assert [f.kind for f in faults] == ["white_noise", "stuck"]
    assert faults[0].seed is not None
    env.reset(seed=0)
    assert env.episode.faults == faults


def test_ground_truth_is_in_info_and_the_label_not_in_the_observation():
    config = {"degradations": [], "randomise": []}
    fault = {"kind": "lane_offset", "onset": 0.0, "size": 1.5}
    healthy, misled = (
        gym.make("SharedControl/LaneKeeping-v1", config={**config, "faults": faults}) for faults in ([], [fault])
    )
    seen = [env.reset(seed=0)[0] for env in (healthy, misled)]
    np.testing.assert_array_equal(*seen)
    info = misled.step(np.zeros(2))[4]
    np.testing.assert_array_equal(info["misperception"], [1.5, 0.0])
    assert info["fault_active"]
    assert info["u_a_des"][1] < -0.01  # it steers away from where it believes to be


def test_missed_lead_drives_at_its_own_speed():
    fault = {"kind": "missed_lead", "onset": 0.0}
    env = TwoLaneEnv({"faults": [fault], "ego": {"speed": 12.0}, "authority": {"law": "none"}})
    info = env.reset(seed=0)[1]
    assert info["misperception"][1] == 1.0
    assert info["u_a_des"][0] > 0.5
    assert info["v_target"] == 12.0


def test_lane_change_moves_the_reference_and_opens_both_lanes():
    env = gym.make("SharedControl/LaneChange-v1", config={"degradations": [], "randomise": []}).unwrapped
    env.reset(seed=0)
    regions, targets, changing = [], [], []
    for _ in range(140):
        regions.append(env.scene["region"].copy())
        targets.append(float(env.scene["y_target"]))
        changing.append(bool(env.scene["changing"]))
        env.step({"driver": np.zeros(2), "authority": np.ones(1)})
    changing, regions = np.array(changing), np.array(regions)
    assert targets[0] == 0.0
    assert targets[-1] == 4.0
    assert (np.diff(targets) >= 0.0).all()
    np.testing.assert_allclose(changing.sum() * 0.05, 4.0, atol=0.1)
    np.testing.assert_array_equal(regions[changing, 2:], np.broadcast_to([-2.0, 6.0], (changing.sum(), 2)))
    np.testing.assert_array_equal(regions[0, 2:], [-2.0, 2.0])
    np.testing.assert_array_equal(regions[-1, 2:], [2.0, 6.0])
    assert env.vehicle.array[1] == pytest.approx(4.0, abs=0.3)
