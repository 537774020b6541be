"""Means of episodes with their uncertainty: interquartile means and stratified bootstrap intervals.

As Agarwal et al. recommend (Deep Reinforcement Learning at the Edge of the Statistical Precipice, NeurIPS 2021):
episodes are resampled within their stratum (scenario and degradation), and the interval is that of percentiles.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy import stats

RESAMPLES = 1000
"""Of the bootstrap."""

COVERAGE = 95.0
"""Of the intervals [%]."""


class Interval(NamedTuple):
    """A statistic with its bootstrap interval; nan without a value.

    Attributes:
        estimate: of the values.
        low, high: ends of the interval; nan where no stratum has two values, as with a single seed.
        n: number of finite values.
    """

    estimate: float
    low: float
    high: float
    n: int

    def overlaps(self, other: Interval) -> bool:
        """Whether two intervals have a number in common."""
        return self.low <= other.high and other.low <= self.high


def mean(values: np.ndarray) -> np.ndarray:
    """Mean over the last axis."""
    return np.mean(values, axis=-1)


def interquartile_mean(values: np.ndarray) -> np.ndarray:
    """Mean of the middle half over the last axis: a quarter of the values, rounded down, is left out at each end."""
    return stats.trim_mean(values, 0.25, axis=-1)


STATISTICS: dict[str, Callable[[np.ndarray], np.ndarray]] = {"mean": mean, "IQM": interquartile_mean}
"""Statistics by name."""


def resample(strata: np.ndarray, rng: np.random.Generator, resamples: int = RESAMPLES) -> np.ndarray:
    """Indices of bootstrap samples, drawn with replacement within every stratum.

    Args:
        strata: stratum of every value, shape (n,).
        rng: generator.
        resamples: how many samples.

    Returns:
        Shape (resamples, n); column i holds indices of the stratum of value i.
    """
    indices = np.empty((resamples, len(strata)), dtype=np.int64)
    for stratum in np.unique(strata):
        members = np.flatnonzero(strata == stratum)
        indices[:, members] = members[rng.integers(len(members), size=(resamples, len(members)))]
    return indices


def intervals(
    values: np.ndarray, strata: np.ndarray, rng: np.random.Generator, resamples: int = RESAMPLES
) -> dict[str, Interval]:
    """Every statistic of some values with its interval.

    Values that are not finite are those of episodes for which the metric is not defined; they are left out.

    Args:
        values: shape (n,).
        strata: stratum of every value, shape (n,).
        rng: generator.
        resamples: of the bootstrap.
    """
    defined = np.isfinite(values)
    values, strata = values[defined], strata[defined]
    if len(values) == 0:
        return dict.fromkeys(STATISTICS, Interval(np.nan, np.nan, np.nan, 0))
    estimates = {name: float(statistic(values)) for name, statistic in STATISTICS.items()}
    if len(np.unique(strata)) == len(strata):
        return {name: Interval(estimate, np.nan, np.nan, len(values)) for name, estimate in estimates.items()}
    samples = values[resample(strata, rng, resamples)]
    tails = [50.0 - 0.5 * COVERAGE, 50.0 + 0.5 * COVERAGE]
    found = {}
    for name, statistic in STATISTICS.items():
        low, high = np.percentile(statistic(samples), tails)
        found[name] = Interval(estimates[name], float(low), float(high), len(values))
    return found
