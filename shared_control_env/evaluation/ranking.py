"""The ranking of a controllability study: margins of authorities against each other, and what they cost."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from shared_control_env.evaluation.margins import COVERAGE, Curves, Outcomes, Weights, first_crossings
from shared_control_env.evaluation.sampling import COARSE
from shared_control_env.evaluation.severity import COMMISSION
from shared_control_env.evaluation.study import Cell, Episode, Study, is_controlled

BASELINES = ("none", "proportional")
"""Authorities that the others are compared with, as far as they are in the study; if none is, the first one."""

RANKED = 0.9
"""Probability of the margin by which authorities are ranked."""

COSTS = {
    "effort": ("driver_effort", False, "driver effort over the coarse grid [-]"),
    "sound_effort": ("driver_effort", True, "driver effort without a fault [-]"),
    "sound_loss": ("false_authority_loss", True, "authority lost without a fault [-]"),
    "sound_alert": ("false_alert", True, "share of the time with an alert without a fault [-]"),
}
"""What an authority costs: metric, whether only without a fault, and description, by column of the ranking."""


def rank(
    study: Study,
    outcomes: Mapping[Cell, Outcomes],
    curves: Mapping[Cell, Curves],
    weights: Weights,
    rows: Mapping[Episode, Mapping[str, Any]],
) -> pd.DataFrame:
    """Geometric mean over the axes of s_90 against each baseline's, and the costs; best first for each driver.

    A margin beyond the grid counts as the largest severity, and one below the coarse grid, or never, as half of its
    first step: ``censored`` says how many of the margins are so. Both limits pull the mean towards 1. The same
    bootstrap weights are used for all curves, so that differences are paired.

    Args:
        study: the study.
        outcomes, curves: outcomes of every curve, and the fits to them.
        weights: weights of the bootstrap.
        rows: rows of all episodes.
    """
    table = []
    bounds = np.array([[0.5 * axis.grid[1], axis.largest] for axis in study.axes])[:, :, None]
    acts = np.array([axis.kind in COMMISSION for axis in study.axes])
    for driver in study.drivers:
        logs, censored, costs = {}, {}, {}
        for authority in study.authorities:
            values = np.array(
                [
                    first_crossings(curves[cell].values, RANKED) * outcomes[cell].severities[-1]
                    for cell in (Cell(i, driver, authority) for i in range(len(study.axes)))
                ]
            )
            clipped = np.clip(values, bounds[:, 0], bounds[:, 1])
            logs[authority] = np.log(clipped)
            censored[authority] = int((clipped[:, 0] != values[:, 0]).sum())
            costs[authority] = _costs(study, driver, authority, weights, rows)
        for baseline in [name for name in BASELINES if name in study.authorities] or list(study.authorities)[:1]:
            part = []
            for authority in study.authorities:
                gain = logs[authority] - logs[baseline]
                row: dict[str, Any] = {"driver": driver, "baseline": baseline, "authority": authority}
                row |= _interval("margin", np.exp(gain.mean(axis=0)))
                for name, chosen in (("commission", acts), ("omission", ~acts)):
                    if chosen.any():
                        row |= _interval(name, np.exp(gain[chosen].mean(axis=0)))
                for name, values in costs[authority].items():
                    row |= _interval(name, values)
                row |= _interval("more_effort", _more_effort(study, driver, authority, baseline, weights, rows))
                part.append({**row, "censored": censored[authority]})
            table += sorted(part, key=lambda row: -row["margin"])
    return pd.DataFrame(table)


def _costs(
    study: Study, driver: str, authority: str, weights: Weights, rows: Mapping[Episode, Mapping[str, Any]]
) -> dict[str, np.ndarray]:
    """Means of :data:`COSTS` in each bootstrap sample, over the coarse grid, which all authorities have in common."""
    used = weights.seeds[:, :COARSE]
    share = used / used.sum(axis=1, keepdims=True)
    cells = [Cell(i, driver, authority) for i in range(len(study.axes))]
    found = {}
    for name, (column, sound, _) in COSTS.items():
        levels = [(cell, s) for cell in cells for s in study.axes[cell.axis].grid if s == 0.0 or not sound]
        values = [[rows[study.episode(cell, s, j)][column] for cell, s in levels] for j in range(COARSE)]
        found[name] = share @ np.array(values, dtype=float).mean(axis=1)
    return found


def _more_effort(
    study: Study,
    driver: str,
    authority: str,
    baseline: str,
    weights: Weights,
    rows: Mapping[Episode, Mapping[str, Any]],
) -> np.ndarray:
    """Mean difference of the driver's effort between two authorities, in each bootstrap sample.

    Only episodes that are controlled under both count: where one of them leaves the road at once, nobody has an effort.
    """
    used = weights.seeds[:, :COARSE]
    differences, counts = np.zeros(COARSE), np.zeros(COARSE)
    for i, axis in enumerate(study.axes):
        for severity in axis.grid:
            for j in range(COARSE):
                mine, other = (
                    rows[study.episode(Cell(i, driver, name), severity, j)] for name in (authority, baseline)
                )
                if is_controlled(mine, study.keep) and is_controlled(other, study.keep):
                    differences[j] += mine["driver_effort"] - other["driver_effort"]
                    counts[j] += 1.0
    return (used @ differences) / np.maximum(used @ counts, 1e-300)


def _interval(name: str, samples: np.ndarray) -> dict[str, float]:
    """Columns of an estimate, the first of the samples, and of its percentile interval."""
    low, high = np.quantile(samples[1:], [0.5 - 0.5 * COVERAGE, 0.5 + 0.5 * COVERAGE])
    return {name: float(samples[0]), f"{name}_low": float(low), f"{name}_high": float(high)}
