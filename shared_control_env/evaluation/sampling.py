"""Where the next episodes of a controllability curve go: to its crossings, to suspected dips, and into gaps."""

from __future__ import annotations

import numpy as np

from shared_control_env.evaluation.margins import FINE, Curves, Outcomes, first_crossings

PROBABILITIES = (0.99, 0.9, 0.5)
"""Probabilities of the margins s_99, s_90 and s_50 [-]."""

COARSE = 16
"""Number of episodes at each severity of the coarse grid."""

BLOCK = 24
"""Number of episodes that a severity gets more at a time."""

RESOLUTION = 1.0 / 40.0
"""Distance between severities, as a share of the largest, below which no new severity is put between them."""

STEPS = 200
"""New severities are multiples of the largest one divided by this, so that authorities share them."""

MOST_SEVERITIES = 18
"""Largest number of severities of a curve."""


def wanted(outcomes: Outcomes, curves: Curves, at: float) -> dict[float, int]:
    """Severities that need more episodes, and how many they should have in all.

    Four wishes, each from the outcomes alone:

    - at the crossing of each probability, a new severity, or more episodes at its two neighbours once they are close;
    - at a severity that is controlled less than a larger one, more episodes at both, until the difference is a dip or
      is gone;
    - in the widest gap between severities, a new one, where a dip could hide;
    - at the severity that was asked for, more episodes.

    Args:
        outcomes: outcomes so far.
        curves: fits to them.
        at: severity that was asked for; NaN for none.
    """
    s, tried, kept = outcomes.severities, outcomes.tried, outcomes.kept
    largest = s[-1]
    wishes: dict[float, int] = {}

    def more(i: int) -> None:
        wishes[float(s[i])] = max(wishes.get(float(s[i]), 0), int(tried[i]) + BLOCK)

    def between(x: float) -> bool:
        """Wish for a new severity near x; False if there is one already, or no room."""
        new = round(x * STEPS) / STEPS * largest
        if len(s) + len(wishes) >= MOST_SEVERITIES or np.abs(s - new).min() < 0.5 * RESOLUTION * largest:
            return False
        wishes[float(new)] = 2 * COARSE
        return True

    for q in PROBABILITIES:
        x = float(first_crossings(curves.values[:1], q)[0])
        if np.isinf(x):
            more(0 if x < 0.0 else len(s) - 1)
            continue
        right = min(int(np.searchsorted(s, x * largest)), len(s) - 1)
        left = max(right - 1, 0)
        if s[right] - s[left] > RESOLUTION * largest and between(x):
            continue
        more(left if tried[left] <= tried[right] else right)
    if at in s:
        more(int(np.flatnonzero(s == at)[0]))
    share = kept / np.maximum(tried, 1)
    dips = {dip.severity for dip in curves.dips}
    rising = [(share[i:].max() - share[i], i) for i in range(len(s) - 1) if float(s[i]) not in dips]
    rise, low = max(rising, default=(0.0, 0))
    if rise > 0.05:
        more(low)
        more(low + int(share[low:].argmax()))
    gap = int(np.diff(s).argmax())
    if s[gap + 1] - s[gap] > 2.0 * RESOLUTION * largest:
        between(0.5 * (s[gap] + s[gap + 1]) / largest)
    return wishes


def is_settled(low: float, high: float, largest: float, width: float) -> bool:
    """Whether an interval of a margin is narrow enough.

    Args:
        low, high: ends of the interval; infinite for never and beyond the grid.
        largest: largest severity.
        width: wanted width, as a share of the largest severity [-].
    """
    if low == high:
        return True
    ends = np.clip([low, high], FINE[0] * largest, largest)
    return bool(np.isfinite(low) and np.isfinite(high) and ends[1] - ends[0] <= width * largest)
