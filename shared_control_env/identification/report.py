"""The report on identified drivers: one self-contained HTML file with table, fits and residuals."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd
from jinja2 import ChoiceLoader, Environment, PackageLoader
from matplotlib.figure import Figure

from shared_control_env.core.parameters import IDENTIFIED_DRIVERS
from shared_control_env.evaluation.episodes import versions
from shared_control_env.evaluation.report import COLOURS, INK, STYLE, number, svg_of
from shared_control_env.evaluation.storage import write_atomically
from shared_control_env.identification.diagnostics import LAGS
from shared_control_env.identification.estimate import innovations
from shared_control_env.identification.model import respond
from shared_control_env.identification.person import Person

PAPERS_FIT = {
    "driver_1": 83.14,
    "driver_2": 86.53,
    "driver_3": 80.28,
    "driver_4": 74.53,
    "driver_5": 80.76,
    "average": 81.05,
}
"""Fit of the paper's Table IV [%]."""

SHOWN = 3
"""Trials of a person that are drawn."""


def write_report(
    people: Mapping[str, Person], table: pd.DataFrame, refused: list[str], channel: str, place: Path, path: Path
) -> None:
    """Write the report.

    Args:
        people: what was identified, by code.
        table: the estimates.
        refused: what was refused, in words.
        channel: ``steering`` or ``acceleration``.
        place: folder of the recordings.
        path: path of the HTML file.
    """
    loader = ChoiceLoader(
        [PackageLoader("shared_control_env.identification", "."), PackageLoader("shared_control_env.evaluation", ".")]
    )
    environment = Environment(loader=loader, autoescape=True)
    environment.filters["number"] = number
    with mpl.rc_context(STYLE):
        plots = [
            (code, svg_of(draw_fit(person, channel), f"fit{i}"), svg_of(draw_residuals(person), f"residuals{i}"))
            for i, (code, person) in enumerate(people.items())
        ]
    page = environment.get_template("identification.html.j2").render(
        rows=table.to_dict("records"),
        papers=[(name, lag, PAPERS_FIT[name]) for name, lag in IDENTIFIED_DRIVERS.items()],
        people=people,
        refused=refused,
        channel=channel,
        place=place,
        plots=plots,
        versions=versions(),
    )
    write_atomically(path, lambda draft: draft.write_text(page, encoding="utf-8"))


def draw_fit(person: Person, channel: str) -> Figure:
    """Draw recorded and simulated u_h,act of some trials.

    Args:
        person: what was identified.
        channel: ``steering`` or ``acceleration``.
    """
    drives = person.drives
    shown = np.linspace(0, len(drives.names) - 1, min(SHOWN, len(drives.names))).astype(int)
    figure = Figure(figsize=(11.0, 2.6), layout="constrained")
    axes = np.atleast_1d(figure.subplots(1, len(shown), sharey=True))
    t = np.arange(drives.y.shape[1]) * drives.dt
    for axis, i in zip(axes, shown, strict=True):
        T = drives.lengths[i]
        y_hat = respond(drives.v[i], person.estimate.arm, drives.dt) + person.estimate.offset.value
        axis.plot(t[:T], drives.y[i, :T], color=INK, lw=1.0, label="recorded")
        axis.plot(t[:T], y_hat[:T], color=COLOURS[0], lw=1.4, label="arm of Eq. 16")
        axis.set(title=drives.names[i], xlabel="t [s]")
        axis.spines[["top", "right"]].set_visible(False)
    axes[0].set_ylabel(f"u_h,act [{'rad' if channel == 'steering' else 'm/s^2'}]")
    axes[0].legend(frameon=False, fontsize=8)
    return figure


def draw_residuals(person: Person) -> Figure:
    """Draw the autocorrelation of the innovations, and their correlation with the input, over all trials.

    Args:
        person: what was identified.
    """
    drives = person.drives
    e = innovations(drives, person.estimate.theta)
    rows = [(a[c][1:], v[c][1:]) for a, v, c in zip(e, drives.v, drives.counts, strict=True) if c.sum() > 2 * LAGS]
    lags = np.arange(LAGS + 1)
    if not rows:
        return Figure(figsize=(11.0, 0.3))
    own = np.mean([_correlations(a, a) for a, _ in rows], axis=0)
    cross = np.mean([_correlations(a, v) for a, v in rows], axis=0)
    bound = 1.96 / np.sqrt(sum(len(a) for a, _ in rows))
    figure = Figure(figsize=(11.0, 2.2), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    for axis, values, title in zip(
        axes, (own, cross), ("innovations with themselves", "innovations with the past input"), strict=True
    ):
        axis.stem(lags[1:] if values is own else lags, values[1:] if values is own else values, basefmt=" ")
        axis.axhspan(-bound, bound, color=INK, alpha=0.12, lw=0)
        axis.axhline(0.0, color=INK, lw=0.5)
        axis.set(title=title, xlabel="lag [steps]")
        axis.spines[["top", "right"]].set_visible(False)
    axes[0].set_ylabel("correlation [-]")
    return figure


def _correlations(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    a, b = a - a.mean(), b - b.mean()
    size = float(np.sqrt((a @ a) * (b @ b))) or 1.0
    return np.array([a[lag:] @ b[: len(b) - lag] for lag in range(LAGS + 1)]) / size
