"""From recordings to the table beside Table IV: acceptance, refusals, report and command."""

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from shared_control_env.cli import app
from shared_control_env.core.parameters import IDENTIFIED_DRIVERS
from shared_control_env.drive.session import Choice
from shared_control_env.drive.simulated import Remnant, SimulatedPerson
from shared_control_env.identification.data import read_people
from shared_control_env.identification.estimate import box_jenkins
from shared_control_env.identification.people import identify
from shared_control_env.recordings.trial import Trial
from tests.drive.test_session import driven


def recorded(folder, name, number, seeds, **about):
    """Drives of a simulated person with a remnant, as a study records them."""
    person, place = SimulatedPerson(name, number, Remnant(steering=0.005)), folder / f"S{number:02d}"
    for seed in seeds:
        drive = driven(Choice("lane_change", "bias:steering:0.05:-", "proportional", "", seed), person)
        header = {"device": "simulated", "code": place.name, "condition": "shared", "simulated": name, **about}
        drive.trial(header).write(place / f"shared-{seed}.parquet")
        drive.close()


@pytest.fixture(scope="module")
def five(tmp_path_factory):
    """The paper's five drivers, eight drives each."""
    folder = tmp_path_factory.mktemp("five")
    for i in range(1, 6):
        recorded(folder, f"mpc_{i}", i, range(8))
    return folder


def changed(path, to, **header):
    trial = Trial.read(path)
    Trial({**trial.header, **header}, trial.columns).write(to)


def test_intervals_cover_the_papers_drivers(tmp_path):
    """30 intervals: K_h and T_h of five drivers, each in three studies of eight drives."""
    hits = 0
    for study in range(3):
        folder = tmp_path / f"{study}"
        for i in range(1, 6):
            recorded(folder, f"mpc_{i}", i, range(1000 * study, 1000 * study + 8))
        people, refused = read_people(folder)
        assert not refused
        for i in range(1, 6):
            estimate, true = box_jenkins(people[f"S{i:02d}"]), IDENTIFIED_DRIVERS[f"driver_{i}"]
            hits += estimate.K_h.low <= true.K_h <= estimate.K_h.high
            hits += estimate.T_h.low <= true.T_h <= estimate.T_h.high
    assert hits >= 27


def test_the_table_stands_beside_the_papers(five, tmp_path):
    out = tmp_path / "identification"
    result = CliRunner().invoke(app, ["identify", str(five), "--out", str(out)], env={"COLUMNS": "140"})
    assert result.exit_code == 0, result.output
    assert "Table IV" in result.output
    table = pd.read_csv(out / "drivers.csv")
    assert set(table["person"]) == {f"S{i:02d}" for i in range(1, 6)}
    first = table[table["method"] == "output error"].set_index("person")
    for i in range(1, 6):
        row, true = first.loc[f"S{i:02d}"], IDENTIFIED_DRIVERS[f"driver_{i}"]
        assert row["K_h"] == pytest.approx(true.K_h, abs=0.06)
        assert row["T_h"] == pytest.approx(true.T_h, abs=0.06)
        assert 50.0 < row["fit"] < 95.0
        assert row["vaf"] > 75.0
    page = (out / "report.html").read_text()
    for words in ("relative to the model", "does not validate", "simulated: mpc_3", "83.14", "<svg"):
        assert words in page
    again = CliRunner().invoke(app, ["identify", str(five), "--out", str(out)])
    assert again.exit_code == 2
    assert "holds an identification already" in " ".join(again.output.split())


def test_the_report_in_a_browser(five, tmp_path, browser):
    identify(five, tmp_path / "out")
    browser.get((tmp_path / "out/report.html").as_uri())
    assert len(browser.find_elements("css selector", "figure svg")) == 10
    assert browser.execute_script("return document.documentElement.scrollWidth <= innerWidth")
    assert not [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]


def test_what_is_refused_is_said(five, tmp_path):
    source = sorted((five / "S01").glob("*.parquet"))
    for i, path in enumerate(source):
        changed(path, tmp_path / f"a/{i}.parquet", code="keys", device="keyboard")
        changed(path, tmp_path / f"b/{i}.parquet", code="stops", valid=i < 6, pauses=["paused"])
        changed(path, tmp_path / f"c/{i}.parquet", code="few", condition="shared" if i < 2 else "practice")
    people, refused = read_people(tmp_path)
    assert set(people) == {"stops"}
    assert len(people["stops"].names) == 6
    told = "\n".join(refused)
    assert "keys: driven by keyboard, whose keys are no arm" in told
    assert "stops: invalid" in told
    assert "few: practice (6" in told
    assert "few: 2 usable trials; at least 4" in told
    with pytest.raises(ValueError, match=r"no person is left to identify.*keyboard"):
        read_people(tmp_path / "a")
    with pytest.raises(ValueError, match="not of the condition 'other'"):
        read_people(five, condition="other")


def test_an_arm_that_has_nothing_to_do_is_refused(tmp_path):
    """Under Eq. 10 on a straight road nothing is wanted beside the automation."""
    person = SimulatedPerson("mpc_1", 1)
    for seed in range(4):
        drive = driven(Choice("two_lane", "none", "paper", "", seed), person)
        trial = drive.trial({"device": "wheel", "code": "idle"})
        trial.columns["wanted"][:] = trial.columns["u_a_act"]
        trial.write(tmp_path / f"{seed}.parquet")
    with pytest.raises(ValueError, match="hardly moves"):
        read_people(tmp_path)


def test_flagged_trials_are_named(five, tmp_path):
    for i, path in enumerate(sorted((five / "S02").glob("*.parquet"))):
        changed(path, tmp_path / f"{i}.parquet", latency={"flagged": True})
    people, _ = read_people(tmp_path)
    assert "8 trials with an input age above 40 ms" in "; ".join(people["S02"].notes)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--channel", "steerin"], "did you mean 'steering'"),
        (["--condition", "nothing"], "not of the condition 'nothing'"),
    ],
)
def test_wrong_options(five, tmp_path, arguments, said):
    result = CliRunner().invoke(app, ["identify", str(five), "--out", str(tmp_path / "o"), *arguments])
    assert result.exit_code == 2
    assert said in " ".join(result.output.replace("│", " ").split())


def test_a_place_without_recordings(tmp_path):
    for place in (tmp_path, tmp_path / "nowhere"):
        result = CliRunner().invoke(app, ["identify", str(place)])
        assert result.exit_code == 2
    (tmp_path / "broken.parquet").write_bytes(b"PAR1")
    with pytest.raises(ValueError, match="damaged"):
        read_people(tmp_path)


def test_the_acceleration_is_a_channel_too(tmp_path):
    person = SimulatedPerson("mpc_2", 1, Remnant(acceleration=0.1))
    for seed in range(6):
        drive = driven(Choice("lead_braking", "bias:acceleration:1:-", "proportional", "", seed), person)
        drive.trial({"device": "simulated", "code": "x"}).write(tmp_path / f"{seed}.parquet")
    table, _ = identify(tmp_path, channel="acceleration")
    row = table.iloc[0]
    assert row["K_h_low"] < 1.15 < row["K_h_high"]
    assert np.isfinite(row["T_h"])
