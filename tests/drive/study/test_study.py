"""A whole study: simulated people through the page's connection, interruption, resumption and export."""

import json

import numpy as np
import pandas as pd
import pytest
from rich.console import Console

from shared_control_env.drive.devices import Simulated
from shared_control_env.drive.latency import Timing
from shared_control_env.drive.protocol import Answers
from shared_control_env.drive.session import Drive as Session
from shared_control_env.drive.simulated import NO_REMNANT, Remnant, SimulatedPerson
from shared_control_env.drive.study import run as study_run
from shared_control_env.drive.study.export import ANSWERS, TRIALS, export
from shared_control_env.drive.study.folder import MOST_ATTEMPTS, Drive, Questions, StudyFolder
from shared_control_env.drive.study.plan import read_plan
from shared_control_env.drive.study.programme import StudyProgramme
from shared_control_env.recordings.trial import Trial
from tests.drive.conftest import Page, Serving
from tests.drive.study.test_plan import PLAN, written

QUIET = Console(quiet=True)


@pytest.fixture
def plan(tmp_path):
    return read_plan(written(tmp_path))


def simulate(plan, out, people=1, names="hands_on"):
    study_run.with_simulated(plan, out, names, people, NO_REMNANT, QUIET)


def test_the_whole_plan_with_simulated_people(plan, tmp_path):
    out = tmp_path / "study"
    simulate(plan, out, people=2, names=["hands_on", "mpc_1"])
    trials = pd.read_csv(out / TRIALS)
    real = trials[trials["condition"] != "practice"]
    assert len(real) == 2 * 2 * plan.repetitions
    assert real["valid"].all()
    assert set(real["code"]) == {"S01", "S02"}
    assert set(real["simulated"]) == {"hands_on", "mpc_1"}
    for _, group in real.groupby(["code", "condition"]):
        assert sorted(group["seed"]) == [3000, 3001]  # every condition on the same episodes
    answers = pd.read_csv(out / ANSWERS)
    assert set(answers["questionnaire"]) == {"nasa_tlx", "van_der_laan"}
    assert set(answers["condition"]) == {"fuzzy", "unlimited"}
    assert (answers[answers["item"] == "raw_tlx"]["value"] == 50.0).all()
    kept = {path: path.read_bytes() for path in (out / "people").rglob("*.*")}
    simulate(plan, out, people=2, names=["hands_on", "mpc_1"])  # nothing is left to do
    assert {path: path.read_bytes() for path in (out / "people").rglob("*.*")} == kept


def test_the_same_people_drive_the_same_to_the_bit(plan, tmp_path):
    for name in ("one", "two"):
        simulate(plan, tmp_path / name)
    first = Trial.read(tmp_path / "one/people/S01/fuzzy-1_1.parquet")
    second = Trial.read(tmp_path / "two/people/S01/fuzzy-1_1.parquet")
    for name, values in first.columns.items():
        assert values.tobytes() == second.columns[name].tobytes(), name


def test_a_person_is_the_same_in_every_drive_and_differs_from_others():
    lags = {SimulatedPerson("population", number, Remnant()).lag for number in range(4)}
    assert len(lags) == 4
    assert SimulatedPerson("mpc_2", 0).lag == SimulatedPerson("mpc_2", 9).lag == (1.15, 0.21)


def test_stopped_at_any_moment_it_goes_on(plan, tmp_path, monkeypatch):
    """Stopped after each step in turn, the study ends with the same files."""
    out, whole = tmp_path / "study", tmp_path / "whole"
    simulate(plan, whole)
    stops = 0

    async def one_step(folder, person):
        nonlocal stops
        stops += 1
        programme = StudyProgramme(_Seat(), folder)
        step = programme._step
        if step["step"] == "consent":
            folder.agree(True)
        elif step["step"] == "device":
            folder.choose_device({"device": "simulated", "calibration": None})
        elif step["step"] == "questionnaire":
            await programme.handle(_answers(step))
        else:
            await _drive(programme, person)

    monkeypatch.setattr(study_run, "_simulate", one_step)
    for _ in range(40):
        simulate(plan, out)
        folder = StudyFolder(out, plan, "S01", "hands_on")
        upcoming = folder.next() if folder.device else True
        folder.close()
        if upcoming is None:
            break
    assert stops == 2 + len(list((whole / "people/S01").glob("*.parquet"))) + 4
    names = {path.name for path in (whole / "people/S01").iterdir()}
    assert {path.name for path in (out / "people/S01").iterdir()} == names
    for path in (whole / "people/S01").glob("*.parquet"):
        there = Trial.read(out / "people/S01" / path.name)
        assert there.columns["state"].tobytes() == Trial.read(path).columns["state"].tobytes()


