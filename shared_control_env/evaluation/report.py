"""The report on the episodes of a benchmark: one self-contained HTML file."""

from __future__ import annotations

import io
import re
import shlex
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import matplotlib as mpl
import numpy as np
import pandas as pd
from jinja2 import Environment, PackageLoader
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from shared_control_env.evaluation.statistics import STATISTICS, Interval, intervals_of_pairs
from shared_control_env.evaluation.storage import MAY_GROW, write_atomically

if TYPE_CHECKING:
    from shared_control_env.evaluation.metrics import Metric
    from shared_control_env.evaluation.storage import ResultsFolder

SHOWN = ("lateral_rms", "driver_effort", "conflict", "false_authority_loss")
"""Metrics that are plotted if the table has them."""

GALLERY = 20
"""Largest number of failed episodes that the report lists."""

INK = "#010203"
"""Placeholder for the text colour of the page, which depends on the light or dark scheme of the reader."""

COLOURS = ("#4477aa", "#ee6677", "#228833", "#ccbb44", "#66ccee", "#aa3377", "#999999", INK)
"""Tol's bright palette, which is safe for colour-blind readers; its grey is darker here, to be visible on white."""

STYLE: dict[Any, Any] = {
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "savefig.facecolor": "none",
    "text.parse_math": False,  # a dollar sign in a name does not start a formula
    "svg.fonttype": "none",
    "svg.hashsalt": "shared_control_env",
}
"""Style of all plots: page colours, selectable text, and identical output for identical figures."""

MARKERS = "osD^vP*X<>hd"


class Cell(NamedTuple):
    """One metric of one pair of authority and driver under one statistic.

    Attributes:
        interval: the estimate with its interval.
        best: whether no other pair has a better estimate.
        tied: whether the pair is not distinguishable from the best: the intervals overlap, or there are none.
    """

    interval: Interval
    best: bool
    tied: bool


class Row(NamedTuple):
    """Row of the table for one pair of authority and driver.

    Attributes:
        authority, driver: names of the pair.
        episodes: number of episodes.
        cells: cells by metric, then by statistic.
    """

    authority: str
    driver: str
    episodes: int
    cells: dict[str, dict[str, Cell]]


def write_report(
    table: pd.DataFrame,
    metrics: Mapping[str, Metric],
    path: Path,
    provenance: Mapping[str, object],
    folder: ResultsFolder | None = None,
) -> None:
    """Write the report.

    Args:
        table: one row per episode, as returned by :func:`runner.evaluate`.
        metrics: metrics of the table by name.
        path: path of the HTML file.
        provenance: description of the benchmark and its versions, shown unchanged.
        folder: folder of the results, which the replay commands refer to; None without one.
    """
    environment = Environment(loader=PackageLoader("shared_control_env.evaluation", "."), autoescape=True)
    environment.filters["number"] = number
    rows = rows_of(table, metrics) if len(table) else []
    page = environment.get_template("report.html.j2").render(
        episodes=len(table),
        metrics=metrics,
        statistics=list(STATISTICS),
        rows=rows,
        provenance=provenance,
        plots=draw_plots(table, rows, metrics) if len(table) else [],
        gallery=gallery(table, folder),
    )
    write_atomically(path, lambda draft: draft.write_text(page, encoding="utf-8"))


def rows_of(table: pd.DataFrame, metrics: Mapping[str, Metric]) -> list[Row]:
    """Rows of the report's table: every pair of authority and driver with all metrics.

    Args:
        table: one row per episode.
        metrics: metrics of the table by name.
    """
    found = intervals_of_pairs(table, metrics)
    sizes = table.groupby(["authority", "driver"]).size()
    bests = {
        (name, statistic): _best([pair[name][statistic] for pair in found.values()], metrics[name].better)
        for name in metrics
        for statistic in STATISTICS
    }
    return [
        Row(
            *pair,
            int(sizes[pair]),
            {
                name: {key: _cell(interval, bests[name, key]) for key, interval in values.items()}
                for name, values in cells.items()
            },
        )
        for pair, cells in found.items()
    ]


