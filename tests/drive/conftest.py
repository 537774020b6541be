"""A server of the rig in a thread, and what connects to it."""

import asyncio
import json
import threading
import time

import pytest
from websockets.sync.client import connect

from shared_control_env.drive.folders import RecordingsFolder
from shared_control_env.drive.free import FreeDriving
from shared_control_env.drive.server import Server
from shared_control_env.drive.session import Choice


class Serving:
    """A server that runs in a thread until the test is over."""

    def __init__(self, make, **options):
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(make, options), daemon=True)
        self._thread.start()
        assert self._ready.wait(30)

    def _run(self, make, options):
        async def main():
            self.server = Server(make, port=0, **options)
            self.loop = asyncio.get_running_loop()
            serving = asyncio.create_task(self.server.serve())
            await self.server.started()
            self._ready.set()
            await serving

        asyncio.run(main())

    def stop(self):
        self.loop.call_soon_threadsafe(self.server.stop)
        self._thread.join(10)
        assert not self._thread.is_alive()

    def connect(self, token=None, origin=None, **options):
        token = self.server.token if token is None else token
        origin = self.server.origins[0] if origin is None else origin
        url = f"ws://127.0.0.1:{self.server.port}/ws?token={token}"
        return connect(url, origin=origin or None, max_size=2**22, **options)


class Page:
    """The page's side of a connection: keeps what arrives."""

    def __init__(self, connection):
        self.connection, self.seq, self.frame, self.since = connection, 0, None, 0.0

    def say(self, **message):
        self.connection.send(json.dumps(message))

    def receive(self, timeout=60.0):
        message = json.loads(self.connection.recv(timeout=timeout))
        if message["type"] == "frame":
            self.frame, self.since = message, time.monotonic()
        return message

    def until(self, kind, timeout=60.0, **wanted):
        """The first message of a kind with these entries."""
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            message = self.receive(timeout)
            if message["type"] == kind and all(message.get(key) == value for key, value in wanted.items()):
                return message
        raise AssertionError(f"no {kind} with {wanted}")

    def press(self, readings=(0.0, 0.0, 0.0, 0.0)):
        """Send an input as the page does."""
        now = time.monotonic()
        echo, held = (-1, 0.0) if self.frame is None else (self.frame["n"], now - self.since)
        self.say(type="input", seq=self.seq, stamp=now, echo=echo, held=held, readings=list(readings))
        self.seq += 1

    def start(self, **choice):
        given = {"scenario": "two_lane", "degradation": "own", "authority": "proportional", "seed": 0, **choice}
        self.say(type="start", **given)
        self.until("state", state="ready")

    def drive(self, seconds, readings=(0.0, 0.0, 0.0, 0.0)):
        """Drive for some time or until the episode is over, with inputs at 60 Hz; what arrived meanwhile.

        What follows the end of the episode is left for the test to receive. Where the machine is so busy that an input
        comes too late, the drive goes on after the pause.
        """
        got, end = [], time.monotonic() + seconds
        while time.monotonic() < end:
            self.press(readings)
            step = time.monotonic() + 1.0 / 60.0
            while (left := step - time.monotonic()) > 0.0:
                try:
                    got.append(self.receive(left))
                except TimeoutError:
                    break
                if got[-1].get("state") == "over":
                    return got
                if got[-1].get("state") == "paused":
                    break
            if got and got[-1].get("state") == "paused" and "more than 150 ms" in got[-1]["reason"]:
                got.pop()
                self.say(type="resume")
        return got


@pytest.fixture
def folder(tmp_path):
    return RecordingsFolder(tmp_path / "drives")


@pytest.fixture
def serving(folder):
    made = Serving(lambda seat: FreeDriving(seat, folder, Choice()))
    yield made
    made.stop()


@pytest.fixture
def page(serving):
    with serving.connect() as connection:
        made = Page(connection)
        made.until("welcome")
        yield made
