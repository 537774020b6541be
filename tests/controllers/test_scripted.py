import gymnasium as gym
import numpy as np
import pytest

from shared_control_env.controllers import Driver
from shared_control_env.controllers.scripted import (
    DistractedDriver,
    FightingDriver,
    OverreactingDriver,
    ScriptedDriver,
)
from shared_control_env.core.feedback.observation import DRIVER_V0
from shared_control_env.core.records import SCENE
from shared_control_env.wrappers import DriverModel

ALL = (ScriptedDriver, DistractedDriver, OverreactingDriver, FightingDriver)


def scene_at(y=0.0, v=15.0, t=0.0, felt=(0.0, 0.0), displayed=1.0):
    scene = np.zeros((), SCENE)
    scene["z"][1], scene["z"][3], scene["v_target"], scene["t"] = y, v, 15.0, t
    scene["felt"], scene["displayed"] = felt, displayed
    return scene


def observation():
    return np.zeros(DRIVER_V0.size, dtype=np.float32)


@pytest.mark.parametrize("cls", ALL)
def test_is_a_driver(cls):
    assert isinstance(cls(), Driver)
    assert cls().act(observation(), scene_at()).shape == (2,)


@pytest.mark.parametrize("name", ["SharedControl/TwoLane-v1", "SharedControl/Curve-v1"])
@pytest.mark.parametrize("law", ["paper", "proportional"])
def test_keeps_the_lane_under_the_limiter(name, law):
    env = DriverModel(gym.make(name, config={"authority": {"law": law}}), ScriptedDriver())
    env.reset(seed=0)
    done = False
    while not done:
        _, _, terminated, truncated, info = env.step(0)
        assert not terminated
        assert info["lane_departures"] == 0
        done = truncated
    assert abs(info["z"][1]) < 1.0


@pytest.mark.parametrize("name", ["SharedControl/Bend-v1", "SharedControl/SCurve-v1", "SharedControl/LaneKeeping-v1"])
def test_drives_alone(name):
    config = {"authority": {"law": "driver_only"}, "degradations": ["none"]}
    env = DriverModel(gym.make(name, config=config), ScriptedDriver())
    for seed in range(3):
        env.reset(seed=seed)
        done, largest = False, 0.0
        while not done:
            _, _, terminated, truncated, info = env.step(0)
            largest = max(largest, abs(info["z"][1] - info["y_target"]))
            done = terminated or truncated
        assert not terminated
        assert largest < 1.5


def test_keeps_its_distance():
    scene = scene_at()
    free = ScriptedDriver().act(observation(), scene)[0]
    scene["neighbours"][2], scene["bodies"] = (1.0, 12.0, 0.0, 15.0, 0.0), 5.0
    assert ScriptedDriver().act(observation(), scene)[0] < min(free, -1.0)


def test_distracted_driver_follows_the_wheel_until_attention_is_back():
    driver, felt = DistractedDriver(notice=0.9, reaction=1.0, recovery=0.5), (1.0, 0.2)
    attentive = ScriptedDriver().act(observation(), scene_at(y=1.0))
    np.testing.assert_allclose(driver.act(observation(), scene_at(1.0, t=5.0, felt=felt)), felt)
    driver.act(observation(), scene_at(1.0, t=6.0, felt=felt, displayed=0.5))
    np.testing.assert_allclose(driver.act(observation(), scene_at(1.0, t=6.9, felt=felt)), felt)
    half = driver.act(observation(), scene_at(1.0, t=7.0 + 0.5 * np.log(2.0), felt=felt))
    np.testing.assert_allclose(half, 0.5 * (np.array(felt) + attentive))
    driver.reset()
    np.testing.assert_allclose(driver.act(observation(), scene_at(1.0, t=9.0, felt=felt)), felt)


def test_over_reacting_and_fighting():
    calm = ScriptedDriver().act(observation(), scene_at(y=1.0))
    np.testing.assert_allclose(OverreactingDriver(3.0).act(observation(), scene_at(y=1.0)), 3.0 * calm)
    felt = np.array([0.5, -0.1])
    fought = FightingDriver(2.0).act(observation(), scene_at(y=1.0, felt=felt))
    np.testing.assert_allclose(fought, calm + 2.0 * (calm - felt))
