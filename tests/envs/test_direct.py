"""The driver's slot in the mode ``direct``: u_h,act itself, past Eq. 16."""

import gymnasium as gym
import numpy as np
import pytest

import shared_control_env  # noqa: F401
from shared_control_env.wrappers import DriverModel

DIRECT = {"driver_lag": {"direct": True}}


def test_the_command_acts_at_once_and_unfiltered():
    env = gym.make("SharedControl/Bend-v1", config=DIRECT)
    env.reset(seed=0)
    limits = env.unwrapped.command_limits
    rng = np.random.default_rng(0)
    for _ in range(40):
        action = rng.uniform(-0.2, 0.2, 2).astype(np.float32)
        info = env.step(action)[4]
        np.testing.assert_allclose(info["u_h_act"], action * limits, atol=1e-15)
        np.testing.assert_allclose(info["u"], np.clip(info["u_a_act"] + info["u_h_act"], -limits, limits), atol=1e-15)
        np.testing.assert_allclose(info["u_h_des"], info["u_a_act"] + info["u_h_act"], atol=1e-15)


def test_a_lag_before_the_direct_slot_is_the_lagged_slot():
    """Eq. 16 done outside, with u_h,act into the direct slot, drives as the environment with its own lag."""
    lagged = gym.make("SharedControl/LaneChange-v1", config={"authority": {"law": "proportional"}})
    direct = gym.make("SharedControl/LaneChange-v1", config={"authority": {"law": "proportional"}, **DIRECT})
    lagged.reset(seed=3)
    direct.reset(seed=3)
    limits, phi, arm = direct.unwrapped.command_limits, np.exp(-0.05 / 0.2), np.zeros(2)
    rng, wanted = np.random.default_rng(1), np.zeros(2)
    for _ in range(120):
        wanted = 0.9 * wanted + 0.1 * rng.uniform(-0.3, 0.3, 2)
        first = lagged.step(wanted)[4]
        second = direct.step(arm / limits)[4]
        np.testing.assert_allclose(first["state"], second["state"], rtol=1e-9, atol=1e-9)
        arm = phi * arm + (1.0 - phi) * (wanted * limits - second["u_a_act"])


def test_single_and_vectorised_are_equal():
    single = gym.make("SharedControl/LaneChange-v1", config=DIRECT)
    many = gym.make_vec("SharedControl/LaneChange-v1", num_envs=2, config=DIRECT)
    single.reset(seed=5)
    many.reset(seed=[5, 6])
    rng = np.random.default_rng(2)
    for _ in range(60):
        actions = rng.uniform(-0.1, 0.1, (2, 2)).astype(np.float32)
        info = single.step(actions[0])[4]
        infos = many.step(actions)[4]
        for name in ("state", "u_h_act", "u_h_des", "u", "alpha_a"):
            np.testing.assert_array_equal(info[name], infos[name][0])


class Still:
    def reset(self, seed=None):
        pass

    def act(self, observation, scene):
        return np.array([0.5, 0.01])


def test_a_driver_of_ones_own_gives_u_h_act():
    env = DriverModel(gym.make("SharedControl/TwoLane-v1", config=DIRECT), Still())
    env.reset(seed=0)
    np.testing.assert_allclose(env.step(0)[4]["u_h_act"], [0.5, 0.01], atol=1e-15)


@pytest.mark.parametrize(
    ("config", "said"),
    [
        ({"driver_lag": {"direct": True, "K_h": 1.2}}, r"\['K_h'\] = 1.2 would not act: a direct driver"),
        ({"driver_lag": {"direct": True}, "person": {"active": True}}, "has an arm with a lag"),
        ({"driver_lag": {"direct": True}, "persons": ["attentive"]}, "has an arm with a lag"),
        ({"driver_lag": {"direct": 1}}, r"\['direct'\] = 1"),
        ({"driver_lag": {"directly": True}}, "did you mean 'direct'"),
    ],
)
def test_what_would_not_act_is_refused(config, said):
    with pytest.raises(ValueError, match=said):
        gym.make("SharedControl/TwoLane-v1", config=config)


def test_the_predictive_driver_is_refused():
    with pytest.raises(ValueError, match="does not go with the predictive driver"):
        DriverModel(gym.make("SharedControl/TwoLane-v1", config=DIRECT))
    with pytest.raises(ValueError, match="does not go with the predictive driver"):
        gym.make_vec("SharedControl/TwoLane-v1", num_envs=2, driver=True, config=DIRECT)
    env = gym.make_vec("SharedControl/TwoLane-v1", num_envs=2, driver=True)
    with pytest.raises(ValueError, match="does not go with the predictive driver"):
        env.unwrapped.set_config(DIRECT)
