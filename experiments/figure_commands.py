"""Figures 10 and 13: acceleration and steering of the automation and the driver."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from experiments import style
from experiments.case_runs import Run
from experiments.figure_risk import ONSET


def draw(runs: dict[Run, pd.DataFrame], case: int, path: Path) -> None:
    """Draw acceleration and steering in two panels: des, f and act of the automation; des and act of the driver.

    Args:
        runs: signals of all runs.
        case: 1 or 2.
        path: file of the picture.
    """
    table = runs[Run(case, "paper", "graded")]
    with style.figure(path, 1, 2, (12.0, 4.0)) as (fig, axes):
        for axis, symbol, title, unit, scale in (
            (axes[0, 0], "a", "(a) longitudinal acceleration", "m/s$^2$", 1.0),
            (axes[0, 1], "delta", "(b) front steering angle", "deg", 180.0 / np.pi),
        ):
            name = symbol if symbol == "a" else r"\delta"
            curves = (
                (f"{symbol}_a_des", f"${name}_{{a,des}}$", style.DESIRED, "-", 2.6),
                (f"{symbol}_a_f", f"${name}_{{a,f}}$", style.DEGRADED, "--", 1.6),
                (f"{symbol}_a_act", f"${name}_{{a,act}}$", style.ACTUAL, "-", 1.2),
                (f"{symbol}_h_des", f"${name}_{{h,des}}$", style.DRIVER, "--", 1.2),
                (f"{symbol}_h_act", f"${name}_{{h,act}}$", style.DRIVER, "-", 1.2),
                (symbol, "$u$", style.TOTAL, ":", 1.4),
            )
            values = {label: scale * table[column].to_numpy() for column, label, *_ in curves}
            shown = style.labels(values, 0.005 * max(np.ptp(np.concatenate([*values.values()])), 1e-6))
            for _, label, colour, look, width in curves:
                axis.plot(table["t"], values[label], look, color=colour, lw=width, label=shown[label])
            axis.set(title=title, xlabel="t [s]", ylabel=unit)
            axis.legend(ncols=2, fontsize=8)
            style.mark_fault(axis, ONSET[case])
        fig.suptitle(f"Case {case}, law of Eq. 10, graded risk; dotted: onset of the degradation")
