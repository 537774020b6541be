"""Controllability studies end to end, and what they refuse."""

import json
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from shared_control_env.cli import app
from shared_control_env.core.faults.kinds import KINDS, SHARE, Kind, add_kind
from shared_control_env.evaluation import controllability, evaluate, summarise
from shared_control_env.evaluation.catalogue import AUTHORITIES, DRIVERS
from shared_control_env.evaluation.controllability import class_of, study_controllability
from shared_control_env.evaluation.episodes import EpisodeBatch, run
from shared_control_env.evaluation.severity import GradedFault, axis_of, parse_fault
from shared_control_env.evaluation.study import planned_study

SMALL = {
    "kinds": "bias",
    "authority": ["none", "barrier"],
    "driver": "hands_on",
    "scenarios": ["lane_keeping", "bend"],
    "budget": 420,
}


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    out = tmp_path_factory.mktemp("study") / "out"
    return controllability(**SMALL, at=0.2, out=out), out


def test_a_small_study(small):
    table, out = small
    assert list(table["authority"]) == ["none", "barrier"]
    by_name = table.set_index("authority")
    assert by_name.loc["barrier", "s_90"] > by_name.loc["none", "s_90"]
    assert (by_name["s_90_low"] <= by_name["s_90"]).all()
    assert (by_name["s_90"] <= by_name["s_90_high"]).all()
    assert list(by_name["class"]) == [class_of(share) for share in by_name["share"]]
    episodes = pd.read_parquet(out / "episodes.parquet")
    assert len(episodes) <= 420
    graded = episodes[episodes["severity"] > 0.0]
    np.testing.assert_allclose(graded["fault_size"].abs(), graded["severity"], rtol=1e-5)
    assert graded["fault_onset"].between(1.0, 3.0).all()
    assert set(np.sign(graded["fault_size"])) == {-1.0, 1.0}
    stored = json.loads((out / "margins.json").read_text())
    assert [row["authority"] for row in stored["margins"]] == ["none", "barrier"]
    assert len(pd.read_csv(out / "margins.csv")) == 2
    assert "<svg" in (out / "report.html").read_text()


def test_processes_and_resuming_give_the_same(small, tmp_path):
    table, _ = small

    def stop(done, total):
        if done > 150:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        controllability(**SMALL, at=0.2, out=tmp_path / "out", progress=stop)
    told = []
    again = controllability(**SMALL, at=0.2, out=tmp_path / "out", jobs=2, progress=lambda *n: told.append(n))
    pd.testing.assert_frame_equal(again, table)
    assert told[-1][0] <= told[-1][1] == 420


def test_all_authorities_meet_the_same_episodes(small):
    episodes = pd.read_parquet(small[1] / "episodes.parquet")
    keys = ["scenario", "degradation", "seed"]
    one, other = (episodes[episodes["authority"] == name].set_index(keys).sort_index() for name in ("none", "barrier"))
    both = one.index.intersection(other.index)
    assert len(both) > 100
    for column in ("K_h", "T_h", "response", "fault_onset"):
        np.testing.assert_array_equal(one.loc[both, column], other.loc[both, column])


def test_how_long_a_fault_may_last():
    table = controllability(
        "bias", "none", "hands_on", scenarios="lane_keeping", at={"bias": 0.3}, last=True, budget=300
    )
    assert list(table["over"]) == ["size", "duration"]
    assert table["s_50"].iloc[1] < 2.0  # a bias of 0.3 rad leaves the lane within a second
    assert table["fault"].iloc[1] == "bias of steering for a time, size 0.3"


def test_a_kind_keeps_its_own_channel():
    study = planned_study(
        ["bias:acceleration"], "none", "hands_on", "steering", "bend", "lane", 2.0, True, 400, 0.1, 0, {}
    )
    assert [(axis.channel, axis.over) for axis in study.axes] == [
        ("acceleration", "size"),
        ("acceleration", "duration"),
    ]


def test_ranking_has_the_baseline_at_one(small):
    study = planned_study(
        "bias",
        ["none", "proportional", "barrier"],
        "hands_on",
        "steering",
        ["bend"],
        "lane",
        None,
        False,
        400,
        0.1,
        0,
        {},
    )
    ranking = study_controllability(study).ranking
    own = ranking[ranking["authority"] == ranking["baseline"]]
    assert (own[["margin", "margin_low", "margin_high"]] == 1.0).all(axis=None)
    assert (own["more_effort"] == 0.0).all()
    against = ranking.pivot_table(index="authority", columns="baseline", values="margin")
    assert against.loc["proportional", "none"] == pytest.approx(1.0 / against.loc["none", "proportional"])


def test_own_kinds_scenarios_and_allocators_enter_by_name():
    class Half:
        def reset(self, seed=None):
            pass

        def allocate(self, scene, signals):
            return 0.5

    add_kind(Kind("faded", SHARE, act=_faded))
    try:
        axis = axis_of("faded")
        assert (axis.unit, axis.largest, axis.library) == ("-", 1.0, None)
        table = controllability("faded", {"half": Half}, "hands_on", scenarios="bend", budget=120)
        assert table["fault"].item() == "faded of steering"
    finally:
        del KINDS["faded"]


def _faded(c):
    return (1.0 - c.g * c.size) * c.u


