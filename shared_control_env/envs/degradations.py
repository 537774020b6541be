"""The library of degradations: each a kind of :mod:`core.faults` with published ranges to draw it from."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from shared_control_env.core.faults.kinds import KINDS
from shared_control_env.core.parameters import Limits
from shared_control_env.nearest import hint

Range = tuple[float, float]


class Degradation(NamedTuple):
    """A degradation to draw: uniform within its ranges, one channel of those named, with one seed for its noise.

    Attributes:
        description: what goes wrong.
        kind: of :data:`core.faults.kinds.KINDS`.
        channels: candidates; the kinds that concern perception have no channel.
        size: range of the size, None where the kind has none. In the channel's limit (5 m/s^2, 30 deg) for those
            with ``of_limit``, else in the unit of the kind.
        of_limit: whether the size is a share of the channel's limit.
        signed: whether the size is of either sign.
        onset, ramp: ranges [s].
        duration: range [s]; None for a permanent one.
        period: range of one that comes and goes [s].
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


_ALL = ("steering", "acceleration", "both")

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
        "a share of the command is lost", "loss_of_effectiveness", _ALL, size=(0.3, 0.9), ramp=(0.0, 1.0)
    ),
    "stuck": Degradation("locked in place at the command of the onset", "stuck", _ALL),
    "rate_limit": Degradation("the command changes slowly", "rate_limit", size=(0.02, 0.2), of_limit=True),
    "saturation": Degradation("the command's range shrinks", "saturation", _ALL, size=(0.7, 0.98), ramp=(0.0, 1.0)),
    "delay": Degradation("the command comes late", "delay", _ALL, size=(0.1, 0.6), ramp=(0.0, 1.0)),
    "white_noise": Degradation("white noise on the command", "white_noise", size=(0.05, 0.3), of_limit=True),
    "coloured_noise": Degradation(
        "noise of 0.5 s correlation time on the command", "coloured_noise", size=(0.05, 0.4), of_limit=True
    ),
    "oscillation": Degradation("oscillation of 0.5 Hz on the command", "oscillation", size=(0.05, 0.4), of_limit=True),
    "drop_out": Degradation("the command is zero for a while", "drop_out", _ALL, duration=(0.5, 2.0)),
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
"""The library by name. The sizes run from what a driver hardly notices to what leaves the lane within a second."""

STANDARD = tuple(DEGRADATIONS)
"""Names of the package's own; those that others add come after them."""


def add_degradation(name: str, degradation: Degradation) -> None:
    """Add a degradation, which settings and suites may name from then on; no scenario draws it by itself.

    Args:
        name: in ``config["degradations"]`` and in suites.
        degradation: its kind is one of :data:`core.faults.kinds.KINDS`.

    Raises:
        ValueError: if the name is taken, or the kind unknown.
    """
    if name in DEGRADATIONS:
        raise ValueError(f"degradation {name!r} is there already")
    if degradation.kind not in KINDS:
        raise ValueError(f"degradation {name!r} has kind = {degradation.kind!r}; {hint(degradation.kind, KINDS)}")
    DEGRADATIONS[name] = degradation


def draw_degradation(name: str, limits: Limits, rng: np.random.Generator) -> list[dict[str, Any]]:
    """Settings of the faults that a named degradation consists of, its numbers drawn.

    Args:
        name: key of :data:`DEGRADATIONS`.
        limits: of the commands.
        rng: generator; always asked for the same number of draws.

    Returns:
        Entries for ``config["faults"]``; none for ``"none"``.
    """
    which, size, sign, onset, ramp, duration, period = rng.random(7).tolist()
    seed = int(rng.integers(2**31))
    entry = DEGRADATIONS[name]
    if entry is None:
        return []
    channel = entry.channels[int(which * len(entry.channels))]
    fault: dict[str, Any] = {
        "kind": entry.kind,
        "channel": channel,
        "onset": _between(entry.onset, onset),
        "ramp": _between(entry.ramp, ramp),
        "period": _between(entry.period, period),
    }
    if KINDS[entry.kind].draws:
        fault["seed"] = seed
    if entry.size is not None:
        bound = limits.a_max if channel == "acceleration" else limits.delta_max
        fault["size"] = _between(entry.size, size) * (bound if entry.of_limit else 1.0)
        if entry.signed and sign < 0.5:
            fault["size"] = -fault["size"]
    if entry.duration is not None:
        fault["duration"] = _between(entry.duration, duration)
    return [fault]


def _between(ends: Range, share: float) -> float:
    return ends[0] + (ends[1] - ends[0]) * share
