"""Runs of the benchmark: the same rows however they are run, kept whole, and refused where they do not belong."""

import io
import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pandas as pd
import pytest
from rich.console import Console

from shared_control_env.cli import summary
from shared_control_env.controllers.scripted import ScriptedDriver
from shared_control_env.evaluation import (
    AUTHORITIES,
    DRIVERS,
    METRICS,
    SUITES,
    AuthorityEntry,
    DriverEntry,
    Suite,
    evaluate,
)
from shared_control_env.evaluation import runner as runner_module
from shared_control_env.evaluation.episodes import EpisodeBatch, fault_named, run
from shared_control_env.evaluation.replay import replay_episode
from shared_control_env.evaluation.storage import IDENTITY, ResultsFolder, write_atomically
from tests.evaluation.single import drive_single
from tests.evaluation.test_user_automation import Cruise

SMALL = Suite("two scenarios and degradations", ("lane_change", "bend"), ("none", "bias_ramp", "white_noise"))
TIMED = ["real_time_factor"]
"""Columns that differ from run to run."""


def rows_of(table):
    return table.drop(columns=TIMED)


def test_one_row_an_episode():
    table = evaluate(["scripted", "none"], "linear", SMALL, seeds=[3, 4])
    assert len(table) == 2 * 2 * 3 * 2
    assert not table.duplicated(IDENTITY).any()
    assert set(METRICS) <= set(table)
    assert table[["config_hash", "version", "versions"]].notna().all(axis=None)
    assert table["config_hash"].nunique() == 2 * 2 * 3  # scenario, driver, degradation


def test_same_seed_same_rows():
    first, again = (evaluate("scripted", "softmax", SMALL, seeds=[5]) for _ in range(2))
    pd.testing.assert_frame_equal(rows_of(first), rows_of(again))


def test_processes_give_the_serial_rows():
    serial = evaluate(["mpc", "scripted"], ["paper", "linear"], SMALL, seeds=[1])
    parallel = evaluate(["mpc", "scripted"], ["paper", "linear"], SMALL, seeds=[1], jobs=2)
    pd.testing.assert_frame_equal(rows_of(serial), rows_of(parallel))


@pytest.mark.parametrize("authority", ["paper", "takeover", "time_based"])
@pytest.mark.parametrize("scenario", ["cut_in", "dense_traffic", "s_curve"])
def test_the_single_environment_gives_the_same_metrics(scenario, authority):
    suite = Suite("one", (scenario,), ("oscillation",))
    row = evaluate("distracted", authority, suite, seeds=[11]).iloc[0]
    entries = ("distracted", DRIVERS["distracted"]), (authority, AUTHORITIES[authority])
    single = drive_single(EpisodeBatch(scenario, *entries, (("oscillation", 11),), {}))
    for name in set(METRICS) - set(TIMED) - {"time_to_detect", "missed_detection"}:  # which need the twin
        assert single[name] == pytest.approx(row[name], abs=1e-9, nan_ok=True), name


def test_a_driver_and_an_allocator_of_ones_own():
    class Mine:
        def reset(self, seed=None):
            self.seed = seed

        def allocate(self, scene, signals):
            return 1.0 if signals["r_y"] < 0.3 else 0.2

    own = evaluate({"mine": ScriptedDriver}, {"also_mine": Mine}, SMALL, seeds=[0])
    assert set(own["driver"]) == {"mine"}
    assert set(own["authority"]) == {"also_mine"}
    known = evaluate("scripted", {"also_mine": AuthorityEntry("mine", "proportional", Mine)}, SMALL, seeds=[0])
    np.testing.assert_array_equal(own["lateral_rms"], known["lateral_rms"])


@pytest.mark.parametrize("suite", SUITES)
def test_suites_run(suite):
    table = evaluate("none", "proportional", suite, seeds=[0])
    assert len(table) == len(SUITES[suite].scenarios) * len(SUITES[suite].degradations)


@pytest.mark.parametrize("driver", DRIVERS)
def test_every_driver_runs(driver):
    assert len(evaluate(driver, "paper", "paper")) == 2


@pytest.mark.parametrize("authority", AUTHORITIES)
def test_every_authority_runs(authority):
    table = evaluate("scripted", authority, "paper")
    assert len(table) == 2
    assert (table["driver_effort"] < 2.0).all()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"driver": "scriptd"}, ["scriptd", "did you mean 'scripted'", "over_reacting"]),
        ({"authority": ["paper", "lineer"]}, ["lineer", "did you mean 'linear'"]),
        ({"suite": "papr"}, ["papr", "did you mean 'paper'", "full"]),
        ({"engine": "rey"}, ["rey", "did you mean 'ray'"]),
        ({"jobs": 0}, ["jobs = 0"]),
    ],
)
def test_unknown_names_are_refused_with_the_nearest(arguments, words):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        evaluate(**arguments)
    assert all(word in str(error.value) for word in words)


