"""The kinds of degradation, one row each: what it is called, what its size means, and what it does.

Names follow the usage of fault-tolerant control (Blanke et al., Diagnosis and Fault-Tolerant Control, Chapter 1;
Zhang & Jiang, Bibliographical Review on Reconfigurable Fault-Tolerant Control Systems, 2008): bias, loss of
effectiveness, stuck (lock in place), saturation, and so on. :func:`add_kind` adds one from outside the package.
"""

from __future__ import annotations

from collections.abc import Callable
from math import pi, sin
from typing import NamedTuple

from shared_control_env.core.compile.calls import Interface, by_value
from shared_control_env.core.faults.noise import coloured, standard_normal
from shared_control_env.core.parameters import DegradationParameters
from shared_control_env.core.records import MAX_DELAY, FaultMemory, Signals
from shared_control_env.nearest import hint

COMMAND, RATE, SHARE, TIME, LENGTH = "command", "rate", "share", "time", "length"
"""What a size is: in the unit of its channel [m/s^2 or rad], that per second, a share in [0, 1], [s], or [m]."""

UNITS = (COMMAND, RATE, SHARE, TIME, LENGTH)


class Acting(NamedTuple):
    """A degradation at work on one channel.

    Attributes:
        fault: its parameters.
        memory: what it carries from step to step.
        channel: 0 for the acceleration, 1 for the steering.
        u: the channel's command [m/s^2 or rad].
        g: severity, in (0, 1].
        size: of this channel, in the kind's unit.
        bound: the channel's physical limit [m/s^2 or rad].
        k: time step.
        dt: time step [s].
    """

    fault: DegradationParameters
    memory: FaultMemory
    channel: int
    u: float
    g: float
    size: float
    bound: float
    k: int
    dt: float


ACT = Interface(float, by_value(Acting))
"""``act(acting)``: one channel's command under a degradation."""

ADVANCE = Interface(None, DegradationParameters, FaultMemory, int, float)
"""``advance(fault, memory, k, dt)``: carry a degradation's memory to step k, acting or not."""

PERCEIVE = Interface(None, DegradationParameters, float, Signals)
"""``perceive(fault, g, signals)``: add to ``signals.misperception`` what the automation's perception has wrong."""


class Kind(NamedTuple):
    """A kind of degradation.

    Attributes:
        name: in settings.
        unit: what its size is, see :data:`COMMAND`; None for a kind that has no size.
        act: the degraded command of one channel, given an :class:`Acting`.
        perceive: of the automation's perception, compiled as :data:`PERCEIVE`.
        advance: what its memory needs at every step, compiled as :data:`ADVANCE`.
        heeds: fields of the settings that it heeds beside its size: ``seed``, ``time_constant``, ``frequency``.
        channels: that it may name, where it acts on none of them.
    """

    name: str
    unit: str | None
    act: Callable[..., float] | None = None
    perceive: Callable[..., None] | None = None
    advance: Callable[..., None] | None = None
    heeds: tuple[str, ...] = ()
    channels: tuple[str, ...] = ("steering", "acceleration", "both")

    @property
    def draws(self) -> bool:
        """Whether it draws random numbers, whose seed is part of its settings."""
        return "seed" in self.heeds


def _bias(c: Acting) -> float:
    """``u + g size``."""
    return c.u + c.g * c.size


def _loss_of_effectiveness(c: Acting) -> float:
    """``(1 - g size) u``."""
    return (1.0 - c.g * c.size) * c.u


def _stuck(c: Acting) -> float:
    """The command at the moment it set in."""
    return c.memory.kept[c.channel]


def _rate_limit(c: Acting) -> float:
    """The command within ``size dt`` of the last one."""
    last, most = c.memory.last[c.channel], c.size * c.dt
    return min(max(c.u, last - most), last + most)


def _saturation(c: Acting) -> float:
    """The command within ``(1 - g size) bound``."""
    bound = (1.0 - c.g * c.size) * c.bound
    return min(max(c.u, -bound), bound)


