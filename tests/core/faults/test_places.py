"""Where a degradation acts, and who shares a misperception."""

import gymnasium as gym
import numpy as np
import pytest

from shared_control_env.core.authority.laws import LAWS

BIAS = [{"channel": "steering", "onset": 0.5, "size": 0.2}]


def story(place, law, faults=BIAS, steps=40, **more):
    """Infos of an episode in both kinds of environments, held against one another."""
    config = {"fault_at": place, "authority": {"law": law}, "faults": faults, **more}
    env = gym.make("SharedControl/TwoLane-v1", config=config)
    many = gym.make_vec("SharedControl/TwoLane-v1", num_envs=2, config=config)
    env.reset(seed=0)
    many.reset(seed=0)
    infos = []
    for _ in range(steps):
        info = env.step(np.zeros(2))[4]
        both = many.step(np.zeros((2, 2)))[4]
        for name in ("u_a_des", "u_a_f", "u_a_act", "u", "fault", "r_y", "alpha_a", "z"):
            np.testing.assert_array_equal(both[name][1], info[name])
        infos.append(info)
    return infos


@pytest.mark.parametrize("law", ["proportional", "none"])
def test_at_the_planner_the_desired_command_is_wrong_and_nobody_knows(law):
    for info in story("planner", law):
        np.testing.assert_array_equal(info["u_a_des"], info["u_a_f"])
        assert info["fault"][1] == pytest.approx(0.2 if info["t"] >= 0.5 else 0.0)
    assert info["alpha_a"] < 0.5  # the risk is that of the wrong command


@pytest.mark.parametrize("law", LAWS)
def test_at_the_actuator_the_limiter_sees_nothing_and_cannot_help(law):
    infos = story("actuator", law)
    bound = np.radians(30.0)
    for info in infos:
        np.testing.assert_array_equal(info["u_a_des"], info["u_a_f"])
        expected = 0.2 if info["t"] >= 0.5 else 0.0
        assert info["fault"][1] == pytest.approx(expected)
        if law == "driver_only":
            assert info["u_a_act"][1] == pytest.approx(expected)
        if law == "none":
            assert info["u_a_act"][1] == pytest.approx(np.clip(info["u_a_des"][1] + expected, -bound, bound))
    assert infos[10]["alpha_a"] > 0.9  # at the onset the monitor trusts the sound command


@pytest.mark.parametrize("law", LAWS)
def test_at_the_command_it_is_as_the_paper_has_it(law):
    plain = {"authority": {"law": law}, "faults": BIAS}
    env = gym.make("SharedControl/TwoLane-v1", config=plain)
    env.reset(seed=0)
    for info in story("command", law):
        other = env.step(np.zeros(2))[4]
        np.testing.assert_array_equal(info["state"], other["state"])
        np.testing.assert_array_equal(info["fault"], info["u_a_f"] - info["u_a_des"])


def test_a_law_that_needs_the_sound_command_is_refused_at_the_planner():
    with pytest.raises(ValueError, match=r"'fault_at'\] = 'planner' does not go with .*'paper'"):
        gym.make("SharedControl/TwoLane-v1", config={"fault_at": "planner"})


def test_stuck_at_the_actuator_holds_the_limited_command():
    infos = story("actuator", "proportional", [{"kind": "stuck", "channel": "both", "onset": 0.3}])
    held = infos[6]["u_a_act"]
    for info in infos[6:]:
        np.testing.assert_array_equal(info["u_a_act"], held)


def test_a_shared_misperception_hides_the_risk():
    offset = [{"kind": "lane_offset", "onset": 0.2, "size": 1.5}]
    alone = story("command", "proportional", offset, 60)
    shared = story("command", "proportional", offset, 60, misperception="shared")
    assert min(info["alpha_a"] for info in alone) < 0.5
    assert np.mean([info["alpha_a"] for info in shared[20:]]) > np.mean([info["alpha_a"] for info in alone[20:]]) + 0.2


def test_a_missed_lead_is_missed_by_the_monitor_too():
    missed = [{"kind": "missed_lead", "onset": 0.2}]
    lead = {"vehicles": [{"lane": 0, "position": 12.0, "speed": 8.0}]}
    alone = story("command", "none", missed, 12, **lead)
    shared = story("command", "none", missed, 12, misperception="shared", **lead)
    assert alone[-1]["r_x"] > 0.3
    assert shared[-1]["r_x"] == 0.0
