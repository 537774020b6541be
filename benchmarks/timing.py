"""Repeated timings and their percentiles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import numpy as np


@dataclass(frozen=True)
class Timing:
    """Time of one call, from repeated measurements.

    Attributes:
        median: median [s].
        low: 10th percentile [s].
        high: 90th percentile [s].
    """

    median: float
    low: float
    high: float

    @classmethod
    def of(cls, seconds: list[float] | np.ndarray) -> Timing:
        """Percentiles of measured times.

        Args:
            seconds: the times [s], shape (n,).
        """
        low, median, high = np.percentile(seconds, [10, 50, 90])
        return cls(float(median), float(low), float(high))

    def __str__(self) -> str:
        return f"{self.median * 1e6:,.1f} us ({self.low * 1e6:,.1f} to {self.high * 1e6:,.1f})"


def time_block(block: Callable[[], int], repeats: int) -> Timing:
    """Time of one unit of work.

    Args:
        block: function that does some units of work and returns their number.
        repeats: number of measured calls; one more call runs before, unmeasured.
    """
    block()
    seconds = []
    for _ in range(repeats):
        begin = perf_counter()
        units = block()
        seconds.append((perf_counter() - begin) / units)
    return Timing.of(seconds)
