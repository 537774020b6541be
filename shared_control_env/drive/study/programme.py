"""The protocol on the page: consent, device, practice, trials and questionnaires, one step after the other."""

from __future__ import annotations

import asyncio
import math
from typing import Any

from shared_control_env.drive.devices import Calibration
from shared_control_env.drive.protocol import Answers, Consent, Device, Message, Simple, check_device
from shared_control_env.drive.seat import PAUSED, READY, Seat
from shared_control_env.drive.session import Drive as Session
from shared_control_env.drive.study.folder import Drive, Questions, StudyFolder
from shared_control_env.drive.study.questionnaires import QUESTIONNAIRES, checked


class StudyProgramme:
    """What the page shows and asks for in a study with one person.

    Args:
        seat: the seat.
        folder: folder of the study.

    Attributes:
        over: whether the person is done.
    """

    kind = "study"

    def __init__(self, seat: Seat, folder: StudyFolder) -> None:
        self.seat, self.folder = seat, folder
        self.over = asyncio.Event()
        self._told = folder.recordings.lost
        self._present: Drive | None = None
        self._step = self._next_step()
        if self._step["step"] == "end":
            self.over.set()

    def welcome(self) -> dict[str, Any]:
        """What a page needs to know at first."""
        return {"kind": self.kind, "lost": self._told, "native": getattr(self.seat.native, "name", "")}

    def present(self) -> list[dict[str, Any]]:
        """Messages that tell a page that comes later what is going on."""
        return self.seat.present() if self._present is not None else [self._step]

    async def handle(self, message: Message) -> None:
        """Do what the page asks for.

        Args:
            message: the message.

        Raises:
            ValueError: if it is not the time for it, in words.
        """
        step, upcoming = self._step["step"], self.folder.next()
        match message:
            case Consent() if step == "consent":
                self.folder.agree(message.agreed)
            case Device() if step == "device":
                allowed = ("simulated",) if self.folder.simulated else self.folder.plan.devices
                if message.device not in allowed:
                    raise ValueError(f"device = {message.device!r}; this study allows {', '.join(allowed)}")
                check_device(message.device, message.calibration)
                self.folder.choose_device(message.model_dump(exclude={"type"}))
            case Answers() if step == "questionnaire" and isinstance(upcoming, Questions):
                self.folder.answer(upcoming, checked(upcoming.name, message.values))
            case Simple(type="begin" | "resume") if self._present is not None and self.seat.state in (READY, PAUSED):
                self.folder.recordings.mark(f"the drive {self._present.label} of {self.folder.code}")
                self.seat.begin()
                return
            case Simple(type="begin") if step == "next" and isinstance(upcoming, Drive) and self._present is None:
                await self._prepare(upcoming)
                return
            case Simple(type="begin") if step == "device":
                pass  # a calibration was cancelled
            case _:
                raise ValueError(f"{message.type} is not what comes now: {self._step['title']}")  # type: ignore[attr-defined]
        self._go_on()

    def _go_on(self) -> None:
        self._step = self._next_step()
        self.seat.send(self._step)
        if self._step["step"] == "end":
            self.over.set()

    async def _prepare(self, drive: Drive) -> None:
        device = self.folder.device
        assert device is not None
        calibration = None if device["calibration"] is None else Calibration.model_validate(device["calibration"])
        self._present = drive
        try:
            await self.seat.prepare(
                drive.what.choice(drive.seed),
                device["device"],
                calibration,
                drive.what.show,
                self._finished,
                self._give_up,
            )
        except BaseException:
            self._present = None
            self.seat.send(self._step)
            raise

    async def _give_up(self) -> None:
        """Go back to the step before a drive that failed."""
        self.folder.recordings.unmark()
        self._present = None
        await self.seat.clear()
        self._go_on()

    async def _finished(self, session: Session) -> None:
        """Write the recording, then go on."""
        drive, device = self._present, self.folder.device
        assert drive is not None
        assert device is not None
        result = {name: value if math.isfinite(value) else None for name, value in session.result().items()}
        trial = session.trial(
            {
                **device,
                "code": self.folder.code,
                "condition": "practice" if drive.condition is None else drive.condition.name,
                "result": result,
                "simulated": self.folder.simulated,
            }
        )
        await asyncio.to_thread(self.folder.add, drive, trial)
        self.folder.recordings.unmark()
        self._present = None
        await self.seat.clear()
        self._told = ""
        if not trial.header["valid"]:
            self._told = f"The last drive counts as invalid ({'; '.join(trial.header['pauses'])}) and is repeated."
        elif drive.condition is None and self.folder.plan.practice is not None:
            practice, value = self.folder.plan.practice, result[self.folder.plan.practice.metric]
            told = "not defined" if value is None else f"{value:.2f}"
            self._told = f"{practice.metric.replace('_', ' ')} was {told}; below {practice.below:g} is wanted."
        self._go_on()

    def _next_step(self) -> dict[str, Any]:
        """Message with what comes next."""
        plan, folder = self.folder.plan, self.folder
        base = {"type": "step", "title": plan.title}
        if folder.consent is None:
            return {**base, "step": "consent", "text": plan.consent}
        if not folder.consent:
            return {
                **base,
                "step": "end",
                "title": "Thank you",
                "text": "Nothing is recorded. You can close this page.",
            }
        if folder.device is None:
            devices = ["simulated"] if self.folder.simulated else list(plan.devices)
            text = "Choose what you drive with. A gamepad or a wheel is calibrated first."
            return {**base, "step": "device", "title": "Your device", "text": text, "devices": devices}
        upcoming = folder.next()
        if upcoming is None:
            return {**base, "step": "end", "title": "Thank you", "text": "That was all. You can close this page."}
        if isinstance(upcoming, Questions):
            asked = QUESTIONNAIRES[upcoming.name]
            items = [item._asdict() for item in asked.items]
            return {**base, "step": "questionnaire", "title": asked.title, "text": "", "items": items}
        kind = "Trial" if upcoming.condition is not None else "Practice"
        texts = [self._told, plan.instructions if upcoming.number == 1 or upcoming.condition is None else ""]
        return {
            **base,
            "step": "next",
            "title": f"{kind} {upcoming.number} of {upcoming.of if upcoming.condition else f'at most {upcoming.of}'}",
            "text": "\n\n".join(text for text in texts if text),
            "button": "Next",
        }
