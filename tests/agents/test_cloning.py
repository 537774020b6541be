"""Learning from demonstrations: the dataset, the clone, and what both refuse."""

import sys

import numpy as np
import pytest
from scipy import stats
from typer.testing import CliRunner

pytest.importorskip("minari", reason="needs the extra 'minari'")
pytest.importorskip("stable_baselines3", reason="needs the extra 'train'")

import minari
import typer

from agents import clone, demonstrate
from agents.drivers import driver_entry
from shared_control_env.evaluation.catalogue import DRIVERS, DriverEntry
from shared_control_env.learned.card import is_direct
from shared_control_env.learned.history import HISTORY, History, of_episode
from shared_control_env.learned.policy import LearnedDriver, Policy
from shared_control_env.learned.views import DRIVER_FEATURES, driver_view
from shared_control_env.recordings.samples import joined, samples_of
from shared_control_env.wrappers import DriverModel

ID = "SharedControl/LaneKeeping-v1"
DATASET = "shared-control/cloned-v0"

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning:minari")


def run(main, *arguments):
    app = typer.Typer()
    app.command()(main)
    result = CliRunner().invoke(app, arguments, catch_exceptions=False)
    return result.exit_code, " ".join(result.output.replace("│", " ").split())


@pytest.fixture(scope="module")
def datasets(tmp_path_factory):
    """A folder of datasets with one of 30 demonstrations."""
    folder = tmp_path_factory.mktemp("minari")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MINARI_DATASETS_PATH", str(folder))
        code, said = run(demonstrate.main, "--dataset", DATASET, "--episodes", "30")
        assert code == 0, said
        yield folder


def test_a_dataset_holds_what_was_executed_and_what_was_wanted(datasets):
    dataset = minari.load_dataset(DATASET)
    assert dataset.total_episodes == 30
    episode = dataset[3]
    noise = episode.actions - episode.infos["wanted"]
    assert noise.std() == pytest.approx(0.03, rel=0.2)
    assert abs(noise.mean()) < 0.01
    env = dataset.recover_environment()
    observation, _ = env.reset(seed=3)
    np.testing.assert_array_equal(observation, episode.observations[0])
    for k, action in enumerate(episode.actions):
        observation, reward, _, _, info = env.step(action)
        np.testing.assert_array_equal(observation, episode.observations[k + 1])
        np.testing.assert_array_equal(np.float32(info["u_a_act"]), episode.infos["felt"][k + 1])
        assert reward == episode.rewards[k]
    arms = set()
    for seed in range(5):
        env.reset(seed=seed)
        arms.add(env.unwrapped.episode.driver_lag.K_h)
    assert len(arms) == 5
    env.close()


def test_without_noise_the_episodes_are_the_drivers_own(datasets):
    code, said = run(demonstrate.main, "--dataset", "shared-control/quiet-v0", "--episodes", "2", "--noise", "0")
    assert code == 0, said
    episode = minari.load_dataset("shared-control/quiet-v0")[1]
    np.testing.assert_array_equal(episode.actions, episode.infos["wanted"])
    env = DriverModel(minari.load_dataset("shared-control/quiet-v0").recover_environment())
    env.reset(seed=1)
    for k in range(50):
        np.testing.assert_allclose(env.step(0)[0], episode.observations[k + 1], atol=1e-6)


def test_a_policy_sees_in_a_dataset_what_it_sees_as_it_drives(datasets):
    rng = np.random.default_rng(0)
    observations = rng.normal(size=(9, 3)).astype(np.float32)
    history = History(1, 3)
    np.testing.assert_array_equal(of_episode(observations), [history.push(o[None])[0] for o in observations])

    inputs = []

    class Watched(Policy):
        def act(self, stacked):
            inputs.append(stacked[0].copy())
            return super().act(stacked)

    layers = [(0.01 * rng.normal(size=(2, HISTORY * len(DRIVER_FEATURES))), np.zeros(2))]
    watched = Watched(layers, "tanh", False, {"task": "driver", "dead_zone": 0.0})
    entry = DriverEntry("watched", lambda: LearnedDriver(watched))
    env = demonstrate.recorded_env(ID, "watched", entry)
    (episode,) = demonstrate.demonstrations(env, entry, 0.03, [5])
    buffer = episode.buffer(0)
    seen = of_episode(driver_view(buffer.observations[:-1], buffer.infos["felt"][:-1]))
    np.testing.assert_allclose(seen, inputs, atol=1e-6)
    assert np.abs(buffer.infos["felt"]).max() > 0.0


def test_a_dataset_is_read_as_a_learner_needs_it(datasets):
    data = samples_of(DATASET)
    assert data.id == ID
    assert data.about["driver"] == "internal_model"
    everything = joined(data.episodes)
    assert everything.seen.shape == (everything.wanted.shape[0], HISTORY * 30)
    assert everything.last.sum() == 30
    assert (everything.ends <= everything.last).all()


def test_the_parts_share_no_episode(datasets):
    episodes = samples_of(DATASET).episodes
    parts = clone.split(episodes)
    assert [len(part.seen) for part in parts] == [
        sum(len(episodes[i].seen) for i in range(30) if i % 10 in own) for own in (range(8), [8], [9])
    ]
    np.testing.assert_array_equal(parts.test.seen[: len(episodes[9].seen)], episodes[9].seen)
    assert all(len(part.seen) for part in clone.split(episodes[:3]))
    with pytest.raises(ValueError, match=r"2 episode\(s\); three are needed"):
        clone.split(episodes[:2])


