"""Key figures of all runs, and the expected key figures that the tests compare them with.

``python -m experiments.key_figures`` writes new expected figures, after a change that is meant to change them.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from experiments.case_runs import Run, all_runs, simulate
from shared_control_env.evaluation.storage import write_atomically

EXPECTED = Path(__file__).parent / "expected" / "key_figures.json"

TOLERANCES = {
    "max_abs_y": 0.02,  # [m]
    "final_v_x": 0.02,  # [m/s]
    "min_gap": 0.02,  # [m]
    "max_r_x": 0.01,
    "max_r_y": 0.01,
    "min_alpha_a": 0.01,
    "alpha_a_at_1_s": 0.01,
    "max_abs_u_h_act_a": 0.02,  # [m/s^2]
    "max_abs_u_h_act_delta": 0.005,  # [rad]
    "steps": 0,
    "lane_departures": 0,
}
"""Absolute tolerance of every figure: solvers and compilers may differ in the last digits, methods may not."""


def key_figures(table: pd.DataFrame) -> dict[str, float]:
    """The key figures of one run, in the order of :data:`TOLERANCES`.

    Args:
        table: signals of the run, one row per time step.
    """
    values = (
        table["y"].abs().max(),
        table["v_x"].iloc[-1],
        table["gap"].min(),
        table["r_x"].max(),
        table["r_y"].max(),
        table["alpha_a"].min(),
        table.loc[table["k"] == 20, "alpha_a"].iloc[0],
        table["a_h_act"].abs().max(),
        table["delta_h_act"].abs().max(),
        len(table),
        table["lane_departures"].iloc[-1],
    )
    return {name: float(value) for name, value in zip(TOLERANCES, values, strict=True)}


def of_all_runs(runs: Mapping[Run, pd.DataFrame]) -> dict[str, dict[str, float]]:
    """Key figures of each run, by the name of the run.

    Args:
        runs: signals of all runs.
    """
    return {run.name: key_figures(table) for run, table in runs.items()}


def main() -> None:
    """Simulate all runs and write their key figures as the expected ones."""
    figures = of_all_runs({run: simulate(run) for run in all_runs()})
    write_atomically(EXPECTED, lambda path: path.write_text(json.dumps(figures, indent=2) + "\n"))
    print(f"wrote {EXPECTED}")


if __name__ == "__main__":
    main()
