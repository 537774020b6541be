"""The server against what pages, other sites, bad networks and power cuts do."""

import asyncio
import json
import os
import resource
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from shared_control_env.drive.folders import RecordingsFolder
from shared_control_env.drive.free import FreeDriving
from shared_control_env.drive.server import MOST_WAITING
from shared_control_env.drive.session import Choice
from shared_control_env.recordings.trial import Trial
from tests.drive.conftest import Page, Serving


def status(url, **headers):
    try:
        with urllib.request.urlopen(urllib.request.Request(url, headers=headers)) as answer:
            return answer.status, dict(answer.headers), answer.read()
    except urllib.error.HTTPError as error:
        return error.code, dict(error.headers), b""


def test_only_this_machine_with_the_token_and_the_right_host(serving):
    server = serving.server
    root = f"http://127.0.0.1:{server.port}"
    assert status(f"{root}/?token={server.token}")[0] == 200
    assert status(f"{root}/?token=wrong")[0] == 403
    assert status(root)[0] == 403
    assert status(f"{root}/?token={server.token}", Host="evil.example")[0] == 400
    for name in ("server.py", "..%2fserver.py", "index.htm"):
        assert status(f"{root}/static/{name}")[0] == 404
    _, headers, _ = status(f"{root}/?token={server.token}")
    assert "frame-ancestors 'none'" in headers["content-security-policy"]
    assert server._socket.getsockname()[0] == "127.0.0.1"


@pytest.mark.parametrize(
    ("token", "origin"), [("wrong", None), (None, "http://evil.example"), (None, ""), (None, "null"), ("", None)]
)
def test_a_foreign_page_does_not_connect(serving, token, origin):
    with pytest.raises((InvalidStatus, ConnectionClosed)), serving.connect(token, origin) as connection:
        connection.recv(timeout=5)


def test_a_drive_from_start_to_recording(page, folder):
    page.start(degradation="bias:steering:0.9:-", authority="none")  # leaves the road soon
    page.say(type="begin")
    page.until("state", state="driving")
    got = page.drive(12.0)
    assert got[-1]["state"] == "over"
    result = page.until("result")
    too_busy = any("more than 150 ms" in pause for pause in result["pauses"])
    assert result["valid"] or too_busy
    assert {row["name"] for row in result["rows"]} >= {"controlled", "lateral rms", "driver effort"}
    trial = Trial.read(folder.path / result["recording"])
    assert trial.header["device"] == "keyboard"
    assert trial.header["valid"] == result["valid"]
    assert trial.header["finished"]
    assert trial.columns["crashed"][-1] or not trial.columns["on_road"][-1]
    assert not (folder.path / ".running.json").exists()
    frames = [message for message in got if message["type"] == "frame"]
    assert len(frames) >= len(trial)
    page.say(type="replay", name=result["recording"])
    page.until("state", state="ready")
    assert page.until("replayed")["same"]


def test_ten_seconds_in_real_time(page, folder, capsys):
    """200 ticks; how late they were is printed, and is a defect only if it is beyond what a person would feel."""
    page.start(scenario="lane_keeping", degradation="none")
    page.say(type="begin")
    begin = time.monotonic()
    got = page.drive(20.0)
    assert got[-1]["state"] == "over"
    took = time.monotonic() - begin
    trial = Trial.read(folder.path / page.until("result")["recording"])
    if not trial.header["valid"]:
        pytest.skip(f"this machine is too busy to drive in real time: {trial.header['pauses']}")
    assert took == pytest.approx(10.0, abs=0.5)
    late, age = 1e3 * trial.columns["lateness"], 1e3 * trial.columns["input_age"]
    with capsys.disabled():
        print(
            f"\n{len(late)} ticks: {100 * np.mean(late < 5):.1f} % less than 5 ms late, at most {late.max():.1f} ms; input age "
            f"{np.median(age):.1f} ms, 95 % below {np.quantile(age, 0.95):.1f} ms"
        )
    assert len(late) == 200
    assert (late >= 0.0).all()
    assert trial.header["latency"]["lateness"]["max"] == pytest.approx(late.max() / 1e3, abs=1e-6)