def test_resumes_without_losing_or_doubling(tmp_path, monkeypatch):
    real, ran = runner_module._run, []

    def stopping(batches, jobs, engine):
        for batch, rows in real(batches, jobs, engine):
            if len(ran) == 2:
                raise KeyboardInterrupt
            ran.append(batch.key)
            yield batch, rows

    monkeypatch.setattr(runner_module, "_run", stopping)
    with pytest.raises(KeyboardInterrupt):
        evaluate(["scripted", "none"], "fixed", SMALL, out=tmp_path / "run")
    monkeypatch.setattr(runner_module, "_run", real)
    told = []
    table = evaluate(["scripted", "none"], "fixed", SMALL, out=tmp_path / "run", progress=lambda *n: told.append(n))
    assert told[:2] == [(0, 12), (3, 12)]
    assert told[-1] == (12, 12)
    pd.testing.assert_frame_equal(rows_of(table), rows_of(evaluate(["scripted", "none"], "fixed", SMALL)))
    pd.testing.assert_frame_equal(table, pd.read_parquet(tmp_path / "run/episodes.parquet"))
    assert (tmp_path / "run/report.html").stat().st_size > 10_000


def test_drivers_can_be_added_later(tmp_path):
    evaluate("none", "fixed", SMALL, out=tmp_path)
    table = evaluate("scripted", "fixed", SMALL, out=tmp_path)
    assert set(table["driver"]) == {"none", "scripted"}
    assert json.loads((tmp_path / "benchmark.json").read_text())["drivers"].keys() == {"none", "scripted"}


@pytest.mark.parametrize("changed", [{"seeds": [1]}, {"suite": "paper"}, {"config": {"duration": 5.0}}])
def test_a_folder_of_another_benchmark_is_refused(tmp_path, changed):
    arguments = {"driver": "none", "authority": "fixed", "suite": SMALL}
    evaluate(**arguments, out=tmp_path)
    before = sorted(path.name for path in tmp_path.rglob("*"))
    (part,) = changed
    with pytest.raises(ValueError, match=rf"with {part} = .*--fresh"):
        evaluate(**{**arguments, **changed}, out=tmp_path)
    assert sorted(path.name for path in tmp_path.rglob("*")) == before
    evaluate(**{**arguments, **changed}, out=tmp_path, fresh=True)


def test_a_folder_of_another_version_is_refused(tmp_path):
    evaluate("none", "fixed", SMALL, out=tmp_path)
    manifest = json.loads((tmp_path / "benchmark.json").read_text())
    manifest["versions"] = manifest["versions"].replace("numba ", "numba 9.")
    (tmp_path / "benchmark.json").write_text(json.dumps(manifest))
    with pytest.raises(ValueError, match="with versions = "):
        evaluate("none", "fixed", SMALL, out=tmp_path)


def test_foreign_files_are_left_alone(tmp_path):
    (tmp_path / "thesis.tex").write_text("mine")
    for fresh in (False, True):
        with pytest.raises(ValueError, match="no results of a benchmark"):
            ResultsFolder(tmp_path, {"drivers": [], "authorities": []}, fresh)
    assert (tmp_path / "thesis.tex").read_text() == "mine"


def test_a_full_disk_leaves_what_was_there(tmp_path):
    path = tmp_path / "table"
    write_atomically(path, lambda draft: draft.write_text("whole"))

    def fail(draft):
        draft.write_text("ha")
        raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match="No space left"):
        write_atomically(path, fail)
    assert [p.name for p in tmp_path.iterdir()] == ["table"]
    assert path.read_text() == "whole"


