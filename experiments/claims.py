"""The paper's assertions about its results, each as a number taken from the runs, with a verdict.

The assertions are reworded here, and the place in the paper is named. The paper gives no thresholds for words such
as "small". The thresholds here are our choice and part of the check. Each claim is judged with the printed
longitudinal risk (preset ``paper``) and with the ``graded`` one.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import spearmanr

from experiments.case_runs import Run
from shared_control_env.core.authority.fuzzy import authority
from shared_control_env.core.parameters import Limits, LongitudinalRiskParameters, VehicleParameters
from shared_control_env.core.risk.longitudinal import dynamic_field

Runs = Mapping[Run, pd.DataFrame]

HOLDS, HOLDS_GRADED, FAILS = "holds", "holds with graded risk", "does not hold"

ONSET = {1: 0.5, 2: 0.25}
FULL = {1: 1.5, 2: 0.5}
"""Times at which the degradation of each case begins and is complete [s]."""


@dataclass(frozen=True)
class Claim:
    """One assertion.

    Attributes:
        name: short name.
        case: 1, 2, or 0 for the method itself.
        source: place in the paper.
        says: the assertion, reworded.
        check: description of the number that tests the assertion.
        unit: unit of the number.
        measure: function that gives the number from the runs and the preset of the longitudinal risk.
        bound: threshold.
        at_most: True if the number must not exceed the bound; False if it must not fall below the bound.
    """

    name: str
    case: int
    source: str
    says: str
    check: str
    unit: str
    measure: Callable[[Runs, str], float]
    bound: float
    at_most: bool

    def passes(self, value: float) -> bool:
        """Whether a number meets the bound; NaN never does.

        Args:
            value: the number, in the claim's unit.
        """
        return value <= self.bound if self.at_most else value >= self.bound


def _table(runs: Runs, case: int, preset: str, law: str = "paper") -> pd.DataFrame:
    return runs[Run(case, law, preset)]


def _before(table: pd.DataFrame, case: int) -> pd.DataFrame:
    return table[table["t"] < ONSET[case] - 1e-9]


def _ramp(table: pd.DataFrame, case: int) -> pd.DataFrame:
    return table[table["t"].between(ONSET[case] - 1e-9, FULL[case] + 1e-9)]


def _after(table: pd.DataFrame, case: int, since: Mapping[int, float] = FULL) -> pd.DataFrame:
    return table[table["t"] >= since[case] - 1e-9]


def _rank_correlation(a: pd.Series, b: pd.Series) -> float:
    """Spearman's rank correlation of values rounded to three decimals; NaN if either is then constant."""
    a, b = a.round(3), b.round(3)
    if a.nunique() < 2 or b.nunique() < 2:
        return float("nan")
    return float(spearmanr(a, b).statistic)


def _scaled(table: pd.DataFrame, first: str, second: str | None = None) -> float:
    """Largest command, or difference of two commands, relative to its limit, over both channels."""
    limits = Limits()
    largest = 0.0
    for channel, bound in (("a", limits.a_max), ("delta", limits.delta_max)):
        values = table[first.format(channel)] - (table[second.format(channel)] if second else 0.0)
        largest = max(largest, float(values.abs().max()) / bound)
    return largest


def _excess(table: pd.DataFrame, channel: str, bound: pd.Series) -> float:
    return float((table[f"{channel}_a_act"].abs() - bound).max())


def _largest_rise_of_authority(runs: Runs, preset: str) -> float:
    risks = np.linspace(0.0, 1.0, 101)
    surface = np.array([[authority(r_x, r_y, 0) for r_x in risks] for r_y in risks])
    return float(max(np.diff(surface, axis=0).max(), np.diff(surface, axis=1).max()))


def _largest_field_when_opening(runs: Runs, preset: str) -> float:
    p = LongitudinalRiskParameters(graded=preset == "graded")
    values = [dynamic_field(dv, dx, 5.0, p) for dv in np.linspace(-5, 0, 21) for dx in np.linspace(0, 30, 61)]
    values += [dynamic_field(dv, dx, 5.0, p) for dv in np.linspace(0, 5, 21) for dx in np.linspace(-30, -0.1, 61)]
    return float(max(values))


def _largest_in_any_run(runs: Runs, preset: str) -> float:
    return max(
        _excess(table, channel, table[f"{channel}_a_des"].abs())
        for run, table in runs.items()
        if run.preset == preset and run.law == "paper"
        for channel in ("a", "delta")
    )


