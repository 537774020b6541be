"""Compiled functions that other compiled functions call by their address.

LLVM optimises a function together with everything that the function calls. Calls by address have four advantages. The
kernel stays small. Functions that no setting uses are never compiled. Two processes can compile at the same time
(:mod:`cold_start`). Additions from outside the package (a tyre, a kind of degradation, a reward term) do not require
the rest to be compiled again.
"""

from __future__ import annotations

from collections.abc import Callable
from dis import get_instructions
from types import FunctionType
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import numpy as np
from llvmlite import ir
from numba import from_dtype, types
from numba.core import cgutils
from numba.core.caching import NullCache
from numba.core.ccallback import CFunc
from numba.core.errors import NumbaError, TypingError
from numba.extending import intrinsic

from shared_control_env.core.compile.cache import cache_of
from shared_control_env.core.compile.jit import ARITHMETIC, is_interpreted
from shared_control_env.core.records import record_dtype

PACKAGE = __name__.partition(".")[0]

VECTOR = types.Array(types.float64, 1, "C")
"""Numba's type of a one-dimensional array of double-precision floats."""

MATRIX = types.Array(types.float64, 2, "C")
"""Numba's type of a two-dimensional array of double-precision floats."""

SINGLES = types.Array(types.float32, 1, "C")
"""Numba's type of a one-dimensional array of single-precision floats."""

_interpreted: list[Callable[..., Any]] = [lambda: None]
"""Functions of a core that runs as Python; the index is the address. The first entry reserves address 0."""


def compiled_type(kind: Any) -> Any:
    """Numba's type that corresponds to a Python type.

    Args:
        kind: None, ``float``, ``int``, ``bool``, a tuple of types, a structured NumPy type, one of numba's types, a
            class of :mod:`core.records` or :mod:`core.parameters`, which stands for a record with its fields, or
            ``Annotated[type, numba's type]``.
    """
    if get_origin(kind) is Annotated:
        kind = get_args(kind)[1]
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
    """Numba's type of a named tuple that is passed as a tuple and not as a record; its fields may be records.

    Args:
        kind: class of the named tuple.
    """
    return types.NamedTuple([compiled_type(hint) for hint in get_type_hints(kind, include_extras=True).values()], kind)


def array_of(fields_of: type) -> Any:
    """Numba's type of a one-dimensional array of records.

    Args:
        fields_of: class of :mod:`core.records` or :mod:`core.parameters` with the fields of a record.
    """
    return types.Array(compiled_type(fields_of), 1, "C")


class Interface:
    """Signature of a family of functions, any of which compiled code can call by its address.

    Args:
        result: type of the returned value, see :func:`compiled_type`.
        arguments: types of the arguments, see :func:`compiled_type`.

    Attributes:
        call: function for compiled code, ``call(address, *arguments)``.
    """

    def __init__(self, result: Any, *arguments: Any) -> None:
        self._signature = compiled_type(result)(*map(compiled_type, arguments))
        self._compiled: dict[Callable[..., Any], tuple[int, Any]] = {}
        self.call = _call_interpreted if is_interpreted() else _call_of(self._signature)

    def address(self, function: Callable[..., Any]) -> int:
        """Address of a function in memory. The function is compiled first, or read from numba's cache.

        Args:
            function: Python function, or a function that numba has already compiled.

        Raises:
            ValueError: if numba cannot compile the function with this signature.
        """
        plain: Any = getattr(function, "py_func", function)
        if not isinstance(plain, FunctionType):
            raise ValueError(f"{function!r} must be a function, defined by def, which numba compiles")
        if plain not in self._compiled:
            _check_raises_nothing(plain)
            self._compiled[plain] = self._interpret(function) if is_interpreted() else self._compile(plain)
        return self._compiled[plain][0]

    def _interpret(self, function: Callable[..., Any]) -> tuple[int, Any]:
        _interpreted.append(function)
        return len(_interpreted) - 1, function

    def _compile(self, function: Callable[..., Any]) -> tuple[int, Any]:
        options: Any = {**ARITHMETIC, "_nrt": False}
        signature = self._signature
        compiled: Any = CFunc(function, (signature.args, signature.return_type), locals={}, options=options)
        own = function.__module__.partition(".")[0] == PACKAGE
        # Changes of functions outside this package are not tracked, so they are compiled at every start.
        compiled._cache = cache_of(function) if own else NullCache()
        try:
            compiled.compile()
        except (NumbaError, TypeError) as error:
            name = f"{function.__module__}.{function.__qualname__}"
            raise ValueError(f"{name} cannot be compiled: {error}") from None
        return compiled.address, compiled  # the object is kept, since its code would be freed otherwise


def _check_raises_nothing(function: FunctionType) -> None:
    """Raise ValueError for a function that raises or asserts: compiled code cannot pass errors on."""
    if any(each.opname in ("RAISE_VARARGS", "LOAD_ASSERTION_ERROR") for each in get_instructions(function)):
        raise ValueError(f"{function.__qualname__} raises errors, which compiled code cannot pass on; return a number")


def _call_interpreted(address: int, *arguments: Any) -> Any:
    return _interpreted[address](*arguments)


def _call_of(signature: Any) -> Any:
    """Intrinsic for compiled code that calls a function with this signature at an address."""

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
