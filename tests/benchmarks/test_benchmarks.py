"""The benchmark's parts run and count what they say; their times are not tested."""

import re
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks import controllers, cost, environments, parts, scenarios, suite, vectors
from benchmarks.timing import Timing, time_block
from shared_control_env.core.compile.cold_start import cores

ROOT = Path(__file__).parents[2]


def test_timing():
    calls = []
    timing = time_block(lambda: calls.append(1) or 2, repeats=5)
    assert len(calls) == 6
    assert 0.0 <= timing.low <= timing.median <= timing.high
    assert str(Timing(1e-6, 5e-7, 2e-6)) == "1.0 us (0.5 to 2.0)"


def test_every_part_runs():
    for part in (environments.highway, environments.limited, environments.closed_loop):
        assert part(1).median > 0.0
    found = controllers.scenes(30)
    assert len(found) == 30
    assert not np.array_equal(found[0]["z"], found[-1]["z"])
    ours, slsqp, gaps = controllers.automation(found, 1)
    assert 0.0 < ours.median < slsqp.median
    assert np.isfinite(gaps).all()


def test_parts_and_vectors_run(monkeypatch):
    monkeypatch.setattr(vectors, "BLOCK", 512)
    assert all(timing.median > 0.0 for timing in parts.times(1).values())
    one = vectors.kernel(1, True, 1)
    assert one.one.median > 0.0
    assert (one.all, one.ratio) == (None, 1.0)
    several = vectors.kernel(64, False, 1, "SharedControl/DenseTraffic-v1")
    assert (several.all is not None) == (len(cores()) > 1)
    assert several.ratio > 0.0
    allowed = cores()
    many = vectors.kernel(1024, False, 1)
    assert cores() == allowed
    assert (many.all is None) is (len(allowed) == 1)
    assert many.ratio > 0.0
    (seconds,) = suite.seconds_for(10, 1, "paper")
    assert seconds > 0.0
    assert 0 < vectors.bytes_per_environment() <= 4400


def test_every_scenario_is_timed_with_every_driver(monkeypatch):
    ids = {"SharedControl/TwoLane-v1": "two_lane", "SharedControl/Bend-v1": "bend"}
    monkeypatch.setattr(scenarios, "ENVIRONMENTS", ids)
    monkeypatch.setattr(scenarios, "N", 32)
    monkeypatch.setattr(scenarios, "STEPS", 5)
    rows = scenarios.speeds(1)
    assert {(row.id, row.driver) for row in rows} == {(id, driver) for id in ids for driver in scenarios.DRIVERS}
    assert next(row.speed for row in rows if (row.id, row.driver) == scenarios.REFERENCE) == 1.0
    assert scenarios.mean_speed(rows, "mpc") > 0.0
    found = scenarios.shares("SharedControl/Bend-v1", 1)
    assert found["drawing of episodes"].median > 0.0
    assert set(parts.PARTS) < set(found)


def test_the_page_on_the_cost_of_a_step(monkeypatch, tmp_path):
    monkeypatch.setattr(cost, "VEHICLES", (0, 8, 12, 20))
    work = {name: (values[:2], of) for name, (values, of) in cost.WORK.items()}
    work["other vehicles"] = cost.VEHICLES, cost.WORK["other vehicles"][1]
    monkeypatch.setattr(cost, "WORK", work)
    monkeypatch.setattr(cost, "N", 4)
    monkeypatch.setattr(cost, "block", partial(vectors.block, steps=5))
    cost.main(repeats=3, out=tmp_path)
    page = (tmp_path / "speed.md").read_text()
    assert (tmp_path / "speed.png").stat().st_size > 10_000
    assert len(re.findall(r"^\| --- ", page, flags=re.MULTILINE)) == 3
    assert "| 30 |" in (ROOT / "docs/speed.md").read_text()
