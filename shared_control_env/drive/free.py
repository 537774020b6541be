"""Driving freely: what to drive is chosen on the page, and the result stands beside the predictive driver's."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from shared_control_env.core.authority.laws import LAWS
from shared_control_env.drive.devices import Command
from shared_control_env.drive.folders import RecordingsFolder
from shared_control_env.drive.protocol import Message, Replay, Simple, Start, check_device
from shared_control_env.drive.seat import EMPTY, OVER, Seat
from shared_control_env.drive.session import BESIDE, Choice, Drive, result_of_model
from shared_control_env.drive.view import SHOWN
from shared_control_env.envs.degradations import DEGRADATIONS
from shared_control_env.envs.scenarios import SCENARIOS
from shared_control_env.evaluation.catalogue import AUTHORITIES
from shared_control_env.evaluation.episodes import AS_GIVEN, versions
from shared_control_env.evaluation.metrics import METRICS
from shared_control_env.recordings.trial import Trial

COMPARED = ("controlled", "lateral_rms", "lateral_max", "driver_effort", "conflict", "min_gap", "min_ttc", "jerk_rms")
"""Metrics that the page shows of a drive."""


class FreeDriving:
    """What the page asks for when a person drives freely.

    Args:
        seat: the seat.
        folder: folder of the recordings.
        first: what is chosen on the page at first.
    """

    kind = "free"

    def __init__(self, seat: Seat, folder: RecordingsFolder, first: Choice) -> None:
        self.seat, self.folder, self.first = seat, folder, first
        self._start: Start | None = None
        self._result: dict[str, Any] | None = None

    def welcome(self) -> dict[str, Any]:
        """What a page needs to know at first."""
        return {
            "kind": self.kind,
            "lost": self.folder.lost,
            "folder": str(self.folder.path),
            "choice": self.first._asdict(),
            "catalogue": {
                "scenario": {name: entry.description for name, entry in SCENARIOS.items()},
                "degradation": {
                    AS_GIVEN: "as the scenario has it",
                    **{name: entry.description if entry else "no fault" for name, entry in DEGRADATIONS.items()},
                },
                "authority": {name: entry.description for name, entry in AUTHORITIES.items()},
                "law": {"": "the authority's own", **dict.fromkeys(LAWS, "")},
            },
            "native": self.seat.native.name if self.seat.native is not None else "",
        }

    def present(self) -> list[dict[str, Any]]:
        """Messages that tell a page that comes later what is going on."""
        return [*self.seat.present(), *([self._result] if self._result is not None else [])]

    async def handle(self, message: Message) -> None:
        """Do what the page asks for.

        Args:
            message: the message.

        Raises:
            ValueError: if it cannot be done, in words.
        """
        match message:
            case Start():
                check_device(message.device, message.calibration)
                await self._prepare(message)
            case Replay():
                await self._replay(message.name)
            case Simple(type="begin" | "resume"):
                self._begin()
            case Simple(type="restart") if self._start is not None:
                await self._prepare(self._start)
            case Simple(type="next") if self._start is not None:
                await self._prepare(self._start.model_copy(update={"seed": self._start.seed + 1}))
            case Simple(type="leave"):
                await self._leave()
            case Simple(type="recordings"):
                self.seat.send({"type": "recordings", "names": self.folder.names()})
            case _:
                raise ValueError(f"{message.type} has no meaning here")  # type: ignore[attr-defined]

    async def _leave(self) -> None:
        self.folder.unmark()
        self._result = None
        await self.seat.clear()
        self.seat.send({"type": "state", "state": EMPTY})

    async def _prepare(self, start: Start) -> None:
        choice = Choice(start.scenario, start.degradation, start.authority, start.law, start.seed)
        self._result = None
        self._start = start
        await self.seat.prepare(choice, start.device, start.calibration, SHOWN, self._finished, self._leave)

    def _begin(self) -> None:
        self.seat.begin()
        if self._start is not None and self.seat.drive is not None:
            self.folder.mark(f"the drive {_words(self.seat.drive.choice)}")

    async def _finished(self, drive: Drive) -> None:
        """Write the recording, then show the result."""
        start = self._start
        assert start is not None
        calibration = None if start.calibration is None else start.calibration.model_dump()
        trial = drive.trial({"device": start.device, "calibration": calibration})
        path = await asyncio.to_thread(self.folder.add, time.strftime("drive-%Y%m%d-%H%M%S"), trial)
        if self.seat.drive is drive:
            self.folder.unmark()
        beside = await asyncio.to_thread(result_of_model, drive.choice)
        if self.seat.drive is drive:  # and not the next one already
            self._result = result_message(drive, trial, beside, path)
            self.seat.send(self._result)

    async def _replay(self, name: str) -> None:
        trial = await asyncio.to_thread(Trial.read, self.folder.find(name))
        self._result = self._start = None
        playback = Playback(trial, name)

        async def finished(drive: Drive) -> None:
            self._result = {"type": "replayed", "name": name, "same": playback.same(drive), "versions": versions()}
            self.seat.send(self._result)

        await self.seat.prepare(Choice(**trial.header["choice"]), "simulated", None, SHOWN, finished, self._leave)
        self.seat.play(playback)


class Playback:
    """A device that gives the commands of a recording.

    Args:
        trial: the recording.
        name: its name.
    """

    readings = 2

    def __init__(self, trial: Trial, name: str) -> None:
        self.name, self._trial, self._k = f"the recording {name}", trial, 0

    def read(self, now: float) -> tuple[np.ndarray, float]:
        """Command of the next step, and its age.

        Args:
            now: the server's clock [s]; not used.
        """
        row = self._trial.columns["command"][min(self._k, len(self._trial) - 1)]
        self._k += 1
        return row, 0.0

    def command(self, readings: np.ndarray, dt: float) -> Command:
        """The recorded command.

        Args:
            readings: acceleration [m/s^2] and steering [rad], shape (2,).
            dt: time step [s]; not used.
        """
        return Command(*readings.tolist())

    def push(self, automation: float, full: float, calibration: Any) -> None:
        """Nothing to push.

        Args:
            automation, full, calibration: not used.
        """

    def rest(self) -> None:
        """Nothing to let go of."""

    def same(self, drive: Drive) -> bool:
        """Whether the drive went as recorded, to the bit.

        Args:
            drive: the drive.
        """
        return np.array_equal(drive.trial({}).columns["state"], self._trial.columns["state"])


def result_message(drive: Drive, trial: Trial, beside: Mapping[str, Any], path: Path) -> dict[str, Any]:
    """What the page shows after a drive.

    Args:
        drive: the drive.
        trial: its recording.
        beside: metrics of the predictive driver.
        path: path of the recording.
    """
    mine = drive.result()
    return {
        "type": "result",
        "state": OVER,
        "what": _words(drive.choice),
        "valid": trial.header["valid"],
        "pauses": trial.header["pauses"],
        "latency": trial.header["latency"],
        "recording": path.name,
        "beside": BESIDE,
        "rows": [
            {
                "name": name.replace("_", " "),
                "unit": METRICS[name].unit,
                "definition": METRICS[name].definition,
                "better": METRICS[name].better,
                "mine": _finite(mine[name]),
                "model": _finite(beside[name]),
            }
            for name in COMPARED
        ],
        "path": np.round(trial.columns["z"][:, [0, 1]], 2).tolist(),
        "target": np.round(trial.columns["y_target"], 2).tolist(),
    }


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _words(choice: Choice) -> str:
    law = f", law {choice.law}" if choice.law else ""
    return f"{choice.scenario}, {choice.degradation}, {choice.authority}{law}, seed {choice.seed}"
