"""Recorded faults: a file over time, resampled, scaled by its size, and refused where it cannot be played."""

import copy
import pickle

import gymnasium as gym
import numpy as np
import pandas as pd
import pytest

import shared_control_env  # noqa: F401
from shared_control_env.core.faults.kinds import KINDS
from shared_control_env.envs.degradations import Degradation, add_degradation
from shared_control_env.envs.profiles import read_profile, resampled
from shared_control_env.evaluation import controllability

T = np.arange(0.0, 12.0, 0.03)
WAVE = 0.05 * np.sin(T)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "lka.csv"
    np.savetxt(path, np.column_stack([T + 100.0, WAVE]), delimiter=",", header="t,value", comments="", fmt="%.17g")
    return str(path)


def driven(fault, steps=120, seed=0, **config):
    env = gym.make("SharedControl/TwoLane-v1", config={"faults": [fault], "authority": {"law": "none"}, **config})
    env.reset(seed=seed)
    return [env.step(np.zeros(2))[4] for _ in range(steps)]


def test_the_profile_is_added_from_its_onset_on_and_scaled(file):
    infos = driven({"kind": "recorded_bias", "file": file, "onset": 1.02, "size": 2.0})
    for info in infos:
        since = info["t"] - 1.02
        expected = 2.0 * np.interp(since, T, WAVE) if since >= 0.0 else 0.0
        assert info["fault"][1] == pytest.approx(expected, abs=1e-4)
        assert info["fault"][0] == 0.0
        assert info["fault_active"] == (since >= 0.0)


def test_the_profile_takes_the_place_of_the_command(file):
    infos = driven({"kind": "recorded_command", "file": file, "onset": 0.5, "size": 1.0, "duration": 2.0})
    for info in infos:
        since = info["t"] - 0.5
        if 0.0 <= since < 2.0:
            assert info["u_a_f"][1] == pytest.approx(np.interp(since, T, WAVE), abs=1e-4)
        else:
            np.testing.assert_array_equal(info["u_a_f"], info["u_a_des"])


def test_on_the_acceleration_and_from_parquet(tmp_path):
    path = tmp_path / "brake.parquet"
    pd.DataFrame({"t": [0.0, 1.0, 20.0], "value": [0.0, -2.0, -2.0], "note": "x"}).to_parquet(path)
    infos = driven({"kind": "recorded_bias", "channel": "acceleration", "file": str(path), "onset": 0.0, "size": 1.0})
    assert infos[10]["fault"][0] == pytest.approx(-1.0)


def test_resampling_keeps_the_samples_and_the_end(file):
    np.testing.assert_allclose(resampled(file, 0.03)[: len(T)], WAVE, atol=1e-15)
    assert resampled(file, 0.05) is resampled(file, 0.05)
    assert len(resampled(file, 0.05)) * 0.05 >= T[-1]


def test_single_and_vectorised_are_the_same_and_copies_go_on(file):
    config = {"faults": [{"kind": "recorded_bias", "file": file, "onset": 0.4, "size": 1.0}]}
    single = gym.make("SharedControl/Bend-v1", config=config)
    many = gym.make_vec("SharedControl/Bend-v1", num_envs=3, config=config)
    single.reset(seed=2)
    many.reset(seed=[2, 3, 4])
    for _ in range(40):
        info, infos = single.step(np.zeros(2))[4], many.step(np.zeros((3, 2)))[4]
        np.testing.assert_array_equal(info["u_a_f"], infos["u_a_f"][0])
    bare = single.unwrapped
    action = {"driver": np.zeros(2), "authority": np.ones(1)}
    first = pickle.loads(pickle.dumps(bare)).step(action)[4]
    second = copy.deepcopy(bare).step(action)[4]
    np.testing.assert_array_equal(first["u_a_f"], second["u_a_f"])
    np.testing.assert_array_equal(first["fault"], bare.step(action)[4]["fault"])


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("t,value\n0,0\n", "has 1 rows"),
        ("t,value\n0,0\n1,nan\n", "value is not finite in row 2"),
        ("t,value\n0,0\n1,1\n1,2\n", "t does not increase after row 2"),
        ("t,value\n0,0\n1,much\n", "'much' in row 2 is no number"),
        ("t,value\n0,0\n1\n", "None in row 2 is no number"),
        ("time,value\n0,0\n1,1\n", "has no column t;"),
        ("", "has no column t, value;"),
        ("t,value\n0,0\n1,0.1\n", "lasts 1 s, and the fault acts for 9 s"),
    ],
)
def test_what_cannot_be_played_is_refused(tmp_path, content, said):
    path = tmp_path / "fault.csv"
    path.write_text(content)
    fault = {"kind": "recorded_bias", "file": str(path), "onset": 1.0, "size": 1.0}
    with pytest.raises(ValueError, match=r"config\['faults'\]\[0\]\['file'\]") as error:
        gym.make("SharedControl/TwoLane-v1", config={"faults": [fault]})
    assert said in str(error.value)


def test_other_wrong_files(tmp_path):
    (tmp_path / "x.parquet").write_bytes(b"no")
    with pytest.raises(ValueError, match="no Parquet file"):
        read_profile(str(tmp_path / "x.parquet"))
    (tmp_path / "x.csv").write_bytes(b"\xff\xfe\x00t")
    with pytest.raises(ValueError, match="no CSV file"):
        read_profile(str(tmp_path / "x.csv"))
    with pytest.raises(ValueError, match="cannot be read"):
        read_profile(str(tmp_path / "none.csv"))


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ({"kind": "recorded_bias", "size": 1.0}, "'file'] is missing"),
        ({"kind": "bias", "size": 0.1, "file": "x.csv"}, "plays no recording"),
        ({"kind": "recorded_bias", "file": "FILE"}, "'size'] is missing"),
        ({"kind": "recorded_bias", "file": "FILE", "size": 101.0}, "must lie in"),
        ({"kind": "recorded_bias", "file": "FILE", "size": 1.0, "channel": "both"}, "does not act on it"),
    ],
)
def test_wrong_settings(file, fault, said):
    made = {"onset": 1.0, **fault, **({"file": file} if fault.get("file") == "FILE" else {})}
    with pytest.raises(ValueError, match=r"config\['faults'\]\[0\]") as error:
        gym.make("SharedControl/TwoLane-v1", config={"faults": [made]})
    assert said in str(error.value)


def test_a_file_that_changes_is_read_again(file, tmp_path):
    before = resampled(file, 0.05)
    path = tmp_path / "lka.csv"
    path.write_text("t,value\n0,1\n20,1\n")
    assert resampled(file, 0.05)[0] == 1.0
    assert before[0] == 0.0  # what runs keeps its own


def test_recorded_kinds_have_no_axis_and_no_entry_in_the_library(tmp_path):
    with pytest.raises(ValueError, match="is not a kind of degradation"):
        controllability("recorded_bias", "paper", "none", out=tmp_path / "out")
    with pytest.raises(ValueError, match="plays a file"):
        add_degradation("played", Degradation("", "recorded_bias", ("steering",), (0.5, 1.0)))
    assert KINDS["recorded_bias"].recorded
