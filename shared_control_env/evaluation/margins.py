"""Controllability curves and their margins: from outcomes at several severities to numbers with intervals.

A curve is P(controlled | severity). The margin s_q is the largest severity up to which all smaller ones are controlled
with a probability of at least q: the first crossing from below, since a curve need not fall. Uncertainty comes from
resampling the seeds, each of which stands for one person in one episode; a seed's outcomes at all severities, and under
all authorities, stay together.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import stats

RESAMPLES = 300
"""Number of bootstrap samples."""

COVERAGE = 0.95
"""Nominal coverage of the intervals [-]."""

LAPSES = np.array([0.0, 0.01, 0.03, 0.08, 0.2])
"""Lapse rates that a fit may take [-]: the share of episodes that fail at any severity."""

LAPSE_COST = 0.5
"""Log-likelihood that a lapse must gain to be part of a fit (Akaike)."""

MISFIT = 0.01
"""Smallest p-value of the deviance with which a logistic curve counts as fitting."""

DIP = 0.001
"""Largest p-value of a dip, after multiplication by the number of pairs of severities compared."""

FEW_FAILURES = 2.0
"""Number of failures expected at the probability of a margin below which a fitted margin is an extrapolation."""

ITERATIONS = 40
"""Largest number of iterations of Fisher scoring."""

LARGEST_STEP = 4.0
"""Largest change of the linear predictor in one iteration [-]."""

PRIOR = 1e-4
"""Precision of a normal prior on both coefficients, which keeps fits to separated outcomes finite."""

BANDWIDTHS = (0.01, 0.05)
"""Smallest and largest standard deviation of the smoother's kernel, as a share of the largest severity.

