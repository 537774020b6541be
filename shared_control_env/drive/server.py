"""The server: loopback only, one person who drives and some who look on."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import secrets
import socket
import threading
import time
import webbrowser
from collections import deque
from collections.abc import AsyncIterator, Callable, Coroutine
from pathlib import Path
from typing import Any, Protocol

import uvicorn
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from shared_control_env.drive.protocol import LARGEST, Input, Message, Pause, Sample, parse
from shared_control_env.drive.seat import Seat

HOST = "127.0.0.1"
PORT = 8642
"""Port that is tried first. A page's calibrations belong to its address, so that it should stay the same."""

PAGE = Path(__file__).parent / "page"
FILES = {"index.html": "text/html", "drive.css": "text/css"} | dict.fromkeys(
    ("drive.js", "world.js", "input.js", "study.js"), "text/javascript"
)

HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' data:; connect-src 'self'; frame-ancestors 'none'",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}

RATE, BURST = 200.0, 400.0
"""Messages a second that a page may send, and how many at once."""

MOST_REFUSED = 20
"""Malformed messages after which a connection is closed."""

MOST_PAGES = 8
"""Largest number of connections."""

MOST_WAITING = 64
"""Messages, frames not counted, that may wait for a slow page."""

POLICY, TOO_MANY = 1008, 1013
"""Codes with which a connection is closed."""


class Programme(Protocol):
    """What the server runs: driving freely, or a study."""

    kind: str

    def welcome(self) -> dict[str, Any]:
        """What a page needs to know at first."""
        ...

    def present(self) -> list[dict[str, Any]]:
        """What a page needs to know that comes later."""
        ...

    async def handle(self, message: Message) -> None:
        """Do what the page asks for.

        Args:
            message: the message.
        """
        ...


class Page:
    """A connected page. Of frames only the latest waits; other messages wait in order."""

    def __init__(self, socket: WebSocket) -> None:
        self.socket = socket
        self._messages: deque[str] = deque()
        self._frame = ""
        self._more = asyncio.Event()
        self.slow = asyncio.Event()

    def put(self, message: dict[str, Any]) -> None:
        """Let a message wait for its turn.

        Args:
            message: the message.
        """
        if len(self._messages) > MOST_WAITING:
            self.slow.set()
            return
        text = json.dumps(message, allow_nan=False)
        if message["type"] == "frame":
            self._frame = text
        else:
            if self._frame and message["type"] == "state":  # the frame before it is the one that it belongs to
                self._messages.append(self._frame)
                self._frame = ""
            self._messages.append(text)
        self._more.set()

    async def send(self) -> None:
        """Send what waits, for as long as the page is connected."""
        while True:
            await self._more.wait()
            self._more.clear()
            while self._messages:
                await self.socket.send_text(self._messages.popleft())
            if self._frame:
                text, self._frame = self._frame, ""
                await self.socket.send_text(text)


