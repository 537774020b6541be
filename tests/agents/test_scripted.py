import gymnasium as gym
import pytest

from agents.scripted import StanleyDriver
from shared_control_env.controllers import Driver
from shared_control_env.registration import ENVIRONMENTS
from shared_control_env.wrappers import DriverModel


def test_is_a_driver():
    assert isinstance(StanleyDriver(), Driver)


@pytest.mark.parametrize("name", ENVIRONMENTS)
@pytest.mark.parametrize("law", ["paper", "proportional"])
def test_keeps_the_lane_under_the_limiter(name, law):
    env = DriverModel(gym.make(name, config={"authority": {"law": law}}), StanleyDriver())
    env.reset(seed=0)
    done = False
    while not done:
        _, _, terminated, truncated, info = env.step(0)
        assert not terminated
        assert info["lane_departures"] == 0
        done = truncated
    assert abs(info["z"][1]) < 1.0
