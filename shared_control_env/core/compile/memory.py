"""Numbers at an address: tables of any length that a record names, without an array in the record."""

from __future__ import annotations

import ctypes
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from shared_control_env.core.compile.jit import is_interpreted


def _number_at(typing_context: Any, address: Any, index: Any) -> Any:
    """The double that lies ``index`` doubles after an address."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        first = builder.inttoptr(values[0], ir.DoubleType().as_pointer())
        return builder.load(builder.gep(first, [values[1]]))

    return types.float64(types.int64, types.int64), generate


def _number(address: int, index: int) -> float:
    """The double at an address, where the core runs as Python."""
    return ctypes.c_double.from_address(int(address) + 8 * int(index)).value


number_at: Any = _number if is_interpreted() else intrinsic(_number_at)
"""``number_at(address, index)``: entry of a contiguous array of float64 that someone else keeps alive."""