def _best(candidates: Sequence[Interval], better: str) -> Interval | None:
    """The best interval in the direction of a metric; None if there is no direction or all estimates are equal."""
    defined = [interval for interval in candidates if interval.n > 0]
    if better == "neither" or len({interval.estimate for interval in defined}) < 2:
        return None
    return (min if better == "lower" else max)(defined, key=lambda interval: interval.estimate)


def _cell(interval: Interval, best: Interval | None) -> Cell:
    if best is None or interval.n == 0:
        return Cell(interval, False, False)
    return Cell(interval, interval.estimate == best.estimate, not interval.distinct_from(best))


def number(value: float) -> str:
    """A number with three significant digits; a dash if it is not finite.

    Args:
        value: the number.
    """
    return "–" if not np.isfinite(value) else f"{value:.3g}"


def gallery(table: pd.DataFrame, folder: ResultsFolder | None = None, most: int = GALLERY) -> list[dict[str, Any]]:
    """The worst failed episodes, spread over scenarios, degradations, drivers and authorities, with replay commands.

    Args:
        table: one row per episode.
        folder: folder of the results for the replay commands; None without one.
        most: largest number of episodes.
    """
    names = ["scenario", "degradation", "driver", "authority", "seed"]
    failed = table[table["terminated"].astype(bool)] if len(table) else table
    chosen = _spread(_worst_first(failed), names[:-1], most) if len(failed) else failed
    return [
        {
            **{name: row[name] for name in names},
            "what": "collision" if row.get("collisions", 0.0) > 0.0 else "off the road",
            "when": row.get("duration", np.nan),
            "command": _command({name: str(row[name]) for name in names}, folder),
        }
        for row in chosen.to_dict("records")
    ]


def _command(episode: Mapping[str, str], folder: ResultsFolder | None) -> str:
    """The replay command of an episode, or an instruction if what it needs cannot be imported."""
    manifest: Mapping[str, Any] = {} if folder is None else folder.manifest
    needed = {}
    for part, what in zip(MAY_GROW, ("driver", "authority"), strict=True):
        if part in manifest:
            needed[f"the {what} {episode[what]!r}"] = manifest[part][episode[what]]
    if manifest.get("automation"):
        needed["the automation"] = manifest["automation"]
    if manifest.get("additions"):
        needed["the additions"] = {"origin": None}
    for what, entry in needed.items():
        if entry["origin"] is None:
            return f"by evaluation.replay_episode, in the program that has {what}"
    source = [] if folder is None else ["--from", str(folder.path)]
    parts = [part for name, value in episode.items() for part in (f"--{name}", value)]
    return shlex.join(["shared-control", "replay", *source, *parts])


def _worst_first(failed: pd.DataFrame) -> pd.DataFrame:
    """Sort collisions before road departures, and early ends before late ones, if the table has these columns."""
    keys = {"collisions": False, "duration": True}
    present = [key for key in keys if key in failed]
    return failed.sort_values(present, ascending=[keys[key] for key in present], kind="stable") if present else failed


def _spread(table: pd.DataFrame, names: Sequence[str], n: int) -> pd.DataFrame:
    """Choose up to n rows. Each choice is the first row with the fewest values in common with the chosen rows."""
    values = table[list(names)].astype(str).to_numpy()
    in_common = np.zeros(len(table))
    chosen: list[int] = []
    for _ in range(min(n, len(table))):
        chosen.append(int(np.argmin(in_common)))
        in_common += (values == values[chosen[-1]]).sum(axis=1)
        in_common[chosen[-1]] = np.inf
    return table.iloc[chosen]


def draw_plots(
    table: pd.DataFrame, rows: Sequence[Row], metrics: Mapping[str, Metric]
) -> list[tuple[str, str, Markup]]:
    """Titles, explanations and pictures of the plots. Plots of metrics are left out if no metric is to be shown.

    Args:
        table: one row per episode.
        rows: rows of the report's table.
        metrics: metrics of the table by name.
    """
    shown = {name: f"{name} [{metrics[name].unit}]" for name in SHOWN if name in metrics}
    plots = []
    with mpl.rc_context(STYLE):
        if shown:
            what = "One panel a metric: authorities down, drivers by colour and mark."
            picture = svg_of(draw_intervals(rows, shown), "intervals")
            plots.append(("Interquartile means with their 95 % intervals", what, picture))
            what = "Share of the episodes, of all drivers, whose value is at most that on the axis."
            picture = svg_of(draw_distributions(table, shown), "distributions")
            plots.append(("Distributions by authority", what, picture))
        what = "Share of the episodes, of all drivers and scenarios, that end in a collision or off the road."
        plots.append(("Failures by degradation and authority", what, svg_of(draw_failures(table), "failures")))
    return plots


