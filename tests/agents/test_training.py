"""Training repeats, goes on where it was stopped, and gives policies that act the same wherever they are loaded."""

import json
import re

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs the extra 'train'")

from stable_baselines3 import PPO
from typer.testing import CliRunner

from agents import train
from agents.tasks import HELD_OUT_DEGRADATIONS, HELD_OUT_SEED, TASKS, VALIDATION_SEED, training_config
from agents.vec_envs import make_environment
from shared_control_env.envs.degradations import DEGRADATIONS
from shared_control_env.evaluation import Suite, evaluate
from shared_control_env.learned.policy import LearnedAllocator, LearnedDriver, Policy
from shared_control_env.vector.stable_baselines import StableBaselinesVecEnv
from shared_control_env.wrappers import AuthorityLimiter, DriverModel

ID = "SharedControl/LaneKeeping-v1"
SMALL = {
    "ppo": {"n_steps": 16, "batch_size": 64, "n_epochs": 2},
    "sac": {"buffer_size": 2000, "learning_starts": 64, "batch_size": 32, "gradient_steps": 1},
    "td3": {"buffer_size": 2000, "learning_starts": 64, "batch_size": 32, "gradient_steps": 1, "action_noise": 0.1},
}


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Few steps and episodes."""
    common = {"environments": 8, "segment": 256, "half_life": 1000, "learning_rate": 1e-3}
    network = {"policy_kwargs": {"net_arch": [16]}}
    monkeypatch.setattr(train, "hyperparameters", lambda algorithm, ids: {**common, **network, **SMALL[algorithm]})
    monkeypatch.setattr(train, "VALIDATION_EPISODES", 4)


def trained(folder, algorithm="ppo", task="driver", segments=2, seed=0, ids=(ID,)):
    for _ in range(segments):
        training = train.Training(folder, algorithm, ids, task, seed)
        training.run_segment(lambda n: None)
    return training


@pytest.mark.parametrize("algorithm", train.ALGORITHMS)
def test_the_same_seed_gives_the_same_policy_stopped_or_not(tmp_path, algorithm):
    stopped = trained(tmp_path / "stopped", algorithm)
    whole = train.Training(tmp_path / "whole", algorithm, [ID], "driver", 0)
    for _ in range(2):
        whole.run_segment(lambda n: None)
    assert stopped.state["scores"] == whole.state["scores"]
    assert stopped.state["steps"] == 512
    policies = [Policy.load(tmp_path / name / "best.npz") for name in ("stopped", "whole")]
    for (weights, biases), (same_weights, same_biases) in zip(policies[0].layers, policies[1].layers, strict=True):
        np.testing.assert_array_equal(weights, same_weights)
        np.testing.assert_array_equal(biases, same_biases)
    trained(tmp_path / "other", algorithm, seed=1)
    other = Policy.load(tmp_path / "other" / "best.npz")
    assert not np.array_equal(other.layers[0][0], policies[0].layers[0][0])


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("algorithm", train.ALGORITHMS)
def test_an_exported_policy_acts_as_its_model_does_on_normalised_observations(tmp_path, algorithm, task):
    trained(tmp_path / "run", algorithm, task, segments=1)
    env = make_environment([ID], task, 8, seed=3)
    normalised = train.VecNormalize.load(str(tmp_path / "run/checkpoint-256-normalisation.pkl"), env)
    model = train.ALGORITHMS[algorithm].load(tmp_path / "run/checkpoint-256.zip")
    policy = Policy.load(tmp_path / "run/best.npz")
    seen = env.reset()
    for _ in range(20):
        actions = policy.act(seen)
        expected, _ = model.predict(normalised.normalize_obs(seen), deterministic=True)
        np.testing.assert_allclose(actions, expected, atol=1e-4)
        seen, *_ = env.step(actions)
    assert policy.card["algorithm"] == algorithm
    assert policy.card["environments"] == [ID]


@pytest.mark.parametrize("task", TASKS)
def test_what_a_policy_sees_is_the_same_in_the_single_environment(tmp_path, task):
    """One episode of the single environment and of the vector environment, with the same policy."""
    trained(tmp_path / "run", task=task, segments=1)
    policy = Policy.load(tmp_path / "run/best.npz")
    config = training_config(ID, task)
    bare = gym.make(ID, config=config).unwrapped
    if task == "driver":
        env = DriverModel(AuthorityLimiter(bare), LearnedDriver(policy))
    else:
        env = DriverModel(AuthorityLimiter(bare, LearnedAllocator(policy)))
    env.reset(seed=HELD_OUT_SEED)
    vector = make_environment([ID], task, 1, seed=HELD_OUT_SEED)
    seen = vector.reset()
    for _ in range(40):
        _, reward, *_ = env.step(0)
        seen, rewards, *_ = vector.step(policy.act(seen))
        # The allocator's driver is solved to rounding in the kernel and to OSQP's tolerance here.
        assert rewards[0] == pytest.approx(reward, rel=1e-4, abs=1e-5)


def test_policies_run_in_the_benchmark(tmp_path):
    trained(tmp_path / "driver", segments=1)
    trained(tmp_path / "allocator", task="allocator", segments=1)
    driver, allocator = (Policy.load(tmp_path / name / "best.npz") for name in TASKS)
    suite = Suite("s", ("bend",), ("none",))
    table = evaluate({"learned": lambda: LearnedDriver(driver)}, {"a": lambda: LearnedAllocator(allocator)}, suite)
    assert len(table) == 1
    with pytest.raises(ValueError, match="task 'driver', not 'allocator'"):
        LearnedAllocator(driver)


def test_training_draws_the_lag_and_every_degradation_but_those_held_out():
    config = training_config(ID, "driver")
    assert set(config["degradations"]) == set(DEGRADATIONS) - set(HELD_OUT_DEGRADATIONS)
    env = make_environment([ID], "driver", 64, seed=0)
    env.reset()
    drawn = {(fault.kind, fault.period > 0.0) for e in env.get_attr("episodes")[0] for fault in e.faults}
    assert len(drawn) > 6
    assert not drawn & {("delay", False), ("coloured_noise", False), ("sign_error", False), ("bias", True)}
    lags = [(e.driver_lag.K_h, e.driver_lag.T_h) for e in env.get_attr("episodes")[0]]
    assert len(set(lags)) == 64
    for values, entry in zip(zip(*lags, strict=True), TASKS["driver"].draws, strict=True):
        assert entry["low"] <= min(values) <= max(values) <= entry["high"]


def test_several_environments_are_learned_together(tmp_path):
    ids = [ID, "SharedControl/Bend-v1"]
    training = trained(tmp_path / "run", segments=1, ids=ids)
    assert training.state["steps"] == 256
    assert Policy.load(tmp_path / "run/best.npz").card["environments"] == ids
    joined = make_environment(ids, "driver", 4, seed=5).reset()
    for i, id in enumerate(ids):
        np.testing.assert_array_equal(joined[2 * i : 2 * i + 2], make_environment([id], "driver", 2, 5 + 2 * i).reset())
    with pytest.raises(ValueError, match="num_envs = 5 must be a multiple of the 2"):
        make_environment(ids, "driver", 5, seed=0)


def test_segments_and_training_seeds_have_episodes_of_their_own_below_those_of_validation(tmp_path, monkeypatch):
    seeds = []
    reset = StableBaselinesVecEnv.reset

    def noted(env):
        seeds.append(tuple(env._seeds))
        return reset(env)

    monkeypatch.setattr(StableBaselinesVecEnv, "reset", noted)
    monkeypatch.setattr(train, "validate", lambda *arguments: 0.0)
    for seed in (0, 1, VALIDATION_SEED, HELD_OUT_SEED):
        trained(tmp_path / str(seed), segments=2, seed=seed)
    flat = [seed for each in seeds for seed in each]
    assert len(seeds) == 8
    assert len(set(flat)) == len(flat) == 64
    assert max(flat) < VALIDATION_SEED


def test_a_training_that_was_stopped_in_its_first_segment_goes_on(tmp_path, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(PPO, "train", lambda self: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            trained(tmp_path / "stopped", segments=1)
    assert (tmp_path / "stopped/tensorboard").is_dir()
    again, whole = (trained(tmp_path / name) for name in ("stopped", "whole"))
    assert again.state["scores"] == whole.state["scores"]
    assert len(list((tmp_path / "stopped/tensorboard").iterdir())) == 1


def test_a_folder_of_another_training_is_refused(tmp_path):
    trained(tmp_path / "run", segments=1)
    with pytest.raises(ValueError, match="with seed = 0, not 5"):
        train.Training(tmp_path / "run", "ppo", [ID], "driver", 5)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/notes.txt").write_text("mine")
    with pytest.raises(ValueError, match="no training"):
        train.Training(tmp_path / "mine", "ppo", [ID], "driver", 0)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("features", ["the fault"], "the fault"),
        ("history", 7, "history of 7"),
        ("dead_zone", 1.5, r"dead_zone = 1.5 in its card must be a number in \[0, 1\)"),
        ("environments", ["SharedControl/LaneKeeping-v9"], "LaneKeeping-v9, which is not registered.*LaneKeeping-v1"),
    ],
)
def test_a_policy_for_other_spaces_or_environments_is_refused(tmp_path, name, value, message):
    trained(tmp_path / "run", segments=1)
    policy = Policy.load(tmp_path / "run/best.npz")
    policy.card[name] = value
    policy.save(tmp_path / "other.npz")
    with pytest.raises(ValueError, match=message):
        Policy.load(tmp_path / "other.npz")
    del policy.card[name]
    policy.save(tmp_path / "other.npz")
    with pytest.raises(ValueError, match=f"its card lacks {name}"):
        Policy.load(tmp_path / "other.npz")


def test_a_file_that_is_no_policy_is_refused(tmp_path):
    (tmp_path / "text.npz").write_text("text")
    np.savez(tmp_path / "arrays.npz", a=np.zeros(2))
    for name in ("text", "arrays"):
        with pytest.raises(ValueError, match="is no policy"):
            Policy.load(tmp_path / f"{name}.npz")


def test_the_card_beside_the_best_policy_says_how_to_repeat_it(tmp_path):
    training = trained(tmp_path / "run", segments=2, seed=4)
    card = json.loads((tmp_path / "run/best.json").read_text())
    assert card["seed"] == 4
    assert card["score"] == max(score for _, score in training.state["scores"])
    assert card["config"][ID] == json.loads(json.dumps(training_config(ID, "driver")))
    assert [spec["id"] for spec in card["specs"]] == [ID]
    assert "torch" in card["versions"]
    assert list((tmp_path / "run/tensorboard").rglob("events.*"))
    assert VALIDATION_SEED < HELD_OUT_SEED


@pytest.mark.parametrize("owner", [train.VecNormalize, Policy])
def test_a_training_stopped_while_it_keeps_a_segment_goes_on_from_the_one_before(tmp_path, monkeypatch, owner):
    trained(tmp_path / "run", segments=1)
    before = json.loads((tmp_path / "run/progress.json").read_text())
    monkeypatch.setattr(train, "validate", lambda policy, ids, task: float(np.abs(policy.layers[0][0]).sum()))
    with monkeypatch.context() as patch:
        patch.setattr(owner, "save", lambda *arguments: 1 / 0)
        patch.setattr(train, "validate", lambda *arguments: 1e9)
        with pytest.raises(ZeroDivisionError):
            trained(tmp_path / "run", segments=1)
    assert json.loads((tmp_path / "run/progress.json").read_text()) == before
    again, whole = trained(tmp_path / "run", segments=1), trained(tmp_path / "whole", segments=2)
    assert again.state["scores"][-1] == whole.state["scores"][-1]


def test_the_command_trains_and_names_what_it_does_not_know(tmp_path):
    runner, out = CliRunner(), str(tmp_path / "run")
    arguments = ["--steps", "256", "--out", out]
    app = train.typer.Typer()
    app.command()(train.main)
    result = runner.invoke(app, arguments)
    assert result.exit_code == 0, result.output
    shares = re.findall(r"(environment|adapters|policy|learning) (\d+) %", " ".join(result.output.split()))
    assert len(shares) == 4
    assert sum(int(share) for _, share in shares) == pytest.approx(100, abs=2)
    wrong = runner.invoke(app, ["--env", "SharedControl/LaneKepping-v1"])
    assert "LaneKeeping-v1" in wrong.output
    assert wrong.exit_code == 2
