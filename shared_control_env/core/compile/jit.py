"""The numba decorators of the core, with their disk cache and the notice printed on a cold compilation."""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from time import perf_counter
from typing import Any, TypeVar, cast

import numpy as np
from numba import config, njit, types
from numba.core import event

from shared_control_env.core.compile.cache import cache_of, say_once

F = TypeVar("F", bound=Callable[..., Any])

ARITHMETIC = {"error_model": "numpy"}
"""Numba's options of all compiled functions: divisions follow IEEE 754."""


def jit(function: F) -> F:
    """Decorator: compile a function, with a disk cache.

    Divisions follow IEEE 754, as in NumPy. Neither fast-math nor threads are used within a function, so that rollouts
    are bitwise reproducible.

    Args:
        function: Python function that creates no arrays.
    """
    return _compile(function, inline="never")


def jit_allocating(function: F) -> F:
    """Decorator: as :func:`jit`, for a function that creates arrays.

    Args:
        function: Python function.
    """
    return _compile(function, inline="never", allocating=True)


def jit_inlined(function: F) -> F:
    """Decorator: as :func:`jit`, for a function with one or two callers, which is compiled as a part of its callers.

    LLVM optimises everything that a function calls once more for each caller. Without inlining, every layer of a deep
    call tree would take as long to compile as the whole tree.

    Args:
        function: Python function that creates no arrays.
    """
    return _compile(function, inline="always")


def _compile(function: F, inline: str, allocating: bool = False) -> F:
    options: dict[str, Any] = {
        **ARITHMETIC,
        "nogil": True,
        "inline": inline,
        "no_cfunc_wrapper": True,
        # Functions that create no arrays need no reference counting.
        "_nrt": allocating,
        # A private function is never called from Python, so it needs no wrapper for such calls.
        "no_cpython_wrapper": function.__name__.startswith("_"),
    }
    if is_interpreted():
        return _interpreted(function)
    dispatcher: Any = njit(**options)(function)
    _ignore_literals(dispatcher)
    dispatcher._cache = cache_of(function)
    return cast(F, dispatcher)


def is_interpreted() -> bool:
    """Whether the core runs as Python because the environment variable ``NUMBA_DISABLE_JIT`` is set."""
    settings: Any = config
    return bool(settings.DISABLE_JIT)


def _interpreted(function: F) -> F:
    """Wrap a function that runs as Python, for debuggers (``NUMBA_DISABLE_JIT=1``).

    The wrapper makes the fields of records accessible as attributes, as in compiled code.
    """
    say_once("NUMBA_DISABLE_JIT is set: the core runs as Python, some thousand times slower.")

    @wraps(function)
    def interpreted(*arguments: Any) -> Any:
        with np.errstate(all="ignore"):
            return function(*(_with_attributes(argument) for argument in arguments))

    interpreted.py_func = function  # type: ignore[attr-defined]
    return cast(F, interpreted)


_RECORD: Any = np.record


class _Fields(_RECORD):
    """Record whose fields are attributes, including fields such as ``size`` that NumPy uses for something else."""

    def __getattribute__(self, name: str) -> Any:
        fields = object.__getattribute__(self, "dtype").fields
        return _with_attributes(self[name]) if name in fields else object.__getattribute__(self, name)


def _with_attributes(argument: Any) -> Any:
    """View of a record, or of an array of records, with fields as attributes; named tuples are converted by entry."""
    if isinstance(argument, tuple) and hasattr(argument, "_fields"):
        return type(argument)(*map(_with_attributes, argument))
    if isinstance(argument, np.void | np.ndarray) and argument.dtype.names and argument.dtype.type is not _Fields:
        return argument.view(np.dtype((_Fields, argument.dtype)))
    return argument


def _ignore_literals(dispatcher: Any) -> None:
    """Make compiled callers share one specialisation for constants and variables of the same type."""
    call_template = dispatcher.get_call_template

    def get_call_template(args: Any, kws: Any) -> Any:
        return call_template(
            [types.unliteral(arg) for arg in args], {name: types.unliteral(arg) for name, arg in kws.items()}
        )

    dispatcher.get_call_template = get_call_template


def compiled_form(function: Callable[..., Any]) -> Callable[..., Any] | None:
    """The machine code of a function that has been called, as a Python function that does not look at its arguments.

    Numba finds out the types of all arguments at every call, which takes longer than a step of the kernel. Where a
    function is always called with the same types, that is not needed. Other types are undefined behaviour.

    Args:
        function: function compiled by :func:`jit`, with one form.

    Returns:
        The function; None before the first call. Where the core runs as Python, the function itself.
    """
    if is_interpreted():
        return function
    forms = list(cast(Any, function).overloads.values())
    return forms[0].entry_point if len(forms) == 1 else None


def is_cached(function: Callable[..., Any]) -> bool:
    """Whether numba's disk cache holds a compiled form of a function of this package.

    Args:
        function: function compiled by :func:`jit` or one of its variants.
    """
    dispatcher: Any = function
    module, name = dispatcher.py_func.__module__.rsplit(".", 1)[-1], dispatcher.py_func.__qualname__
    path = dispatcher.stats.cache_path
    return path is not None and any(Path(path).glob(f"{module}.{name}-*.nbi"))


class _Compilation(event.Listener):
    """Print a notice on stderr when functions are compiled for the first time, once per series of compilations.

    The garbage collector is disabled during a compilation: numba creates millions of objects that live until its end,
    and checking them repeatedly takes a tenth of the time.
    """

    quiet_since = -float("inf")
    depth = 0
    collecting = False

    def on_start(self, event: Any) -> None:
        """Handle the start of a compilation, possibly within another compilation.

        Args:
            event: numba's event, which holds the function to compile.
        """
        function = event.data["dispatcher"].py_func
        pause = perf_counter() - self.quiet_since
        if self.depth == 0:
            self.collecting = gc.isenabled()
            gc.disable()
        self.depth += 1
        if pause > 5.0 and function.__module__.startswith("shared_control_env") and sys.stderr is not None:
            print(
                "shared_control_env: compiling the numerical core for this use and machine, once "
                "(up to a minute); later runs read it from numba's cache.",
                file=sys.stderr,
                flush=True,
            )
        self.quiet_since = perf_counter()

    def on_end(self, event: Any) -> None:
        """Handle the end of a compilation.

        Args:
            event: numba's event, unused.
        """
        self.depth -= 1
        if self.depth == 0 and self.collecting:
            gc.enable()
        self.quiet_since = perf_counter()


event.register("numba:compile", _Compilation())
