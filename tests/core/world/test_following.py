"""The speed behind a vehicle, and an automation that keeps its distance by it."""

import gymnasium as gym
import numpy as np
import pytest

from shared_control_env.core.parameters import TaskParameters
from shared_control_env.core.records import NEAR_S, PRESENT
from shared_control_env.core.world.scene import following_speed
from shared_control_env.envs.scenarios import SCENARIOS

KEEPING = TaskParameters(target_speed=20.0, time_headway=1.2, standstill_gap=4.0, closing_time=1.5)
DRAWN = [name for name in SCENARIOS if name not in ("two_lane", "curve", "recorded")]


def test_without_a_headway_it_is_the_other_vehicles():
    task = TaskParameters(target_speed=15.0)
    for gap in (1.0, 100.0):
        assert following_speed(12.0, gap, 15.0, task) == 12.0
    assert following_speed(20.0, 30.0, 15.0, task) == 15.0
    assert following_speed(-1.0, 30.0, 15.0, task) == 0.0


def test_with_a_headway_it_is_the_other_vehicles_at_the_headway():
    assert following_speed(12.0, 4.0 + 1.2 * 12.0, 12.0, KEEPING) == pytest.approx(12.0)
    assert following_speed(12.0, 4.0 + 1.2 * 12.0 + 3.0, 12.0, KEEPING) == pytest.approx(14.0)
    assert following_speed(12.0, 4.0 + 1.2 * 12.0 - 3.0, 12.0, KEEPING) == pytest.approx(10.0)
    assert following_speed(0.0, 4.0, 0.0, KEEPING) == 0.0
    assert following_speed(12.0, 500.0, 12.0, KEEPING) == 20.0
    assert following_speed(5.0, 0.1, 20.0, KEEPING) == 0.0


@pytest.mark.parametrize("name", DRAWN)
def test_a_sound_automation_keeps_its_distance(name):
    """Nobody at the wheel, no limiter, no fault: no failure in 20 seeds, and no headway under 0.6 s.

    From 3 s after the start, or the end of a manoeuvre of the other vehicle or of its own, on.
    """
    config = {
        "faults": [],
        "degradations": [],
        "driver_lag": {"K_h": 0.0},
        "authority": {"law": "none"},
        "task": {"time_headway": 1.2},
    }
    env = gym.make_vec(SCENARIOS[name].id, num_envs=20, driver=True, autoreset_mode="disabled", config=config)
    env.reset(seed=0)
    episodes = env.unwrapped.episodes
    after = np.array([max(3.0, *ends_of(episode)) for episode in episodes])
    least = np.full(20, np.inf)
    for _ in range(episodes[0].steps):
        _, _, terminations, _, infos = env.step(None)
        assert not terminations.any()
        preceding, speed = infos["neighbours"][:, 2], infos["z"][:, 3]
        gap = preceding[:, NEAR_S] - infos["z"][:, 0] - 5.0
        headway = np.where((preceding[:, PRESENT] > 0.0) & (speed > 0.5), gap / np.maximum(speed, 0.5), np.inf)
        least = np.where(infos["t"] >= after, np.minimum(least, headway), least)
    assert least.min() >= 0.6


def ends_of(episode):
    """When the manoeuvres of an episode end [s]."""
    yield 0.0
    for each in (episode, *episode.vehicles):
        if each.lane_change is not None:
            yield each.lane_change.onset + each.lane_change.duration
    for vehicle in episode.vehicles:
        if vehicle.brake is not None:
            yield vehicle.brake.onset + vehicle.speed / vehicle.brake.deceleration
