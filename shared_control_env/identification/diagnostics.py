"""How well an identified arm describes the drives, on drives that it was not identified from."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

from shared_control_env.identification.data import Drives
from shared_control_env.identification.estimate import Estimate, box_jenkins, innovations
from shared_control_env.identification.model import respond

FOLDS = 5
"""Parts into which the trials are divided; each is predicted from the others."""

LAGS = 10
"""Lags of the tests of the residuals [steps]."""


class Diagnostics(NamedTuple):
    """Quality of an estimate.

    Attributes:
        fit: 100 (1 - |y - y_hat| / |y - mean y|) of simulated against recorded u_h,act, on held-out trials, median [%].
        fit_low, fit_high: quartiles over the held-out trials [%].
        vaf: variance accounted for, 100 (1 - var(y - y_hat) / var y), likewise [%].
        white: share of trials whose innovations pass the Ljung-Box test at 5 % [-].
        crossed: share of lags at which innovations and input correlate beyond their 95 % bound [-].
    """

    fit: float
    fit_low: float
    fit_high: float
    vaf: float
    white: float
    crossed: float


def diagnose(drives: Drives, estimate: Estimate) -> Diagnostics:
    """Judge an estimate.

    Args:
        drives: drives of a person.
        estimate: the estimate from all of them, by :func:`estimate.box_jenkins`.
    """
    n = len(drives.names)
    fold = np.arange(n) % min(FOLDS, n)
    fits, vafs = [], []
    for i in range(min(FOLDS, n)):
        fitted = box_jenkins(drives.part(fold != i), not np.isnan(estimate.delay.value), resamples=2)
        held_out = drives.part(fold == i)
        y_hat = respond(held_out.v, fitted.arm, drives.dt) + fitted.offset.value
        for y, simulated, counts in zip(held_out.y, y_hat, held_out.counts, strict=True):
            if counts.sum() > 2 * LAGS:
                fits.append(fit(y[counts], simulated[counts]))
                vafs.append(variance_accounted_for(y[counts], simulated[counts]))
    if not fits:
        return Diagnostics(*(np.nan for _ in Diagnostics._fields))
    e = innovations(drives, estimate.theta)
    kept = [row[counts][1:] for row, counts in zip(e, drives.counts, strict=True)]
    white = [ljung_box(row, fitted=1) > 0.05 for row in kept if len(row) > 2 * LAGS]
    crossed = [
        _crossed(row[counts][1:], v[counts][1:])
        for row, v, counts in zip(e, drives.v, drives.counts, strict=True)
        if counts.sum() > 2 * LAGS
    ]
    low, middle, high = np.quantile(fits, [0.25, 0.5, 0.75])
    return Diagnostics(middle, low, high, float(np.median(vafs)), float(np.mean(white)), float(np.mean(crossed)))


def fit(y: np.ndarray, y_hat: np.ndarray) -> float:
    """Fit of a simulated output [%], as in the paper's Table IV: 100 is perfect, 0 as good as the mean.

    Args:
        y, y_hat: recorded and simulated output, shape (T,).
    """
    return 100.0 * (1.0 - float(np.linalg.norm(y - y_hat) / max(float(np.linalg.norm(y - y.mean())), 1e-12)))


def variance_accounted_for(y: np.ndarray, y_hat: np.ndarray) -> float:
    """Variance accounted for [%].

    Args:
        y, y_hat: recorded and simulated output, shape (T,).
    """
    return 100.0 * (1.0 - float(np.var(y - y_hat)) / max(float(np.var(y)), 1e-24))


def ljung_box(e: np.ndarray, lags: int = LAGS, fitted: int = 0) -> float:
    """p-value of the Ljung-Box test that a series is white.

    Args:
        e: the series, shape (T,).
        lags: number of lags.
        fitted: number of parameters of the model whose residuals these are.
    """
    T = len(e)
    centred = e - e.mean()
    square = float(centred @ centred) or 1.0
    r = np.array([centred[lag:] @ centred[:-lag] for lag in range(1, lags + 1)]) / square
    return float(chi2.sf(T * (T + 2.0) * np.sum(r**2 / (T - np.arange(1, lags + 1))), lags - fitted))


def _crossed(e: np.ndarray, v: np.ndarray) -> float:
    """Share of the lags 0 to LAGS at which innovations correlate with past inputs beyond the 95 % bound."""
    a, b = e - e.mean(), v - v.mean()
    size = float(np.sqrt((a @ a) * (b @ b))) or 1.0
    r = np.array([a[lag:] @ b[: len(b) - lag] for lag in range(LAGS + 1)]) / size
    return float(np.mean(np.abs(r) > 1.96 / np.sqrt(len(e))))
