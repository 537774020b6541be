"""Threads that do one piece of work after the other together."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from typing import Any


class Threads:
    """A number of threads, the calling one among them.

    Copies, and a forked process, have threads of their own.

    Args:
        count: how many, at least 1.
    """

    def __init__(self, count: int) -> None:
        self.count = count
        self._open()

    def _open(self) -> None:
        self._pool = ThreadPoolExecutor(self.count - 1) if self.count > 1 else None
        self._process = os.getpid()

    def __getstate__(self) -> dict[str, Any]:
        """Only how many there are: threads stay in their process."""
        return {"count": self.count}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Start as many."""
        self.__init__(**state)  # type: ignore[misc]

    def run(self, work: Callable[[int], None]) -> None:
        """Call ``work(i)`` in every thread i, the calling one being 0, and return when all are done.

        Raises:
            BaseException: what one of the calls has raised, or an interrupt, once no thread is at work any more.
        """
        if self._process != os.getpid():
            self._open()
        others: list[Future[None]] = []
        try:
            if self._pool is not None:
                others.extend(self._pool.submit(work, thread) for thread in range(1, self.count))
            work(0)
        finally:
            _await_all(others)
        for other in others:
            other.result()

    def close(self) -> None:
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown()


def _await_all(futures: Sequence[Future[None]]) -> None:
    """Wait until all are done, interrupts notwithstanding: threads left running would race with what comes next."""
    interrupt: KeyboardInterrupt | None = None
    while not all(future.done() for future in futures):
        try:
            wait(futures)
        except KeyboardInterrupt as error:
            interrupt = error
    if interrupt is not None:
        raise interrupt
