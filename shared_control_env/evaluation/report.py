"""The report on a benchmark's episodes: one HTML file that needs nothing else."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
import pandas as pd
from jinja2 import Environment, PackageLoader
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shared_control_env.evaluation.metrics import Metric
from shared_control_env.evaluation.statistics import STATISTICS, Interval, intervals
from shared_control_env.evaluation.storage import write_atomically

SHOWN = ("lateral_rms", "driver_effort", "conflict", "false_authority_loss")
"""Metrics of the plots, as far as the table has them."""

GALLERY = 20
"""Failures shown."""

COLOURS = ("#4477aa", "#ee6677", "#228833", "#ccbb44", "#66ccee", "#aa3377", "#bbbbbb", "#000000")
"""Tol's bright palette, told apart by the colour-blind."""

MARKERS = "osD^vP*X<>hd"


class Cell(NamedTuple):
    """A metric of one pair under one statistic.

    Attributes:
        interval: the numbers.
        best: whether no other pair's estimate is better.
        tied: whether its interval overlaps the best one's.
    """

    interval: Interval
    best: bool
    tied: bool


class Row(NamedTuple):
    """One pair of the table.

    Attributes:
        authority, driver: the pair.
        episodes: how many.
        cells: by metric, then by statistic.
    """

    authority: str
    driver: str
    episodes: int
    cells: dict[str, dict[str, Cell]]


def write_report(
    table: pd.DataFrame, metrics: Mapping[str, Metric], path: Path, provenance: Mapping[str, object]
) -> None:
    """Write the report.

    Args:
        table: one row an episode, as :func:`runner.evaluate` gives it.
        metrics: its metrics.
        path: of the HTML file.
        provenance: what the results are of and were made with, shown as it is.
    """
    environment = Environment(loader=PackageLoader("shared_control_env.evaluation", "."), autoescape=True)
    environment.filters["number"] = _number
    rows = summarise(table, metrics)
    page = environment.get_template("report.html.j2").render(
        episodes=len(table),
        metrics=metrics,
        statistics=list(STATISTICS),
        rows=rows,
        provenance=provenance,
        plots=draw_plots(table, rows) if len(table) else [],
        gallery=gallery(table),
    )
    write_atomically(path, lambda draft: draft.write_text(page, encoding="utf-8"))


def summarise(table: pd.DataFrame, metrics: Mapping[str, Metric]) -> list[Row]:
    """Rows of the table: every pair of authority and driver with all metrics."""
    rng = np.random.default_rng(0)
    found: dict[tuple[str, str], dict[str, dict[str, Interval]]] = {}
    sizes = {}
    for (authority, driver), part in table.groupby(["authority", "driver"], sort=False):
        strata = part.groupby(["scenario", "degradation"]).ngroup().to_numpy()
        pair = str(authority), str(driver)
        sizes[pair] = len(part)
        found[pair] = {name: intervals(part[name].to_numpy(dtype=float), strata, rng) for name in metrics}
    bests = {
        (name, statistic): _best([pair[name][statistic] for pair in found.values()], metrics[name].better)
        for name in metrics
        for statistic in STATISTICS
    }
    return [
        Row(
            *pair,
            sizes[pair],
            {
                name: {key: _cell(interval, bests[name, key]) for key, interval in values.items()}
                for name, values in cells.items()
            },
        )
        for pair, cells in found.items()
    ]


def _best(candidates: Sequence[Interval], better: str) -> Interval | None:
    """The best of some intervals in a metric's direction; None where there is none."""
    defined = [interval for interval in candidates if interval.n > 0]
    if better == "neither" or not defined:
        return None
    return (min if better == "lower" else max)(defined, key=lambda interval: interval.estimate)


def _cell(interval: Interval, best: Interval | None) -> Cell:
    if best is None or interval.n == 0:
        return Cell(interval, False, False)
    return Cell(interval, interval.estimate == best.estimate, interval.overlaps(best))


def _number(value: float) -> str:
    """Three digits, and a dash for what is not defined."""
    return "–" if not np.isfinite(value) else f"{value:.3g}"


