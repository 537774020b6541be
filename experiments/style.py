"""Style of the figures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

DESIRED, DEGRADED, ACTUAL, DRIVER, TOTAL = "#d62728", "#17becf", "#1f77b4", "#2ca02c", "#000000"
LAW_COLOURS = {
    "paper": "#1f77b4",
    "proportional": "#9467bd",
    "none": "#ff7f0e",
    "driver_only": "#2ca02c",
    "automation_alone": "#7f7f7f",
}
SAFE_AREA, PREDICTION = "#8fd19e", "#00c81e"


@contextmanager
def figure(path: Path, rows: int, columns: int, size: tuple[float, float]) -> Iterator[tuple]:
    """A figure with its axes, which is written to a file at the end.

    Args:
        path: file of the picture.
        rows, columns: number of panels.
        size: width and height [inch].

    Yields:
        The figure and its axes, shape (rows, columns).
    """
    with plt.rc_context({"font.size": 9, "axes.grid": True, "grid.alpha": 0.3, "legend.frameon": False}):
        fig, axes = plt.subplots(rows, columns, figsize=size, squeeze=False, layout="constrained")
        try:
            yield fig, axes
            path.parent.mkdir(parents=True, exist_ok=True)
            # Without this metadata the same run writes the same bytes.
            fig.savefig(path, dpi=150, metadata={"Software": None})
        finally:
            plt.close(fig)


def labels(curves: Mapping[str, np.ndarray], within: float) -> dict[str, str]:
    """Labels of curves that say which curves lie on one another, until one of them ends: ``b (on a)``.

    Args:
        curves: values of every curve by its label, shape (n,); nan where a curve has ended.
        within: largest distance of two curves that cannot be told apart in the picture, in the unit of the values.

    Returns:
        The label for the legend by the label of the curve.
    """
    shown: dict[str, str] = {}
    for name, values in curves.items():
        on = next((each for each in shown if _coincide(curves[each], values, within)), None)
        shown[name] = name if on is None else f"{name} (on {on})"
    return shown


def _coincide(first: np.ndarray, second: np.ndarray, within: float) -> bool:
    return bool((np.nan_to_num(np.abs(first - second)) <= within).all())


def mark_fault(axis: plt.Axes, onset: float) -> None:
    """Draw a dotted line at the onset of the degradation.

    Args:
        axis: axis over time.
        onset: time of the onset [s].
    """
    axis.axvline(onset, color="0.4", ls=":", lw=1)