class _Seat:
    """A seat that only prepares and steps, for the study without a server."""

    native = None

    def send(self, message):
        pass


def _answers(step):
    values = {item["name"]: item["least"] + item["step"] * (item["steps"] // 2) for item in step["items"]}
    return Answers(type="answers", values=values)


async def _drive(programme, person):
    upcoming = programme.folder.next()
    choice = upcoming.what.choice(upcoming.seed)
    session = Session(choice)
    person.begin(choice)
    device = Simulated(session.limits)
    while session.going:
        readings = np.array(person.shares(session.observation, session.env.scene))
        session.step(device.command(readings, session.dt), readings, Timing(0.0, 0.0, np.nan))
    programme._present = upcoming

    async def clear():
        session.close()

    programme.seat.clear = clear
    await programme._finished(session)


def test_other_people_are_not_mixed_in(plan, tmp_path):
    out = tmp_path / "study"
    simulate(plan, out)
    with pytest.raises(ValueError, match="S01 is hands_on, not mpc_1"):
        simulate(plan, out, names="mpc_1")
    with pytest.raises(ValueError, match=r"not hands_on with a remnant of 0\.01 rad"):
        study_run.with_simulated(plan, out, "hands_on", 1, Remnant(steering=0.01), QUIET)
    with pytest.raises(ValueError, match="not a real person"):
        StudyFolder(out, plan, "S01")


def served(plan, tmp_path):
    """A study whose person has agreed and drives by the keyboard, with its server."""
    folder = StudyFolder(tmp_path / "study", plan)
    folder.agree(True)
    folder.choose_device({"device": "keyboard", "calibration": None})
    serving = Serving(lambda seat: StudyProgramme(seat, folder))
    return folder, serving


def test_a_second_begin_while_driving_is_refused(plan, tmp_path):
    folder, serving = served(plan, tmp_path)
    with serving.connect() as connection:
        page = Page(connection)
        page.until("step", step="next")
        page.say(type="begin")
        assert page.until("road")["device"] == "keyboard"
        page.until("state", state="ready")
        page.say(type="begin")
        page.drive(0.3)
        page.say(type="begin")
        got = page.drive(0.3)
        assert [message["message"] for message in got if message["type"] == "refused"]
        assert page.frame["k"] > 8
    serving.stop()
    folder.close()


def test_a_drive_that_fails_comes_again(plan, tmp_path, monkeypatch):
    folder, serving = served(plan, tmp_path)
    with serving.connect() as connection:
        page = Page(connection)
        title = page.until("step", step="next")["title"]
        page.say(type="begin")
        page.until("state", state="ready")
        page.say(type="begin")
        page.drive(0.3)
        monkeypatch.setattr(serving.server.seat.drive, "step", None)
        page.until("refused")
        assert page.until("step", step="next")["title"] == title
        page.say(type="begin")
        page.until("state", state="ready")
    serving.stop()
    folder.close()


def test_simulated_people_do_not_wait_for_a_disk_that_is_full(plan, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(StudyFolder, "add", full)
    with pytest.raises(RuntimeError, match="No space left"):
        simulate(plan, tmp_path / "study")


def test_who_is_done_is_not_kept_waiting(plan, tmp_path):
    folder = StudyFolder(tmp_path / "study", plan)
    folder.agree(False)
    assert StudyProgramme(_Seat(), folder).over.is_set()
    folder.close()


def test_another_plan_is_not_mixed_in(plan, tmp_path):
    out = tmp_path / "study"
    StudyFolder(out, plan).close()
    other = read_plan(written(tmp_path, PLAN.replace("repetitions = 2", "repetitions = 3")))
    with pytest.raises(ValueError, match="plan differs in repetitions"):
        StudyFolder(out, other)


def test_a_study_has_one_person_at_a_time_and_codes_are_pseudonyms(plan, tmp_path):
    folder = StudyFolder(tmp_path / "study", plan)
    with pytest.raises(ValueError, match="another run is writing"):
        StudyFolder(tmp_path / "study", plan)
    folder.close()
    assert folder.code == "P01"
    second = StudyFolder(tmp_path / "study", plan)
    second.close()
    assert (second.code, second.number) == ("P02", 1)
    assert second.order != folder.order
    with pytest.raises(ValueError, match="no name of a person"):
        StudyFolder(tmp_path / "study", plan, "Ada Lovelace")
    again = StudyFolder(tmp_path / "study", plan, "P01")
    again.close()
    assert again.number == 0


def fake(valid, lateral_rms=1.0):
    latency = {"flagged": False}
    header = {
        **{"format": "shared_control_env drive 1", "valid": valid, "pauses": [], "latency": latency, "device": "wheel"},
        **{"condition": "fuzzy", "simulated": "", "seed": 0, "choice": {}, "result": {"lateral_rms": lateral_rms}},
    }
    return Trial(header, {"reward": np.zeros(2)})


def test_an_invalid_trial_is_kept_and_driven_again_at_most_so_often(plan, tmp_path):
    folder = StudyFolder(tmp_path / "study", plan)
    for _ in range(2):
        folder.add(folder.next(), fake(True))  # practice without meeting the criterion
    label = folder.next().label
    for _ in range(MOST_ATTEMPTS):
        assert folder.next().label == label
        folder.add(folder.next(), fake(False))
    assert folder.next().label != label
    assert len(list(folder.recordings.path.glob(f"{label}_*.parquet"))) == MOST_ATTEMPTS
    folder.close()
    trials, _ = export(tmp_path / "study")
    assert trials["left_out"].sum() == 1


def test_practice_ends_when_it_is_good_enough(plan, tmp_path):
    folder = StudyFolder(tmp_path / "study", plan)
    first = folder.next()
    assert isinstance(first, Drive)
    assert first.condition is None
    folder.add(first, fake(True, lateral_rms=0.3))
    assert folder.next().condition is not None
    folder.close()


def test_who_does_not_agree_is_not_recorded(plan, tmp_path):
    folder = StudyFolder(tmp_path / "study", plan)
    serving = Serving(lambda seat: StudyProgramme(seat, folder))
    with serving.connect() as connection:
        page = Page(connection)
        assert page.until("step")["step"] == "consent"
        page.say(type="begin")
        assert "is not what comes now" in page.until("refused")["message"]
        page.say(type="consent", agreed=False)
        assert page.until("step")["step"] == "end"
    serving.stop()
    folder.close()
    assert json.loads((folder.recordings.path / "consent.json").read_text())["agreed"] is False
    assert not list(folder.recordings.path.glob("*.parquet"))


def test_a_person_on_the_page(plan, tmp_path):
    """Consent, device, practice by keyboard in real time, a paused trial that is repeated, and questionnaires."""
    short = read_plan(
        written(
            tmp_path,
            PLAN.replace("repetitions = 2", "repetitions = 1")
            .replace('degradation = "none"', 'degradation = "bias:steering:0.9:-"')
            .replace("most = 2", 'most = 1\nauthority = "none"')
            .replace('name = "unlimited"\nscenario = "two_lane"', 'name = "unlimited"\nscenario = "curve"')
            .replace('name = "fuzzy"', 'name = "fuzzy"\ndegradation = "bias:steering:0.9:-"')
            .replace('authority = "proportional"', 'authority = "none"'),
        )
    )
    folder = StudyFolder(tmp_path / "study", short)
    serving = Serving(lambda seat: StudyProgramme(seat, folder))
    with serving.connect() as connection:
        page = Page(connection)
        page.until("step", step="consent")
        page.say(type="consent", agreed=True)
        assert page.until("step", step="device")["devices"] == ["keyboard"]
        page.say(type="device", device="wheel")
        assert "this study allows keyboard" in page.until("refused")["message"]
        page.say(type="device", device="keyboard")
        step = page.until("step", step="next")
        assert step["title"].startswith("Practice")
        page.say(type="begin")
        page.until("state", state="ready")
        page.say(type="begin")
        page.drive(12.0)
        step = page.until("step", step="next")
        assert "Trial 1 of 2" in step["title"]
        page.say(type="begin")
        page.until("state", state="ready")
        page.say(type="begin")
        page.drive(0.3)
        page.say(type="pause")
        page.until("state", state="paused")
        page.say(type="resume")
        page.drive(12.0)
        step = page.until("step", step="next")
        assert "is repeated" in step["text"]
        assert "Trial 1 of 2" in step["title"]
    serving.stop()
    label = folder.next().label
    assert isinstance(folder.next(), Drive)
    assert not Trial.read(folder.recordings.path / f"{label}_1.parquet").header["valid"]
    header = Trial.read(folder.recordings.path / "practice-1_1.parquet").header
    assert header["device"] == "keyboard"
    assert header["code"] == "P01"
    folder.close()
    assert not isinstance(folder.next(), Questions)
