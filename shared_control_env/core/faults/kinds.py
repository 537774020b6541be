"""The table of all kinds of degradation: the name of each kind, the meaning of its size, and its effect.

The names follow the usage of fault-tolerant control (Blanke et al., Diagnosis and Fault-Tolerant Control, Chapter 1;
Zhang & Jiang, Bibliographical Review on Reconfigurable Fault-Tolerant Control Systems, 2008): bias, loss of
effectiveness, stuck (lock in place), saturation, and so on. :func:`add_kind` adds a kind from outside the package.
"""

from __future__ import annotations

from collections.abc import Callable
from math import floor, pi, sin
from typing import NamedTuple

from shared_control_env.core.compile.calls import Interface, by_value
from shared_control_env.core.compile.jit import jit
from shared_control_env.core.compile.memory import number_at
from shared_control_env.core.faults.noise import coloured, standard_normal
from shared_control_env.core.parameters import DegradationParameters
from shared_control_env.core.records import MAX_DELAY, FaultMemory, Signals
from shared_control_env.nearest import check_new_name, hint

CHANNEL, RATE, SHARE, TIME, LENGTH, FACTOR = "channel", "rate", "share", "time", "length", "factor"
"""Units of a size: the channel's unit [m/s^2 or rad], the channel's unit per second, a share in [0, 1], [s], [m], or a
factor of what was recorded [-]."""

CHANNELS = ("steering", "acceleration", "both")
"""Channels that the settings of a fault may name."""

HEEDED = ("seed", "time_constant", "frequency", "file")
"""Fields of a fault's settings that a kind may use beside its size."""

UNITS = (CHANNEL, RATE, SHARE, TIME, LENGTH, FACTOR)


class Acting(NamedTuple):
    """A degradation that acts on one channel of the command.

    Attributes:
        fault: parameters of the degradation.
        memory: what the degradation carries from step to step.
        channel: 0 for the acceleration, 1 for the steering.
        u: command of the channel [m/s^2 or rad].
        g: severity, in (0, 1] [-].
        size: size of the degradation in this channel, in the kind's unit.
        bound: physical limit of the channel [m/s^2 or rad].
        k: index of the time step.
        dt: duration of a time step [s].
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
"""``act(acting) -> command``: command of one channel under a degradation [m/s^2 or rad]."""

ADVANCE = Interface(None, DegradationParameters, FaultMemory, int, float)
"""``advance(fault, memory, k, dt)``: advance a degradation's memory to step k, whether it acts or not."""

PERCEIVE = Interface(None, DegradationParameters, float, Signals)
"""``perceive(fault, g, signals)``: add the errors of the automation's perception to ``signals.misperception``."""


class Kind(NamedTuple):
    """A kind of degradation.

    Attributes:
        name: name of the kind in the settings.
        unit: unit of the size, see :data:`CHANNEL`; None for a kind that has no size.
        act: function that returns the degraded command of one channel, compiled with the signature :data:`ACT`.
        perceive: function that changes the automation's perception, compiled with the signature :data:`PERCEIVE`.
        advance: function that advances the memory at every step, compiled with the signature :data:`ADVANCE`.
        heeds: fields of the settings that the kind uses besides its size: ``seed``, ``time_constant``, ``frequency``,
            ``file``.
        channels: channels that the settings of this kind may name. A kind that changes only the perception acts on
            none of them.
    """

    name: str
    unit: str | None
    act: Callable[..., float] | None = None
    perceive: Callable[..., None] | None = None
    advance: Callable[..., None] | None = None
    heeds: tuple[str, ...] = ()
    channels: tuple[str, ...] = CHANNELS

    @property
    def draws(self) -> bool:
        """Whether the kind draws random numbers; their seed is then part of its settings."""
        return "seed" in self.heeds

    @property
    def recorded(self) -> bool:
        """Whether the kind plays a recorded profile, whose file is then part of its settings."""
        return "file" in self.heeds


def _bias(c: Acting) -> float:
    """``u + g size``."""
    return c.u + c.g * c.size


def _loss_of_effectiveness(c: Acting) -> float:
    """``(1 - g size) u``."""
    return (1.0 - c.g * c.size) * c.u


def _stuck(c: Acting) -> float:
    """The command at the onset of the degradation."""
    return c.memory.kept[c.channel]


def _rate_limit(c: Acting) -> float:
    """The command, limited to within ``size dt`` of the last command."""
    last, most = c.memory.last[c.channel], c.size * c.dt
    return min(max(c.u, last - most), last + most)


def _saturation(c: Acting) -> float:
    """The command, limited to an absolute value of ``(1 - g size) bound``."""
    bound = (1.0 - c.g * c.size) * c.bound
    return min(max(c.u, -bound), bound)


def _delay(c: Acting) -> float:
    """The command at the time ``t - g size``."""
    steps = min(round(c.g * c.size / c.dt), MAX_DELAY - 1)
    return c.memory.past[max(c.k - steps, 0) % MAX_DELAY, c.channel]


def _white_noise(c: Acting) -> float:
    """``u + g size n_k`` with independent standard normal numbers n_k."""
    return c.u + c.g * c.size * standard_normal(c.fault.seed, 2 * c.k + c.channel)


def _coloured_noise(c: Acting) -> float:
    """``u + g size x_k`` with the coloured noise x_k of :func:`core.faults.noise.coloured`."""
    return c.u + c.g * c.size * c.memory.noise[c.channel]


