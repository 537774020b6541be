"""What a keyboard, a gamepad or a wheel commands: raw readings in, the driver's actual command u_h,act out.

The readings are mapped here and not in the page, so that a recording holds both and one can be computed from the other.
"""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

import numpy as np
from annotated_types import Interval
from pydantic import BaseModel, ConfigDict, model_validator

from shared_control_env.core.parameters import Limits

KEYBOARD, GAMEPAD, WHEEL, SIMULATED = "keyboard", "gamepad", "wheel", "simulated"
DeviceName = Literal["keyboard", "gamepad", "wheel", "simulated"]
"""Kinds of device."""

LEFT, RIGHT, UP, DOWN = range(4)
"""Readings of a keyboard: 1 for a key that is down."""

STEER_RATE = 0.2
"""Rate at which a key turns the front wheels [rad/s]: half a turn of the wheel a second, with a ratio of 16."""

CENTRE_RATE = 0.6
"""Rate at which the front wheels return to straight ahead when no key is down [rad/s]."""

THROTTLE_RATE, BRAKE_RATE, RELEASE_RATE = 4.0, 12.0, 12.0
"""Rates at which keys accelerate, brake and release [m/s^3]."""

STICK_LINEAR = 0.15
"""Share of a gamepad stick's response that is linear; the rest is cubic, so that small corrections are possible."""

MOVED = 0.02
"""Change of an axis from which it counts as moved [-]."""

MOST_AXES = 32
"""Largest number of readings of a device."""

Reading = Annotated[float, Interval(ge=-1.0, le=1.0)]
Index = Annotated[int, Interval(ge=0, lt=MOST_AXES)]


class Axis(BaseModel):
    """A calibrated axis: the readings at rest and at its ends."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)

    axis: Index
    rest: Reading
    full: Reading
    other: Reading | None = None  # the far end to the right, of a steering axis

    @model_validator(mode="after")
    def _spans(self) -> Axis:
        ends = [self.full] if self.other is None else [self.full, self.other]
        if any(abs(end - self.rest) < 0.2 for end in ends):
            raise ValueError(f"axis {self.axis}: the ends {ends} must be at least 0.2 away from the rest {self.rest}")
        if self.other is not None and (self.full - self.rest) * (self.other - self.rest) >= 0.0:
            raise ValueError(f"axis {self.axis}: the rest {self.rest} must lie between {self.full} and {self.other}")
        return self

    def share(self, reading: float) -> float:
        """Deflection of the axis: 0 at rest, 1 at ``full``, -1 at ``other`` [-].

        Args:
            reading: the raw reading.
        """
        if self.other is not None and (reading - self.rest) * (self.full - self.rest) < 0.0:
            return -min(1.0, (reading - self.rest) / (self.other - self.rest))
        return min(1.0, max(0.0, (reading - self.rest) / (self.full - self.rest)))


class Calibration(BaseModel):
    """The axes of a gamepad or a wheel, learned from the person's movements; mappings are not standard."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)

    device: Literal["gamepad", "wheel"]
    name: Annotated[str, Interval()] = ""
    steering: Axis  # full is the left end
    throttle: Axis
    brake: Axis
    dead_zone: Annotated[float, Interval(ge=0.0, le=0.3)] = 0.0

    @model_validator(mode="after")
    def _two_ends(self) -> Calibration:
        if self.steering.other is None:
            raise ValueError("steering needs both ends: 'full' at the left and 'other' at the right")
        if self.steering.axis in (self.throttle.axis, self.brake.axis):
            raise ValueError(f"axis {self.steering.axis} cannot be the steering and a pedal")
        return self


class Command(NamedTuple):
    """A driver's command.

    Attributes:
        a: acceleration [m/s^2].
        delta: front steering angle, positive to the left [rad].
    """

    a: float
    delta: float


class Keyboard:
    """Four keys as wheel and pedals: rate-limited, and self-centring.

    Args:
        limits: limits of the command.
    """

    readings = 4

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self.reset()

    def reset(self) -> None:
        """Straight ahead, no pedal."""
        self._a = self._delta = 0.0

    def command(self, readings: np.ndarray, dt: float) -> Command:
        """Command after a time step with these keys down.

        Args:
            readings: 1 for each of LEFT, RIGHT, UP and DOWN that is down, shape (4,).
            dt: time step [s].
        """
        turn = readings[LEFT] - readings[RIGHT]
        back = turn * self._delta < 0.0  # a key against the present angle first returns it
        rate = CENTRE_RATE if turn == 0.0 or back else STEER_RATE
        self._delta = _towards(self._delta, turn * self._limits.delta_max, rate * dt)
        push = readings[UP] - readings[DOWN]
        rate = RELEASE_RATE if push == 0.0 else THROTTLE_RATE if push > 0.0 else BRAKE_RATE
        self._a = _towards(self._a, push * self._limits.a_max, rate * dt)
        return Command(self._a, self._delta)


class Axes:
    """A calibrated gamepad or wheel.

    Browsers report 0 for a pedal until it moves, wherever it rests: a pedal counts from its first movement on.

    Args:
        calibration: the axes.
        limits: limits of the command.
    """

    def __init__(self, calibration: Calibration, limits: Limits) -> None:
        self.calibration, self._limits = calibration, limits
        self.readings = 1 + max(calibration.steering.axis, calibration.throttle.axis, calibration.brake.axis)
        self._first: np.ndarray | None = None
        self._moved = np.zeros(MOST_AXES, dtype=bool)

    def command(self, readings: np.ndarray, dt: float) -> Command:
        """Command of the present readings.

        Args:
            readings: raw axes in [-1, 1], at least :attr:`readings` of them.
            dt: time step [s]; not used.
        """
        if self._first is None:
            self._first = readings.copy()
        n = min(len(readings), len(self._first))
        self._moved[:n] |= np.abs(readings[:n] - self._first[:n]) > MOVED
        c, limits = self.calibration, self._limits
        share = c.steering.share(float(readings[c.steering.axis]))
        share = 0.0 if abs(share) <= c.dead_zone else (abs(share) - c.dead_zone) / (1.0 - c.dead_zone) * np.sign(share)
        if c.device == GAMEPAD:
            share = STICK_LINEAR * share + (1.0 - STICK_LINEAR) * share**3
        a = limits.a_max * (self._pedal(c.throttle, readings) - self._pedal(c.brake, readings))
        return Command(float(a), float(share * limits.delta_max))

    def _pedal(self, axis: Axis, readings: np.ndarray) -> float:
        return axis.share(float(readings[axis.axis])) if self._moved[axis.axis] else 0.0


class Simulated:
    """A simulated person's arm: the readings are the shares of the limits themselves.

    Args:
        limits: limits of the command.
    """

    readings = 2

    def __init__(self, limits: Limits) -> None:
        self._limits = limits

    def command(self, readings: np.ndarray, dt: float) -> Command:
        """Command of the present readings.

        Args:
            readings: acceleration and steering as shares of the limits, shape (2,) [-].
            dt: time step [s]; not used.
        """
        return Command(float(readings[0]) * self._limits.a_max, float(readings[1]) * self._limits.delta_max)


def _towards(value: float, goal: float, most: float) -> float:
    """A value moved towards a goal by at most an amount."""
    return value + min(max(goal - value, -most), most)
