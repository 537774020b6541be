"""The library of degradations: each is a kind of :mod:`core.faults` with published ranges to draw it from."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from shared_control_env.core.drawing import between
from shared_control_env.core.faults.kinds import CHANNELS, KINDS
from shared_control_env.core.parameters import Limits
from shared_control_env.nearest import check_new_name, hint

Range = tuple[float, float]


class Degradation(NamedTuple):
    """A degradation to draw. All numbers are uniform within their ranges, and one of the named channels is chosen.

    Attributes:
        description: what goes wrong.
        kind: name of the kind, a key of :data:`core.faults.kinds.KINDS`.
        channels: channels to choose from; kinds that concern perception have no channel.
        size: range of the size; None where the kind has no size. With ``of_limit`` it is a share of the channel's
            limit (5 m/s^2, 30 deg), else it is in the unit of the kind.
        of_limit: whether the size is a share of the channel's limit.
        signed: whether the size can have either sign.
        onset: range of the time of onset [s].
        ramp: range of the duration of the ramp [s].
        duration: range of the duration [s]; None for a permanent degradation.
        period: range of the period of an intermittent degradation [s].
    """

    description: str
    kind: str
    channels: tuple[str, ...] = ("steering", "acceleration")
    size: Range | None = None
    of_limit: bool = False
    signed: bool = False
    onset: Range = (1.0, 3.0)
    ramp: Range = (0.0, 0.0)
    duration: Range | None = None
    period: Range = (0.0, 0.0)


DEGRADATIONS: dict[str, Degradation | None] = {
    "none": None,
    "bias_ramp": Degradation(
        "bias that ramps up and stays, as in the paper",
        "bias",
        size=(0.1, 0.6),
        of_limit=True,
        signed=True,
        ramp=(0.25, 1.5),
    ),
    "step_bias": Degradation("bias that is there at once", "bias", size=(0.05, 0.4), of_limit=True, signed=True),
    "loss_of_effectiveness": Degradation(
        "a share of the command is lost", "loss_of_effectiveness", CHANNELS, size=(0.3, 0.9), ramp=(0.0, 1.0)
    ),
    "stuck": Degradation("locked in place at the command of the onset", "stuck", CHANNELS),
    "rate_limit": Degradation("the command changes slowly", "rate_limit", size=(0.02, 0.2), of_limit=True),
    "saturation": Degradation("the command's range shrinks", "saturation", CHANNELS, size=(0.7, 0.98), ramp=(0.0, 1.0)),
    "delay": Degradation("the command comes late", "delay", CHANNELS, size=(0.1, 0.6), ramp=(0.0, 1.0)),
    "white_noise": Degradation("white noise on the command", "white_noise", size=(0.05, 0.3), of_limit=True),
    "coloured_noise": Degradation(
        "noise of 0.5 s correlation time on the command", "coloured_noise", size=(0.05, 0.4), of_limit=True
    ),
    "oscillation": Degradation("oscillation of 0.5 Hz on the command", "oscillation", size=(0.05, 0.4), of_limit=True),
    "drop_out": Degradation("the command is zero for a while", "drop_out", CHANNELS, duration=(0.5, 2.0)),
    "intermittent": Degradation(
        "bias that comes and goes", "bias", size=(0.1, 0.5), of_limit=True, signed=True, period=(0.6, 2.0)
    ),
    "sign_error": Degradation("the command has the wrong sign", "sign_error"),
    "lane_offset": Degradation(
        "the perceived position in the lane is off",
        "lane_offset",
        ("steering",),
        size=(0.5, 2.5),
        signed=True,
        ramp=(0.0, 2.0),
    ),
    "missed_lead": Degradation("the vehicle that precedes is not perceived", "missed_lead", ("acceleration",)),
    "complete_failure": Degradation("no command at all, for good", "drop_out", ("both",)),
}
"""The library by name. The sizes range from hardly noticeable to a lane departure within a second."""

STANDARD = tuple(DEGRADATIONS)
"""Names of the degradations that the package defines; user-defined degradations come after them."""


def add_degradation(name: str, degradation: Degradation) -> None:
    """Add a degradation, so that settings and suites can name it. The registered scenarios do not draw it.

    Args:
        name: name for ``config["degradations"]`` and for suites.
        degradation: the degradation; its kind is a key of :data:`core.faults.kinds.KINDS`.

    Raises:
        ValueError: if the name is taken, or the kind is unknown.
    """
    check_new_name("degradation", name, DEGRADATIONS)
    if degradation.kind not in KINDS:
        raise ValueError(f"degradation {name!r} has kind = {degradation.kind!r}; {hint(degradation.kind, KINDS)}")
    kind = KINDS[degradation.kind]
    if kind.recorded:
        raise ValueError(
            f"degradation {name!r} has kind = {kind.name!r}, which plays a file: give it in 'faults' instead"
        )
    wrong = [channel for channel in degradation.channels if channel not in kind.channels]
    if wrong or not degradation.channels or isinstance(degradation.channels, str):
        raise ValueError(f"degradation {name!r} has channels = {degradation.channels!r}; {hint(wrong, kind.channels)}")
    if (degradation.size is None) != (kind.unit is None):
        needs = "has none" if kind.unit is None else "needs a range of it, (low, high)"
        raise ValueError(f"degradation {name!r} has size = {degradation.size!r}; its kind {kind.name!r} {needs}")
    DEGRADATIONS[name] = degradation


def draw_degradation(name: str, limits: Limits, rng: np.random.Generator) -> list[dict[str, Any]]:
    """Draw the fault settings of a named degradation.

    Args:
        name: key of :data:`DEGRADATIONS`.
        limits: limits of the commands.
        rng: generator; the number of draws is the same for every degradation.

    Returns:
        Entries for ``config["faults"]``; an empty list for ``"none"``.
    """
    shares = rng.random(7)
    seed = int(rng.integers(2**31))
    entry = DEGRADATIONS[name]
    if entry is None:
        return []
    return [fault_of(entry, entry.channels[int(shares[0] * len(entry.channels))], limits, shares, seed)]


def fault_of(entry: Degradation, channel: str, limits: Limits, shares: np.ndarray, seed: int) -> dict[str, Any]:
    """The fault settings of a degradation; :mod:`core.drawing` makes the same records of the same draws.

    Args:
        entry: the degradation.
        channel: one of its channels.
        limits: limits of the commands.
        shares: shares of the way between the ends, of which the first has chosen the channel, shape (7,): then size,
            sign, onset, ramp, duration and period [-].
        seed: seed of noise.
    """
    _, size, sign, onset, ramp, duration, period = shares.tolist()
    fault: dict[str, Any] = {
        "kind": entry.kind,
        "channel": channel,
        "onset": between(*entry.onset, onset),
        "ramp": between(*entry.ramp, ramp),
        "period": between(*entry.period, period),
    }
    if KINDS[entry.kind].draws:
        fault["seed"] = seed
    if entry.size is not None:
        fault["size"] = between(*entry.size, size) * bound_of(entry, channel, limits)
        if entry.signed and sign < 0.5:
            fault["size"] = -fault["size"]
    if entry.duration is not None:
        fault["duration"] = between(*entry.duration, duration)
    return fault


def bound_of(entry: Degradation, channel: str, limits: Limits) -> float:
    """Unit of a degradation's size: the limit of its channel where it is a share of that, else 1.

    Args:
        entry: the degradation.
        channel: one of its channels.
        limits: limits of the commands.
    """
    if not entry.of_limit:
        return 1.0
    return limits.a_max if channel == "acceleration" else limits.delta_max