def test_stale_input_pauses_and_marks_the_drive(page, folder):
    page.start(degradation="none")
    page.say(type="begin")
    page.drive(0.5)
    paused = page.until("state", state="paused", timeout=2.0)
    assert "more than 150 ms" in paused["reason"]
    frame = page.frame["k"]
    time.sleep(0.3)
    page.say(type="resume")
    got = page.drive(12.0)
    assert next(message["k"] for message in got if message["type"] == "frame") <= frame + 1
    result = page.until("result")
    assert not result["valid"]
    assert not Trial.read(folder.path / result["recording"]).header["valid"]


def test_a_pause_shorter_than_a_step_does_not_double_the_speed(page):
    page.start(degradation="none")
    page.say(type="begin")
    page.drive(0.3)
    for _ in range(5):
        page.say(type="pause")
        page.until("state", state="paused")
        page.say(type="resume")
        page.until("state", state="driving")
        page.press()
    first, begin = page.frame["k"], time.monotonic()
    page.drive(1.0)
    assert page.frame["k"] - first == pytest.approx(20.0 * (time.monotonic() - begin), abs=3)


@pytest.mark.parametrize(
    ("message", "said"), [({"reason": "hidden"}, "the page was hidden"), ({}, "paused by the driver")]
)
def test_a_hidden_page_and_a_pause(page, message, said):
    page.start(degradation="none")
    page.say(type="begin")
    page.drive(0.3)
    page.say(type="pause", **message)
    assert page.until("state", state="paused")["reason"] == said


def test_a_lost_connection_pauses_and_the_next_page_goes_on(serving):
    with serving.connect() as connection:
        page = Page(connection)
        page.start(degradation="none")
        page.say(type="begin")
        page.drive(0.4)
        at = page.frame["k"]
    with serving.connect() as connection:
        page = Page(connection)
        assert page.until("welcome")["role"] == "driver"
        page.until("road")
        assert page.until("state")["state"] == "paused"
        assert page.frame["k"] >= at
        page.say(type="resume")
        page.until("state", state="driving")
        begin = time.monotonic()
        while time.monotonic() < begin + 0.5:  # by a clock of its own, as of a page that was loaded again
            page.say(type="input", seq=0, stamp=time.monotonic() - begin, readings=[0.0] * 4)
            time.sleep(0.02)
        assert serving.server.seat.state == "driving"
        assert page.until("frame")["k"] >= at


def test_a_second_page_looks_on(serving, page):
    page.start(degradation="none")
    with serving.connect() as connection:
        other = Page(connection)
        assert other.until("welcome")["role"] == "spectator"
        other.until("road")
        other.say(type="begin")
        assert "another page drives" in other.until("refused")["message"]
        page.say(type="begin")
        page.drive(0.5)
        assert other.until("frame")["t"] >= 0.0
        page.connection.close()
        assert other.until("welcome", role="driver")


MALFORMED = [
    "",
    "{",
    "null",
    "[]",
    '{"type": "fly"}',
    '{"type": "input"}',
    '{"type": "input", "seq": 1, "stamp": NaN, "readings": [0]}',
    '{"type": "input", "seq": 1, "stamp": 1.0, "readings": []}',
    '{"type": "input", "seq": 1, "stamp": 1.0, "readings": [2.0]}',
    '{"type": "input", "seq": 1, "stamp": 1.0, "readings": ["0"]}',
    '{"type": "begin", "more": 1}',
    '{"type": "start", "scenario": "two_lane"}',
    "[" * 5000,
    "\N{AUTOMOBILE}",
    b"\xff\xfe",
]


def test_malformed_messages_are_refused_in_words_and_end_the_connection_if_many(page):
    for text in MALFORMED:
        page.connection.send(text)
        assert page.until("refused", timeout=5)["message"]

    def go_on():
        for _ in range(30):
            page.connection.send("{")
            page.until("refused", timeout=5)

    with pytest.raises(ConnectionClosed):
        go_on()


