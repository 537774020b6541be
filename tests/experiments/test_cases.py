"""The paper's cases: expected key figures, symmetry of the closed loop, verdicts that come from the runs."""

import json
import re

import numpy as np
import pandas as pd
import pytest

from experiments import claims, key_figures, style
from experiments.case_runs import Run, all_runs, simulate
from shared_control_env.envs import CurveEnv, TwoLaneEnv
from shared_control_env.wrappers import AuthorityLimiter, DriverModel


@pytest.fixture(scope="module")
def runs():
    return {run: simulate(run) for run in all_runs()}


def test_key_figures_are_the_expected_ones(runs):
    expected = json.loads(key_figures.EXPECTED.read_text())
    measured = key_figures.of_all_runs(runs)
    assert measured.keys() == expected.keys()
    for name, figures in measured.items():
        for figure, value in figures.items():
            assert value == pytest.approx(expected[name][figure], abs=key_figures.TOLERANCES[figure]), (name, figure)


def test_orders_of_the_spec(runs):
    """Case 1, largest |y|: alone leaves the lane, then unlimited, proportional, and Eq. 10 next to none."""
    largest = {run.name: table["y"].abs().max() for run, table in runs.items()}
    alone, unlimited = largest["case1-automation_alone-graded"], largest["case1-none-graded"]
    assert alone > 2.0 > unlimited > largest["case1-proportional-graded"] > largest["case1-paper-graded"]
    assert largest["case1-paper-graded"] < 1e-3
    alpha = runs[Run(2, "paper", "graded")].set_index("k")["alpha_a"]
    assert alpha[4] > 0.9 > alpha[10] > 0.5
    assert (np.diff(alpha.loc[5:10]) < 0.0).all()
    assert runs[Run(2, "paper", "paper")]["r_x"].max() < 1e-3


def closed_loop(env, steps):
    env = DriverModel(AuthorityLimiter(env))
    env.reset(seed=0)
    rows = []
    for _ in range(steps):
        info = env.step(0)[4]
        u = np.concatenate([info[name] for name in ("u_a_des", "u_a_f", "u_a_act", "u_h_des", "u_h_act", "u")])
        rows.append(np.r_[info["z"][1:] - [info["y_target"], 0, 0, 0, 0], u, info["r_x"], info["r_y"], info["alpha_a"]])
    return np.array(rows)


ODD = np.r_[-1, -1, 1, -1, -1, np.tile([1, -1], 6), 1, 1, 1]
"""Signs under a mirror of y, psi, v_x, v_y, r, the six commands, the risks and alpha_a."""


def test_two_lane_loop_mirrors():
    faults = [{"channel": "steering", "onset": 0.5, "ramp": 1.0, "size": 0.3}]
    right = [dict(fault, size=-0.3) for fault in faults]
    common = {"authority": {"law": "proportional"}}
    vehicles = [(0, 38.0, 12.0), (1, 30.0, 15.0), (1, -5.0, 12.0)]
    place = lambda flip: [{"lane": 1 - lane if flip else lane, "position": s, "speed": v} for lane, s, v in vehicles]
    here = TwoLaneEnv({**common, "faults": faults, "vehicles": place(False), "ego": {"lateral_offset": 0.4}})
    there = TwoLaneEnv({**common, "faults": right, "vehicles": place(True), "ego": {"lane": 1, "lateral_offset": -0.4}})
    np.testing.assert_allclose(closed_loop(there, 120), closed_loop(here, 120) * ODD, atol=2e-6)


def test_curve_loop_mirrors():
    def env(sign):
        return CurveEnv(
            {
                "road": {"lanes": 1, "segments": [{"length": 300.0, "curvature": sign / 60.0}]},
                "authority": {"law": "none"},
                "faults": [{"channel": "steering", "onset": 0.25, "ramp": 0.25, "size": sign * 0.05}],
            }
        )

    np.testing.assert_allclose(closed_loop(env(-1.0), 100), closed_loop(env(1.0), 100) * ODD, atol=2e-6)


def test_verdicts_follow_the_numbers(runs):
    rows = {(row["case"], row["claim"]): row for row in claims.judge(runs)}
    assert len(rows) == len(claims.CLAIMS)
    assert rows[2, "alpha_a follows the risk"]["verdict"] == claims.HOLDS_GRADED
    assert rows[1, "lane kept"]["verdict"] == claims.HOLDS
    # The same claims on a run that leaves the lane must fail.
    broken = dict(runs)
    for preset in ("paper", "graded"):
        broken[Run(1, "paper", preset)] = runs[Run(1, "none", preset, driver=False)]
    rows = {(row["case"], row["claim"]): row for row in claims.judge(broken)}
    assert rows[1, "lane kept"]["verdict"] == claims.FAILS
    assert rows[1, "delta_a,act no larger than delta_a,des"]["verdict"] == claims.FAILS
    assert rows[1, "impact of the fault limited"]["verdict"] == claims.FAILS


def test_an_undefined_number_does_not_hold(runs):
    constant = {run: table.assign(alpha_a=0.5, r_x=0.0) for run, table in runs.items()}
    rows = {(row["case"], row["claim"]): row for row in claims.judge(constant)}
    row = rows[2, "longitudinal risk rises with severity"]
    assert row["value_graded_risk"] is None
    assert row["verdict"] == claims.FAILS
    assert "| - |" in claims.as_markdown(list(rows.values()), {"seed": 0})


def test_claims_read_as_markdown_and_json(runs):
    rows = claims.judge(runs)
    page = claims.as_markdown(rows, {"seed": 0})
    assert all(row["claim"] in page for row in rows)
    table_lines = [line for line in page.splitlines() if line.startswith("|")]
    assert len(table_lines) == len(rows) + 2 * 3
    assert {len(re.findall(r"(?<!\\)\|", line)) for line in table_lines} == {7}
    assert json.loads(claims.as_json(rows, {"seed": 0}))["claims"] == rows


def test_tables_are_whole(runs):
    for run, table in runs.items():
        assert len(table) == 200 or table["terminated"].iloc[-1], run.name
        assert not table.drop(columns=["gap", "safe_area_lower", "safe_area_upper"]).isna().any().any()
        assert isinstance(table, pd.DataFrame)
        assert (table["automation_failures"] == 0).all()
        assert (table["driver_failures"] == 0).all()


def test_curves_that_lie_on_one_another_are_said_to():
    t = np.linspace(0.0, 1.0, 50)
    curves = {"a": t, "b": t + 0.001, "c": t**2, "short": np.where(t < 0.5, t**2, np.nan), "d": 1.0 - t}
    expected = {"a": "a", "b": "b (on a)", "c": "c", "short": "short (on c)", "d": "d"}
    assert style.labels(curves, 0.01) == expected
    assert style.labels(curves, 1e-4)["b"] == "b"
