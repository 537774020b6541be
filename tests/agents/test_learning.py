"""A short training learns what it should, and the reward does not pay for what it should not."""

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs the extra 'train'")

from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize

from agents import vec_envs
from agents.export import export
from agents.tasks import TASKS, training_config
from agents.vec_envs import make_environment
from shared_control_env.controllers.scripted import ScriptedDriver
from shared_control_env.wrappers import DriverModel

ID = "SharedControl/LaneKeeping-v1"
GROSS = {"kind": "bias", "channel": "steering", "onset": 0.0, "size": 0.5}


def changed(monkeypatch, **changes):
    """Training with other settings."""
    monkeypatch.setattr(vec_envs, "training_config", lambda id, task: {**training_config(id, task), **changes})


def returns(task, act, episodes=16):
    """Mean return of whole episodes, and the mean action of every step."""
    env = make_environment([ID], task, episodes, seed=1)
    seen, total, running, actions = env.reset(), np.zeros(episodes), np.ones(episodes, dtype=bool), []
    while running.any():
        actions.append(act(seen))
        seen, rewards, dones, _ = env.step(actions[-1])
        total += rewards * running
        running &= ~dones
    return total.mean(), np.mean(actions)


def learned(task, steps, exploration):
    env = VecNormalize(make_environment([ID], task, 64, seed=0), norm_reward=False, clip_obs=np.inf)
    model = PPO(
        "MlpPolicy",
        env,
        n_steps=32,
        batch_size=512,
        n_epochs=6,
        gamma=0.95,
        learning_rate=1e-3,
        policy_kwargs={"net_arch": [32], "log_std_init": exploration},
        seed=0,
        device="cpu",
    )
    model.learn(steps)
    return export(model, env, {"task": task})


def test_a_short_training_beats_chance_on_a_trivial_fault(monkeypatch):
    """The automation's commands are gone: somebody has to drive."""
    lost = {"kind": "drop_out", "channel": "both", "onset": 0.0}
    changed(monkeypatch, degradations=[], faults=[lost], duration=4.0)
    rng = np.random.default_rng(0)
    random, _ = returns("driver", lambda seen: rng.uniform(-1.0, 1.0, (16, 2)).astype(np.float32))
    reached, _ = returns("driver", learned("driver", 40_000, -1.7).act)
    assert reached > 0.5 * random  # returns are below zero


def test_an_allocator_learns_to_give_less_authority_under_a_gross_fault(monkeypatch):
    """Beside the paper's driver, whose failures a short training can learn to prevent."""
    draws = [each for each in training_config(ID, "allocator")["randomise"] if not each["setting"].startswith("person")]
    driver = {"persons": [], "internal_model": {"active": False}, "randomise": draws}
    middle = lambda seen: np.zeros((16, 1), np.float32)
    means = {}
    for name, faults in (("gross", [GROSS]), ("none", [])):
        changed(monkeypatch, degradations=[], faults=faults, duration=4.0, **driver)
        reached, means[name] = returns("allocator", learned("allocator", 60_000, -1.0).act)
        assert reached > returns("allocator", middle)[0]
    assert means["gross"] < means["none"] - 0.1


class Bad:
    """Drives as it should not."""

    def __init__(self, a, delta):
        self.command = np.array([a, delta])

    def reset(self, seed=None):
        pass

    def act(self, observation, scene):
        a, delta = self.command
        if a < 0.0 and scene["z"][3] < 0.1:
            a = 0.0
        return np.array([a, delta])


@pytest.mark.parametrize("weights", [*TASKS, "default"])
@pytest.mark.parametrize("reason", ["standing still", "spinning", "driving off"])
def test_what_is_no_driving_does_not_pay(weights, reason):
    """With a driver alone, and all that may be lost by ending early lost: an hour of bad returns is not the measure."""
    config = {"authority": {"law": "driver_only"}, "degradations": ["none"], "vehicles": []}
    if weights != "default":
        config["reward"] = TASKS[weights].reward
    start = {"ego": {"speed": 3.0}} if reason == "spinning" else {}
    bad = {"standing still": Bad(-5.0, 0.0), "spinning": Bad(0.0, 0.5), "driving off": Bad(2.0, 0.1)}[reason]
    good, paid = (_return(driver, {**config, **start}) for driver in (ScriptedDriver(), bad))
    assert paid < good


def _return(driver, config):
    env = DriverModel(gym.make("SharedControl/TwoLane-v1", config={**config, "faults": []}), driver)
    env.reset(seed=0)
    total, going = 0.0, True
    while going:
        _, reward, terminated, truncated, _ = env.step(0)
        total, going = total + reward, not (terminated or truncated)
    return total