In between it is half the mean distance of a severity to its neighbours: narrow where the grid was refined.
"""

FINE = np.linspace(0.0, 1.0, 401)
"""Severities, as shares of the largest, at which a curve is searched for its crossing."""


class Outcomes(NamedTuple):
    """Outcomes of one curve.

    Attributes:
        severities: severities, ascending, shape (L,).
        controlled: 1 if the seed's episode was controlled, 0 if not, NaN if it was not run, shape (seeds, L).
    """

    severities: np.ndarray
    controlled: np.ndarray

    @property
    def tried(self) -> np.ndarray:
        """Number of episodes at each severity, shape (L,)."""
        return np.isfinite(self.controlled).sum(axis=0)

    @property
    def kept(self) -> np.ndarray:
        """Number of controlled episodes at each severity, shape (L,)."""
        return np.nansum(self.controlled, axis=0)


class Dip(NamedTuple):
    """A severity that is controlled less than a larger one.

    Attributes:
        severity: the severity at which the curve is low.
        share: share of controlled episodes there.
        later: a larger severity that is controlled more.
        later_share: share of controlled episodes there.
        p: p-value of the difference, over pairs of episodes with the same seed, corrected for the number of pairs.
    """

    severity: float
    share: float
    later: float
    later_share: float
    p: float


class Curves(NamedTuple):
    """Fits to one curve and to its bootstrap samples; row 0 is the fit to the outcomes themselves.

    Attributes:
        values: P(controlled) at :data:`FINE`, shape (1 + resamples, 401).
        worse, better: the same with a person who was not seen, and who always fails, or never does.
        logistic: whether they are logistic curves with a lapse; if not, they are smoothed without an assumption.
        dips: severities that are controlled significantly less than a larger one.
    """

    values: np.ndarray
    worse: np.ndarray
    better: np.ndarray
    logistic: bool
    dips: list[Dip]


class Margin(NamedTuple):
    """A margin with its interval, in the unit of the severity.

    Attributes:
        estimate, low, high: margin and ends of its interval; ``inf`` for beyond the grid, ``-inf`` for never.
    """

    estimate: float
    low: float
    high: float


def wilson(kept: float, tried: float) -> tuple[float, float]:
    """Wilson's interval of a share.

    Args:
        kept: number of successes.
        tried: number of trials; with 0 the interval is [0, 1].
    """
    if tried == 0:
        return 0.0, 1.0
    found = stats.binomtest(round(kept), round(tried)).proportion_ci(COVERAGE, method="wilson")
    return float(found.low), float(found.high)


class Weights(NamedTuple):
    """Weights of the seeds in each bootstrap sample; the first sample has the seeds as they are.

    Attributes:
        seeds: shape (1 + resamples, seeds).
        unseen: weight of a person who was not seen, shape (1 + resamples,).
    """

    seeds: np.ndarray
    unseen: np.ndarray


def resampled_weights(seeds: int, rng: np.random.Generator, resamples: int = RESAMPLES) -> Weights:
    """Weights of a Bayesian bootstrap (Rubin, The Bayesian Bootstrap, Annals of Statistics 9, 1981).

    The weights are exponential instead of numbers of draws. Outcomes that are all alike have no spread in a bootstrap,
    but do not prove that all persons are alike: 30 controlled episodes do not show that 99 % of the drivers are in
    control. Each end of an interval therefore takes one more person into account, who always
    fails (lower end) or never does (upper end), as the ends of the exact interval of a share do.

    Args:
        seeds: number of seeds.
        rng: generator.
        resamples: number of samples.
    """
    drawn, unseen = rng.exponential(size=(resamples, seeds)), rng.exponential(size=resamples)
    return Weights(np.concatenate([np.ones((1, seeds)), drawn]), np.concatenate([[0.0], unseen]))


def fit_curves(outcomes: Outcomes, weights: Weights) -> Curves:
    """Fit a curve to the outcomes, and to each bootstrap sample.

    The curve is logistic with a lapse, ``P = (1 - lapse) / (1 + exp(-(b_0 - b_1 x)))``, x the severity over the largest
    one. Where that does not fit (deviance), or the curve has a dip, it is a kernel smoother.

    Args:
        outcomes: outcomes of the curve.
        weights: weights of the seeds in each sample.
    """
    x = outcomes.severities / outcomes.severities[-1]
    present = np.isfinite(outcomes.controlled)
    used = weights.seeds[:, : len(present)]
    tried, kept = used @ present.astype(float), used @ np.nan_to_num(outcomes.controlled)
    # An unseen person counts as much at each severity as at the one with the most episodes.
    unseen = weights.unseen[:, None] * outcomes.tried / outcomes.tried.max()
    first = fit_logistic(x, kept[:1], tried[:1])
    freedom = max(1, np.count_nonzero(tried[0]) - 2)
    dips = find_dips(outcomes)
    logistic = bool(stats.chi2.sf(first[2][0], freedom) >= MISFIT) and not dips
    fit = _logistic_curves if logistic else smoothed
    sets = (fit(x, kept, tried), fit(x, kept, tried + unseen), fit(x, kept + unseen, tried + unseen))
    return Curves(*sets, logistic, dips)


def _logistic_curves(x: np.ndarray, kept: np.ndarray, tried: np.ndarray) -> np.ndarray:
    """Logistic curves with a lapse at :data:`FINE`, shape (samples, 401)."""
    coefficients, lapses, _ = fit_logistic(x, kept, tried)
    return (1.0 - lapses)[:, None] * _sigmoid(coefficients, FINE)


def _sigmoid(b: np.ndarray, x: np.ndarray) -> np.ndarray:
    return 1.0 / (1.0 + np.exp(-np.clip(b[:, :1] + b[:, 1:] * x, -500.0, 500.0)))


def smoothed(x: np.ndarray, kept: np.ndarray, tried: np.ndarray) -> np.ndarray:
    """Kernel smoother of shares, weighted by the number of trials, at :data:`FINE`.

    Args:
        x: severities as shares of the largest, shape (L,).
        kept, tried: numbers of successes and trials, shape (samples, L).

    Returns:
        Shape (samples, 401).
    """
    gaps = np.diff(x)
    apart = 0.5 * (np.append(gaps, gaps[-1]) + np.insert(gaps, 0, gaps[0]))
    width = np.clip(0.5 * apart, *BANDWIDTHS)[:, None]
    kernel = np.exp(-0.5 * ((FINE[None, :] - x[:, None]) / width) ** 2) / width
    kernel += 1e-9 * np.exp(-np.abs(FINE[None, :] - x[:, None]) / BANDWIDTHS[0])  # between severities far apart
    return (kept @ kernel) / np.maximum(tried @ kernel, 1e-300)


def fit_logistic(x: np.ndarray, kept: np.ndarray, tried: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fit logistic curves with a lapse to many samples by Fisher scoring, once for each of :data:`LAPSES`.

    Args:
        x: severities as shares of the largest, shape (L,).
        kept, tried: numbers of successes and trials, shape (samples, L).

    Returns:
        Coefficients b_0 and -b_1, shape (samples, 2); lapse of each sample, shape (samples,); deviance, (samples,).
    """
    samples = len(kept)
    best = np.full(samples, -np.inf)
    coefficients, lapses = np.zeros((samples, 2)), np.zeros(samples)
    for lapse in LAPSES:
        fitted = _scored(x, kept, tried, lapse)
        value = _log_likelihood(fitted, x, kept, tried, lapse) - (LAPSE_COST if lapse > 0.0 else 0.0)
        better = value > best
        best[better], lapses[better], coefficients[better] = value[better], lapse, fitted[better]
    share = np.divide(kept, tried, out=np.full_like(kept, 0.5), where=tried > 0.0)
    full = _binomial(kept, tried, share)
    reached = best + np.where(lapses > 0.0, LAPSE_COST, 0.0)
    return coefficients, lapses, 2.0 * (full - reached)


