"""Messages of the page. Whatever else arrives is refused in words."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from annotated_types import Interval, Len, MaxLen
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from shared_control_env.drive.devices import MOST_AXES, Calibration, DeviceName, Reading

LARGEST = 16_384
"""Largest size of a message [bytes]."""

Name = Annotated[str, MaxLen(200)]
Count = Annotated[int, Interval(ge=-1, le=2**53)]
Seconds = Annotated[float, Interval(ge=-1e9, le=1e9)]


class Message(BaseModel):
    """Base of all messages."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)


class Input(Message):
    """Readings of the device, with the page's clock and the frame that it last had."""

    type: Literal["input"]
    seq: Count
    stamp: Seconds
    echo: Count = -1
    held: Seconds = 0.0
    readings: Annotated[list[Reading], Len(1, MOST_AXES)]
    device: DeviceName = "keyboard"


class Start(Message):
    """Prepare a drive."""

    type: Literal["start"]
    scenario: Name
    degradation: Name
    authority: Name
    law: Name = ""
    seed: Annotated[int, Interval(ge=0, lt=2**53)] = 0
    device: DeviceName = "keyboard"
    calibration: Calibration | None = None


class Simple(Message):
    """A request without arguments."""

    type: Literal["begin", "resume", "restart", "next", "leave", "recordings", "done"]


class Pause(Message):
    """Pause the drive."""

    type: Literal["pause"]
    reason: Literal["driver", "hidden"] = "driver"

    @property
    def words(self) -> str:
        """The reason in words."""
        return "the page was hidden" if self.reason == "hidden" else "paused by the driver"


class Replay(Message):
    """Show a recorded drive."""

    type: Literal["replay"]
    name: Name


class Sample(Message):
    """Readings at a step of the calibration; none for a wheel that the server reads itself."""

    type: Literal["sample"]
    step: Literal["left", "right", "centre", "throttle", "released", "brake", "free"]
    device: Literal["gamepad", "wheel"]
    name: Name
    readings: Annotated[list[Reading], MaxLen(MOST_AXES)] = []


class Consent(Message):
    """The person agrees to take part, or does not."""

    type: Literal["consent"]
    agreed: bool


class Device(Message):
    """The device that the person will use throughout a study."""

    type: Literal["device"]
    device: DeviceName
    calibration: Calibration | None = None


class Answers(Message):
    """Answers to a questionnaire, by item."""

    type: Literal["answers"]
    values: Annotated[dict[Name, float], MaxLen(40)]


_ANY: TypeAdapter[Any] = TypeAdapter(
    Annotated[
        Input | Start | Simple | Pause | Sample | Replay | Consent | Device | Answers, Field(discriminator="type")
    ]
)


def parse(text: str | bytes) -> Message:
    """The message in a text.

    Args:
        text: JSON of at most :data:`LARGEST` bytes.

    Raises:
        ValueError: if the text is no message, with the field and what is wrong.
    """
    if len(text) > LARGEST:
        raise ValueError(f"a message of {len(text)} bytes; at most {LARGEST} are taken")
    try:
        message: Message = _ANY.validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"]) or "message"
        raise ValueError(f"{where}: {first['msg']}") from None
    except RecursionError:
        raise ValueError("message: nested too deeply") from None
    return message


def check_device(device: str, calibration: Calibration | None) -> None:
    """Check that a device has the calibration that it needs.

    Args:
        device: a :data:`drive.devices.DeviceName`.
        calibration: its calibration.

    Raises:
        ValueError: if it is missing, or of another device.
    """
    needed = device in ("gamepad", "wheel")
    if needed and (calibration is None or calibration.device != device):
        raise ValueError(f"device = {device!r} needs a calibration of its own; calibrate it first")
    if not needed and calibration is not None:
        raise ValueError(f"device = {device!r} takes no calibration")
