"""A car's CAN record: what it tells about actuator and conflict, and what it does not tell about the driver."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

SIGNALS = {
    "command": ("t_command", "steering torque that the automation requests [counts]"),
    "request": ("t_command", "1 while the automation steers"),
    "driver_torque": ("t_torque", "torque of the driver [counts]"),
    "motor_torque": ("t_torque", "torque of the steering motor [counts]"),
    "speed": ("t_speed", "speed [m/s]"),
    "wheel_angle": ("t_angle", "angle of the steering wheel [deg]"),
}
"""Signals of a record, the array with their time stamps [s], and what they are."""

RATE = 100.0
"""Rate to which the signals are brought [1/s]."""

LONGEST_DELAY = 0.5
"""Largest delay that is searched for [s]."""

TOUCHED = 100.0
"""Torque of the driver from which it counts as a push [counts]; assumed."""


class Record(NamedTuple):
    """A CAN record at one rate.

    Attributes:
        t: time, shape (T,) [s].
        signals: each of :data:`SIGNALS`, shape (T,).
    """

    t: np.ndarray
    signals: dict[str, np.ndarray]


class Findings(NamedTuple):
    """What a CAN record tells.

    Attributes:
        duration: length of the record [s].
        engaged: share of it with the automation steering [-].
        by_hand: time without it [s].
        delay: delay from command to motor torque at which they correlate most, while it steers [s].
        correlation: that correlation [-]; negative if the two have opposite signs.
        torque: largest torque of the driver while the automation steers [counts].
        pushing: share of the time with the automation steering in which the driver pushes [-].
        conflict: share of that in which driver and motor push against each other [-]; nan if the driver never pushes.
    """

    duration: float
    engaged: float
    by_hand: float
    delay: float
    correlation: float
    torque: float
    pushing: float
    conflict: float


WORDS = (
    "K_h and T_h are not identified from this record: one driver, a few seconds by hand, a torque instead of an angle, "
    "and no u_h,des: nobody knows what this driver wanted. While the automation steers, the driver's torque is "
    "probably that of hands at rest. Nothing here validates a model of a driver."
)
"""What has to be said of every such record."""


def read_record(path: Path) -> Record:
    """Read a record.

    Args:
        path: ``.npz`` file with the arrays of :data:`SIGNALS` and their time stamps.

    Raises:
        ValueError: if an array is missing, of another length, not finite, or if its time stamps do not increase.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: np.asarray(file[name], dtype=float) for name in file.files}
    except (OSError, ValueError, EOFError) as error:
        raise ValueError(f"{path} is no record of arrays: {error}") from None
    for name, (stamps, meaning) in SIGNALS.items():
        for each in (name, stamps):
            if each not in arrays:
                raise ValueError(f"{path} has no {each!r} ({meaning if each == name else 'time stamps'})")
            if arrays[each].ndim != 1 or not np.isfinite(arrays[each]).all():
                raise ValueError(f"{path}: {each!r} must be a series of finite numbers")
        if len(arrays[name]) != len(arrays[stamps]) or len(arrays[name]) < 2:
            raise ValueError(f"{path}: {name!r} has {len(arrays[name])} values and {len(arrays[stamps])} time stamps")
        if (np.diff(arrays[stamps]) < 0.0).any():
            raise ValueError(f"{path}: the time stamps {stamps!r} do not increase")
    begin = max(arrays[stamps][0] for stamps, _ in SIGNALS.values())
    end = min(arrays[stamps][-1] for stamps, _ in SIGNALS.values())
    t = np.arange(begin, end, 1.0 / RATE)
    return Record(t, {name: np.interp(t, arrays[stamps], arrays[name]) for name, (stamps, _) in SIGNALS.items()})


def study(record: Record) -> Findings:
    """Actuator delay and conflict of a record.

    Args:
        record: the record.

    Raises:
        ValueError: if the automation hardly steers, or if no delay can be told.
    """
    signals = record.signals
    steers = signals["request"] > 0.5
    if steers.sum() < 4 * LONGEST_DELAY * RATE:
        raise ValueError(
            f"the automation steers for {steers.sum() / RATE:.1f} s; at least {4 * LONGEST_DELAY:g} s are needed"
        )
    command, motor = signals["command"], signals["motor_torque"]
    for name in ("command", "motor_torque"):
        if np.ptp(signals[name][steers]) == 0.0:
            raise ValueError(f"{name!r} is constant while the automation steers, so that no delay can be told")
    lags = np.arange(int(LONGEST_DELAY * RATE) + 1)
    found = []
    for lag in lags:
        both = steers[: len(steers) - lag] & steers[lag:]
        found.append(np.corrcoef(command[: len(command) - lag][both], motor[lag:][both])[0, 1])
    best = int(np.argmax(np.abs(found)))  # the two may have opposite signs
    if best == lags[-1]:
        raise ValueError(
            f"command and motor torque correlate most at {LONGEST_DELAY:g} s or beyond, the end of the search"
        )
    pushes = steers & (np.abs(signals["driver_torque"]) > TOUCHED)
    against = pushes & (signals["driver_torque"] * motor < 0.0)
    return Findings(
        duration=len(record.t) / RATE,
        engaged=float(steers.mean()),
        by_hand=float((~steers).sum() / RATE),
        delay=float(lags[best] / RATE),
        correlation=float(found[best]),
        torque=float(np.abs(signals["driver_torque"][steers]).max()),
        pushing=float(pushes.sum() / steers.sum()),
        conflict=float(against.sum() / pushes.sum()) if pushes.any() else np.nan,
    )