def test_requests_that_make_no_sense_now_are_refused(page):
    for message, said in (
        ({"type": "begin"}, "nothing to begin"),
        ({"type": "restart"}, "no meaning here"),
        ({"type": "consent", "agreed": True}, "no meaning here"),
        ({"type": "replay", "name": "../../etc/passwd"}, "is no recording"),
        ({"type": "start", "scenario": "x", "degradation": "own", "authority": "paper"}, "scenario = 'x'"),
        (
            {"type": "start", "scenario": "bend", "degradation": "own", "authority": "paper", "device": "wheel"},
            "calibration",
        ),
    ):
        page.say(**message)
        assert said in page.until("refused", timeout=20)["message"]
        time.sleep(0.05)


def test_the_device_has_as_many_readings_as_it_needs(page):
    page.start()
    page.press([0.0])
    assert "the device has 4" in page.until("refused")["message"]


def test_a_message_that_is_too_long_ends_the_connection(page):
    page.connection.send(json.dumps({"type": "start", "scenario": "x" * 100_000}))
    with pytest.raises(ConnectionClosed):
        page.until("result", timeout=5)


def flood(page):
    for _ in range(20_000):
        page.press()
    page.until("result", timeout=10)


def test_a_flood_ends_the_connection_and_memory_stays_bounded(serving):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in range(3):
        with serving.connect() as connection:
            page = Page(connection)
            page.until("welcome")
            with pytest.raises(ConnectionClosed):
                flood(page)
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    assert grown < 100.0, f"{grown:.0f} MiB"
    with serving.connect() as connection:
        assert Page(connection).until("welcome")


class Stuck:
    """A connection whose page does not read: nothing can be sent, and nothing comes."""

    def __init__(self, server):
        self.headers, self.query_params = {"origin": server.origins[0]}, {"token": server.token}

    async def accept(self):
        pass

    async def receive(self):
        await asyncio.Event().wait()

    async def send_text(self, text):
        await asyncio.Event().wait()

    async def close(self, code, reason=""):
        await asyncio.Event().wait()


def test_a_page_that_does_not_read_is_dropped_and_what_waits_for_it_is_bounded(serving):
    server = serving.server

    async def check():
        connection = asyncio.create_task(server._connect(Stuck(server)))
        await asyncio.sleep(0.1)
        (page,) = server._pages
        for k in range(1000):
            server.send_all({"type": "frame", "n": k})
        assert len(page._messages) < 5
        assert json.loads(page._frame)["n"] == 999  # of frames the latest alone waits
        for _ in range(1000):
            server.send_all({"type": "refused", "message": "x" * 1000})
        assert len(page._messages) <= MOST_WAITING + 1
        await asyncio.wait_for(connection, 5.0)
        assert not server._pages

    asyncio.run_coroutine_threadsafe(check(), serving.loop).result(20)


def test_readings_of_another_length_pause_and_the_drive_is_kept(page, folder):
    """A second gamepad that the browser puts first."""
    page.start(degradation="bias:steering:0.9:-", authority="none")
    page.say(type="begin")
    page.drive(0.4)
    page.press([0.0] * 5)
    assert "another device: 5 readings" in page.until("state", state="paused")["reason"]
    page.say(type="resume")
    page.drive(12.0)
    result = page.until("result")
    assert not result["valid"]
    assert Trial.read(folder.path / result["recording"]).columns["raw"].shape[1] == 4


def test_inputs_of_another_device_do_not_count(page):
    page.start(degradation="none")
    page.say(type="begin")
    page.drive(0.3)
    end = time.monotonic() + 0.4
    while time.monotonic() < end:
        page.say(type="input", seq=0, stamp=time.monotonic(), readings=[1.0, 0.0, 0.0, 0.0], device="gamepad")
        time.sleep(0.02)
    assert "more than 150 ms" in page.until("state", state="paused")["reason"]
    assert page.frame["wheel"] == [0.0, 0.0]


def test_the_first_input_has_150_ms(page):
    page.start(degradation="none")
    page.say(type="begin")
    page.until("state", state="driving")
    time.sleep(0.06)  # the first tick has passed
    page.press()
    assert page.until("frame")["k"] >= 0
    time.sleep(0.02)
    page.press()
    while page.frame["k"] < 2:
        page.press()
        assert page.receive(1.0).get("state") != "paused"