class Server:
    """Pages, and what they may do.

    Args:
        make: makes the programme around a seat.
        in_step: whether ticks follow inputs; for simulated people.
        port: port; 0 for any that is free.

    Attributes:
        token: what a page must know to be let in.
        seat, programme: what is run.
        url: address of the page.
    """

    def __init__(self, make: Callable[[Seat], Programme], in_step: bool = False, port: int = PORT) -> None:
        self.token = secrets.token_urlsafe(24)
        self._pages: list[Page] = []
        self.seat = Seat(self.send_all, in_step)
        self.programme = make(self.seat)
        self._socket = _bound(port)
        self.port = self._socket.getsockname()[1]
        self.origins = [f"http://{name}:{self.port}" for name in (HOST, "localhost")]
        self.url = f"{self.origins[0]}/?token={self.token}"
        self._working: set[asyncio.Task[None]] = set()
        app = Starlette(
            routes=[
                Route("/", self._index),
                Route("/static/{name}", self._static),
                WebSocketRoute("/ws", self._connect),
            ],
            middleware=[Middleware(TrustedHostMiddleware, allowed_hosts=[HOST, "localhost"])],
            lifespan=self._lifespan,
        )
        self._uvicorn = uvicorn.Server(
            uvicorn.Config(
                app,
                log_level=logging.WARNING,
                ws="websockets-sansio",
                ws_max_size=LARGEST,
                ws_max_queue=16,
                timeout_graceful_shutdown=1,
            )
        )

    def run(self, browser: bool = False, until: Coroutine[Any, Any, None] | None = None) -> None:
        """Serve until interrupted.

        Args:
            browser: whether to open the page in a browser.
            until: ends the serving when it ends; None to go on.
        """

        async def both() -> None:
            ending = asyncio.create_task(self._stop_after(until)) if until is not None else None
            await self.serve()
            if ending is not None:
                ending.cancel()

        if browser:
            threading.Timer(0.5, webbrowser.open, [self.url]).start()
        with contextlib.suppress(KeyboardInterrupt):
            asyncio.run(both())

    async def _stop_after(self, until: Coroutine[Any, Any, None]) -> None:
        await until
        self.stop()

    async def serve(self) -> None:
        """Serve within a running event loop, until :meth:`stop`."""
        await self._uvicorn.serve(sockets=[self._socket])

    async def started(self) -> None:
        """Wait until pages can connect."""
        while not self._uvicorn.started:
            await asyncio.sleep(0.005)

    def stop(self) -> None:
        """End :meth:`run` or :meth:`serve`."""
        self._uvicorn.should_exit = True

    def send_all(self, message: dict[str, Any]) -> None:
        """Send a message to all pages.

        Args:
            message: the message.
        """
        for page in self._pages:
            page.put(message)

    @contextlib.asynccontextmanager
    async def _lifespan(self, app: Starlette) -> AsyncIterator[None]:
        yield
        await self.seat.clear()

    async def _index(self, request: Request) -> Response:
        if not self._knows(request.query_params.get("token", "")):
            return PlainTextResponse(
                "This page needs the token of the address that the command printed.", 403, headers=HEADERS
            )
        return FileResponse(PAGE / "index.html", headers=HEADERS)

    async def _static(self, request: Request) -> Response:
        name = request.path_params["name"]
        if name not in FILES:
            return PlainTextResponse("There is no such file.", 404, headers=HEADERS)
        return FileResponse(PAGE / name, media_type=FILES[name], headers=HEADERS)

    def _knows(self, token: str) -> bool:
        return secrets.compare_digest(token.encode(), self.token.encode())

    async def _connect(self, socket: WebSocket) -> None:
        """Serve one page: the first drives, the others look on."""
        if socket.headers.get("origin") not in self.origins or not self._knows(socket.query_params.get("token", "")):
            await socket.close(POLICY)
            return
        await socket.accept()
        if len(self._pages) >= MOST_PAGES:
            await socket.close(TOO_MANY, "too many pages")
            return
        page = Page(socket)
        self._pages.append(page)
        self._introduce(page)
        tasks = [asyncio.create_task(part) for part in (page.send(), self._listen(page), page.slow.wait())]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            self._leave(page)
            with contextlib.suppress(RuntimeError, WebSocketDisconnect, TimeoutError):  # where it has gone already
                await asyncio.wait_for(socket.close(POLICY, "too slow" if page.slow.is_set() else ""), 1.0)

    def _introduce(self, page: Page) -> None:
        role = "driver" if self._pages[0] is page else "spectator"
        if role == "driver":
            self.seat.greet()
        page.put({"type": "welcome", "role": role, **self.programme.welcome()})
        for message in self.programme.present():
            page.put(message)

    def _leave(self, page: Page) -> None:
        """Without its page the drive is paused; the next page may go on with it."""
        drove = self._pages[0] is page
        self._pages.remove(page)
        if drove:
            self.seat.pause("the connection was lost")
            if self._pages:
                self._introduce(self._pages[0])

    async def _listen(self, page: Page) -> None:
        """Take the messages of a page, as many as it may send."""
        allowance, last, refused = BURST, time.monotonic(), 0
        with contextlib.suppress(WebSocketDisconnect):
            while True:
                received = await page.socket.receive()
                if received["type"] == "websocket.disconnect":
                    return
                now = time.monotonic()
                allowance, last = min(BURST, allowance + RATE * (now - last)) - 1.0, now
                if allowance < 0.0 and not self.seat.in_step:
                    await page.socket.close(POLICY, f"more than {RATE:g} messages a second")
                    return
                try:
                    message = parse(received.get("text") or received.get("bytes") or "")
                    if self._pages[0] is not page:
                        raise ValueError("another page drives; this one looks on")
                    if isinstance(message, Input):
                        await self.seat.receive(message)
                    elif isinstance(message, Pause):
                        self.seat.pause(message.words)
                    elif isinstance(message, Sample):
                        self.seat.sample(message)
                    else:
                        self._work(page, message)
                except ValueError as error:
                    refused += 1
                    page.put({"type": "refused", "message": str(error)})
                    if refused >= MOST_REFUSED:
                        await page.socket.close(POLICY, "too many messages that cannot be read")
                        return

    def _work(self, page: Page, message: Message) -> None:
        """Do what a page asks for while its further inputs are taken; one thing after the other."""
        if self._working:
            raise ValueError("one moment: the last request is still being worked on")

        async def work() -> None:
            try:
                await self.programme.handle(message)
            except ValueError as error:
                page.put({"type": "refused", "message": str(error)})
            except Exception as error:
                logging.getLogger(__name__).exception("the page's request failed")
                page.put({"type": "refused", "message": f"{type(error).__name__}: {error}"})

        task = asyncio.create_task(work())
        self._working.add(task)
        task.add_done_callback(self._working.discard)


def _bound(port: int) -> socket.socket:
    """A socket on the loopback interface, on the port or, if that is taken, on one that is free."""
    bound = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        bound.bind((HOST, port))
    except OSError:
        bound.bind((HOST, 0))
    return bound