def command(*arguments, **options):
    return subprocess.Popen(
        [sys.executable, "-m", "shared_control_env.cli", *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env={**os.environ, "COLUMNS": "200"},
        **options,
    )


def test_the_command_killed_at_any_moment_goes_on(tmp_path):
    options = ("benchmark", "--suite", "full", "--drivers", "none", "--authorities", "paper,fixed", "--seeds", "0-1")
    killed = command(*options, "--jobs", 2, "--out", tmp_path / "run", start_new_session=True)
    shards = tmp_path / "run/episodes"
    while not (shards.is_dir() and len(list(shards.glob("*.parquet"))) >= 3):
        assert killed.poll() is None, killed.stdout.read()
        time.sleep(0.05)
    os.killpg(killed.pid, signal.SIGKILL)
    killed.communicate()
    for path in shards.glob("[!.]*.parquet"):
        pd.read_parquet(path)
    again = command(*options, "--jobs", 2, "--out", tmp_path / "run")
    output, _ = again.communicate(timeout=300)
    assert again.returncode == 0, output
    table = pd.read_parquet(tmp_path / "run/episodes.parquet")
    assert len(table) == 10 * 17 * 2 * 2
    assert not table.duplicated(IDENTITY).any()
    assert "680 episodes are in" in output


def test_the_command_names_what_is_wrong(tmp_path):
    for arguments, words in (
        (("--drivers", "scriptd"), "did you mean 'scripted'"),
        (("--seeds", "a-b"), "numbers and ranges"),
        (("--suite", "fulll"), "did you mean 'full'"),
    ):
        wrong = command("benchmark", *arguments, "--out", tmp_path / "run")
        output, _ = wrong.communicate(timeout=60)
        assert wrong.returncode == 2
        assert words in " ".join(output.split())
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("automation", [None, Cruise])
def test_pictures_of_an_episode_end_with_it(automation):
    """Also where the same episode without a fault, which the metrics need, goes on."""
    frames = []
    fault = fault_named("bias:steering:0.4:-")
    pairs = ("none", DRIVERS["none"]), ("none", AUTHORITIES["none"])
    replay_episode("motorway", *pairs, fault, 3, frames, automation=automation)
    (row,) = run(EpisodeBatch("motorway", *pairs, ((fault, 3),), {}, automation))
    steps = round(row["duration"] * 20)
    assert row["terminated"]
    assert len(frames) == steps + 1 < 150
    moved = [np.abs(b.astype(int) - a).mean() for a, b in zip(frames[:-1], frames[1:], strict=True)]
    assert max(moved) < 5.0 * np.median(moved)  # no picture of another episode


def test_list_and_replay(tmp_path):
    listed, _ = command("list").communicate(timeout=60)
    for name in (*DRIVERS, *AUTHORITIES, *SUITES, "lateral_rms", "loss_of_effectiveness", "SharedControl/CutIn-v1"):
        assert name in listed
    video = tmp_path / "episode.mp4"
    arguments = ("replay", "--scenario", "bend", "--degradation", "stuck", "--driver", "scripted", "--seed", 2)
    shown, _ = command(*arguments, "--video", video).communicate(timeout=120)
    assert "lateral_rms" in shown
    assert video.stat().st_size > 10_000
    refused = command(*arguments, "--video", video)
    assert "exists already" in " ".join(refused.communicate(timeout=60)[0].split())


def test_a_full_disk_is_said_and_what_was_done_is_kept(tmp_path, monkeypatch):
    from typer.testing import CliRunner

    from shared_control_env.cli import app

    real = ResultsFolder.add

    def add_until_full(folder, *arguments):
        if len(list(tmp_path.rglob("*.parquet"))) == 1:
            raise OSError(28, "No space left on device")
        real(folder, *arguments)

    arguments = [
        "benchmark",
        "--drivers",
        "none",
        "--authorities",
        "fixed,none",
        "--seeds",
        "0",
        "--out",
        str(tmp_path),
    ]
    monkeypatch.setattr(ResultsFolder, "add", add_until_full)
    full = CliRunner().invoke(app, arguments)
    assert full.exit_code == 1
    assert "No space left on device" in full.output
    assert len(pd.concat([pd.read_parquet(path) for path in tmp_path.rglob("*.parquet")])) == 1
    monkeypatch.setattr(ResultsFolder, "add", real)
    assert CliRunner().invoke(app, arguments).exit_code == 0
    assert len(pd.read_parquet(tmp_path / "episodes.parquet")) == 4


def test_the_printed_table_counts_every_failure_and_fits_a_terminal():
    names = [(driver, authority) for driver in ("mpc", "over_reacting") for authority in ("proportional", "none")]
    rows = [
        {"driver": driver, "authority": authority, "terminated": ends, "collisions": ends and side, **METERED}
        for driver, authority in names
        for ends, side in ((1, 1), (1, 0), (0, 0), (0, 0))
    ]
    console = Console(width=80, record=True, file=io.StringIO())
    console.print(summary(pd.DataFrame(rows)))
    text = console.export_text()
    assert max(map(len, text.splitlines())) <= 80
    for word in ("failures", "collisions", "lateral", "rms", "driver", "effort"):
        assert word in text
    assert text.count("0.5 ") == text.count("0.25 ") == 4


METERED = {"lateral_rms": 0.123, "driver_effort": 0.0456}


def test_the_driver_who_knows_the_own_lag_does_not_fail():
    """The predictive driver of the paper alone leaves the road in half of the episodes; knowing its lag, it stays."""
    laws = ["driver_only", "none", "proportional", "paper"]
    table = evaluate("internal_model", laws, "full", seeds=[1])
    assert len(table) == 4 * 170
    assert table["terminated"].mean() <= 0.005
    assert not table.loc[table["degradation"] == "none", "terminated"].any()
    alone = evaluate(["mpc", "internal_model"], "driver_only", "full", seeds=[1]).groupby("driver")
    assert alone["terminated"].mean()["mpc"] > 0.3
    assert alone["lateral_rms"].mean()["internal_model"] < 0.3 * alone["lateral_rms"].mean()["mpc"]
    case_2 = evaluate("internal_model", "driver_only", Suite("case 2", ("curve",), (None,)))
    assert case_2["lateral_max"].max() < 0.1


@pytest.mark.parametrize(("gain", "time"), [(0.8, 0.8), (0.8, 1.2), (1.2, 0.8), (1.2, 1.2)])
def test_a_driver_who_is_wrong_about_the_own_lag_seldom_fails(gain, time):
    believes = {"internal_model": {"active": True, "K_h": 1.0, "T_h": 0.2}}
    entry = DriverEntry("wrong", config={**believes, "driver_lag": {"K_h": gain, "T_h": 0.2 * time}})
    table = evaluate({"wrong": entry}, ["driver_only", "none", "proportional", "paper"], "full", seeds=[2])
    assert table["terminated"].mean() <= 0.05