def _scored(x: np.ndarray, kept: np.ndarray, tried: np.ndarray, lapse: float) -> np.ndarray:
    """Coefficients (b_0, -b_1) of the logistic curve with a given lapse, shape (samples, 2)."""
    b = np.tile([3.0, -6.0], (len(kept), 1))
    for _ in range(ITERATIONS):
        s = _sigmoid(b, x)
        p = np.clip((1.0 - lapse) * s, 1e-12, 1.0 - 1e-12)
        slope = (1.0 - lapse) * s * (1.0 - s)
        pull = (kept - tried * p) * slope / (p * (1.0 - p))
        weight = tried * slope**2 / (p * (1.0 - p))
        g0, g1 = pull.sum(1) - PRIOR * b[:, 0], (pull * x).sum(1) - PRIOR * b[:, 1]
        h00, h01, h11 = weight.sum(1) + PRIOR, (weight * x).sum(1), (weight * x * x).sum(1) + PRIOR
        determinant = h00 * h11 - h01 * h01
        step = np.stack([(h11 * g0 - h01 * g1) / determinant, (h00 * g1 - h01 * g0) / determinant], axis=1)
        largest = np.maximum(np.abs(step[:, 0]), np.abs(step.sum(axis=1)))
        step *= np.minimum(1.0, LARGEST_STEP / np.maximum(largest, 1e-300))[:, None]
        b += step
        if largest.max() < 1e-6:
            break
    return b


def _log_likelihood(b: np.ndarray, x: np.ndarray, kept: np.ndarray, tried: np.ndarray, lapse: float) -> np.ndarray:
    return _binomial(kept, tried, (1.0 - lapse) * _sigmoid(b, x))


def _binomial(kept: np.ndarray, tried: np.ndarray, share: np.ndarray) -> np.ndarray:
    p = np.clip(share, 1e-12, 1.0 - 1e-12)
    return (kept * np.log(p) + (tried - kept) * np.log1p(-p)).sum(axis=1)


