"""Loading of the functions that a step runs: compiled, or read from numba's cache, with their addresses in memory."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from shared_control_env.core import kernel
from shared_control_env.core.authority.allocators import ALLOCATE, fuzzy_authority
from shared_control_env.core.batch import (
    NOT_LOADED,
    WORK,
    Calls,
    Setup,
    Sizes,
    empty_batch,
    empty_starts,
    new_outputs,
)
from shared_control_env.core.compile.cold_start import OtherProcess, has_second_core
from shared_control_env.core.compile.jit import is_cached, is_interpreted
from shared_control_env.core.control.automation import AUTOMATE, automate
from shared_control_env.core.control.predictive_driver import DRIVE, PROGRAM, drive
from shared_control_env.core.feedback.observation import DRIVER_V0, WRITE, Observation
from shared_control_env.core.feedback.reward import STANDARD, TERMS, VALUE
from shared_control_env.core.risk.assessment import ASSESS, assess
from shared_control_env.core.risk.finding import SEARCH, TRIANGULATE, search, triangulate
from shared_control_env.core.world.motion import MOVE, move

_CALLED = ((AUTOMATE, automate), (SEARCH, search), (TRIANGULATE, triangulate), (ASSESS, assess))
"""The large functions of every step, with their interfaces. Either process compiles them, the slowest first."""


_other: OtherProcess | None = None
"""The process that compiles at the same time as this one."""


def begin(driver: bool, limiter: bool) -> None:
    """Have another process compile what the kernel calls, if that is yet to be done and a second core is free.

    :func:`load` waits for it. What this process does before that, such as importing highway-env, costs no time then.

    Args:
        driver: whether the predictive driver is bound.
        limiter: whether the fuzzy inference is bound.
    """
    global _other
    compiled: Any = kernel.advance
    if _other or is_interpreted() or compiled.signatures or not has_second_core() or is_cached(compiled):
        return
    _other = OtherProcess(
        f"from {__name__} import compile_beside_kernel; compile_beside_kernel({driver!r}, {limiter!r})"
    )


def load(driver: bool, allocate: Callable[..., Any] | None, observation: Observation) -> Calls:
    """Compile the functions that are not in numba's cache, on two cores if possible, and return all addresses.

    Args:
        driver: whether the predictive driver is bound.
        allocate: the bound allocator, with the signature :data:`ALLOCATE`; None if no allocator is bound.
        observation: specification of the observation.
    """
    global _other
    begin(driver, allocate is fuzzy_authority)
    if _other:
        try:
            compile_with_kernel(driver)
            _other.wait()
        finally:
            _other.end()
            _other = None
    return Calls(
        automate=AUTOMATE.address(automate),
        triangulate=TRIANGULATE.address(triangulate),
        search=SEARCH.address(search),
        assess=ASSESS.address(assess),
        move=MOVE.address(move),
        drive=DRIVE.address(drive) if driver else 0,
        allocate=0 if allocate is None else ALLOCATE.address(allocate),
        observe=WRITE.address(observation.write),
    )


def compile_with_kernel(driver: bool) -> None:
    """Compile the kernel, and the functions that make this process take as long as the other.

    Args:
        driver: whether the predictive driver is bound, whose solver keeps the other process busy.
    """
    none, one = np.zeros(1, dtype=bool), np.zeros((1, 1))
    setup = Setup(empty_starts(0, Sizes(0, 0, 0)), 1, 1, 1.0, NOT_LOADED, DRIVER_V0.scales)
    kernel.advance(
        np.zeros(1, dtype=np.int64),
        1,
        none,
        False,
        np.zeros((1, 2)),
        one,
        empty_batch(1, Sizes(0, 0, 0)),
        setup,
        new_outputs(1, DRIVER_V0.size),
        one,
        np.zeros((1, 1), dtype=bool),
        np.zeros(1, WORK),
        np.zeros(1, PROGRAM),
        0,
    )
    MOVE.address(move)
    WRITE.address(DRIVER_V0.write)
    for name in STANDARD:
        VALUE.address(TERMS[name].value)
    if driver:
        for interface, function in _CALLED:
            interface.address(function)


def compile_beside_kernel(driver: bool, limiter: bool) -> None:
    """Compile the functions that the kernel calls by address; the second process of a cold start runs this.

    Args:
        driver: whether the predictive driver is bound.
        limiter: whether the fuzzy inference is bound.
    """
    if driver:
        DRIVE.address(drive)
    else:
        for interface, function in _CALLED:
            interface.address(function)
    if limiter:
        ALLOCATE.address(fuzzy_authority)
