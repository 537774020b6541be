"""Recordings on disk, and the dataset that they make."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from shared_control_env.drive.session import Choice
from shared_control_env.drive.simulated import Remnant, SimulatedPerson
from shared_control_env.recordings.dataset import to_minari
from shared_control_env.recordings.trial import KEY, Trial, trials_in
from tests.drive.test_session import driven

LANE_CHANGE = Choice("lane_change", "step_bias", "proportional", "", 11)


@pytest.fixture(scope="module")
def drives(tmp_path_factory):
    folder = tmp_path_factory.mktemp("drives")
    person = SimulatedPerson("attentive", 2, Remnant(steering=0.005))
    for seed in (11, 12):
        driven(LANE_CHANGE._replace(seed=seed), person).trial({"device": "wheel"}).write(folder / f"{seed}.parquet")
    driven(LANE_CHANGE._replace(authority="linear"), person).trial({"device": "wheel"}).write(folder / "linear.parquet")
    return folder


def test_a_damaged_file_is_said(drives, tmp_path):
    whole = (drives / "11.parquet").read_bytes()
    for name, content in (
        ("cut", whole[: len(whole) // 2]),
        ("empty", b""),
        ("flipped", whole[:1000] + bytes(200) + whole[1200:]),
        ("text", b"t,a,delta\n"),
    ):
        (tmp_path / f"{name}.parquet").write_bytes(content)
        with pytest.raises(ValueError, match=f"{name}.parquet is no recording of a drive, or damaged"):
            Trial.read(tmp_path / f"{name}.parquet")


def test_other_parquet_files_are_no_recordings(tmp_path):
    pq.write_table(pa.table({"a": [1]}), tmp_path / "table.parquet")
    with pytest.raises(ValueError, match="no recording"):
        Trial.read(tmp_path / "table.parquet")
    with pytest.raises(ValueError, match="holds no recordings"):
        trials_in(tmp_path)
    schema = pa.schema(
        [pa.field("a", pa.int64(), metadata={"shape": "[]"})], metadata={KEY: json.dumps({"format": "x"})}
    )
    pq.write_table(pa.table([[1]], schema=schema), tmp_path / "old.parquet")
    with pytest.raises(ValueError, match="no recording of the format"):
        Trial.read(tmp_path / "old.parquet")
    with pytest.raises(ValueError, match="no such file"):
        Trial.read(tmp_path / "none.parquet")


def test_the_header_says_all_that_a_reader_needs(drives):
    header = Trial.read(drives / "11.parquet").header
    assert header["environment"]["id"] == "SharedControl/LaneChange-v1"
    assert header["environment"]["config"]["driver_lag"] == {"direct": True}
    assert header["seed"] == 11
    assert "sources" in header["versions"]
    assert header["device"] == "wheel"
    assert header["valid"]


@pytest.fixture
def minari(tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "minari"))
    return pytest.importorskip("minari", reason="needs the extra 'minari'")


@pytest.mark.filterwarnings("ignore::UserWarning:minari")
def test_a_round_trip_through_minari(drives, minari):
    """Load, recover the environment: the first observations repeat to the bit, and so do the episodes, to float32."""
    paths = [drives / "11.parquet", drives / "12.parquet"]
    to_minari(paths, "shared-control/lane-change-v0", author="the project")
    dataset = minari.load_dataset("shared-control/lane-change-v0")
    assert dataset.total_episodes == 2
    env = dataset.recover_environment()
    for path, episode in zip(paths, dataset.iterate_episodes(), strict=True):
        trial = Trial.read(path)
        observation, _ = env.reset(seed=trial.header["seed"])
        np.testing.assert_array_equal(observation, episode.observations[0])
        assert len(episode.observations) == len(trial) + 1
        for k, action in enumerate(episode.actions):
            observation, reward, terminated, truncated, _ = env.step(action)
            np.testing.assert_allclose(observation, episode.observations[k + 1], atol=1e-5)
            assert reward == pytest.approx(episode.rewards[k], abs=1e-5)
            assert (terminated, truncated) == (episode.terminations[k], episode.truncations[k])
    env.close()


@pytest.mark.filterwarnings("ignore::UserWarning:minari")
def test_under_another_authority_the_action_has_both_slots(drives, minari):
    dataset = to_minari([drives / "linear.parquet"], "shared-control/linear-v0")
    env, episode = dataset.recover_environment(), dataset[0]
    trial = Trial.read(drives / "linear.parquet")
    observation, _ = env.reset(seed=11)
    np.testing.assert_array_equal(observation, episode.observations[0])
    for k in range(len(trial)):
        action = {name: values[k] for name, values in episode.actions.items()}
        observation = env.step(action)[0]
        np.testing.assert_allclose(observation, episode.observations[k + 1], atol=1e-5)
    env.close()


def test_a_dataset_has_one_environment_and_valid_drives(drives, minari, tmp_path):
    with pytest.raises(ValueError, match=r"they differ in .*config\['authority'\]|they differ in limiter"):
        to_minari([drives / "11.parquet", drives / "linear.parquet"], "shared-control/mixed-v0")
    with pytest.raises(ValueError, match="empty"):
        to_minari([], "shared-control/none-v0")
    trial = Trial.read(drives / "11.parquet")
    Trial({**trial.header, "valid": False, "pauses": ["paused"]}, trial.columns).write(tmp_path / "invalid.parquet")
    with pytest.raises(ValueError, match="with_invalid=True"):
        to_minari([tmp_path / "invalid.parquet"], "shared-control/invalid-v0")