def first_crossings(curves: np.ndarray, q: float) -> np.ndarray:
    """First severity, as a share of the largest, at which each curve falls below q.

    Args:
        curves: values at :data:`FINE`, shape (samples, 401).
        q: probability.

    Returns:
        Shape (samples,); ``inf`` for curves that stay at or above q, ``-inf`` for those that begin below it.
    """
    below = curves < q
    first = below.argmax(axis=1)
    rows = np.arange(len(curves))
    before, after = curves[rows, np.maximum(first - 1, 0)], curves[rows, first]
    share = np.divide(before - q, before - after, out=np.zeros(len(curves)), where=before > after)
    crossing = (np.maximum(first - 1, 0) + share) / (len(FINE) - 1)
    return np.where(~below.any(axis=1), np.inf, np.where(first == 0, -np.inf, crossing))


def margin_of(outcomes: Outcomes, curves: Curves, q: float) -> Margin:
    """Margin s_q with its interval.

    The ends are percentiles of the samples: the lower end the lower one of those as drawn and of those with a further
    person who always fails, the upper end the upper one of those as drawn and of those with one who never does. The
    interval is widened to the first severity whose Wilson interval excludes q, where so few failures are expected that
    the fit extrapolates; and to the neighbouring severities that were tried where all
    episodes below the margin were controlled and none above: the fit then knows no slope.

    Args:
        outcomes: outcomes of the curve.
        curves: fits to them.
        q: probability.
    """
    s, known = outcomes.severities, outcomes.tried > 0
    estimate = float(first_crossings(curves.values[:1], q)[0]) * s[-1]
    low, high = (
        pick(
            float(np.quantile(first_crossings(samples[1:], q) * s[-1], tail, method="nearest"))
            for samples in (curves.values, further)
        )
        for further, tail, pick in (
            (curves.worse, 0.5 - 0.5 * COVERAGE, min),
            (curves.better, 0.5 + 0.5 * COVERAGE, max),
        )
    )
    mixed = known & (outcomes.kept > 0) & (outcomes.kept < outcomes.tried)
    if np.isfinite(estimate) and not mixed.any():
        low = min(low, s[known & (s <= estimate)].max(initial=0.0))
        high = max(high, s[known & (s >= estimate)].min(initial=np.inf))
    if (1.0 - q) * outcomes.tried.max() < FEW_FAILURES:
        excluded = [x for x, *counts in zip(s, outcomes.kept, outcomes.tried, strict=True) if wilson(*counts)[1] < q]
        high = max(high, min(excluded, default=np.inf))
    return Margin(estimate, min(low, estimate), max(high, estimate))


def find_dips(outcomes: Outcomes) -> list[Dip]:
    """Severities that are controlled significantly less than a larger one, each with the larger one that shows it best.

    Episodes with the same seed are compared (exact McNemar test), and p-values are multiplied by the number of pairs of
    severities.

    Args:
        outcomes: outcomes of the curve.
    """
    c = outcomes.controlled
    count = c.shape[1]
    pairs = max(1, count * (count - 1) // 2)
    found = []
    for i in range(count):
        best: Dip | None = None
        for j in range(i + 1, count):
            both = np.isfinite(c[:, i]) & np.isfinite(c[:, j])
            gained = int(((c[both, i] == 0.0) & (c[both, j] == 1.0)).sum())
            lost = int(((c[both, i] == 1.0) & (c[both, j] == 0.0)).sum())
            if gained <= lost:
                continue
            p = min(1.0, pairs * stats.binomtest(gained, gained + lost, alternative="greater").pvalue)
            if p <= DIP and (best is None or p < best.p):
                share_i, share_j = np.nanmean(c[:, i]), np.nanmean(c[:, j])
                best = Dip(
                    float(outcomes.severities[i]), float(share_i), float(outcomes.severities[j]), float(share_j), p
                )
        if best is not None:
            found.append(best)
    return found