@pytest.mark.parametrize("name", [name for name in KINDS if name != "none" and not KINDS[name].recorded])
def test_every_kind_has_an_axis_that_begins_with_no_fault_and_grows(name):
    channel = KINDS[name].channels[0]
    axis = axis_of(name, channel)
    assert axis.grid[0] == 0.0
    assert (np.diff(axis.grid) > 0.0).all()
    assert axis.library is None or axis.library <= axis.largest
    for seed in (0, 1):
        fault = axis.fault(axis.grid[3], seed)
        assert parse_fault(fault.label).settings() == fault.settings()
    entries = ("mpc", DRIVERS["mpc"]), ("none", AUTHORITIES["none"])
    (row,) = run(EpisodeBatch("lane_keeping", *entries, ((axis.fault(axis.grid[3], 0), 0),), {}, twins=False))
    assert row["fault_kind"] == name


def test_a_label_names_its_fault():
    assert parse_fault("bias:steering:-0.1:-") == GradedFault("bias", "steering", 0.1, -0.1, None, True)
    assert parse_fault("stuck:both:-:2.5").settings()["faults"] == [
        {"kind": "stuck", "channel": "both", "onset": 1.0, "duration": 2.5}
    ]
    for wrong in ("bias", "bias:steering", "bias:steering:much:-", "bies:steering:0.1:-", "bias:sterring:0.1:-"):
        with pytest.raises(ValueError, match=r"bias|steering"):
            parse_fault(wrong)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"kinds": "bies"}, "did you mean 'bias'"),
        ({"kinds": []}, "kinds is empty"),
        ({"kinds": "lane_offset", "channel": "acceleration"}, "channel = 'acceleration' of the kind 'lane_offset'"),
        ({"channel": "sterring"}, "did you mean 'steering'"),
        ({"authority": "bariier"}, "did you mean 'barrier'"),
        ({"scenarios": "bent"}, "did you mean 'bend'"),
        ({"keep": "lanes"}, "did you mean 'lane'"),
        ({"at": 3.0}, r"must be a number in \[0, 0.5236\] rad"),
        ({"at": -0.1}, r"must be a number in \[0, 0.5236\] rad"),
        ({"at": {"delay": 0.1}}, "'delay' is not among the kinds"),
        ({"kinds": ["bias", "delay"], "at": 0.1}, "give one for each kind"),
        ({"kinds": "white_noise", "last": True, "at": {}}, "needs at"),
        ({"at": 0.0, "last": True}, "no fault that could last"),
        ({"budget": 100}, "budget = 100 episodes is too small.*need 224"),
        ({"budget": 1.5}, "budget = 1.5 must be an integer"),
        ({"width": 0.0}, "width = 0.0 must be a number above 0"),
        ({"jobs": 0}, "jobs = 0"),
        ({"fresh": "yes"}, "fresh = 'yes' must be True or False"),
        ({"config": ["ego"]}, "must be a dict"),
        ({"config": {"persons": ["hands_on"]}}, "persons"),
    ],
)
def test_what_is_refused(changes, words):
    with pytest.raises(ValueError, match=words):
        controllability(**{**SMALL, **changes})


def test_a_folder_of_a_benchmark_is_not_mixed_with_a_study(tmp_path):
    from shared_control_env.evaluation import Suite

    evaluate("none", "none", Suite("x", ("two_lane",), ("none",)), out=tmp_path)
    with pytest.raises(ValueError, match="holds results with"):
        controllability(**SMALL, out=tmp_path)


def test_the_command(tmp_path):
    arguments = ["controllability", "--kinds", "bias", "--authorities", "none", "--drivers", "hands_on", "--scenarios"]
    arguments += ["bend", "--budget", "160", "--at", "0.2", "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    assert "bias of steering" in result.output.replace("\n", " ")
    again = CliRunner().invoke(app, [*arguments[:-1], str(tmp_path / "other"), "--at", "much"])
    assert again.exit_code != 0


def test_a_failure_is_replayed_from_its_command(small):
    _, out = small
    text = (out / "report.html").read_text()
    start = text.index("shared-control replay")
    command = text[start : text.index("</code>", start)].split()[1:]
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 0, result.output


def test_the_page_in_a_browser(browser, small):
    _, out = small
    browser.set_window_size(1300, 2400)
    browser.get((out / "report.html").as_uri())
    assert [entry for entry in browser.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")] == []
    titles = [each.text for each in browser.find_elements("tag name", "h2")]
    for title in (
        "Ranking: hands_on, against none",
        "Controllability curves: hands_on",
        "Margins",
        "Failures to look at",
    ):
        assert title in titles
    assert len(browser.find_elements("css selector", "figure svg")) == 2
    assert len(browser.find_elements("css selector", "#margins tbody tr")) == 2
    ids = [each.get_attribute("id") for each in browser.find_elements("css selector", "[id]")]
    assert len(ids) == len(set(ids))
    width = browser.execute_script("return document.documentElement.scrollWidth - document.documentElement.clientWidth")
    assert width <= 0  # wide tables scroll by themselves


def test_summarise_is_public():
    table = evaluate("scripted", ["none", "paper"], "paper", seeds=[0, 1])
    summary = summarise(table)
    assert set(summary["authority"]) == {"none", "paper"}
    row = summary[(summary["authority"] == "none") & (summary["metric"] == "lateral_rms")].iloc[0]
    mean = table[table["authority"] == "none"]["lateral_rms"].mean()
    assert row["mean"] == pytest.approx(mean)
    assert row["mean_low"] <= mean <= row["mean_high"]


def test_the_classes():
    assert [class_of(share) for share in (1.0, 0.99, 0.98, 0.9, 0.89, 0.0)] == ["C1", "C1", "C2", "C2", "C3", "C3"]


def test_importing_it_does_not_import_plots():
    code = "import sys, shared_control_env.evaluation; print('matplotlib' in sys.modules)"
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "False"
