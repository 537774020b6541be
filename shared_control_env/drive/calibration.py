"""The calibration of a gamepad or wheel: which axes move when the person does what the page asks for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from shared_control_env.drive.devices import GAMEPAD, Axis, Calibration

STEPS = {
    "left": "Turn the wheel, or push the stick, fully to the left and hold it there.",
    "right": "Now fully to the right, and hold it there.",
    "centre": "Let go, so that it stands straight.",
    "throttle": "Press the accelerator fully and hold it.",
    "released": "Release it.",
    "brake": "Press the brake fully and hold it.",
    "free": "Release it.",
}
"""What the person is asked for, in this order."""

LEAST = 0.3
"""Smallest change of a reading that counts as an answer [-]."""

DEAD_ZONE = 0.08
"""Dead zone of a gamepad's stick, which does not return to one reading [-]."""


def calibrated(device: str, name: str, samples: Mapping[str, Sequence[float]]) -> Calibration:
    """Calibration from the readings at each step.

    Args:
        device: ``gamepad`` or ``wheel``.
        name: name of the device.
        samples: raw readings at each of :data:`STEPS`.

    Raises:
        ValueError: if a step is missing, the readings are not as many in each, or nothing moved in one, in words.
    """
    missing = [step for step in STEPS if step not in samples]
    if missing:
        raise ValueError(f"the calibration lacks {', '.join(missing)}; begin it again")
    counts = {len(samples[step]) for step in STEPS}
    if len(counts) > 1 or not counts - {0}:
        raise ValueError("the number of readings changed from step to step, or there were none; begin again")
    steering = _moved(samples, "left", "right")
    throttle, brake = _moved(samples, "throttle", "released", steering), _moved(samples, "brake", "free", steering)

    def axis(index: int, rest: str, full: str, other: str = "") -> Axis:
        end = samples[other][index] if other else None
        return Axis(axis=index, rest=samples[rest][index], full=samples[full][index], other=end)

    return Calibration(
        device="gamepad" if device == GAMEPAD else "wheel",
        name=name,
        steering=axis(steering, "centre", "left", "right"),
        throttle=axis(throttle, "released", "throttle"),
        brake=axis(brake, "free", "brake"),
        dead_zone=DEAD_ZONE if device == GAMEPAD else 0.0,
    )


def _moved(samples: Mapping[str, Sequence[float]], first: str, second: str, but: int = -1) -> int:
    """The axis that differs most between two steps."""
    changes = [
        0.0 if i == but else abs(a - b) for i, (a, b) in enumerate(zip(samples[first], samples[second], strict=True))
    ]
    best = max(range(len(changes)), key=changes.__getitem__)
    if changes[best] < LEAST:
        raise ValueError(f"no axis moved enough between {first!r} and {second!r}; begin again")
    return best
