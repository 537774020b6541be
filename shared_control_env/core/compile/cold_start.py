"""Cold start on two cores: another process compiles some functions while this process compiles the others.

The other process stores its results in numba's cache, where this process finds them. Numba compiles only one function
at a time in a process, so threads would not help.
"""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
from collections.abc import Callable
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


def run_beside(code: str, here: Callable[[], None]) -> None:
    """Run Python code in another process and a function in this process at the same time, and wait for both.

    Args:
        code: Python code for the other process, which uses the same module search path.
        here: function that this process calls meanwhile; not called if no other process can be started.
    """
    silent: Any = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
    try:
        # As in multiprocessing, the other process gets the flags that this interpreter was started with, such as -I.
        flags = subprocess._args_from_interpreter_flags()  # type: ignore[attr-defined]
        code = f"import sys; sys.path[:] = {sys.path!r}; {code}"
        other = subprocess.Popen([sys.executable, *flags, "-c", code], **silent)
    except OSError:
        return
    try:
        here()
        other.wait(PATIENCE)
    except subprocess.TimeoutExpired:
        pass
    finally:
        other.kill()
        other.wait()
