"""The reference table and the sensitivity: made from runs, with sentences that their numbers allow."""

import numpy as np
import pandas as pd
import pytest

from experiments import benchmark, sensitivity
from shared_control_env.envs.scenarios import SCENARIOS
from shared_control_env.envs.settings import combined
from shared_control_env.evaluation import evaluate


def table_of(**failures):
    """Episodes of one driver whose share of failures under each authority is given."""
    rows = [
        {
            "scenario": "bend",
            "degradation": "none" if seed % 2 else "stuck",
            "driver": "mpc",
            "authority": authority,
            "seed": seed,
            "terminated": seed < rate * 40,
            "lateral_rms": 0.1,
            "versions": "numpy 2",
        }
        for authority, rate in failures.items()
        for seed in range(40)
    ]
    return pd.DataFrame(rows)


@pytest.mark.parametrize(
    ("paper", "none", "verdict"),
    [(0.1, 0.8, "has fewer failures"), (0.8, 0.1, "has more failures"), (0.5, 0.525, "cannot be told apart")],
)
def test_a_sentence_says_what_its_interval_allows(paper, none, verdict):
    assert verdict in benchmark.compared(table_of(paper=paper, none=none), "mpc", "paper", "none")


def test_the_difference_is_that_of_pairs():
    change, low, high = benchmark.difference(table_of(paper=0.1, none=0.8), "mpc", "paper", "none")
    assert change == pytest.approx(-0.7)
    assert low < change < high < 0.0


def test_markdown_of_a_real_run():
    table = evaluate(["mpc", "none"], ["paper", "none"], "full", seeds=[0, 1])
    text = benchmark.as_markdown(table)
    assert "| paper | " in text
    rate = 100.0 * table[(table["authority"] == "none") & (table["driver"] == "none")]["terminated"].mean()
    assert f"{rate:.1f} / " in text
    assert text.count("\n- ") >= 4


def test_sensitivity_of_a_parameter_that_matters(tmp_path):
    base, *others = sensitivity.variations()
    assert {v.parameter for v in others} >= {"MPC weight W, factor", "T_h, value [s]", "tau_p, value [s]"}
    chosen = [base, *(v for v in others if v.parameter in ("K_h, value", "membership breakpoints, exponent"))]
    table = pd.concat([sensitivity.measure(variation) for variation in chosen], ignore_index=True)
    published, ranges = sensitivity.deviations(table, "curve", "proportional")
    assert ranges["low"]["K_h, value"] < published - 0.5
    assert (ranges["low"] <= published).all()
    assert (ranges["high"] >= published).all()
    sensitivity.draw(table, tmp_path / "sensitivity.png")
    assert (tmp_path / "sensitivity.png").stat().st_size > 20_000
    assert sensitivity.as_markdown(table).count("\n") == len(table) + 2


def test_breakpoints_as_published_are_the_limiters():
    base = evaluate("mpc", "proportional", "paper")
    same = sensitivity.measure(sensitivity.variations()[0])
    np.testing.assert_allclose(same[same["authority"] == "proportional"]["lateral_max"], base["lateral_max"])


def test_every_variation_is_allowed_and_the_persons_and_tyres_are_among_them():
    both = [*sensitivity.variations(), *sensitivity.variations_of_the_person()]
    for variation in both:
        combined(SCENARIOS["two_lane"].settings, variation.config)
    names = {variation.parameter for variation in both}
    assert names >= {"brush tyres, friction", "steering actuator, lag [s]", "response, factor", "delay, factor"}


def test_sensitivity_of_a_person(monkeypatch):
    monkeypatch.setattr(sensitivity, "PEOPLE", range(6))
    chosen = [
        each
        for each in sensitivity.variations_of_the_person()
        if each.parameter in (sensitivity.BASE, "response, factor")
    ]
    table = pd.concat([sensitivity.measure(variation) for variation in chosen], ignore_index=True)
    assert set(table["driver"]) == {"hands_on"}
    _, ranges = sensitivity.deviations(table, "two_lane", "proportional")
    assert ranges["high"]["response, factor"] > ranges["low"]["response, factor"] + 0.2
