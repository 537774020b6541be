"""A person's drive is an episode of the benchmark, and its recording drives it again."""

import numpy as np
import pytest

from agents.drivers import driver_entry
from shared_control_env.drive.devices import Command, Simulated
from shared_control_env.drive.latency import Timing
from shared_control_env.drive.session import Choice, Drive, result_of_model
from shared_control_env.drive.simulated import Remnant, SimulatedPerson
from shared_control_env.drive.view import SHOWN, frame_of, road_of
from shared_control_env.evaluation.catalogue import AUTHORITIES, DRIVERS
from shared_control_env.evaluation.episodes import EpisodeBatch, RunningBatch, fault_named, run
from shared_control_env.evaluation.metrics import METRICS
from shared_control_env.recordings.trial import Trial

NOW = Timing(0.0, 0.0, np.nan)


def driven(choice, person):
    """A drive by a simulated person."""
    drive = Drive(choice)
    person.begin(choice)
    device = Simulated(drive.limits)
    while drive.going:
        readings = np.array(person.shares(drive.observation, drive.env.scene))
        drive.step(device.command(readings, drive.dt), readings, NOW)
    return drive


@pytest.mark.parametrize(
    ("name", "choice"),
    [
        ("mpc_1", Choice("lane_change", "bias:steering:0.05:-", "proportional", "", 4)),
        ("internal_model", Choice("bend", "step_bias", "none", "", 2)),
        ("scripted", Choice("lead_braking", "bias_ramp", "linear", "", 1)),
    ],
)
def test_a_simulated_person_at_the_wheel_drives_as_that_driver_in_the_loop(name, choice):
    """Eq. 16 in the person and the direct slot, or in the environment: the same episode."""
    person = SimulatedPerson(name, 0)
    drive = driven(choice, person)
    lag = {"driver_lag": {"K_h": person.lag[0], "T_h": person.lag[1]}}
    entry = DRIVERS[name]._replace(config={**DRIVERS[name].config, **lag}, draws=())
    running = RunningBatch(choice.batch((name, entry)), single=True)
    states = []
    going = True
    while going:
        going = running.step()
        states.append(running.infos["state"][0])
    np.testing.assert_allclose(drive.trial({}).columns["state"], states, rtol=1e-6, atol=1e-6)


def test_hands_off_the_wheel_are_the_driver_none():
    choice = Choice("bend", "step_bias", "proportional", "", 3)
    drive = Drive(choice)
    while drive.going:
        drive.step(Command(0.0, 0.0), np.zeros(4), NOW)
    mine = drive.result()
    batch = EpisodeBatch(
        "bend", ("none", DRIVERS["none"]), ("proportional", AUTHORITIES["proportional"]), (("step_bias", 3),), {}
    )
    (row,) = run(batch)
    for name in METRICS:
        if name not in (
            "real_time_factor",
            "time_to_detect",
            "missed_detection",
            "false_authority_loss",
            "false_alert",
        ):
            np.testing.assert_allclose(mine[name], row[name], rtol=1e-9, atol=1e-12, err_msg=name)


def test_a_recording_holds_all_signals_and_drives_again(tmp_path):
    choice = Choice("lane_change", "step_bias", "proportional", "", 7)
    drive = driven(choice, SimulatedPerson("population", 3, Remnant(steering=0.01)))
    path = tmp_path / "drive.parquet"
    drive.trial({"device": "simulated"}).write(path)
    trial = Trial.read(path)
    assert {"u_a_des", "u_h_act", "safe_area_lower", "automation.status", "wanted", "raw", "lateness"} <= set(
        trial.columns
    )
    for name, values in drive.trial({}).columns.items():
        np.testing.assert_array_equal(trial.columns[name], values, err_msg=name)
        assert trial.columns[name].dtype == values.dtype
    again = Drive(Choice(**trial.header["choice"]))
    for command, raw in zip(trial.columns["command"], trial.columns["raw"], strict=True):
        again.step(Command(*command), raw, NOW)
    np.testing.assert_array_equal(again.trial({}).columns["state"], trial.columns["state"])
    np.testing.assert_array_equal(again.trial({}).columns["wanted"], trial.columns["wanted"])
    entry = driver_entry(str(path))
    batch = EpisodeBatch(
        "lane_change",
        ("recorded", entry),
        ("proportional", AUTHORITIES["proportional"]),
        ((fault_named("step_bias"), 7),),
        {},
    )
    (row,) = run(batch)
    assert row["lateral_rms"] == pytest.approx(drive.result()["lateral_rms"], rel=1e-9)
    assert np.isnan(row["K_h"])


def test_what_the_predictive_driver_would_have_wanted_is_logged_beside():
    choice = Choice("lane_change", "bias:steering:0.05:-", "proportional", "", 4)
    drive = Drive(choice)
    for _ in range(60):
        drive.step(Command(0.0, 0.0), np.zeros(4), NOW)
    columns = drive.trial({}).columns
    assert np.abs(columns["wanted"][-1, 1]) > 1e-3
    np.testing.assert_array_equal(columns["u_h_act"], 0.0)


def test_the_frame_shows_what_the_condition_shows():
    drive = Drive(Choice())
    drive.step(Command(0.0, 0.0), np.zeros(4), NOW)
    assert {"alpha", "risk", "fault", "automation"} <= set(frame_of(drive, SHOWN))
    assert not {"alpha", "risk", "fault", "automation", "command"} & set(frame_of(drive, ()))
    road = road_of(drive)
    assert road["lanes"] == drive.settings.road.lanes
    assert len(road["line"]) > 100


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"scenario": "lane_chance"}, "did you mean 'lane_change'"),
        ({"degradation": "step_bia"}, "did you mean 'step_bias'"),
        ({"degradation": "bias:steering"}, "must be kind:channel:size:duration"),
        ({"degradation": "bias:steering:9:-"}, "size"),
        ({"authority": "guardiann"}, "did you mean 'guardian'"),
        ({"law": "proportionl"}, "did you mean 'proportional'"),
        ({"seed": -1}, "whole number"),
        ({"seed": 1.5}, "whole number"),
    ],
)
def test_wrong_choices(changes, said):
    with pytest.raises(ValueError, match=said):
        Drive(Choice(**changes))


def test_another_law_than_the_authoritys_own():
    first = result_of_model(Choice("bend", "step_bias", "proportional", "", 1))
    second = result_of_model(Choice("bend", "step_bias", "proportional", "none", 1))
    assert first["driver_effort"] != second["driver_effort"]
