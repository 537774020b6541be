"""A cold start on two cores: another process compiles some functions while this one compiles the others.

What it compiles ends in numba's cache, where this process finds it. Numba compiles one function at a time in a process,
so that threads would not help.
"""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
from collections.abc import Callable
from typing import Any

PATIENCE = 120.0
"""How long the other process is waited for [s]; after that this one compiles all by itself."""


def cores() -> list[int]:
    """Cores that this process may use, where the system says."""
    return sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else list(range(os.cpu_count() or 1))


def has_second_core() -> bool:
    """Whether another process may be started, and has a core.

    Worker processes have other work for their cores; an application that is frozen cannot start Python anew.
    """
    worker = multiprocessing.parent_process() is not None
    return not worker and not getattr(sys, "frozen", False) and len(cores()) > 1


def run_beside(code: str, here: Callable[[], None]) -> None:
    """Run Python code in another process and a function in this one, and wait for both.

    Args:
        code: of the other process, which finds the same modules.
        here: what this process does meanwhile; left out where no other process can be started.
    """
    silent: Any = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
    try:
        # As multiprocessing does: with the flags that this Python was started with, such as -I.
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
