"""A pool of threads that run one task at a time together."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from typing import Any


class Threads:
    """A pool of threads that includes the calling thread.

    A copy and a forked process get their own threads.

    Args:
        count: number of threads, at least 1.

    Attributes:
        count: number of threads.
    """

    def __init__(self, count: int) -> None:
        self.count = count
        self._open()

    def _open(self) -> None:
        self._pool = ThreadPoolExecutor(self.count - 1) if self.count > 1 else None
        self._process = os.getpid()

    def __getstate__(self) -> dict[str, Any]:
        """State for pickling: only the number of threads, because threads belong to their process."""
        return {"count": self.count}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Start the same number of threads."""
        self.__init__(**state)  # type: ignore[misc]

    def run(self, work: Callable[[int], None]) -> None:
        """Call ``work(i)`` in every thread i, and return when all calls are done. The calling thread has the index 0.

        Args:
            work: function of the index of the thread.

        Raises:
            BaseException: the exception of one of the calls, or an interrupt, after all threads have finished.
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
    """Wait until all are done, even if interrupted, because threads left running would race with the next task."""
    interrupt: KeyboardInterrupt | None = None
    while not all(future.done() for future in futures):
        try:
            wait(futures)
        except KeyboardInterrupt as error:
            interrupt = error
    if interrupt is not None:
        raise interrupt
