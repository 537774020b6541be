"""Training repeats, goes on where it was stopped, and gives policies that act the same wherever they are loaded."""

import json

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs the extra 'train'")

from agents import train
from agents.history import HISTORY, History
from agents.policy import LearnedDriver, Policy
from agents.tasks import HELD_OUT_KINDS, LAG_RANGES, make_environment, training_config
from shared_control_env.core.observation import FEATURES
from shared_control_env.envs.degradations import DEGRADATIONS
from shared_control_env.evaluation import Suite, evaluate
from shared_control_env.wrappers import DriverModel

ID = "SharedControl/LaneKeeping-v0"
SMALL = {
    "ppo": {"n_steps": 16, "batch_size": 64, "n_epochs": 2},
    "sac": {"buffer_size": 2000, "learning_starts": 64, "batch_size": 32, "gradient_steps": 1},
    "td3": {"buffer_size": 2000, "learning_starts": 64, "batch_size": 32, "gradient_steps": 1},
}


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Few steps and episodes."""
    common = {"environments": 8, "segment": 256, "policy_kwargs": {"net_arch": [16]}}
    monkeypatch.setattr(train, "hyperparameters", lambda algorithm, id: {**common, **SMALL[algorithm]})
    monkeypatch.setattr(train, "EVALUATION_EPISODES", 4)


def trained(folder, algorithm="ppo", task="driver", segments=2, seed=0):
    for _ in range(segments):
        training = train.Training(folder, algorithm, ID, task, seed)
        training.run_segment(lambda n: None)
    return training


@pytest.mark.parametrize("algorithm", train.ALGORITHMS)
def test_the_same_seed_gives_the_same_policy_stopped_or_not(tmp_path, algorithm):
    stopped = trained(tmp_path / "stopped", algorithm)
    whole = train.Training(tmp_path / "whole", algorithm, ID, "driver", 0)
    for _ in range(2):
        whole.run_segment(lambda n: None)
    other = trained(tmp_path / "other", algorithm, seed=1)
    assert stopped.state["scores"] == whole.state["scores"] != other.state["scores"]
    assert stopped.state["steps"] == 512
    policies = [Policy.load(tmp_path / name / "best.npz") for name in ("stopped", "whole")]
    for (weights, biases), (same_weights, same_biases) in zip(policies[0].layers, policies[1].layers, strict=True):
        np.testing.assert_array_equal(weights, same_weights)
        np.testing.assert_array_equal(biases, same_biases)


@pytest.mark.parametrize("task", train.TASKS)
@pytest.mark.parametrize("algorithm", train.ALGORITHMS)
def test_an_exported_policy_acts_as_its_model(tmp_path, algorithm, task):
    training = trained(tmp_path / "run", algorithm, task, segments=1)
    model = train.ALGORITHMS[algorithm].load(training.checkpoint)
    policy = Policy.load(tmp_path / "run/best.npz")
    seen = np.random.default_rng(0).normal(size=(20, HISTORY * 25)).astype(np.float32)
    np.testing.assert_allclose(policy.act(seen), model.predict(seen, deterministic=True)[0], atol=1e-5)
    assert policy.card["algorithm"] == algorithm
    assert policy.card["environment"] == ID


def test_a_policy_drives_in_the_single_environment_and_in_the_benchmark(tmp_path):
    trained(tmp_path / "run", segments=1)
    policy = Policy.load(tmp_path / "run/best.npz")
    env = DriverModel(gym.make(ID), LearnedDriver(policy))
    env.reset(seed=0)
    assert np.isfinite(env.step(0)[4]["u_h_des"]).all()
    table = evaluate({"learned": lambda: LearnedDriver(policy)}, "proportional", Suite("s", ("bend",), ("none",)))
    assert len(table) == 1


def test_the_history_is_that_of_training():
    env = make_environment(ID, "driver", 1, seed=3)
    history, stacked = History(25), env.reset()
    for _ in range(6):
        np.testing.assert_array_equal(history.push(stacked[0, -25:]), stacked[0])
        stacked, *_ = env.step(np.zeros((1, 2)))


def test_training_draws_the_lag_and_every_degradation_but_those_held_out():
    config = training_config(gym.make(ID).unwrapped.config)
    assert set(config["degradations"]) == set(DEGRADATIONS) - set(HELD_OUT_KINDS)
    env = make_environment(ID, "driver", 64, seed=0)
    env.reset()
    lags = [(e.driver_lag.K_h, e.driver_lag.T_h) for e in env.get_attr("episodes")[0]]
    assert len(set(lags)) == 64
    for values, entry in zip(zip(*lags, strict=True), LAG_RANGES, strict=True):
        assert entry["low"] <= min(values) <= max(values) <= entry["high"]


def test_a_folder_of_another_training_is_refused(tmp_path):
    trained(tmp_path / "run", segments=1)
    with pytest.raises(ValueError, match="with seed = 0, not 5"):
        train.Training(tmp_path / "run", "ppo", ID, "driver", 5)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/notes.txt").write_text("mine")
    with pytest.raises(ValueError, match="no training"):
        train.Training(tmp_path / "mine", "ppo", ID, "driver", 0)


def test_a_policy_of_other_observations_is_refused(tmp_path):
    trained(tmp_path / "run", segments=1)
    policy = Policy.load(tmp_path / "run/best.npz")
    policy.card["features"] = [*[name for name, _ in FEATURES][:-1], "the fault"]
    policy.save(tmp_path / "other.npz")
    with pytest.raises(ValueError, match="the fault"):
        Policy.load(tmp_path / "other.npz")


def test_progress_is_written_last(tmp_path, monkeypatch):
    trained(tmp_path / "run", segments=1)
    before = json.loads((tmp_path / "run/progress.json").read_text())
    training = train.Training(tmp_path / "run", "ppo", ID, "driver", 0)
    monkeypatch.setattr(train, "export", lambda model, card: 1 / 0)
    monkeypatch.setattr(train, "score", lambda *arguments: 1e9)
    with pytest.raises(ZeroDivisionError):
        training.run_segment(lambda n: None)
    assert json.loads((tmp_path / "run/progress.json").read_text()) == before
    assert train.Training(tmp_path / "run", "ppo", ID, "driver", 0).checkpoint.is_file()
