"""The one numba decorator of the core: its disk cache, and the notice that a cold compilation gives."""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable
from functools import cache
from hashlib import sha256
from pathlib import Path
from time import perf_counter
from typing import Any, TypeVar, cast

from numba import njit, types
from numba.core import event

F = TypeVar("F", bound=Callable[..., Any])

_PACKAGE = Path(__file__).parent.parent
_COMPILED_SOURCES = ("core/*.py", *(f"vector/{name}.py" for name in ("intrinsics", "kernel", "records", "solvers")))


def jit(function: F) -> F:
    """Compile with a disk cache.

    Divisions follow IEEE 754 as in NumPy. Neither fast-math nor threads are used within a function, so
    that rollouts repeat to the bit.
    """
    return _compile(function, inline="never")


def jit_allocating(function: F) -> F:
    """As :func:`jit`, for a function that makes arrays."""
    return _compile(function, inline="never", allocating=True)


def jit_inlined(function: F) -> F:
    """As :func:`jit`, for a function that one or two others call: it is compiled as a part of them.

    LLVM optimises all that a function calls anew for each of its callers, so that every layer of a deep
    composition would cost as much to compile as the whole.
    """
    return _compile(function, inline="always")


def _compile(function: F, inline: str, allocating: bool = False) -> F:
    options: dict[str, Any] = {
        "cache": True,
        "error_model": "numpy",
        "nogil": True,
        "inline": inline,
        "no_cfunc_wrapper": True,
        # Arrays are made nowhere in the step path, so that nobody needs to count who holds them.
        "_nrt": allocating,
        # A private function is never called from Python, so it needs no entry for that.
        "no_cpython_wrapper": function.__name__.startswith("_"),
    }
    dispatcher: Any = njit(**options)(function)
    _ignore_literals(dispatcher)
    _drop_stale_cache(dispatcher.stats.cache_path)
    return cast(F, dispatcher)


def _ignore_literals(dispatcher: Any) -> None:
    """Have compiled callers share one specialisation for a constant and a variable of the same type."""
    call_template = dispatcher.get_call_template

    def get_call_template(args: Any, kws: Any) -> Any:
        return call_template(
            [types.unliteral(arg) for arg in args], {name: types.unliteral(arg) for name, arg in kws.items()}
        )

    dispatcher.get_call_template = get_call_template


def is_cached(function: Callable[..., Any]) -> bool:
    """Whether numba's cache on disk holds a compiled form of a function of this package."""
    dispatcher: Any = function
    module, name = dispatcher.py_func.__module__.rsplit(".", 1)[-1], dispatcher.py_func.__qualname__
    return any(Path(dispatcher.stats.cache_path).glob(f"{module}.{name}-*.nbi"))


@cache
def _drop_stale_cache(directory: str) -> None:
    """Empty a cache directory that older sources filled.

    Numba compares only a function's own file, yet inlines what it calls: after a change in
    one file the callers in others would silently keep the old equation.
    """
    sources = sorted(path for pattern in _COMPILED_SOURCES for path in _PACKAGE.glob(pattern))
    digest = sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()
    stamp = Path(directory) / "shared_control_env.sha256"
    if stamp.is_file() and stamp.read_text() == digest:
        return
    try:
        for pattern in ("*.nbi", "*.nbc"):
            for path in Path(directory).glob(pattern):
                path.unlink(missing_ok=True)
        stamp.parent.mkdir(parents=True, exist_ok=True)
        stamp.write_text(digest)
    except OSError:  # A directory that cannot be written cannot hold a stale cache of ours either.
        return


class _Compilation(event.Listener):
    """Say on stderr that something is compiled for the first time, once for all that is compiled in a row.

    The garbage collector rests meanwhile: numba makes millions of objects that live until the end, and looking
    through them again and again takes a tenth of the time.
    """

    quiet_since = -float("inf")
    depth = 0
    collecting = False

    def on_start(self, event: Any) -> None:
        """Note that a compilation begins, perhaps within another."""
        function = event.data["dispatcher"].py_func
        pause = perf_counter() - self.quiet_since
        if self.depth == 0:
            self.collecting = gc.isenabled()
            gc.disable()
        self.depth += 1
        if pause > 5.0 and function.__module__.startswith("shared_control_env"):
            print(
                "shared_control_env: compiling the numerical core for this use and machine, once "
                "(up to a minute); later runs read it from numba's cache.",
                file=sys.stderr,
                flush=True,
            )
        self.quiet_since = perf_counter()

    def on_end(self, event: Any) -> None:
        """Note that a compilation has ended just now."""
        self.depth -= 1
        if self.depth == 0 and self.collecting:
            gc.enable()
        self.quiet_since = perf_counter()


event.register("numba:compile", _Compilation())
