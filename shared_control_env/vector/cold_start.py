"""A cold start on two cores: another process compiles the solvers while this one compiles the kernel that calls them.

The solvers end in numba's cache, where this process finds them. Numba compiles one function at a time in a process, so
that threads would not help.
"""

from __future__ import annotations

import multiprocessing
import subprocess
import sys
from collections.abc import Callable
from typing import Any

from shared_control_env.core.jit import is_cached
from shared_control_env.vector import kernel, solvers
from shared_control_env.vector.threads import cores

PATIENCE = 120.0
"""How long the other process is waited for [s]; after that this one compiles the solvers itself."""


def compile_all(compile_kernel: Callable[[], None], driver: bool) -> solvers.Addresses:
    """Compile what is not in numba's cache, and say where the solvers are.

    Args:
        compile_kernel: calls the kernel for no environment.
        driver: whether the predictive driver is bound.
    """
    if _worthwhile():
        _compile_beside(compile_kernel, driver)
    return solvers.addresses(driver)


def _worthwhile() -> bool:
    """Whether the kernel is yet to be compiled and a second core is free for the solvers.

    Worker processes have other work for their cores; an application that is frozen cannot start Python anew.
    """
    compiled: Any = kernel.advance
    worker = multiprocessing.parent_process() is not None
    if compiled.signatures or worker or getattr(sys, "frozen", False):
        return False
    return len(cores()) > 1 and not is_cached(kernel.advance)


def _compile_beside(compile_kernel: Callable[[], None], driver: bool) -> None:
    """Compile the kernel, and the search too where the driver's solver gives the other process enough to do."""
    theirs = ("AUTOMATE", "TRIANGULATE", "DRIVE" if driver else "SEARCH")
    addresses = ", ".join(f"solvers.{name}.address" for name in theirs)
    code = f"import sys; sys.path[:] = {sys.path!r}; from {solvers.__package__} import solvers; {addresses}"
    silent: Any = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
    try:
        # As multiprocessing does: with the flags that this Python was started with, such as -I.
        flags = subprocess._args_from_interpreter_flags()  # type: ignore[attr-defined]
        other = subprocess.Popen([sys.executable, *flags, "-c", code], **silent)
    except OSError:
        return
    try:
        compile_kernel()
        if driver:
            _ = solvers.SEARCH.address
        other.wait(PATIENCE)
    except subprocess.TimeoutExpired:
        pass
    finally:
        other.kill()
        other.wait()
