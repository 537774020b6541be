"""What the kernel needs of the machine and numba does not offer: a call by address, and a count that threads share."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.errors import TypingError
from numba.extending import intrinsic
from numba.np.arrayobj import make_array


def call_of(signature: Any) -> Any:
    """A call of a function with this signature at an address, in compiled code."""

    @intrinsic
    def call(typing_context: Any, address: Any, *arguments: Any) -> Any:
        if tuple(arguments) != signature.args:
            raise TypingError("a solver is called with other types than those it is compiled for")

        def generate(context: Any, builder: Any, found: Any, values: Any) -> Any:
            result, *kinds = (context.get_value_type(kind) for kind in (signature.return_type, *signature.args))
            pointer = builder.inttoptr(values[0], ir.FunctionType(result, kinds).as_pointer())
            return builder.call(pointer, cgutils.unpack_tuple(builder, values[1]))

        return signature.return_type(address, types.StarArgTuple(arguments)), generate

    return call


def _fetch_add(typing_context: Any, counts: Any, index: Any, amount: Any) -> Any:
    """Add to an entry of a contiguous int64 array and return what it was, with no other thread in between."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        first = make_array(signature.args[0])(context, builder, values[0]).data
        return builder.atomic_rmw("add", builder.gep(first, [values[1]]), values[2], "monotonic")

    return types.int64(counts, types.int64, types.int64), generate


fetch_add: Any = intrinsic(_fetch_add)
