"""A wheel on this machine, read without the browser, with optional force feedback on Linux.

The axes are read with pygame's joysticks. The forces go through the kernel's event devices (package ``evdev``): a
spring to the middle, and a constant force towards the automation's steering angle. They are off by default, and capped.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np

from shared_control_env.drive.devices import MOST_AXES, Calibration

STRONGEST = 0.3
"""Largest torque that can be asked for, as a share of what the device can do [-]: a hand can always hold it."""

FULL_FORCE = 0x7FFF
"""Largest level of a force [-]."""

REACH = 0.1
"""Difference between automation and wheel at which the force is at its cap, as a share of full lock [-]."""

TO_THE_LEFT = 0x4000
"""Direction of a force, in the kernel's units: 0x4000 is left, 0xC000 right (``linux/input.h``)."""


class Joystick(Protocol):
    """What is needed of pygame's joystick."""

    def get_name(self) -> str:
        """Name of the device."""
        ...

    def get_numaxes(self) -> int:
        """Number of axes."""
        ...

    def get_axis(self, axis_number: int, /) -> float:
        """Reading of an axis in [-1, 1].

        Args:
            axis_number: number of the axis.
        """
        ...


class NativeWheel:
    """A wheel that the server reads itself, at the tick.

    Args:
        joystick: the device.
        attached: updates the readings, and says whether the device is still there.
        feedback: turns the wheel; None for no forces.

    Attributes:
        name: name of the device.
    """

    def __init__(self, joystick: Joystick, attached: Callable[[], bool], feedback: Feedback | None = None) -> None:
        self._joystick, self._attached, self._feedback = joystick, attached, feedback
        self.name = joystick.get_name()

    def read(self, now: float) -> tuple[np.ndarray, float]:
        """Raw axes, and their age [s]; infinite if the device has gone.

        They are read now, so that their age is 0: what the device itself takes is not known.

        Args:
            now: the server's clock [s]; not used.
        """
        there = self._attached()
        n = min(self._joystick.get_numaxes(), MOST_AXES)
        return np.array([self._joystick.get_axis(i) for i in range(n)]).clip(-1.0, 1.0), 0.0 if there else np.inf

    def push(self, automation: float, full: float, calibration: Calibration | None) -> None:
        """Push the wheel towards the automation's angle, if forces are on.

        Args:
            automation: the automation's steering [rad].
            full: steering at full lock [rad].
            calibration: axes of the wheel.
        """
        if self._feedback is not None and calibration is not None:
            readings, _ = self.read(0.0)
            self._feedback.push(
                automation / full - calibration.steering.share(float(readings[calibration.steering.axis]))
            )

    def rest(self) -> None:
        """Let go of the wheel."""
        if self._feedback is not None:
            self._feedback.rest()


class Feedback:
    """Forces on a wheel.

    Args:
        device: ``evdev.InputDevice`` of the wheel, or what has its methods.
        torque: largest torque as a share of the device's, in [0, STRONGEST] [-].
        ff: the module ``evdev.ff``.
        codes: the module ``evdev.ecodes``.

    Raises:
        ValueError: for a torque outside its range, or a device without these forces.
    """

    def __init__(self, device: Any, torque: float, ff: Any, codes: Any) -> None:
        if not 0.0 < torque <= STRONGEST:
            raise ValueError(f"torque = {torque:g} must lie in (0, {STRONGEST:g}]: a hand must be able to hold it")
        able = device.capabilities().get(codes.EV_FF, [])
        if codes.FF_CONSTANT not in able or codes.FF_SPRING not in able:
            raise ValueError(f"{device.name!r} has no spring and constant force")
        self._device, self._torque, self._ff, self._codes = device, torque, ff, codes
        self._constant = -1
        self._spring = device.upload_effect(self._effect(codes.FF_SPRING, -1, 0))
        device.write(codes.EV_FF, self._spring, 1)

    def push(self, difference: float) -> None:
        """Set the constant force.

        Args:
            difference: automation's angle minus the wheel's, as a share of full lock, positive to the left [-].
        """
        share = self._torque * min(max(difference / REACH, -1.0), 1.0)
        started = self._constant >= 0
        effect = self._effect(self._codes.FF_CONSTANT, self._constant, round(share * FULL_FORCE))
        self._constant = self._device.upload_effect(effect)
        if not started:
            self._device.write(self._codes.EV_FF, self._constant, 1)

    def rest(self) -> None:
        """Take the constant force away; the spring stays."""
        if self._constant >= 0:
            self.push(0.0)

    def _effect(self, kind: int, number: int, level: int) -> Any:
        """A constant force of a level, or the spring to the middle."""
        ff = self._ff
        if kind == self._codes.FF_CONSTANT:
            what = ff.EffectType(ff_constant_effect=ff.Constant(level, ff.Envelope(0, 0, 0, 0)))
        else:
            stiff = round(self._torque * FULL_FORCE)
            spring = ff.Condition(2 * stiff, 2 * stiff, stiff, stiff, 0, 0)
            what = ff.EffectType(ff_condition_effect=(ff.Condition * 2)(spring, spring))
        return ff.Effect(kind, number, TO_THE_LEFT, ff.Trigger(0, 0), ff.Replay(0, 0), what)


def open_wheel(name: str, torque: float = 0.0) -> NativeWheel:
    """Find a wheel on this machine.

    Args:
        name: a part of its name; ``any`` for the first device.
        torque: largest torque of the force feedback, as a share of the device's; 0 for none.

    Raises:
        ValueError: if there is none of that name, with those that there are; or if forces are asked for that it lacks.
    """
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")  # no window is needed
    os.environ.setdefault("SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS", "1")
    import pygame

    pygame.display.init()
    pygame.joystick.init()
    found: Sequence[Any] = [pygame.joystick.Joystick(i) for i in range(pygame.joystick.get_count())]
    chosen = choose(found, name)
    gone: set[int] = set()

    def attached() -> bool:
        gone.update(event.instance_id for event in pygame.event.get(pygame.JOYDEVICEREMOVED))
        return chosen.get_instance_id() not in gone  # type: ignore[attr-defined]

    return NativeWheel(chosen, attached, feedback_of(chosen.get_name(), torque))


def choose(found: Sequence[Joystick], name: str) -> Joystick:
    """The device of a name.

    Args:
        found: devices.
        name: a part of the name; ``any`` for the first.

    Raises:
        ValueError: if there is none.
    """
    for joystick in found:
        if name == "any" or name.lower() in joystick.get_name().lower():
            return joystick
    names = ", ".join(repr(joystick.get_name()) for joystick in found) or "none"
    raise ValueError(f"wheel = {name!r} is not connected; connected are {names}")


def feedback_of(name: str, torque: float) -> Feedback | None:
    """Force feedback of a device, None for no torque.

    Args:
        name: name of the device.
        torque: largest torque as a share of the device's; 0 for none.

    Raises:
        ValueError: without the package evdev, on another system than Linux, or without such a device.
    """
    if torque == 0.0:
        return None
    try:
        import evdev
    except ImportError:
        raise ValueError(
            f'torque = {torque:g} needs Linux and the extra "wheel": pip install "shared_control_env[wheel]"'
        ) from None
    for path in evdev.list_devices():
        device = evdev.InputDevice(path)
        if device.name == name:
            return Feedback(device, torque, evdev.ff, evdev.ecodes)
    raise ValueError(f"torque = {torque:g}: no event device {name!r} that this user may write to")
