"""Loading of the functions that a step runs: compiled or read from numba's cache, with their addresses in memory."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from shared_control_env.core import kernel
from shared_control_env.core.authority.allocators import ALLOCATE
from shared_control_env.core.batch import Calls
from shared_control_env.core.compile.cold_start import has_second_core, run_beside
from shared_control_env.core.compile.jit import is_cached, is_interpreted
from shared_control_env.core.control.automation import AUTOMATE, automate
from shared_control_env.core.control.predictive_driver import DRIVE, drive
from shared_control_env.core.feedback.observation import WRITE, Observation
from shared_control_env.core.risk.finding import SEARCH, TRIANGULATE, search, triangulate


def load(
    compile_kernel: Callable[[], None], driver: bool, allocate: Callable[..., float] | None, observation: Observation
) -> Calls:
    """Compile the functions that are not in numba's cache, on two cores if possible, and return all addresses.

    Args:
        compile_kernel: function that compiles the kernel, by calling it without any active environment.
        driver: whether the predictive driver is bound.
        allocate: the bound allocator, with the signature :data:`ALLOCATE`; None if no allocator is bound.
        observation: specification of the observation.
    """
    compiled: Any = kernel.advance
    if not is_interpreted() and not compiled.signatures and has_second_core() and not is_cached(compiled):
        run_beside(f"from {__name__} import compile_others; compile_others({driver!r})", compile_kernel)
    return Calls(
        automate=AUTOMATE.address(automate),
        triangulate=TRIANGULATE.address(triangulate),
        search=SEARCH.address(search),
        drive=DRIVE.address(drive) if driver else 0,
        allocate=0 if allocate is None else ALLOCATE.address(allocate),
        observe=WRITE.address(observation.write),
    )


def compile_others(driver: bool) -> None:
    """Compile the functions that the kernel calls by address; the second process of a cold start runs this.

    Args:
        driver: whether the predictive driver is bound.
    """
    for interface, function in ((AUTOMATE, automate), (TRIANGULATE, triangulate), (SEARCH, search)):
        interface.address(function)
    if driver:
        DRIVE.address(drive)