def _delay(c: Acting) -> float:
    """The command of the time ``t - g size``."""
    steps = min(round(c.g * c.size / c.dt), MAX_DELAY - 1)
    return c.memory.past[max(c.k - steps, 0) % MAX_DELAY, c.channel]


def _white_noise(c: Acting) -> float:
    """``u + g size n_k`` with independent standard normal n_k."""
    return c.u + c.g * c.size * standard_normal(c.fault.seed, 2 * c.k + c.channel)


def _coloured_noise(c: Acting) -> float:
    """``u + g size x_k`` with x_k of :func:`core.faults.noise.coloured`."""
    return c.u + c.g * c.size * c.memory.noise[c.channel]


def _advance_noise(fault: DegradationParameters, memory: FaultMemory, k: int, dt: float) -> None:
    """x_k of both channels."""
    for channel in range(2):
        x = memory.noise[channel]
        memory.noise[channel] = coloured(x, fault.seed, 2 * k + channel, k, fault.time_constant, dt)


def _oscillation(c: Acting) -> float:
    """``u + g size sin(2 pi frequency (t - onset))``."""
    return c.u + c.g * c.size * sin(2.0 * pi * c.fault.frequency * (c.k * c.dt - c.fault.onset))


def _drop_out(c: Acting) -> float:
    """No command."""
    return 0.0


def _sign_error(c: Acting) -> float:
    """``-u``."""
    return -c.u


def _lane_offset(fault: DegradationParameters, g: float, signals: Signals) -> None:
    """The automation believes to be ``g size`` further to the left than it is."""
    signals.misperception[0] += g * fault.size


def _missed_lead(fault: DegradationParameters, g: float, signals: Signals) -> None:
    """The automation does not see the vehicle that precedes."""
    if g > 0.0:
        signals.misperception[1] = 1.0


KINDS: dict[str, Kind] = {
    kind.name: kind
    for kind in (
        Kind("none", None),
        Kind("bias", COMMAND, _bias),
        Kind("loss_of_effectiveness", SHARE, _loss_of_effectiveness),
        Kind("stuck", None, _stuck),
        Kind("rate_limit", RATE, _rate_limit),
        Kind("saturation", SHARE, _saturation),
        Kind("delay", TIME, _delay),
        Kind("white_noise", COMMAND, _white_noise, heeds=("seed",)),
        Kind("coloured_noise", COMMAND, _coloured_noise, advance=_advance_noise, heeds=("seed", "time_constant")),
        Kind("oscillation", COMMAND, _oscillation, heeds=("frequency",)),
        Kind("drop_out", None, _drop_out),
        Kind("sign_error", None, _sign_error),
        Kind("lane_offset", LENGTH, perceive=_lane_offset, channels=("steering",)),
        Kind("missed_lead", None, perceive=_missed_lead, channels=("steering", "acceleration")),
    )
}
"""All kinds by name, in the order of their codes; ``none`` has the code 0."""


def add_kind(kind: Kind) -> None:
    """Add a kind, which settings may name from then on; no registered environment draws it.

    Args:
        kind: its functions take and give what :class:`Kind` says.

    Raises:
        ValueError: if its name is taken, its unit unknown, or it does nothing, or what numba cannot compile.
    """
    if kind.name in KINDS:
        raise ValueError(f"kind {kind.name!r} is there already")
    if kind.unit not in (*UNITS, None):
        raise ValueError(f"kind {kind.name!r} has unit = {kind.unit!r}; {hint(kind.unit, UNITS)}")
    if kind.act is None and kind.perceive is None:
        raise ValueError(f"kind {kind.name!r} does nothing: give it act or perceive")
    addresses(kind)
    KINDS[kind.name] = kind


def addresses(kind: Kind) -> tuple[int, int, int]:
    """Where the compiled forms of a kind's act, perceive and advance are; 0 for what it has not."""
    return (
        0 if kind.act is None else ACT.address(kind.act),
        0 if kind.perceive is None else PERCEIVE.address(kind.perceive),
        0 if kind.advance is None else ADVANCE.address(kind.advance),
    )