def _advance_noise(fault: DegradationParameters, memory: FaultMemory, k: int, dt: float) -> None:
    """Advance the coloured noise x_k of both channels."""
    for channel in range(2):
        x = memory.noise[channel]
        memory.noise[channel] = coloured(x, fault.seed, 2 * k + channel, k, fault.time_constant, dt)


def _oscillation(c: Acting) -> float:
    """``u + g size sin(2 pi frequency (t - onset))``."""
    return c.u + c.g * c.size * sin(2.0 * pi * c.fault.frequency * (c.k * c.dt - c.fault.onset))


def _drop_out(c: Acting) -> float:
    """Zero command."""
    return 0.0


def _sign_error(c: Acting) -> float:
    """``-u``."""
    return -c.u


@jit
def _profile(c: Acting) -> float:
    """The recorded profile at the present time since the onset, interpolated linearly and held beyond its end."""
    x = max(c.k - c.fault.onset / c.dt, 0.0)
    i = min(floor(x), c.fault.profile_steps - 1)
    low = number_at(c.fault.profile, i)
    return low + (x - i) * (number_at(c.fault.profile, min(i + 1, c.fault.profile_steps - 1)) - low)


def _recorded_bias(c: Acting) -> float:
    """``u + g size p(t - onset)`` with the recorded profile p."""
    return c.u + c.g * c.size * _profile(c)


def _recorded_command(c: Acting) -> float:
    """``(1 - g) u + g size p(t - onset)``: the recorded profile p instead of the command."""
    return (1.0 - c.g) * c.u + c.g * c.size * _profile(c)


def _lane_offset(fault: DegradationParameters, g: float, signals: Signals) -> None:
    """The automation perceives the ego ``g size`` further to the left than it is."""
    signals.misperception[0] += g * fault.size


def _missed_lead(fault: DegradationParameters, g: float, signals: Signals) -> None:
    """The automation does not perceive the preceding vehicle."""
    if g > 0.0:
        signals.misperception[1] = 1.0


KINDS: dict[str, Kind] = {
    kind.name: kind
    for kind in (
        Kind("none", None),
        Kind("bias", CHANNEL, _bias),
        Kind("loss_of_effectiveness", SHARE, _loss_of_effectiveness),
        Kind("stuck", None, _stuck),
        Kind("rate_limit", RATE, _rate_limit),
        Kind("saturation", SHARE, _saturation),
        Kind("delay", TIME, _delay),
        Kind("white_noise", CHANNEL, _white_noise, heeds=("seed",)),
        Kind("coloured_noise", CHANNEL, _coloured_noise, advance=_advance_noise, heeds=("seed", "time_constant")),
        Kind("oscillation", CHANNEL, _oscillation, heeds=("frequency",)),
        Kind("drop_out", None, _drop_out),
        Kind("sign_error", None, _sign_error),
        Kind("recorded_bias", FACTOR, _recorded_bias, heeds=("file",), channels=("steering", "acceleration")),
        Kind("recorded_command", FACTOR, _recorded_command, heeds=("file",), channels=("steering", "acceleration")),
        Kind("lane_offset", LENGTH, perceive=_lane_offset, channels=("steering",)),
        Kind("missed_lead", None, perceive=_missed_lead, channels=("steering", "acceleration")),
    )
}
"""All kinds by name. Their order gives their codes; ``none`` has the code 0."""

STANDARD = tuple(KINDS)
"""Names of the kinds that belong to the package; kinds added later follow them in :data:`KINDS`."""


def add_kind(kind: Kind) -> None:
    """Add a kind of degradation. Settings can then name it; no registered environment draws it at random.

    Args:
        kind: the kind; its functions have the signatures that :class:`Kind` names, and are compiled here.

    Raises:
        ValueError: if the name is taken, if the unit is unknown, if the kind has neither ``act`` nor ``perceive``, if
            it heeds an unknown field or has no channel, or if numba cannot compile a function.
    """
    check_new_name("kind", kind.name, KINDS)
    if kind.unit not in (*UNITS, None):
        raise ValueError(f"kind {kind.name!r} has unit = {kind.unit!r}; {hint(kind.unit, UNITS)}")
    if kind.act is None and kind.perceive is None:
        raise ValueError(f"kind {kind.name!r} does nothing: give it act or perceive")
    for field, valid in (("heeds", HEEDED), ("channels", CHANNELS)):
        given = getattr(kind, field)
        if not isinstance(given, tuple | list):
            raise ValueError(f"kind {kind.name!r} has {field} = {given!r}; it must be a tuple such as {valid[:1]}")
        wrong = [each for each in given if each not in valid]
        if wrong:
            raise ValueError(f"kind {kind.name!r} has {field} = {given!r}; {hint(wrong[0], valid)}")
    if not kind.channels:
        raise ValueError(f"kind {kind.name!r} has no channels; {hint('', CHANNELS)}")
    addresses(kind)
    KINDS[kind.name] = kind


def addresses(kind: Kind) -> tuple[int, int, int]:
    """Addresses of the compiled functions ``act``, ``perceive`` and ``advance`` of a kind; 0 for a missing function.

    Args:
        kind: kind of degradation.

    Raises:
        ValueError: if numba cannot compile a function.
    """
    return (
        0 if kind.act is None else ACT.address(kind.act),
        0 if kind.perceive is None else PERCEIVE.address(kind.perceive),
        0 if kind.advance is None else ADVANCE.address(kind.advance),
    )
