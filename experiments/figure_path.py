"""Figures 8 and 11: the ego's path with the safe area and the CTRA prediction."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from experiments import style
from experiments.case_runs import Run, make
from shared_control_env.core.world.road import point_at

EVERY = 25
"""Number of time steps between two drawn safe areas and predictions."""


SAME = 0.05
"""Largest distance of two paths that are said to coincide [m]: half of a line's width."""


def draw(runs: dict[Run, pd.DataFrame], case: int, path: Path) -> None:
    """Draw one panel for the paper's law, and one for all laws.

    Args:
        runs: signals of all runs.
        case: 1 or 2.
        path: file of the picture.
    """
    main = Run(case, "paper", "graded")
    line = make(main).unwrapped.line  # type: ignore[attr-defined]
    table = runs[main]
    size = (11.0, 4.6) if case == 1 else (11.0, 5.6)
    shape = (2, 1) if case == 1 else (1, 2)
    with style.figure(path, *shape, size) as (_, axes):
        first, second = axes.ravel()
        _draw_road(first, line, table["s"].max() + 30.0)
        for k in range(0, len(table), EVERY):
            _draw_moment(first, line, table.iloc[k], label=k == 0)
        first.plot(table["x"], table["y_cartesian"], color="k", lw=1.2, label="ego's path")
        first.set_title(f"Case {case}: safe area and prediction, law of Eq. 10")
        _draw_road(second, line, table["s"].max() + 30.0)
        shown = [run for run in runs if run.case == case and run.preset == "graded"]
        # Wide lines are drawn first, and the paper's law last and dashed, so that coinciding paths stay visible.
        shown.sort(key=lambda run: run == main)
        names = [run.law if run.driver else "automation_alone" for run in shown]
        stations = np.arange(0.0, max(runs[run]["s"].max() for run in shown), 0.5)
        offsets = {
            who: np.interp(stations, runs[run]["s"], runs[run]["y"], right=np.nan)
            for who, run in zip(names, shown, strict=True)
        }
        labels = style.labels(offsets, SAME)
        for i, (who, run) in enumerate(zip(names, shown, strict=True)):
            signals = runs[run]
            ended = bool(signals["terminated"].iloc[-1])
            second.plot(
                signals["x"],
                signals["y_cartesian"],
                "--" if run == main else "-",
                color=style.LAW_COLOURS[who],
                lw=4.0 - 0.6 * i,
                marker="X" if ended else None,
                markevery=[len(signals) - 1],
                ms=9,
                label=labels[who].replace("_", " ") + (f" (ends at {signals['t'].iloc[-1]:.1f} s)" if ended else ""),
            )
        second.set_title(f"Case {case}: path under every law")
        for axis in (first, second):
            axis.set(xlabel="x [m]", ylabel="y [m], to the left")
            axis.legend(loc="upper left", ncols=5 if case == 1 else 1, fontsize=7)
            if case == 1:
                axis.set(xlim=(-3, table["x"].max() + 15.0), ylim=(-3.2, 8.5))
            else:
                axis.set_aspect("equal")


def _draw_road(axis: Axes, line: np.ndarray, end: float) -> None:
    s = np.linspace(-3.0, end, 300)
    for d, look in ((-2.0, "-"), (2.0, "--"), (6.0, "-")):
        points = np.array([point_at(line, value, d)[:2] for value in s])
        axis.plot(*points.T, color="0.6", ls=look, lw=0.8)


def _draw_moment(axis: Axes, line: np.ndarray, row: pd.Series, label: bool) -> None:
    """Draw the safe area and the prediction of one time step."""
    lower, upper = (np.asarray(row[f"safe_area_{side}"]).reshape(-1, 2) for side in ("lower", "upper"))
    outline = np.vstack([_resampled(lower), _resampled(upper)[::-1]])
    points = np.array([point_at(line, s, d)[:2] for s, d in outline])
    axis.add_patch(
        Polygon(
            points, facecolor=style.SAFE_AREA, edgecolor="#3a9d5d", alpha=0.25, label="safe area C" if label else None
        )
    )
    axis.plot(
        row["x_pred"],
        row["y_pred_cartesian"],
        "D",
        color=style.PREDICTION,
        mec="k",
        mew=0.5,
        ms=6,
        label="CTRA prediction" if label else None,
    )


def _resampled(chain: np.ndarray) -> np.ndarray:
    """A boundary with many points, so that the drawn boundary follows the curve of the road."""
    pieces = [np.linspace(a, b, 20) for a, b in zip(chain[:-1], chain[1:], strict=True) if (a != b).any()]
    return np.vstack(pieces)