def gallery(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Failed episodes, spread over degradations, authorities and drivers, with the command that shows each again."""
    failed = table[table["terminated"].astype(bool)] if len(table) else table
    chosen = failed.groupby(["degradation", "authority"]).head(1) if len(failed) else failed
    if len(chosen) > GALLERY:
        chosen = chosen.iloc[np.linspace(0, len(chosen) - 1, GALLERY).astype(int)]
    names = ("scenario", "degradation", "driver", "authority", "seed")
    return [
        {
            **{name: row[name] for name in names},
            "what": "collision" if row.get("collisions", 0.0) > 0.0 else "off the road",
            "when": row.get("duration", np.nan),
            "command": "shared-control replay " + " ".join(f"--{name} {row[name]}" for name in names),
        }
        for row in chosen.to_dict("records")
    ]


def draw_plots(table: pd.DataFrame, rows: Sequence[Row]) -> list[tuple[str, Markup]]:
    """Titles and pictures."""
    shown = [name for name in SHOWN if name in table]
    plots = [
        ("Interquartile means with their 95 % intervals", _svg(draw_intervals(rows, shown))),
        ("Distributions over all episodes", _svg(draw_distributions(table, shown))),
        ("Failures by degradation and authority", _svg(draw_failures(table))),
    ]
    return plots


def draw_intervals(rows: Sequence[Row], shown: Sequence[str]) -> Figure:
    """A panel a metric: authorities down, drivers side by side."""
    authorities, drivers = (list(dict.fromkeys(getattr(row, key) for row in rows)) for key in ("authority", "driver"))
    figure, axes = _panels(len(shown), 0.5 + len(authorities) * (0.25 + 0.1 * len(drivers)))
    for axis, name in zip(axes, shown, strict=True):
        for row in rows:
            value, j = row.cells[name]["IQM"].interval, drivers.index(row.driver)
            y = authorities.index(row.authority) + 0.8 * ((j + 0.5) / len(drivers) - 0.5)
            axis.plot([value.low, value.high], [y, y], color=COLOURS[j % len(COLOURS)], lw=2)
            label = row.driver if row.authority == authorities[0] else None
            axis.plot(value.estimate, y, MARKERS[j % 12], color=COLOURS[j % len(COLOURS)], ms=4, label=label)
        axis.set_xlabel(name)
        axis.set_yticks(range(len(authorities)), authorities)
    axes[0].invert_yaxis()
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=6, frameon=False)
    return figure


def draw_distributions(table: pd.DataFrame, shown: Sequence[str]) -> Figure:
    """A panel a metric: share of episodes under a value, by authority."""
    figure, axes = _panels(len(shown), 3.2)
    for axis, name in zip(axes, shown, strict=True):
        for i, (authority, part) in enumerate(table.groupby("authority", sort=False)):
            values = part[name].to_numpy(dtype=float)
            values = values[np.isfinite(values)]
            if len(values):
                style = "-" if i < len(COLOURS) else "--"
                axis.ecdf(values, color=COLOURS[i % len(COLOURS)], ls=style, label=str(authority))
        axis.set_xlabel(name)
    axes[0].set_ylabel("share of episodes")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=6, frameon=False)
    return figure


def draw_failures(table: pd.DataFrame) -> Figure:
    """Share of episodes that end in a collision or off the road."""
    rates = 100.0 * table.pivot_table(
        index="degradation", columns="authority", values="terminated", aggfunc="mean", sort=False
    ).astype(float)
    figure = Figure(figsize=(5.0 + 0.8 * rates.shape[1], 3.0 + 0.3 * rates.shape[0]), layout="constrained")
    axis = figure.subplots()
    image = axis.imshow(rates, cmap="Blues", vmin=0.0, aspect="auto")
    axis.set_xticks(range(rates.shape[1]), rates.columns, rotation=30, ha="right")
    axis.set_yticks(range(rates.shape[0]), rates.index)
    dark = 0.5 * float(np.nanmax(rates.to_numpy()))
    for (i, j), value in np.ndenumerate(rates.to_numpy()):
        if np.isfinite(value):
            axis.text(j, i, f"{value:.0f}", ha="center", va="center", color="white" if value > dark else "black")
    figure.colorbar(image, label="failures [%]")
    return figure


def _panels(n: int, height: float) -> tuple[Figure, list[Axes]]:
    """A figure with n panels side by side that share their y axis."""
    figure = Figure(figsize=(max(3.2 * n, 9.0), max(height + 0.8, 4.0)), layout="constrained")
    axes = list(np.atleast_1d(figure.subplots(1, n, sharey=True)))
    for axis in axes:
        axis.grid(alpha=0.3)
        axis.spines[["top", "right"]].set_visible(False)
    return figure, axes


def _svg(figure: Figure) -> Markup:
    """A figure as an SVG element; the same figure gives the same text."""
    buffer = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": "shared_control_env", "svg.fonttype": "path"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    text = buffer.getvalue()
    return Markup(text[text.index("<svg") :])
