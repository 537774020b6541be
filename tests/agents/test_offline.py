"""Offline learning with d3rlpy; run by ``make offline`` in a virtual environment of its own."""

import json

import numpy as np
import pytest

pytest.importorskip("d3rlpy", reason="needs d3rlpy, in an environment of its own: make offline")

import gymnasium as gym
import minari
import typer
from minari.data_collector import EpisodeBuffer
from typer.testing import CliRunner

from agents import offline
from shared_control_env.core.feedback.observation import DRIVER_V0
from shared_control_env.learned.history import HISTORY
from shared_control_env.learned.policy import LearnedDriver, Policy
from shared_control_env.learned.views import DRIVER_FEATURES
from shared_control_env.recordings.samples import joined, samples_of

DATASET = "shared-control/offline-v0"
STEPS = 40


class Spaces(gym.Env):
    """The spaces of an environment that this Gymnasium cannot make."""

    spec = gym.spec("SharedControl/LaneKeeping-v1")
    observation_space = gym.spaces.Box(-1.0, 1.0, (DRIVER_V0.size,), np.float32)
    action_space = gym.spaces.Box(-1.0, 1.0, (2,), np.float32)


@pytest.fixture(scope="module", autouse=True)
def dataset(tmp_path_factory):
    """Four episodes of a driver who steers against the lateral error; this Gymnasium cannot run the environments."""
    rng = np.random.default_rng(0)
    buffers = []
    for i in range(4):
        observations = rng.uniform(-1.0, 1.0, (STEPS + 1, DRIVER_V0.size)).astype(np.float32)
        wanted = np.stack([np.zeros(STEPS), -0.5 * observations[:-1, 0]], axis=1).astype(np.float32)
        buffers.append(
            EpisodeBuffer(
                id=i,
                observations=observations,
                actions=wanted,
                rewards=rng.normal(size=STEPS).tolist(),
                terminations=[False] * (STEPS - 1) + [i == 0],
                truncations=[False] * (STEPS - 1) + [i > 0],
                infos={"felt": np.zeros((STEPS + 1, 2), np.float32), "wanted": wanted},
            )
        )
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MINARI_DATASETS_PATH", str(tmp_path_factory.mktemp("minari")))
        minari.create_dataset_from_buffers(
            DATASET,
            buffer=buffers,
            env=Spaces(),
        )
        yield


def run(*arguments):
    app = typer.Typer()
    app.command()(offline.main)
    result = CliRunner().invoke(app, ["--data", DATASET, *arguments], catch_exceptions=False)
    return result.exit_code, " ".join(result.output.replace("│", " ").split())


def test_failures_end_the_future_and_truncations_do_not():
    buffer = offline.buffer_of(joined(samples_of(DATASET).episodes))
    assert [episode.terminated for episode in buffer.episodes] == [True, False, False, False]
    assert [len(episode) for episode in buffer.episodes] == [STEPS] * 4


@pytest.mark.parametrize("algorithm", list(offline.ALGORITHMS))
def test_the_exported_policy_acts_as_the_learner(algorithm):
    data = joined(samples_of(DATASET).episodes)
    config = offline.ALGORITHMS[algorithm](observation_scaler=offline.StandardObservationScaler())
    learner = config.create(device="cpu:0")
    learner.fit(offline.buffer_of(data), 20, 20, logger_adapter=offline.NoopAdapterFactory(), show_progress=False)
    policy = offline.policy_of(learner, {})
    np.testing.assert_allclose(policy.act(data.seen), learner.predict(data.seen), atol=1e-4)
    assert policy.layers[0][0].shape[1] == HISTORY * len(DRIVER_FEATURES)


def test_a_learning_learns_and_goes_on(tmp_path):
    arguments = ("--algo", "bc", "--out", str(tmp_path / "bc"), "--epoch", "200")
    code, said = run(*arguments, "--steps", "200")
    assert code == 0, said
    code, said = run(*arguments, "--steps", "400")
    assert code == 0, said
    assert "400 steps" in said
    policy, data = Policy.load(tmp_path / "bc" / "policy.npz"), joined(samples_of(DATASET).episodes)
    assert policy.card["steps"] == 400
    assert np.mean((policy.act(data.seen) - data.wanted) ** 2) < 0.2 * np.var(data.wanted[:, 1])
    assert LearnedDriver(policy).act(np.zeros(DRIVER_V0.size), {"felt": np.zeros(2)}).shape == (2,)
    code, said = run("--algo", "iql", "--out", str(tmp_path / "bc"))
    assert code == 2
    assert "algorithm = 'bc', not 'iql'" in said
    assert sorted(path.name for path in (tmp_path / "bc").iterdir()) == ["model-400.pt", "policy.npz", "progress.json"]


def test_a_learning_killed_between_two_files_goes_on_from_before(tmp_path, monkeypatch):
    arguments = ("--algo", "bc", "--epoch", "100")
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    run(*arguments, "--steps", "200", "--out", str(whole))
    run(*arguments, "--steps", "100", "--out", str(cut))
    with monkeypatch.context() as patch:
        patch.setattr(offline.Policy, "save", lambda *_: (_ for _ in ()).throw(OSError("killed")))
        with pytest.raises(OSError, match="killed"):
            run(*arguments, "--steps", "200", "--out", str(cut))
    assert json.loads((cut / "progress.json").read_text())["steps"] == 100
    run(*arguments, "--steps", "200", "--out", str(cut))
    for mine, theirs in zip(
        Policy.load(cut / "policy.npz").layers, Policy.load(whole / "policy.npz").layers, strict=True
    ):
        np.testing.assert_array_equal(mine[0], theirs[0])


def test_an_unknown_algorithm_is_refused(tmp_path):
    code, said = run("--algo", "cql", "--out", str(tmp_path))
    assert code == 2
    assert "algo = 'cql' must be one of td3_plus_bc, iql, bc" in said
