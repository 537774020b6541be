"""The table of trained drivers and allocators beside the others."""

from functools import partial

import numpy as np
import pandas as pd
import pytest

pytest.importorskip("stable_baselines3", reason="needs the extra 'train'")

from typer.testing import CliRunner

from agents import evaluate, render
from agents.card import card_of
from agents.evaluate import COMPARED, KINDS, LEARNED, METRICS, compare, losses, measure, over_seeds
from agents.tasks import HELD_OUT_SEED
from shared_control_env.learned.history import HISTORY
from shared_control_env.learned.policy import Policy
from shared_control_env.learned.views import FEATURES_OF

ID = "SharedControl/Bend-v1"


@pytest.fixture
def idle(tmp_path):
    """Files of policies that always give the same small action."""

    def make(task, biases):
        paths = []
        for i, bias in enumerate(biases):
            actions = np.array([0.0, bias] if task == "driver" else [bias])
            weights = np.zeros((len(actions), len(FEATURES_OF[task]) * HISTORY))
            policy = Policy([(weights, actions)], "tanh", False, card_of("none", [ID], task, 0, {}, ()))
            paths.append(tmp_path / f"{task}-{i}.npz")
            policy.save(paths[-1])
        return [str(path) for path in paths]

    return make


@pytest.mark.parametrize(("task", "baseline"), [("driver", "internal_model"), ("allocator", "proportional")])
def test_table(idle, task, baseline):
    table = measure(task, idle(task, (0.0, 0.1)), ("bend",), 2)
    assert table["seed"].min() >= HELD_OUT_SEED
    rows = compare(table, task)
    names = [LEARNED, *COMPARED[task], f"{LEARNED} - {baseline}"]
    assert [(row.kind, row.name) for row in rows] == [(kind, name) for kind in KINDS for name in names]
    for row in rows:
        if " - " in row.name:
            continue
        part = table[(table["kind"] == row.kind) & table["name"].str.startswith(row.name)]
        for name in METRICS:
            assert row.values[name].estimate == pytest.approx(part[name].mean())
        assert row.values["lateral_rms"].n == (2 if row.name == LEARNED else len(part))
    differences = {row.kind: row.values for row in rows if " - " in row.name}
    both = {row.kind: row.values for row in rows if row.name == baseline}
    for row in rows:
        if row.name == LEARNED:
            for name in METRICS:
                expected = row.values[name].estimate - both[row.kind][name].estimate
                assert differences[row.kind][name].estimate == pytest.approx(expected, abs=1e-12)


def test_intervals_over_seeds_are_students():
    values = np.array([1.0, 2.0, 4.0, 3.0, 2.5])
    found = over_seeds(values)
    # t of 4 degrees of freedom at 97.5 %: 2.776
    assert found.high - found.estimate == pytest.approx(2.776 * np.std(values, ddof=1) / np.sqrt(5), rel=1e-3)
    assert found.estimate == 2.5
    assert np.isnan(over_seeds(values[:1]).low)


def made_up(learned, baseline=0.2):
    """A table of five training seeds in one scenario under one degradation, the same value for all metrics."""
    values = {
        **{f"{LEARNED} {i}": value for i, value in enumerate(learned)},
        **dict.fromkeys(COMPARED["driver"], baseline),
    }
    rows = [
        {
            "scenario": "bend",
            "degradation": "delay",
            "kind": KINDS[0],
            "seed": seed,
            "name": name,
            **dict.fromkeys(METRICS, v),
        }
        for name, v in values.items()
        for seed in range(4)
    ]
    return pd.DataFrame(rows)


@pytest.mark.parametrize(
    ("learned", "lost"),
    [((0.3, 0.31, 0.32, 0.3, 0.31), True), ((0.9, 0.1, 0.15, 0.2, 0.18), False), ((0.1, 0.1, 0.11, 0.1, 0.1), False)],
)
def test_losses_are_those_that_all_of_the_interval_shows(learned, lost):
    found = losses(made_up(learned), "driver")
    assert list(found["metric"]) == (list(METRICS) if lost else [])
    for _, row in found.iterrows():
        assert row[LEARNED] == pytest.approx(np.mean(learned))


def test_a_difference_is_as_uncertain_as_seeds_and_episodes_are():
    table = made_up((0.3, 0.3, 0.3, 0.3, 0.3))
    spread = table["seed"].to_numpy() * (table["name"] == "internal_model")  # of the baseline, from episode to episode
    table["collisions"] += 0.1 * spread - 0.15 * (table["name"] == "internal_model")
    (row,) = [row for row in compare(table, "driver") if row.name == f"{LEARNED} - internal_model"]
    assert row.values["lateral_rms"].low == pytest.approx(0.1)
    assert row.values["lateral_rms"].high == pytest.approx(0.1)
    assert row.values["collisions"].estimate == pytest.approx(0.1)
    assert row.values["collisions"].low < 0.03 < 0.17 < row.values["collisions"].high


def test_command(idle):
    app = evaluate.typer.Typer()
    app.command()(evaluate.main)
    result = CliRunner().invoke(app, [*idle("driver", (0.0,)), "--seeds", "1"])
    assert result.exit_code == 0, result.output
    assert "of bend" in " ".join(result.output.split())
    wrong = CliRunner().invoke(app, ["--task", "diver"])
    assert "driver" in wrong.output
    assert wrong.exit_code == 2


def test_video_side_by_side(idle, tmp_path, monkeypatch):
    short = {"duration": 2.0, "screen_width": 400, "screen_height": 250}
    monkeypatch.setattr(render, "replay_episode", partial(render.replay_episode, config=short))
    (policy,) = idle("driver", (0.0,))
    app = render.typer.Typer()
    app.command()(render.main)
    path = tmp_path / "video.mp4"
    drivers = f"mpc:proportional,{policy},none:none"
    arguments = ["--scenario", "bend", "--degradation", "step_bias", "--drivers", drivers, "--out", str(path)]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    assert path.stat().st_size > 10_000
    again = CliRunner().invoke(app, arguments)
    assert again.exit_code == 2
    assert "choose another --out" in again.output


def test_frames_of_a_drive_that_ended_stay():
    frame = np.zeros((40, 101, 3), np.uint8)
    drives = [render.Drive("short", [frame]), render.Drive("long", [frame, frame + 100])]
    first, last = render.side_by_side(drives)
    assert first.shape == (2 * (40 + render.TITLE_HEIGHT), 100, 3)
    assert last[60].max() <= 235
    np.testing.assert_array_equal(last[render.TITLE_HEIGHT : 60], first[render.TITLE_HEIGHT : 60])
    assert (last[-10] == 100).all()