CLAIMS: tuple[Claim, ...] = (
    Claim(
        "alpha_a is about 1 at low risk", 0, "Section IV", "With both risks low the automation dominates.",
        "alpha_a(0, 0)", "-", lambda runs, preset: authority(0.0, 0.0, 0), 0.99, False,
    ),
    Claim(
        "alpha_a falls with either risk", 0, "Section IV", "A rise of either risk lowers the authority.",
        "largest rise of alpha_a along either risk on a 101 x 101 grid", "-", _largest_rise_of_authority, 1e-12, True,
    ),
    Claim(
        "the field is not positive when the gap opens", 0, "Section III-C",
        "Slower than the vehicle ahead, or faster than the one behind, the dynamic field is at most 0.",
        "largest U^d over such pairs", "-", _largest_field_when_opening, 0.0, True,
    ),
    Claim(
        "r_x stays below 1", 0, "Section III-C", "The longitudinal risk is always less than 1.",
        "largest r_x of both cases, degraded automation alone included", "-",
        lambda runs, preset: max(t["r_x"].max() for run, t in runs.items() if run.preset == preset), 1.0 - 1e-9, True,
    ),
    Claim(
        "u_a,act never exceeds u_a,des", 0, "Section IV", "Under Eq. 10 the actual command is no larger than the desired.",
        "largest |u_a,act| - |u_a,des| of either channel, both cases", "SI", _largest_in_any_run, 1e-9, True,
    ),
    Claim(
        "lane kept", 1, "Section VI-B", "The lane is kept in spite of the degradation.",
        "largest |y| (the body stays in the lane up to 1 m)", "m",
        lambda runs, preset: float(_table(runs, 1, preset)["y"].abs().max()), 1.0, True,
    ),
    Claim(
        "safe area found", 1, "Section VI-B", "The triangulation finds the safe area at every step.",
        "share of steps with a way to the final region", "-",
        lambda runs, preset: float((_table(runs, 1, preset)["safe_area_outcome"] == 0).mean()), 1.0, False,
    ),
    Claim(
        "preceding's speed tracked", 1, "Section VI-B", "The ego's velocity follows the preceding's.",
        "mean |v_x - v_preceding| over the last second", "m/s",
        lambda runs, preset: float((_table(runs, 1, preset)["v_x"] - 12.0).abs().tail(20).mean()), 0.25, True,
    ),
    Claim(
        "lateral risk shows the onset", 1, "Section VI-B",
        "The estimated risk, the lateral one above all, shows that degradation has set in.",
        "largest r_y after the onset minus the largest before", "-",
        lambda runs, preset: float(
            _after(_table(runs, 1, preset), 1, ONSET)["r_y"].max() - _before(_table(runs, 1, preset), 1)["r_y"].max()
        ),
        0.2, False,
    ),
    Claim(
        "alpha_a falls with severity", 1, "Section VI-B", "alpha_a varies with the severity of the degradation.",
        "rank correlation of alpha_a with the fault's size while it ramps up", "-",
        lambda runs, preset: _rank_correlation(
            _ramp(_table(runs, 1, preset), 1)["alpha_a"], _ramp(_table(runs, 1, preset), 1)["fault_delta"].abs()
        ),
        -0.9, True,
    ),
    Claim(
        "no degradation before the onset", 1, "Section VI-B", "In normal operation u_a,f equals u_a,des.",
        "largest |u_a,f - u_a,des| over its limit before 0.5 s", "-",
        lambda runs, preset: _scaled(_before(_table(runs, 1, preset), 1), "{}_a_f", "{}_a_des"), 0.0, True,
    ),
    Claim(
        "driver and automation agree in normal operation", 1, "Section VI-B", "u_h,des is about u_a,des.",
        "largest |u_h,des - u_a,des| over its limit before 0.5 s", "-",
        lambda runs, preset: _scaled(_before(_table(runs, 1, preset), 1), "{}_h_des", "{}_a_des"), 0.05, True,
    ),
    Claim(
        "u_h,act vanishes in normal operation", 1, "Section VI-B", "The driver need not act: u_h,act tends to 0.",
        "largest |u_h,act| over its limit before 0.5 s", "-",
        lambda runs, preset: _scaled(_before(_table(runs, 1, preset), 1), "{}_h_act"), 0.02, True,
    ),
    Claim(
        "delta_a,act much smaller than delta_a,f", 1, "Section VI-B", "The limited steering is much smaller than the degraded.",
        "largest |delta_a,act| / |delta_a,f| from 1.5 s on", "-",
        lambda runs, preset: float(
            (_after(_table(runs, 1, preset), 1)["delta_a_act"] / _after(_table(runs, 1, preset), 1)["delta_a_f"]).abs().max()
        ),
        0.1, True,
    ),
    Claim(
        "delta_a,act no larger than delta_a,des", 1, "Section VI-B", "The limited steering does not exceed the desired.",
        "largest |delta_a,act| - |delta_a,des|", "rad",
        lambda runs, preset: _excess(
            _table(runs, 1, preset), "delta", _table(runs, 1, preset)["delta_a_des"].abs()
        ),
        1e-9, True,
    ),
    Claim(
        "acceleration untouched", 1, "Section VI-B", "The longitudinal command is not degraded: a_a,f equals a_a,des.",
        "largest |a_a,f - a_a,des|", "m/s^2",
        lambda runs, preset: float((_table(runs, 1, preset)["a_a_f"] - _table(runs, 1, preset)["a_a_des"]).abs().max()),
        0.0, True,
    ),
    Claim(
        "driver compensates by steering", 1, "Section VI-B", "The driver compensates by exerting delta_h,act.",
        "largest |delta_h,act| after the onset", "deg",
        lambda runs, preset: float(np.degrees(_after(_table(runs, 1, preset), 1, ONSET)["delta_h_act"].abs().max())),
        0.1, False,
    ),
    Claim(
        "driver has priority", 1, "Section VI-B", "The driver has the final authority where the objectives differ.",
        "largest |u - u_h,des| over its limit from 0.6 s on", "-",
        lambda runs, preset: _scaled(_table(runs, 1, preset).query("t >= 0.6"), "{}", "{}_h_des"), 0.05, True,
    ),
    Claim(
        "impact of the fault limited", 1, "Section VI-B", "The impact of delta_a,f on the motion is limited.",
        "largest |y| under Eq. 10 over that under unlimited degradation", "-",
        lambda runs, preset: float(
            _table(runs, 1, preset)["y"].abs().max() / _table(runs, 1, preset, "none")["y"].abs().max()
        ),
        0.5, True,
    ),
    Claim(
        "lane kept", 2, "Section VI-C", "The driving task is performed on the curve.",
        "largest |y| (the body stays in the lane up to 1 m)", "m",
        lambda runs, preset: float(_table(runs, 2, preset)["y"].abs().max()), 1.0, True,
    ),
    Claim(
        "only a small velocity vibration", 2, "Section VI-C", "The velocity vibrates little, as the degradation sets in.",
        "largest |v_x - 12 m/s|", "m/s",
        lambda runs, preset: float((_table(runs, 2, preset)["v_x"] - 12.0).abs().max()), 0.5, True,
    ),
    Claim(
        "longitudinal risk rises with severity", 2, "Section VI-C", "The longitudinal risk grows with the fault of a_a,f.",
        "rank correlation of r_x with the fault's size while it ramps up", "-",
        lambda runs, preset: _rank_correlation(
            _ramp(_table(runs, 2, preset), 2)["r_x"], _ramp(_table(runs, 2, preset), 2)["fault_a"].abs()
        ),
        0.9, False,
    ),
    Claim(
        "alpha_a follows the risk", 2, "Section VI-C", "The authority varies with the driving risk.",
        "alpha_a before the onset minus that when the fault is complete", "-",
        lambda runs, preset: float(
            _before(_table(runs, 2, preset), 2)["alpha_a"].iloc[-1] - _after(_table(runs, 2, preset), 2)["alpha_a"].iloc[0]
        ),
        0.05, False,
    ),
    Claim(
        "a_a,f much larger than a_a,des", 2, "Section VI-C", "The degraded acceleration far exceeds the desired.",
        "smallest a_a,f - a_a,des from 0.5 s on", "m/s^2",
        lambda runs, preset: float(
            (_after(_table(runs, 2, preset), 2)["a_a_f"] - _after(_table(runs, 2, preset), 2)["a_a_des"]).min()
        ),
        2.5, False,
    ),
    Claim(
        "a_a,act bounded by alpha_a a_a,des", 2, "Section VI-C", "The actual acceleration is bounded by alpha times the desired.",
        "largest |a_a,act| - alpha_a |a_a,des| from 0.5 s on", "m/s^2",
        lambda runs, preset: _excess(
            _after(_table(runs, 2, preset), 2),
            "a",
            _after(_table(runs, 2, preset), 2)["alpha_a"] * _after(_table(runs, 2, preset), 2)["a_a_des"].abs(),
        ),
        1e-9, True,
    ),
    Claim(
        "driver provides the rest", 2, "Section VI-C", "The driver makes up for the command that is required.",
        "largest |u - u_h,des| over its limit from 0.5 s on", "-",
        lambda runs, preset: _scaled(_after(_table(runs, 2, preset), 2), "{}", "{}_h_des"), 0.05, True,
    ),
    Claim(
        "driver compensates by acceleration", 2, "Section VI-C", "The driver exerts what the limited automation lacks.",
        "largest |a_h,act| after the onset", "m/s^2",
        lambda runs, preset: float(_after(_table(runs, 2, preset), 2, ONSET)["a_h_act"].abs().max()), 0.05, False,
    ),
    Claim(
        "safety kept", 2, "Section VI-C", "The driving task stays safe.",
        "smallest bumper-to-bumper gap (d_o = 2 m is the clearance)", "m",
        lambda runs, preset: float(_table(runs, 2, preset)["gap"].min() - VehicleParameters().length), 2.0, False,
    ),
)  # fmt: skip


