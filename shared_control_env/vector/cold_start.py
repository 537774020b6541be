"""A cold start on two cores: another process compiles the safe area while this one compiles the automation.

Both end in numba's cache, where the kernel, which calls them, finds them. Numba compiles one function at a time in a
process, so that threads would not help.
"""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numba import float64, from_dtype, int64, typeof

from shared_control_env.core import automation_mpc, degradation, delaunay, safe_area
from shared_control_env.core.jit import is_cached
from shared_control_env.core.parameters import DegradationParameters, Parameters
from shared_control_env.core.records import AUTOMATION_MEMORY, FAULT_MEMORY, SCENE, SIGNALS, record_dtype
from shared_control_env.vector import kernel
from shared_control_env.vector.records import WORKSPACE

PATIENCE = 120.0
"""How long the other process is waited for [s]; after that the kernel compiles all by itself."""


@cache
def prepare() -> None:
    """Compile what the kernel calls, once, unless the kernel is in the cache or there is no second core to use.

    Worker processes have other work for their cores; an application that is frozen cannot start Python anew.
    """
    one_of_many = multiprocessing.parent_process() is not None
    if is_cached(kernel.advance) or one_of_many or _cores() < 2 or getattr(sys, "frozen", False):
        return
    code = f"import sys; sys.path[:] = {sys.path!r}; from {__name__} import compile_safe_area; compile_safe_area()"
    silent: Any = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
    try:
        other = subprocess.Popen([sys.executable, "-c", code], **silent)
    except OSError:
        return
    try:
        compile_automation()
        other.wait(PATIENCE)
    except subprocess.TimeoutExpired:
        pass
    finally:
        other.kill()
        other.wait()


def _cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def compile_safe_area() -> None:
    """Compile the triangulation and its search as :func:`kernel.find_area` calls them."""
    scene, work = _record(SCENE), _record(WORKSPACE)
    _compile(delaunay.triangulate, scene.typeof("region"), work.typeof("corners"), int64, work.typeof("triangles"))
    triangles = typeof(np.zeros(1, delaunay.WORKSPACE)[0]["triangles"])
    _compile(safe_area.search_triangles, triangles, float64, float64, float64, float64, scene.typeof("area"))


def compile_automation() -> None:
    """Compile the automation's solver and the degradations as the kernel's functions call them."""
    scene, p, work = _record(SCENE), _record(record_dtype(Parameters)), _record(WORKSPACE)
    memory, signals = _record(AUTOMATION_MEMORY), _record(SIGNALS)
    _compile(automation_mpc.solve, memory.typeof("U"), scene, p, int64, work.typeof("solver"))
    faults, memories = (typeof(np.zeros(1, dtype)) for dtype in (record_dtype(DegradationParameters), FAULT_MEMORY))
    before, after = signals.typeof("u_a_des"), signals.typeof("u_a_f")
    _compile(degradation.degrade, before, int64, float64, faults, memories, p.typeof("limits"), after)


def _record(dtype: np.dtype) -> Any:
    """Numba's type of a record; ``typeof`` of it gives that of a field."""
    return from_dtype(dtype)


def _compile(function: Callable[..., Any], *signature: Any) -> None:
    """Compile a function for arguments of these types."""
    compiled: Any = function
    compiled.compile(signature)
