"""Figures 9 and 12: risk, authority and velocity over time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd

from experiments import style
from experiments.case_runs import PRESETS, Run

ONSET = {1: 0.5, 2: 0.25}

SAME = 0.005
"""Largest difference of two curves that are said to coincide, in the unit of the axis."""


def draw(runs: dict[Run, pd.DataFrame], case: int, path: Path) -> None:
    """Draw both risks, alpha_a and v_x in three panels, for both presets of the longitudinal risk.

    Args:
        runs: signals of all runs.
        case: 1 or 2.
        path: file of the picture.
    """
    with style.figure(path, 1, 3, (12.0, 3.4)) as (fig, axes):
        risk, authority, velocity = axes[0]
        curves: dict[Any, dict[str, tuple[pd.Series, str, str]]] = {risk: {}, authority: {}, velocity: {}}
        for preset, look in zip(PRESETS, ("-", "--"), strict=True):
            table = runs[Run(case, "paper", preset)]
            curves[risk][f"$r_x$, {preset}"] = table["r_x"], look, "#ff7f0e"
            curves[risk][f"$r_y$, {preset}"] = table["r_y"], look, "#1f77b4"
            curves[authority][preset] = table["alpha_a"], look, "#9467bd"
            curves[velocity][f"ego, {preset}"] = table["v_x"], look, "k"
        curves[velocity]["preceding"] = table["v_target"], ":", "#d62728"
        for axis, shown in curves.items():
            labels = style.labels({name: values.to_numpy() for name, (values, *_) in shown.items()}, SAME)
            for name, (values, look, colour) in shown.items():
                axis.plot(table["t"], values, look, color=colour, label=labels[name])
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