def judge(runs: Runs) -> list[dict[str, Any]]:
    """Numbers and verdicts of all claims.

    Args:
        runs: signals of all runs.

    Returns:
        One plain dict per claim.
    """
    rows = []
    for claim in CLAIMS:
        values = {preset: float(claim.measure(runs, preset)) for preset in ("paper", "graded")}
        passed = {preset: claim.passes(value) for preset, value in values.items()}
        verdict = HOLDS if passed["paper"] else HOLDS_GRADED if passed["graded"] else FAILS
        rows.append(
            {
                "case": claim.case,
                "claim": claim.name,
                "source": claim.source,
                "says": claim.says,
                "check": claim.check,
                "unit": claim.unit,
                "bound": claim.bound,
                "bound_is": "at most" if claim.at_most else "at least",
                "value_paper_risk": None if np.isnan(values["paper"]) else values["paper"],
                "value_graded_risk": None if np.isnan(values["graded"]) else values["graded"],
                "verdict": verdict,
            }
        )
    return rows


def as_json(rows: list[dict[str, Any]], provenance: dict[str, Any]) -> str:
    """Claims with versions and seed, as JSON.

    Args:
        rows: result of :func:`judge`.
        provenance: versions and seed.
    """
    return json.dumps({"provenance": provenance, "claims": rows}, indent=2) + "\n"


