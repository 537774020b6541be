"""Cold start on two cores: another process compiles some functions while this process compiles the others.

The other process stores its results in numba's cache, where this process finds them. Numba compiles only one function
at a time in a process, so threads would not help.
"""

from __future__ import annotations

import atexit
import multiprocessing
import os
import subprocess
import sys
from contextlib import suppress
from typing import Any

PATIENCE = 120.0
"""Longest time to wait for the other process [s]; after that, this process compiles everything itself."""


def cores() -> list[int]:
    """Indices of the cores that this process may use, or of all cores if the system does not tell."""
    return sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else list(range(os.cpu_count() or 1))


def has_second_core() -> bool:
    """Whether another process may be started and has a core to run on.

    Worker processes need their cores for other work. A frozen application cannot start a new Python interpreter.
    """
    worker = multiprocessing.parent_process() is not None
    return not worker and not getattr(sys, "frozen", False) and len(cores()) > 1


class OtherProcess:
    """Python code in another process, which ends with this one.

    Args:
        code: source code. The other process finds the same modules as this one.
    """

    def __init__(self, code: str) -> None:
        silent: Any = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
        self._process: Any = None
        try:
            # As in multiprocessing: use the flags that this Python was started with, such as -I.
            flags = subprocess._args_from_interpreter_flags()  # type: ignore[attr-defined]
            code = f"import sys; sys.path[:] = {sys.path!r}; {code}"
            self._process = subprocess.Popen([sys.executable, *flags, "-c", code], **silent)
            atexit.register(self.end)
        except OSError:  # no more processes: this one does all the work
            return

    def __bool__(self) -> bool:
        return self._process is not None

    def wait(self) -> None:
        """Wait until it has ended, at most :data:`PATIENCE`."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(PATIENCE)

    def end(self) -> None:
        """End it if it runs."""
        process, self._process = self._process, None
        atexit.unregister(self.end)
        if process is not None:
            process.kill()
            process.wait()
