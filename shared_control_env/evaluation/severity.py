"""Severity of a fault: the size of a degradation on the axis of its kind, from nothing to past the library's range.

A kind with a size is graded by it. A kind without one is graded by how long it lasts, and so is any kind when the time
is asked for that a fault of a given size may last (the fault-tolerant time).
"""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import Any, NamedTuple

from shared_control_env.core.faults.kinds import CHANNEL, KINDS, LENGTH, RATE, SHARE, TIME
from shared_control_env.core.parameters import Limits
from shared_control_env.core.records import MAX_DELAY
from shared_control_env.envs.degradations import DEGRADATIONS
from shared_control_env.nearest import hint

ONSET = (1.0, 3.0)
"""Range from which the onset of a graded fault is drawn [s], as in the library of degradations."""

SIZE, DURATION = "size", "duration"
OVER = (SIZE, DURATION)
"""What a curve may run over."""

LONGEST = 9.0
"""Longest duration of a graded fault [s]: the episodes of the registered scenarios end 10 s after the start."""

COMMISSION = ("bias", "white_noise", "coloured_noise", "oscillation", "sign_error", "lane_offset")
"""Kinds that act where nothing was commanded. The other kinds of the package withhold what was (omission)."""

_SIGNED = ("bias", "lane_offset")
"""Kinds whose size has a sign. Half of the episodes have either."""

_SHARES = (0.0, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0)
"""Coarse grid of the severities, as shares of the largest."""


class Axis(NamedTuple):
    """Axis of severity of a kind of degradation on one channel.

    Attributes:
        kind: key of :data:`core.faults.kinds.KINDS`.
        channel: channel of the command that degrades.
        over: ``size`` or ``duration``.
        unit: unit of the severity.
        meaning: what a severity is.
        largest: largest severity that is physically different from smaller ones.
        library: largest severity that the library of degradations draws, which is s = 1 of its range; None if it draws
            none.
        grid: severities at which a curve begins, ascending from 0, which is no fault.
        size: size of the fault whose duration is graded; None where the size is.
    """

    kind: str
    channel: str
    over: str
    unit: str
    meaning: str
    largest: float
    library: float | None
    grid: tuple[float, ...]
    size: float | None = None

    @property
    def name(self) -> str:
        """Name in tables: kind and channel, and the size where the duration is graded."""
        of = "" if self.over == SIZE or KINDS[self.kind].unit is None else f" for a time, size {self.size:g}"
        return f"{self.kind} of {self.channel}{of}"

    def fault(self, severity: float, seed: int) -> GradedFault:
        """The fault of an episode.

        Args:
            severity: severity in the axis's unit.
            seed: seed of the episode; signed kinds act to the left in episodes with an even seed.
        """
        sign = -1.0 if self.kind in _SIGNED and seed % 2 else 1.0
        if self.over == DURATION:
            size = None if self.size is None else sign * _as_size(self.kind, self.channel, self.size)
            return GradedFault(self.kind, self.channel, severity, size, _short(severity) or None, severity > 0.0)
        size = sign * _as_size(self.kind, self.channel, severity) if severity > 0.0 else None
        return GradedFault(self.kind, self.channel, severity, size, None, severity > 0.0)


class GradedFault(NamedTuple):
    """A fault of a given severity.

    Attributes:
        kind: key of :data:`core.faults.kinds.KINDS`.
        channel: channel of the command that degrades.
        severity: severity on the axis.
        size: size in the kind's unit; None for a kind without one.
        duration: duration [s]; None for a permanent fault.
        present: whether there is a fault at all; not for the severity 0.
    """

    kind: str
    channel: str
    severity: float
    size: float | None
    duration: float | None
    present: bool

    @property
    def label(self) -> str:
        """Name in tables and commands: ``kind:channel:size:duration``; ``-`` for what the fault does not have."""
        numbers = ("-" if each is None else f"{each:g}" for each in (self.size, self.duration))
        return ":".join((self.kind, self.channel, *(numbers if self.present else ("0", "-"))))

    def settings(self) -> dict[str, Any]:
        """Changes to the settings."""
        fault: dict[str, Any] = {"kind": self.kind, "channel": self.channel, "onset": ONSET[0]}
        fault |= {k: v for k, v in (("size", self.size), ("duration", self.duration)) if v is not None}
        return {"degradations": [], "faults": [fault] if self.present else []}

    def draws(self) -> tuple[Mapping[str, Any], ...]:
        """Draws of the settings: the onset."""
        return ({"setting": "faults.0.onset", "low": ONSET[0], "high": ONSET[1]},) if self.present else ()