def test_the_likelihood_is_that_of_a_gaussian():
    rng = np.random.default_rng(0)
    error, std = rng.normal(size=(50, 2)), np.array([0.5, 2.0])
    expected = stats.norm.logpdf(error, scale=std).sum(axis=1).mean()
    assert clone.log_likelihood(error, std) == pytest.approx(expected)


@pytest.fixture(scope="module")
def short(datasets):
    with pytest.MonkeyPatch.context() as patch:
        parameters = {"epochs": 12, "batch_size": 128, "learning_rate": 2e-3, "net_arch": [32]}
        patch.setattr(clone, "hyperparameters", lambda *_: dict(parameters))
        yield parameters


def test_a_clone_is_likelier_than_a_constant_and_is_a_driver(short, tmp_path):
    code, said = run(clone.main, "--data", DATASET, "--out", str(tmp_path / "c"), "--episodes", "4")
    assert code == 0, said
    assert "Lateral RMS in 4 held-out episodes" in said
    policy = Policy.load(tmp_path / "c" / "best.npz")
    parts = clone.split(samples_of(DATASET).episodes)
    train, test = parts.training.wanted, parts.test.wanted
    constant = clone.log_likelihood(test - train.mean(axis=0), train.std(axis=0))
    assert clone.likelihood_of(policy, parts.test) > constant + 0.5
    assert policy.card["dead_zone"] == 0.0
    assert policy.card["dataset"]["noise"] == 0.03
    driver = driver_entry(str(tmp_path / "c" / "best.npz"))
    assert driver.config == {}
    env = DriverModel(minari.load_dataset(DATASET).recover_environment(), driver.make())
    env.reset(seed=0)
    for _ in range(40):
        info = env.step(0)[4]
    assert abs(info["z"][1]) < 2.0


def test_a_stopped_cloning_ends_with_the_same_policy(short, tmp_path):
    parts = clone.split(samples_of(DATASET).episodes)
    card = clone.new_card("behaviour cloning", "driver", 0, short, {ID: {}}, 0.0, "")
    whole = clone.Cloning(tmp_path / "whole", parts, card)
    for _ in range(2):
        whole.run_epoch()
    for _ in range(2):
        clone.Cloning(tmp_path / "parts", parts, card).run_epoch()
    one, two = (Policy.load(tmp_path / name / "best.npz") for name in ("whole", "parts"))
    for a, b in zip(one.layers, two.layers, strict=True):
        np.testing.assert_array_equal(a[0], b[0])
    assert one.card == two.card
    with pytest.raises(ValueError, match="holds a cloning with seed = 0, not 1"):
        clone.Cloning(tmp_path / "whole", parts, {**card, "seed": 1})
    (tmp_path / "else").mkdir()
    (tmp_path / "else" / "file").write_text("")
    with pytest.raises(ValueError, match="no cloning; choose another --out"):
        clone.Cloning(tmp_path / "else", parts, card)


def test_wrong_arguments_are_refused_by_name(datasets):
    for main, arguments, message in (
        (demonstrate.main, ("--dataset", DATASET), "exists already"),
        (demonstrate.main, ("--driver", "internal_modl", "--dataset", "a-v0"), "did you mean 'internal_model'"),
        (demonstrate.main, ("--env", "SharedControl/LaneKeping-v1", "--dataset", "a-v0"), "LaneKeeping-v1"),
        (demonstrate.main, ("--seed", "2999999", "--dataset", "a-v0"), "those of comparisons"),
        (demonstrate.main, ("--dataset", "no id"), "no id"),
        (clone.main, ("--data", "shared-control/none-v0"), "not found locally"),
    ):
        code, said = run(main, *arguments)
        assert code == 2
        assert message in said


def test_a_clone_of_a_person_drives_past_the_lag(short, tmp_path):
    """A person's action is u_h,act; so is the clone's."""
    parts = clone.split(samples_of(DATASET).episodes)
    config = {ID: {"driver_lag": {"direct": True}}}
    card = clone.new_card("behaviour cloning", "driver", 0, short, config, 0.0, "")
    clone.Cloning(tmp_path / "person", parts, card).run_epoch()
    assert is_direct(Policy.load(tmp_path / "person" / "best.npz").card)
    assert driver_entry(str(tmp_path / "person" / "best.npz")).config == {"driver_lag": {"direct": True}}
    assert driver_entry("driver-0").config == {}


@pytest.mark.parametrize("name", list(DRIVERS))
def test_a_recorded_driver_has_an_arm_of_the_population_unless_it_has_its_own(name):
    entry = demonstrate.with_arm(DRIVERS[name])
    env = demonstrate.recorded_env(ID, name, entry)
    lags = []
    for seed in range(3):
        env.reset(seed=seed)
        lags.append(env.unwrapped.episode.driver_lag)
    env.close()
    own = DRIVERS[name].config.get("driver_lag")
    if own is None:
        assert len({(lag.K_h, lag.T_h) for lag in lags}) == 3
    else:
        assert all(getattr(lag, field) == value for lag in lags for field, value in own.items())


@pytest.mark.parametrize(("main", "option"), [(demonstrate.main, "--dataset"), (clone.main, "--data")])
def test_without_minari_the_commands_say_what_to_install(main, option, monkeypatch):
    monkeypatch.setitem(sys.modules, "minari", None)
    code, said = run(main, option, "shared-control/none-v0")
    assert code == 2
    assert "shared_control_env[minari]" in said
