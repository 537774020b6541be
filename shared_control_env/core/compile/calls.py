"""Compiled functions that others call by their address.

LLVM optimises all that a function calls anew together with it. Through an address the kernel stays small, what no
setting uses is never compiled, two processes can compile at the same time (:mod:`cold_start`), and what somebody adds
from outside the package (a tyre, a kind of degradation, a reward term) enters without compiling the rest again.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, get_type_hints

import numpy as np
from llvmlite import ir
from numba import from_dtype, types
from numba.core import cgutils
from numba.core.ccallback import CFunc
from numba.core.errors import NumbaError, TypingError
from numba.extending import intrinsic

from shared_control_env.core.compile.cache import cache_of, no_cache
from shared_control_env.core.compile.jit import is_interpreted
from shared_control_env.core.records import record_dtype

PACKAGE = __name__.partition(".")[0]

MATRIX = types.Array(types.float64, 2, "C")
"""Type of an array of floats with two dimensions."""

SINGLES = types.Array(types.float32, 1, "C")
"""Type of an array of single-precision floats with one dimension."""

_interpreted: list[Callable[..., Any]] = [lambda: None]
"""Functions by their address minus one, where the core runs as Python; none has the address 0."""


def compiled_type(kind: Any) -> Any:
    """Numba's type for None, a number, a tuple of these, a structured type, a class of fields, or a type of its own.

    Args:
        kind: a class of :mod:`core.records` or :mod:`core.parameters` stands for a record of its fields.
    """
    if kind is None:
        return types.void
    if isinstance(kind, tuple):
        return types.Tuple([compiled_type(each) for each in kind])
    if isinstance(kind, types.Type):
        return kind
    if isinstance(kind, np.dtype):
        return from_dtype(kind)
    return _NUMBERS[kind] if kind in _NUMBERS else from_dtype(record_dtype(kind))


_NUMBERS = {float: types.float64, int: types.int64, bool: types.boolean}


def by_value(kind: Any) -> Any:
    """Numba's type for a named tuple that is passed as it is, and not as a record; its fields may be records."""
    return types.NamedTuple([compiled_type(hint) for hint in get_type_hints(kind).values()], kind)


class Interface:
    """What a family of functions takes and gives, so that compiled code can call any of them by its address.

    Args:
        result: type of what they return, see :func:`compiled_type`.
        arguments: types of their arguments.

    Attributes:
        call: for compiled code, ``call(address, *arguments)``.
    """

    def __init__(self, result: Any, *arguments: Any) -> None:
        self._signature = compiled_type(result)(*map(compiled_type, arguments))
        self._compiled: dict[Callable[..., Any], tuple[int, Any]] = {}
        self.call = _call_interpreted if is_interpreted() else _call_of(self._signature)

    def address(self, function: Callable[..., Any]) -> int:
        """Where a function is in memory; it is compiled for that, or read from numba's cache.

        Args:
            function: Python that numba compiles, or what it has compiled already.

        Raises:
            ValueError: if numba cannot compile it to take and give this.
        """
        plain: Any = getattr(function, "py_func", function)
        if plain not in self._compiled:
            self._compiled[plain] = self._interpret(function) if is_interpreted() else self._compile(plain)
        return self._compiled[plain][0]

    def _interpret(self, function: Callable[..., Any]) -> tuple[int, Any]:
        _interpreted.append(function)
        return len(_interpreted) - 1, function

    def _compile(self, function: Callable[..., Any]) -> tuple[int, Any]:
        options: Any = {"error_model": "numpy", "_nrt": False}  # as core.compile.jit has them
        signature = self._signature
        compiled: Any = CFunc(function, (signature.args, signature.return_type), locals={}, options=options)
        own = function.__module__.partition(".")[0] == PACKAGE
        compiled._cache = cache_of(function) if own else no_cache()
        try:
            compiled.compile()
        except NumbaError as error:
            name = f"{function.__module__}.{function.__qualname__}"
            raise ValueError(f"{name} cannot be compiled: {error}") from None
        return compiled.address, compiled  # which is kept, lest its code is freed


def _call_interpreted(address: int, *arguments: Any) -> Any:
    return _interpreted[address](*arguments)


def _call_of(signature: Any) -> Any:
    """A call of a function with this signature at an address, in compiled code."""

    @intrinsic
    def call(typing_context: Any, address: Any, *arguments: Any) -> Any:
        if tuple(arguments) != signature.args:
            raise TypingError(f"called with {arguments}, but compiled for {signature.args}")

        def generate(context: Any, builder: Any, found: Any, values: Any) -> Any:
            result, *kinds = (context.get_value_type(kind) for kind in (signature.return_type, *signature.args))
            pointer = builder.inttoptr(values[0], ir.FunctionType(result, kinds).as_pointer())
            return builder.call(pointer, cgutils.unpack_tuple(builder, values[1]))

        return signature.return_type(address, types.StarArgTuple(arguments)), generate

    return call