def parse_fault(label: str) -> GradedFault:
    """The fault that a label names, see :attr:`GradedFault.label`.

    Args:
        label: text such as ``bias:steering:-0.1:-``.

    Raises:
        ValueError: for a text of another form.
    """
    parts = label.split(":")
    try:
        kind, channel, *numbers = parts
        size, duration = (None if each == "-" else float(each) for each in numbers)
    except ValueError:
        raise ValueError(f"fault = {label!r} must be kind:channel:size:duration, such as bias:steering:0.1:-") from None
    axis_of(kind, channel)
    present = not (size == 0.0 and duration is None)
    return GradedFault(kind, channel, abs(size or duration or 0.0), size if present else None, duration, present)


def _as_size(kind: str, channel: str, severity: float) -> float:
    """Size of a fault in the kind's unit. The severity of a rate limit is the time that it takes to cross the range."""
    return _short(2.0 * _bound(channel) / severity if KINDS[kind].unit == RATE else severity)


def _short(number: float) -> float:
    """The number with six significant digits, so that a label names it exactly."""
    return float(f"{number:g}")


def _bound(channel: str) -> float:
    limits = Limits()
    return limits.a_max if channel == "acceleration" else limits.delta_max


def axis_of(kind: str, channel: str = "steering", over: str = SIZE, size: float | None = None) -> Axis:
    """Axis of severity of a kind on a channel.

    Args:
        kind: key of :data:`core.faults.kinds.KINDS`, one added by a user included.
        channel: channel that degrades.
        over: ``size``, or ``duration`` for the fault-tolerant time.
        size: severity of the fault whose duration is graded.

    Raises:
        ValueError: for an unknown kind, a channel that the kind does not have, or a size outside of physics.
    """
    known = [name for name in KINDS if name != "none" and not KINDS[name].recorded]
    if kind not in known:
        raise ValueError(f"kinds: {kind!r} is not a kind of degradation; {hint(kind, known)}")
    if channel not in KINDS[kind].channels:
        raise ValueError(f"channel = {channel!r} of the kind {kind!r}; {hint(channel, KINDS[kind].channels)}")
    if over not in OVER:
        raise ValueError(f"over = {over!r}; {hint(over, OVER)}")
    unit, meaning, largest = _range_of(kind, channel)
    library = _library_of(kind, channel)
    if KINDS[kind].unit is None or over == DURATION:
        if over == DURATION and KINDS[kind].unit is not None:
            size = checked_severity(size, f"size of {kind!r}", largest, unit)
            if size == 0.0:
                raise ValueError(f"size of {kind!r} = 0.0 {unit} is no fault that could last; it must be above 0")
        grid = tuple(LONGEST * share for share in (0.0, 0.03, 0.06, 0.12, 0.25, 0.5, 1.0))
        return Axis(kind, channel, DURATION, "s", "duration", LONGEST, None, grid, size)
    grid = tuple(largest * share for share in _SHARES)
    return Axis(kind, channel, SIZE, unit, meaning, largest, library, grid)


def checked_severity(value: Any, what: str, largest: float, unit: str) -> float:
    """Check a severity.

    Args:
        value: the severity that the user gave.
        what: name for the error message.
        largest: largest severity.
        unit: its unit.

    Raises:
        ValueError: unless it is a number in [0, largest].
    """
    if (
        isinstance(value, bool)
        or not isinstance(value, int | float)
        or not isfinite(value)
        or not 0 <= value <= largest
    ):
        raise ValueError(f"{what} = {value!r} must be a number in [0, {largest:.4g}] {unit}")
    return float(value)


def _range_of(kind: str, channel: str) -> tuple[str, str, float]:
    """Unit, meaning and largest severity of a kind."""
    of_channel = "m/s^2" if channel == "acceleration" else "rad"
    return {
        CHANNEL: (of_channel, "size", _bound(channel)),
        RATE: ("s", "time to cross the range", 100.0),
        SHARE: ("-", "share lost", 1.0),
        TIME: ("s", "delay", (MAX_DELAY - 1) * 0.05),
        LENGTH: ("m", "offset", 4.0),
        None: ("s", "duration", LONGEST),
    }[KINDS[kind].unit]


def _library_of(kind: str, channel: str) -> float | None:
    """Largest severity that the library draws of a kind; None if it draws none, or has no size."""
    sizes = [
        ends if not entry.of_limit else tuple(each * _bound(channel) for each in ends)
        for entry in DEGRADATIONS.values()
        if entry is not None and entry.kind == kind and (ends := entry.size) is not None
    ]
    if not sizes:
        return None
    if KINDS[kind].unit == RATE:
        return 2.0 * _bound(channel) / min(low for low, _ in sizes)
    return max(high for _, high in sizes)
