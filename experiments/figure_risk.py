"""Figures 9 and 12: risk, authority and velocity over time."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from experiments import style
from experiments.case_runs import PRESETS, Run

ONSET = {1: 0.5, 2: 0.25}


def draw(runs: dict[Run, pd.DataFrame], case: int, path: Path) -> None:
    """Draw both risks, alpha_a and v_x in three panels, for both presets of the longitudinal risk.

    Args:
        runs: signals of all runs.
        case: 1 or 2.
        path: file of the picture.
    """
    with style.figure(path, 1, 3, (12.0, 3.4)) as (fig, axes):
        risk, authority, velocity = axes[0]
        for preset, look in zip(PRESETS, ("-", "--"), strict=True):
            table = runs[Run(case, "paper", preset)]
            risk.plot(table["t"], table["r_x"], look, color="#ff7f0e", label=f"$r_x$, {preset}")
            risk.plot(table["t"], table["r_y"], look, color="#1f77b4", label=f"$r_y$, {preset}")
            authority.plot(table["t"], table["alpha_a"], look, color="#9467bd", label=preset)
            velocity.plot(table["t"], table["v_x"], look, color="k", label=f"ego, {preset}")
        velocity.plot(table["t"], table["v_target"], ":", color="#d62728", label="preceding")
        risk.set(title="(a) driving risk", ylabel="risk [-]", ylim=(-0.03, 1.03))
        authority.set(title=r"(b) authority $\alpha_a$", ylabel=r"$\alpha_a$ [-]", ylim=(-0.03, 1.03))
        velocity.set(title="(c) velocity", ylabel="$v_x$ [m/s]")
        if case == 2:
            velocity.set(ylim=(11.0, 13.0))
        for axis in axes[0]:
            axis.set_xlabel("t [s]")
            axis.legend(fontsize=7)
            style.mark_fault(axis, ONSET[case])
        fig.suptitle(f"Case {case}, law of Eq. 10; dotted: onset of the degradation")