def draw_intervals(rows: Sequence[Row], shown: Mapping[str, str]) -> Figure:
    """Draw interquartile means with their intervals: a panel per metric, authorities downwards, drivers by colour.

    Args:
        rows: rows of the report's table.
        shown: labels of the panels by metric.
    """
    authorities, drivers = (list(dict.fromkeys(getattr(row, key) for row in rows)) for key in ("authority", "driver"))
    figure, axes = _panels(len(shown), 0.5 + len(authorities) * (0.25 + 0.1 * len(drivers)))
    looks: list[dict[str, Any]] = [
        {"color": COLOURS[j % len(COLOURS)], "marker": MARKERS[j % len(MARKERS)]} for j in range(len(drivers))
    ]
    for axis, (name, label) in zip(axes, shown.items(), strict=True):
        for row in rows:
            value, j = row.cells[name]["IQM"].interval, drivers.index(row.driver)
            y = authorities.index(row.authority) + 0.8 * ((j + 0.5) / len(drivers) - 0.5)
            axis.plot([value.low, value.high], [y, y], color=looks[j]["color"], lw=2)
            axis.plot(value.estimate, y, ms=4, **looks[j])
        for between in range(1, len(authorities)):
            axis.axhline(between - 0.5, color=INK, lw=0.5, alpha=0.3)
        axis.set_xlabel(label)
        axis.set_yticks(range(len(authorities)), authorities)
    axes[0].set_ylim(len(authorities) - 0.5, -0.5)
    _legend(figure, drivers, [{"lw": 2, "ms": 4, **look} for look in looks])
    return figure


def draw_distributions(table: pd.DataFrame, shown: Mapping[str, str]) -> Figure:
    """Draw empirical distributions: a panel per metric with the share of episodes up to a value, by authority.

    Args:
        table: one row per episode.
        shown: labels of the panels by metric.
    """
    groups = {str(authority): part for authority, part in table.groupby("authority", sort=False)}
    looks: list[dict[str, Any]] = [
        {"color": COLOURS[i % len(COLOURS)], "ls": "-" if i < len(COLOURS) else "--"} for i in range(len(groups))
    ]
    figure, axes = _panels(len(shown), 3.2)
    for axis, (name, label) in zip(axes, shown.items(), strict=True):
        for part, look in zip(groups.values(), looks, strict=True):
            values = part[name].to_numpy(dtype=float)
            values = values[np.isfinite(values)]
            if len(values):
                axis.ecdf(values, **look)
        axis.set_xlabel(label)
    axes[0].set_ylabel("share of episodes")
    _legend(figure, list(groups), looks)
    return figure


def _legend(figure: Figure, names: Sequence[str], looks: Sequence[Mapping[str, Any]]) -> None:
    """Add a legend below the panels. It is made from the names, because no single panel may have them all."""
    figure.legend([Line2D([], [], **look) for look in looks], names, loc="outside lower center", ncols=6, frameon=False)


def draw_failures(table: pd.DataFrame) -> Figure:
    """Draw the share of episodes that end in a collision or off the road, by degradation and authority.

    Args:
        table: one row per episode.
    """
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


def svg_of(figure: Figure, name: str) -> Markup:
    """A figure as an SVG element with unique ids, in the colours of the page.

    Args:
        figure: the figure.
        name: beginning of the ids, unique in the page.
    """
    buffer = io.StringIO()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph")  # text is not drawn as paths, so the reader's fonts decide
        figure.savefig(buffer, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    text = buffer.getvalue()
    text = text[text.index("<svg") :].replace(INK, "currentColor")
    own = rf"\1{name}-"  # the page holds several pictures, and an id must be unique in the page
    return Markup(re.sub("<[^>]+>", lambda tag: re.sub(r'(\bid="|url\(#|href="#)', own, tag[0]), text))