def test_a_disk_that_is_full_is_said_and_the_next_drive_goes(serving, page, folder, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(folder, "add", full)
        page.start(degradation="bias:steering:0.9:-", authority="none")
        page.say(type="begin")
        page.drive(12.0)
        assert "No space left" in page.until("refused")["message"]
        page.until("state", state="empty")
    page.start(degradation="none")
    assert serving.server.seat.state == "ready"


def test_a_step_that_fails_is_said_and_the_next_drive_goes(serving, page, monkeypatch):
    page.start(degradation="none")
    page.say(type="begin")
    page.drive(0.3)
    with monkeypatch.context() as patch:
        patch.setattr(serving.server.seat.drive, "step", None)
        assert "the drive is lost" in page.until("refused")["message"]
        page.until("state", state="empty")
    page.start(degradation="none", seed=1)


def test_the_result_of_a_drive_that_was_left_does_not_come(page, folder):
    page.start(degradation="bias:steering:0.9:-", authority="none")
    page.say(type="begin")
    got = page.drive(12.0)
    assert got[-1]["state"] == "over"
    page.say(type="restart")
    page.until("state", state="ready")
    page.say(type="begin")
    got = page.drive(1.0)
    assert not [message for message in got if message["type"] == "result"]
    assert len(folder.names()) == 1  # the first drive is recorded all the same


def test_calibrations_that_cannot_be_are_refused_and_the_page_stays(page):
    for step, readings in zip(
        ("left", "right", "centre", "throttle", "released", "brake", "free"),
        ([-1.0, 0.0], [1.0, 0.0], [0.0], [], [0.0], [0.0], [0.0]),
        strict=True,
    ):
        page.say(type="sample", step=step, device="gamepad", name="x", readings=readings)
    assert "number of readings changed" in page.until("refused")["message"]
    page.start()


KILLED = """
import sys
from pathlib import Path
from shared_control_env.drive.free import FreeDriving
from shared_control_env.drive.folders import RecordingsFolder
from shared_control_env.drive.server import Server
from shared_control_env.drive.session import Choice
folder = RecordingsFolder(Path(sys.argv[1]))
server = Server(lambda seat: FreeDriving(seat, folder, Choice()), port=0)
print(server.port, server.token, flush=True)
server.run()
"""


def connected(url, origin):
    """A connection to a server that is starting."""
    for _ in range(200):
        try:
            return connect(url, origin=origin)
        except ConnectionRefusedError:
            time.sleep(0.05)
    raise AssertionError("the server does not start")


@pytest.mark.skipif(os.name == "nt", reason="kill -9")
def test_killed_within_a_drive(tmp_path):
    """At most the running drive is lost, and the next start says so; what was written stays whole."""
    place = tmp_path / "drives"
    process = subprocess.Popen([sys.executable, "-c", KILLED, str(place)], stdout=subprocess.PIPE, text=True)
    try:
        port, token = process.stdout.readline().split()
        url, origin = f"ws://127.0.0.1:{port}/ws?token={token}", f"http://127.0.0.1:{port}"
        with connected(url, origin) as connection:
            page = Page(connection)
            page.start(degradation="bias:steering:0.9:-", authority="none")
            page.say(type="begin")
            page.drive(12.0)
            kept = page.until("result")["recording"]
            page.start(degradation="none", seed=1)
            page.say(type="begin")
            page.drive(0.5)
            process.send_signal(signal.SIGKILL)
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
    folder = RecordingsFolder(place)
    assert "two_lane, none, proportional, seed 1" in folder.lost
    assert "lost" in folder.lost
    assert folder.names() == [kept]
    assert Trial.read(place / kept).header["finished"]
    assert RecordingsFolder(place).lost == ""  # it is said once
    made = Serving(lambda seat: FreeDriving(seat, folder, Choice()))
    with made.connect() as connection:
        assert "interrupted" in Page(connection).until("welcome")["lost"]
    made.stop()


def test_nothing_is_overwritten(folder):
    trial = Trial({"format": "x"}, {"reward": np.zeros(3)})
    first, second = folder.add("drive", trial), folder.add("drive", trial)
    assert first != second
    with pytest.raises(FileExistsError):
        trial.write(first)
