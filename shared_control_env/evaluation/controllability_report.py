"""The report on a controllability study: one self-contained HTML file with curves, margins, ranking and costs."""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil, inf
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from jinja2 import Environment, PackageLoader
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from shared_control_env.evaluation.margins import FINE
from shared_control_env.evaluation.ranking import COSTS
from shared_control_env.evaluation.report import COLOURS, INK, STYLE, gallery, number, svg_of
from shared_control_env.evaluation.storage import ResultsFolder, write_atomically
from shared_control_env.evaluation.study import KEEPS, Controllability, Study

WORST = 5
"""Number of uncontrolled episodes that the report lists."""

COLUMNS = 3
"""Number of panels side by side."""


def write_report(study: Study, result: Controllability, path: Path, folder: ResultsFolder | None = None) -> None:
    """Write the report of a study.

    Args:
        study: the study.
        result: its result.
        path: path of the HTML file.
        folder: folder of the results, which the replay commands refer to; None without one.
    """
    environment = Environment(loader=PackageLoader("shared_control_env.evaluation", "."), autoescape=True)
    environment.filters["number"] = number
    environment.filters["severity"] = severity
    plots = []
    with mpl.rc_context(STYLE):
        for i, driver in enumerate(study.drivers):
            plots.append(
                (f"Controllability curves: {driver}", svg_of(draw_curves(study, result, driver), f"curves{i}"))
            )
            plots.append((f"Margin against effort: {driver}", svg_of(draw_pareto(study, result, driver), f"pareto{i}")))
    failed = result.episodes[result.episodes["terminated"].astype(bool)]
    page = environment.get_template("controllability.html.j2").render(
        study=study,
        episodes=len(result.episodes),
        rankings=list(result.ranking.groupby(["driver", "baseline"], sort=False)),
        margins=result.margins.to_dict("records"),
        unsettled=int((~result.margins["settled"]).sum()),
        plots=plots,
        gallery=gallery(failed, folder, WORST),
        costs=COSTS,
        controlled=KEEPS[study.keep],
        versions=result.episodes["versions"].iloc[0],
        is_best=is_best,
    )
    write_atomically(path, lambda draft: draft.write_text(page, encoding="utf-8"))


def severity(value: float) -> str:
    """A margin in words: a number, ``beyond the grid``, or ``never``.

    Args:
        value: the margin; ``inf`` for beyond the grid, ``-inf`` for never.
    """
    if value in (inf, -inf):
        return "beyond" if value > 0.0 else "never"
    return number(value)


def is_best(row: Mapping[str, Any], part: pd.DataFrame) -> bool:
    """Whether no other authority of a ranking is told apart from this one as the better one.

    Args:
        row: row of the ranking.
        part: rows of the ranking with the same driver and baseline.
    """
    return bool(row["margin_high"] >= part["margin_low"].max())


def looks(study: Study) -> dict[str, dict[str, Any]]:
    """Colour and line style of each authority.

    Args:
        study: the study.
    """
    styles = ("-", "--", ":")
    return {
        name: {"color": COLOURS[i % len(COLOURS)], "ls": styles[i // len(COLOURS) % len(styles)]}
        for i, name in enumerate(study.authorities)
    }


def draw_curves(study: Study, result: Controllability, driver: str) -> Figure:
    """Draw the curves of one driver: a panel for each fault, authorities by colour, with bands and points.

    Args:
        study: the study.
        result: its result.
        driver: name of the driver.
    """
    rows = ceil(len(study.axes) / COLUMNS)
    figure = Figure(figsize=(4.2 * min(COLUMNS, len(study.axes)), 3.0 * rows + 0.8), layout="constrained")
    axes = np.atleast_1d(figure.subplots(rows, min(COLUMNS, len(study.axes)), sharey=True, squeeze=False)).ravel()
    look = looks(study)
    for axis, panel in zip(study.axes, axes, strict=False):
        for part in _of(result.fitted, driver, axis.name):
            style = look[part["authority"]]
            panel.plot(FINE * axis.largest, part["curve"], lw=1.6, **style)
            if len(study.authorities) <= 4:  # more bands hide one another; the table has all intervals
                panel.fill_between(
                    FINE * axis.largest, part["low"], part["high"], color=style["color"], alpha=0.12, lw=0
                )
        for part in _of(result.points, driver, axis.name):
            size = 6.0 * np.sqrt(part["episodes"] / 16.0)
            panel.scatter(part["severity"], part["share"], s=size, color=look[part["authority"]]["color"], lw=0)
        for level in (0.5, 0.9, 0.99):
            panel.axhline(level, color=INK, lw=0.4, alpha=0.4)
        panel.set(title=axis.name, xlabel=f"{axis.meaning} [{axis.unit}]", ylim=(-0.03, 1.03), xlim=(0.0, axis.largest))
        panel.spines[["top", "right"]].set_visible(False)
    for panel in axes[len(study.axes) :]:
        panel.set_visible(False)
    axes[0].set_ylabel("share controlled")
    handles = [Line2D([], [], lw=1.6, **style) for style in look.values()]
    figure.legend(handles, list(look), loc="outside lower center", ncols=5, frameon=False)
    return figure


def _of(table: pd.DataFrame, driver: str, fault: str) -> list[dict[str, Any]]:
    chosen = table[(table["driver"] == driver) & (table["fault"] == fault)]
    return chosen.to_dict("records")  # type: ignore[return-value]


def draw_pareto(study: Study, result: Controllability, driver: str) -> Figure:
    """Draw margin against effort: up and to the left is better; what no other authority beats in both is connected.

    Args:
        study: the study.
        result: its result.
        driver: name of the driver.
    """
    table = result.ranking[result.ranking["driver"] == driver]
    baseline = table["baseline"].iloc[0]
    table = table[table["baseline"] == baseline].sort_values("more_effort")
    figure = Figure(figsize=(8.5, 5.0), layout="constrained")
    axis = figure.subplots()
    look = looks(study)
    for row in table.to_dict("records"):
        colour = look[row["authority"]]["color"]
        x, y = row["more_effort"], row["margin"]
        axis.errorbar(
            x,
            y,
            xerr=[[max(x - row["more_effort_low"], 0.0)], [max(row["more_effort_high"] - x, 0.0)]],
            yerr=[[max(y - row["margin_low"], 0.0)], [max(row["margin_high"] - y, 0.0)]],
            fmt="o",
            ms=5,
            lw=0.8,
            color=colour,
        )
        axis.annotate(row["authority"], (x, y), xytext=(5, 5), textcoords="offset points", color=colour)
    front = table[table["margin"] >= table["margin"].cummax()]
    axis.step(front["more_effort"], front["margin"], where="post", color=INK, lw=0.7, alpha=0.5)
    axis.set_yscale("log")
    for which in (axis.yaxis.set_major_formatter, axis.yaxis.set_minor_formatter):
        which("{x:g}")
    axis.set(
        xlabel=f"driver effort more than under {baseline}, where both control [-]",
        ylabel=f"s_90 against {baseline}, geometric mean [-]",
    )
    axis.grid(alpha=0.3, which="both")
    axis.spines[["top", "right"]].set_visible(False)
    return figure