def as_markdown(rows: list[dict[str, Any]], provenance: dict[str, Any]) -> str:
    """Claims as a Markdown page.

    Args:
        rows: result of :func:`judge`.
        provenance: versions and seed.
    """
    counts = {verdict: sum(row["verdict"] == verdict for row in rows) for verdict in (HOLDS, HOLDS_GRADED, FAILS)}
    lines = [
        "# Claims of the paper, checked on this run",
        "",
        f"Of {len(rows)} claims {counts[HOLDS]} hold, {counts[HOLDS_GRADED]} hold with the graded risk alone, and "
        f"{counts[FAILS]} do not hold.",
        "",
        "*holds*: with the longitudinal risk as printed. *holds with graded risk*: only with sigma_x = 2 d^s.",
        "A dash stands for a number that is not defined, such as the correlation with a risk that stays 0.",
        "",
    ]
    titles = {0: "The method", 1: "Case 1: two lanes, steering degraded", 2: "Case 2: curve, acceleration degraded"}
    for case, title in titles.items():
        lines += [f"## {title}", ""]
        lines += [_row("claim", "check", "bound", "printed risk", "graded risk", "verdict"), _row(*["---"] * 6)]
        for row in rows:
            if row["case"] == case:
                unit = "" if row["unit"] == "-" else f" {row['unit']}"
                lines.append(
                    _row(
                        f"{row['claim']}: {row['says']} ({row['source']})",
                        row["check"],
                        f"{row['bound_is']} {_number(row['bound'])}{unit}",
                        _number(row["value_paper_risk"]),
                        _number(row["value_graded_risk"]),
                        f"**{row['verdict']}**",
                    )
                )
        lines.append("")
    lines += ["Versions and seed: " + ", ".join(f"{name} {value}" for name, value in provenance.items()) + "."]
    return "\n".join(lines) + "\n"


def _row(*cells: str) -> str:
    """A row of a Markdown table; vertical bars within a cell are escaped."""
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _number(value: float | None) -> str:
    """Number with three significant digits; a residue below 1e-12 is shown as 0."""
    return "-" if value is None else "0" if abs(value) < 1e-12 else f"{value:.3g}"
