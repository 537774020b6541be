"""The seat: one drive after another, in real time or in step with a simulated person."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable, Coroutine
from math import nan
from typing import Any

import numpy as np

from shared_control_env.drive.calibration import STEPS, calibrated
from shared_control_env.drive.devices import KEYBOARD, WHEEL, Axes, Calibration, Keyboard, Simulated
from shared_control_env.drive.latency import STALE, Line, Timing
from shared_control_env.drive.protocol import Input, Sample, check_device
from shared_control_env.drive.session import Choice, Drive
from shared_control_env.drive.view import frame_of, road_of

EMPTY, PREPARING, READY, DRIVING, PAUSED, OVER = "empty", "preparing", "ready", "driving", "paused", "over"
"""States of the seat."""

Send = Callable[[dict[str, Any]], None]


class Seat:
    """Prepares, runs, pauses and records drives.

    In real time the ticks have absolute deadlines; a tick that is late is not made up for, and the latest input counts.
    In step, a tick follows each input that answers the last frame, and the clock is the number of ticks.

    Args:
        send: sends a message to all pages.
        in_step: whether the ticks follow the inputs.

    Attributes:
        state: EMPTY, PREPARING, READY, DRIVING, PAUSED or OVER.
        drive: the present drive; None without one.
        shown: what the gauges show.
        native: reads a device that hangs on this machine, instead of the page's; None without one.
        with_scene: whether frames carry the scene record, which simulated people see.
    """

    def __init__(self, send: Send, in_step: bool = False) -> None:
        self.send, self.in_step = send, in_step
        self.state, self.drive = EMPTY, None
        self.shown: tuple[str, ...] = ()
        self.native: Any = None
        self.with_scene = False
        self._road: dict[str, Any] = {}
        self._frame: dict[str, Any] = {}
        self._number = 0
        self._line = Line()
        self._samples: dict[str, list[float]] = {}
        self._source: Any = None
        self._ticker: asyncio.Task[None] | None = None
        self._finished: Callable[[Drive], Coroutine[Any, Any, None]] | None = None
        self._failed: Callable[[], Coroutine[Any, Any, None]] | None = None
        self._begun, self._answered, self._width, self._kind = 0.0, False, 0, ""

    drive: Drive | None

    def clock(self) -> float:
        """The server's clock [s]: monotonic, or the number of frames in step."""
        if self.in_step:
            return self._number * (self.drive.dt if self.drive else 0.0)
        return time.monotonic()

    async def prepare(
        self,
        choice: Choice,
        device: str,
        calibration: Calibration | None,
        shown: tuple[str, ...],
        finished: Callable[[Drive], Coroutine[Any, Any, None]],
        failed: Callable[[], Coroutine[Any, Any, None]],
    ) -> None:
        """Make a drive ready; what has to be compiled is compiled now, and not while the person drives.

        Args:
            choice: what is driven.
            device: kind of device.
            calibration: its calibration, of a gamepad or wheel.
            shown: what the gauges show.
            finished: called when the episode is over.
            failed: called when a step or ``finished`` has failed, which the pages have been told.

        Raises:
            ValueError: if the choice is not possible, the device has no calibration that it needs, or lacks axes of it.
        """
        check_device(device, calibration)
        await self.clear()
        self.state = PREPARING
        self.send({"type": "state", "state": PREPARING})
        try:
            drive = await asyncio.to_thread(_prepared, choice)
        except BaseException:
            self.state = EMPTY
            raise
        self.drive, self.shown, self._finished, self._failed = drive, shown, finished, failed
        self._device: Keyboard | Axes | Simulated
        if calibration is not None:
            self._device = Axes(calibration, drive.limits)
        else:
            self._device = Keyboard(drive.limits) if device == KEYBOARD else Simulated(drive.limits)
        self._source = self.native if device == WHEEL else None  # two devices never mix
        self._calibration, self._readings = calibration, np.zeros(self._device.readings)
        if self._source is not None and len(self._source.read(self.clock())[0]) < self._device.readings:
            await self.clear()
            raise ValueError(f"{self.native.name!r} has fewer axes than its calibration; calibrate it again")
        self._line, self._road = Line(), {**road_of(drive), "device": device, "native": self._source is not None}
        self._width, self._kind = 0, device
        self.state = READY
        chosen = {"choice": choice._asdict()} if self.with_scene else {}
        self.send({"type": "road", **self._road, **chosen})
        self._show(self.clock())
        self.send({"type": "state", "state": READY})

    def play(self, device: Any) -> None:
        """Drive by a device of this machine, such as a recording, from now on.

        Args:
            device: has ``read(now)``, ``command(readings, dt)`` and ``push(angle, full)``.
        """
        self._source = self._device = device
        self.begin()

    def present(self) -> list[dict[str, Any]]:
        """Messages that tell a page that comes later what is going on."""
        messages = [{"type": "state", "state": self.state}]
        if self.drive is not None and self._road:
            messages = [{"type": "road", **self._road}, {"type": "frame", **self._frame}, *messages]
        return messages

    def begin(self) -> None:
        """Begin the drive, or go on with it after a pause.

        Raises:
            ValueError: if nothing is ready.
        """
        if self.state not in (READY, PAUSED):
            raise ValueError(f"there is nothing to begin: the seat is {self.state}")
        self.state = DRIVING
        self._begun, self._answered = self.clock(), False
        self.send({"type": "state", "state": DRIVING})
        if self.in_step:
            self._show(self.clock())  # the simulated person answers this frame
        else:
            if self._ticker is not None:
                self._ticker.cancel()  # one that has not noticed a short pause yet
            self._ticker = asyncio.create_task(self._tick_in_real_time())

    def pause(self, reason: str) -> None:
        """Pause the drive; its trial is invalid then.

        Args:
            reason: why.
        """
        if self.state != DRIVING or self.drive is None:
            return
        self.drive.invalidate(f"{reason} at {len(self.drive)} steps")
        self.state = PAUSED
        self._rest()
        self.send({"type": "state", "state": PAUSED, "reason": reason})

    def greet(self) -> None:
        """Another page drives from now on, whose clock is another one."""
        self._line, self._answered = Line(), False

    async def receive(self, message: Input) -> None:
        """Take an input of the page.

        Args:
            message: the readings.

        Raises:
            ValueError: if there are fewer readings than the device has.
        """
        if self.drive is None or self.state not in (READY, DRIVING, PAUSED) or message.device != self._kind:
            return
        now = self.clock()
        self._line.received(message.stamp, message.echo, message.held, now)
        self._answered = True
        if self._source is not None:
            return  # the server reads the device itself; the page only shows that it is there
        if len(message.readings) < self._device.readings:
            raise ValueError(f"readings: {len(message.readings)} of them; the device has {self._device.readings}")
        if self._width and len(message.readings) != self._width:
            self.pause(f"another device: {len(message.readings)} readings, where there were {self._width}")
            return
        self._readings, self._width = np.array(message.readings), len(message.readings)
        if self.in_step and self.state == DRIVING and message.echo == self._number:
            await self._tick(now, 0.0)

    def sample(self, message: Sample) -> None:
        """Take the readings of a step of the calibration; after the last step the calibration is sent.

        Args:
            message: the step and its readings.

        Raises:
            ValueError: if no calibration can be told from the steps.
        """
        if message.step == next(iter(STEPS)):
            self._samples = {}
        native = self.native is not None and not message.readings
        self._samples[message.step] = self.native.read(self.clock())[0].tolist() if native else message.readings
        if message.step == list(STEPS)[-1]:
            made = calibrated(message.device, self.native.name if native else message.name, self._samples)
            self.send({"type": "calibration", "calibration": made.model_dump()})

    async def clear(self) -> None:
        """Leave the drive, whose recording is dropped unless it has been written."""
        self.state = EMPTY
        self._rest()
        self._source = None
        if self._ticker is not None and self._ticker is not asyncio.current_task():
            self._ticker.cancel()
            await asyncio.gather(self._ticker, return_exceptions=True)
        self._ticker = None
        if self.drive is not None:
            self.drive.close()
        self.drive, self._road = None, {}

    def _rest(self) -> None:
        """Let go of a wheel with forces."""
        if self._source is not None:
            self._source.rest()

    async def _tick_in_real_time(self) -> None:
        """Tick at absolute deadlines until the drive pauses or ends; an error ends the drive, and is told."""
        try:
            await self._keep_ticking()
        except Exception as error:
            await self._fail(error)

    async def _finish(self, drive: Drive) -> None:
        """Let the programme write and show the drive; an error is told, and what was driven is lost."""
        assert self._finished is not None
        try:
            await self._finished(drive)
        except Exception as error:
            await self._fail(error)

    async def _fail(self, error: Exception) -> None:
        logging.getLogger(__name__).error("the drive is lost", exc_info=error)
        self.send({"type": "refused", "message": f"the drive is lost by {type(error).__name__}: {error}"})
        assert self._failed is not None
        await self._failed()

    async def _keep_ticking(self) -> None:
        assert self.drive is not None
        deadline = self.clock()
        while self.state == DRIVING:
            deadline += self.drive.dt
            await asyncio.sleep(max(0.0, deadline - self.clock()))
            now = self.clock()
            if self.state == DRIVING:
                await self._tick(now, now - deadline)
            if now - deadline > self.drive.dt:
                deadline = now  # time that is lost is not made up for
            if self.drive is None:
                return

    async def _tick(self, now: float, lateness: float) -> None:
        drive = self.drive
        assert drive is not None
        age = self._line.age(now) if self._answered else now - self._begun
        if self._source is not None:
            self._readings, age = self._source.read(now)
        timing = Timing(lateness, age, self._line.round_trip)
        if self.in_step:
            timing = Timing(0.0, 0.0, nan)  # nothing waits for anything
        elif age > STALE:
            waited = "no input" if np.isinf(age) else f"input {1e3 * age:.0f} ms old"
            self.pause(f"{waited}, more than {1e3 * STALE:.0f} ms")
            return
        command = self._device.command(self._readings, drive.dt)
        going = drive.step(command, self._readings, timing)
        if self._source is not None:
            self._source.push(float(drive.info["u_a_act"][0, 1]), drive.limits.delta_max, self._calibration)
        self._show(now, timing)
        if not going:
            self.state = OVER
            self._rest()
            self.send({"type": "state", "state": OVER})
            task = asyncio.create_task(self._finish(drive))
            _KEPT.add(task)
            task.add_done_callback(_KEPT.discard)

    def _show(self, now: float, timing: Timing | None = None) -> None:
        assert self.drive is not None
        self._number += 1
        self._frame = {"n": self._number, **frame_of(self.drive, self.shown)}
        if timing is not None:
            times = (1e3 * value for value in timing)
            self._frame["timing"] = [round(value, 1) if np.isfinite(value) else None for value in times]
        self._line.sent(self._number, now)
        message = {"type": "frame", **self._frame}
        if self.with_scene:
            message["scene"] = self.drive.env.scene.tobytes().hex()
            message["observation"] = self.drive.observation.tobytes().hex()
            message["driving"] = self.state == DRIVING
        self.send(message)


_KEPT: set[asyncio.Task[None]] = set()
"""Tasks that no one else keeps."""


def _prepared(choice: Choice) -> Drive:
    """A drive whose functions are loaded: one step of another one compiles what is missing."""
    first = Drive(choice)
    first.step(first.person.command, np.zeros(1), Timing(0.0, 0.0, 0.0))
    first.close()
    return Drive(choice)
