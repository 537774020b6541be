"""The same tasks on a local Ray cluster; run by ``make rllib`` in a virtual environment of its own."""

import numpy as np
import pytest

pytest.importorskip("tree", reason="needs the extra 'rllib', in an environment of its own: make rllib")

import gymnasium as gym
import ray

from agents import rllib
from agents.card import card_of
from agents.tasks import HELD_OUT_SEED, VALIDATION_SEED, training_config
from shared_control_env.learned.history import HISTORY
from shared_control_env.learned.policy import LearnedAllocator, LearnedDriver, Policy
from shared_control_env.learned.views import DRIVER_FEATURES
from shared_control_env.wrappers import AuthorityLimiter, DriverModel

ID = "SharedControl/LaneKeeping-v1"


@pytest.fixture(scope="module", autouse=True)
def cluster():
    rllib.connect("local")
    yield
    ray.shutdown()


@pytest.mark.parametrize("task", ["driver", "allocator"])
def test_a_few_iterations_train_a_policy_that_acts_as_the_module(tmp_path, task):
    normalisation = rllib.measured_normalisation(ID, task, num_envs=8, steps=50)
    algorithm = rllib.make_algorithm(ID, task, 0, normalisation, environments=16, steps=16)
    card = card_of("ppo on RLlib", [ID], task, 0, rllib.HYPERPARAMETERS, ("ray", "torch"))
    before = rllib.export(algorithm, normalisation, card)
    for i in range(3):
        result = algorithm.train()
        assert result["env_runners"]["num_env_steps_sampled_lifetime"] >= (i + 1) * 256
    rllib.export(algorithm, normalisation, card).save(tmp_path / "policy.npz")
    policy = Policy.load(tmp_path / "policy.npz")
    assert any(np.abs(a[0] - b[0]).max() > 0.0 for a, b in zip(policy.layers, before.layers, strict=True))
    env = rllib.make_environment(ID, task, normalisation, 4)
    seen, _ = env.reset(seed=HELD_OUT_SEED)
    module = algorithm.get_module()
    inputs = {"obs": rllib.torch.from_numpy(seen)}
    expected = module.forward_inference(inputs)["action_dist_inputs"].detach().numpy()[:, : policy.layers[-1][1].size]
    raw = seen * normalisation.std + normalisation.mean
    np.testing.assert_allclose(policy.act(raw), np.clip(expected, -1.0, 1.0), atol=1e-4)
    algorithm.stop()
    _drives_as_here(policy, task, env, normalisation)


def _drives_as_here(policy, task, env, normalisation):
    """The policy's episode in RLlib's environments is that of the single environment."""
    bare = gym.make(ID, config=training_config(ID, task)).unwrapped
    if task == "driver":
        single = DriverModel(AuthorityLimiter(bare), LearnedDriver(policy))
    else:
        single = DriverModel(AuthorityLimiter(bare, LearnedAllocator(policy)))
    single.reset(seed=HELD_OUT_SEED)
    seen, _ = env.reset(seed=HELD_OUT_SEED)
    for _ in range(30):
        _, reward, terminated, _, _ = single.step(0)
        actions = policy.act(seen * normalisation.std + normalisation.mean).astype(np.float32)
        seen, rewards, *_ = env.step(actions)
        assert rewards[0] == pytest.approx(reward, rel=1e-3, abs=1e-3)
        if terminated:
            break


def test_episodes_that_end_begin_a_new_history():
    size = len(DRIVER_FEATURES)
    plain = rllib.Normalisation(np.zeros(HISTORY * size), np.ones(HISTORY * size))
    env = rllib.make_environment(ID, "driver", plain, 8)
    env.reset(seed=0)
    begun, ended = np.zeros(8, dtype=bool), 0
    for _ in range(260):
        seen, _, terminations, truncations, _ = env.step(np.ones((8, 2), np.float32))
        assert (seen[begun, size:] == 0.0).all()
        begun = terminations | truncations
        ended += begun.sum()
    assert ended >= 8
    assert np.isfinite(seen).all()


def test_runners_have_episodes_of_their_own_below_those_of_validation():
    size = HISTORY * len(DRIVER_FEATURES)
    env = rllib.make_environment(ID, "driver", rllib.Normalisation(np.zeros(size), np.ones(size)), 8)
    env = rllib.TrainingSeeds(env)  # kept, since Gymnasium closes an environment when a wrapper around it is gone
    seeds = []
    for seed in (0, 1, HELD_OUT_SEED):
        env.reset(seed=seed)
        seeds += env.unwrapped.np_random_seed
    assert len(set(seeds)) == 24
    assert max(seeds) < VALIDATION_SEED
