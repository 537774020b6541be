"""How late things are: ticks, inputs and round trips, measured while a person drives."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from math import nan
from typing import Any, NamedTuple

import numpy as np

STALE = 0.15
"""Age of the input from which a drive is paused and its trial invalid [s]."""

FLAGGED = 0.04
"""95th percentile of the input's age from which a trial is flagged [s]."""

KEPT = 256
"""Number of ticks and inputs that the estimates look back on."""


class Timing(NamedTuple):
    """Timing of one step, each time in seconds.

    Attributes:
        lateness: how long after its deadline the tick ran.
        input_age: time since the device was read whose input the step uses.
        round_trip: time from sending a picture's data to receiving an input that answers it; nan before the first.
    """

    lateness: float
    input_age: float
    round_trip: float


class Line:
    """The connection to the page: clock offset and round trip, from time stamps and echoes.

    An input carries the page's clock, the number of the last frame it had, and how long ago that arrived. The smallest
    difference between both clocks at arrival is the offset plus the shortest way; half of the shortest round trip is
    taken for that way.
    """

    def __init__(self) -> None:
        self._sent: dict[int, float] = {}
        self._differences: deque[float] = deque(maxlen=KEPT)
        self._trips: deque[float] = deque(maxlen=KEPT)
        self.round_trip = nan
        self._read = nan

    def sent(self, number: int, now: float) -> None:
        """A frame leaves.

        Args:
            number: its number.
            now: the server's clock [s].
        """
        self._sent[number] = now
        self._sent.pop(number - KEPT, None)

    def received(self, stamp: float, echo: int, held: float, now: float) -> None:
        """An input arrives.

        Args:
            stamp: the page's clock when the device was read [s].
            echo: number of the last frame that the page had; -1 for none.
            held: time from that frame's arrival to the reading [s].
            now: the server's clock [s].
        """
        self._differences.append(now - stamp)
        if echo in self._sent:
            self.round_trip = max(0.0, now - self._sent[echo] - held)
            self._trips.append(self.round_trip)
        self._read = stamp

    def age(self, now: float) -> float:
        """Age of the last input [s]; infinite without one.

        Args:
            now: the server's clock [s].
        """
        if not self._differences:
            return np.inf
        way = 0.5 * min(self._trips, default=0.0)
        return max(0.0, now - self._read - min(self._differences) + way)


def summary(columns: Mapping[str, Any]) -> dict[str, Any]:
    """Median, 95th and 99th percentile and maximum of each time of a drive [s], and whether it is flagged.

    Args:
        columns: arrays ``lateness``, ``input_age`` and ``round_trip`` [s].
    """
    found: dict[str, Any] = {}
    for name in Timing._fields:
        values = np.asarray(columns[name], dtype=float)
        values = values[np.isfinite(values)]
        if len(values):
            quantiles = np.quantile(values, [0.5, 0.95, 0.99, 1.0])
            found[name] = dict(zip(("median", "p95", "p99", "max"), np.round(quantiles, 6).tolist(), strict=True))
    found["flagged"] = bool(found.get("input_age", {"p95": np.inf})["p95"] > FLAGGED)
    return found
