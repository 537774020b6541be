"""Lanes: eight double-precision numbers, one of each of eight environments, that are computed at once.

A step of a predictive controller is a chain of divisions, each of which waits for the last. The processor is idle in
between. With lanes the same instructions serve eight environments (SIMD). Compiled code adds, multiplies and compares
lanes as it does single numbers, so that one function, written once, serves both: the plant calls it with numbers, the
controllers of a block of environments with lanes.

Every operation acts on each lane alone and follows IEEE 754, so that an environment's result does not depend on its
neighbours, and equals to the bit what single numbers would give.

Where the core runs as Python (``NUMBA_DISABLE_JIT=1``), lanes are NumPy arrays of shape (8,).
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any, TypeAlias, TypeVar, cast

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel.models import PrimitiveModel
from numba.core.datamodel.registry import register_default
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic

from shared_control_env.core.compile.jit import is_interpreted

WIDTH = 8
"""Number of lanes: one register of AVX-512, two of AVX2."""

F = TypeVar("F", bound=Callable[..., Any])

Number: TypeAlias = Any
"""A float, or lanes of floats."""

Truth: TypeAlias = Any
"""A bool, or lanes of bools."""

_REAL = ir.VectorType(ir.DoubleType(), WIDTH)
_BITS = ir.VectorType(ir.IntType(1), WIDTH)


class _Lanes(types.Type):
    """Numba's type of lanes of floats."""

    def __init__(self) -> None:
        super().__init__("Lanes")


class _Mask(types.Type):
    """Numba's type of lanes of bools."""

    def __init__(self) -> None:
        super().__init__("Mask")


LANES, MASK = _Lanes(), _Mask()


@register_default(_Lanes)
class _LanesModel(PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _REAL)


@register_default(_Mask)
class _MaskModel(PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _BITS)


def _spread(builder: Any, value: Any) -> Any:
    """The same float in every lane."""
    nowhere, position = ir.Constant(_REAL, ir.Undefined), ir.IntType(32)
    first = builder.insert_element(nowhere, value, ir.Constant(position, 0))
    return builder.shuffle_vector(first, nowhere, ir.Constant(ir.VectorType(position, WIDTH), [0] * WIDTH))


def _as_lanes(context: Any, builder: Any, value: Any, kind: Any) -> Any:
    return value if kind is LANES else _spread(builder, context.cast(builder, value, kind, types.float64))


def _define(
    operation: Callable[..., Any], operands: tuple[Any, ...], result: Any, generate: Callable[..., Any]
) -> None:
    """Give a Python operator a meaning for lanes, or for lanes and numbers.

    Args:
        operation: function of :mod:`operator`.
        operands: types of the operands; ``types.Number`` stands for a float or an integer.
        result: type of the result.
        generate: ``generate(context, builder, values, kinds)`` makes the instruction.
    """

    def lower(context: Any, builder: Any, typed: Any, values: Any) -> Any:
        return generate(context, builder, values, typed.args)

    lower_builtin(operation, *operands)(lower)

    class Template(AbstractTemplate):
        def generic(self, found: Any, _: Any) -> Any:
            fits = len(found) == len(operands) and all(
                isinstance(kind, types.Float | types.Integer) if wanted is types.Number else kind is wanted
                for kind, wanted in zip(found, operands, strict=True)
            )
            return signature(result, *found) if fits else None

    infer_global(operation)(Template)


def _arithmetic(name: str) -> Callable[..., Any]:
    def generate(context: Any, builder: Any, values: Any, kinds: Any) -> Any:
        return getattr(builder, name)(*(_as_lanes(context, builder, *each) for each in zip(values, kinds, strict=True)))

    return generate


def _comparison(sign: str) -> Callable[..., Any]:
    def generate(context: Any, builder: Any, values: Any, kinds: Any) -> Any:
        operands = (_as_lanes(context, builder, *each) for each in zip(values, kinds, strict=True))
        return builder.fcmp_ordered(sign, *operands)

    return generate


for _operands in ((LANES, LANES), (LANES, types.Number), (types.Number, LANES)):
    for _operation, _name in (
        (operator.add, "fadd"),
        (operator.sub, "fsub"),
        (operator.mul, "fmul"),
        (operator.truediv, "fdiv"),
    ):
        _define(_operation, _operands, LANES, _arithmetic(_name))
    for _operation, _sign in (
        (operator.lt, "<"),
        (operator.le, "<="),
        (operator.gt, ">"),
        (operator.ge, ">="),
        (operator.eq, "=="),
    ):
        _define(_operation, _operands, MASK, _comparison(_sign))
_define(operator.neg, (LANES,), LANES, lambda context, builder, values, kinds: builder.fneg(values[0]))
_define(operator.and_, (MASK, MASK), MASK, lambda context, builder, values, kinds: builder.and_(*values))
_define(operator.or_, (MASK, MASK), MASK, lambda context, builder, values, kinds: builder.or_(*values))
_define(operator.invert, (MASK,), MASK, lambda context, builder, values, kinds: builder.not_(values[0]))


def _address(context: Any, builder: Any, kind: Any, row: Any) -> Any:
    """Address of the eight numbers of a row."""
    return builder.bitcast(context.make_array(kind)(context, builder, row).data, _REAL.as_pointer())


@intrinsic
def _load(_: Any, row: Any) -> Any:
    def generate(context: Any, builder: Any, typed: Any, values: Any) -> Any:
        loaded = builder.load(_address(context, builder, typed.args[0], values[0]))
        loaded.align = 8
        return loaded

    return LANES(row), generate


@intrinsic
def _spread_out(_: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, typed: Any, values: Any) -> Any:
        return _as_lanes(context, builder, values[0], typed.args[0])

    return LANES(value), generate


@intrinsic
def _store(_: Any, row: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, typed: Any, values: Any) -> Any:
        lanes = _as_lanes(context, builder, values[1], typed.args[1])
        builder.store(lanes, _address(context, builder, typed.args[0], values[0])).align = 8
        return context.get_dummy_value()

    return types.void(row, value), generate


@intrinsic
def _choose(_: Any, condition: Any, then: Any, otherwise: Any) -> Any:
    if condition is not MASK:  # one bool; both values are single numbers

        def generate_one(context: Any, builder: Any, typed: Any, values: Any) -> Any:
            chosen = [
                context.cast(builder, *each, types.float64) for each in zip(values[1:], typed.args[1:], strict=True)
            ]
            return builder.select(values[0], *chosen)

        return types.float64(condition, then, otherwise), generate_one

    def generate(context: Any, builder: Any, typed: Any, values: Any) -> Any:
        pairs = zip(values[1:], typed.args[1:], strict=True)
        return builder.select(values[0], *(_as_lanes(context, builder, *each) for each in pairs))

    return LANES(condition, then, otherwise), generate


@intrinsic
def _holds_in_any(_: Any, condition: Any) -> Any:
    def generate(context: Any, builder: Any, typed: Any, values: Any) -> Any:
        bits = builder.bitcast(values[0], ir.IntType(WIDTH))
        return builder.icmp_unsigned("!=", bits, ir.Constant(bits.type, 0))

    return types.boolean(condition), generate


@intrinsic
def _root(_: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, typed: Any, values: Any) -> Any:
        kind, suffix = (_REAL, f"v{WIDTH}f64") if typed.args[0] is LANES else (ir.DoubleType(), "f64")
        form = ir.FunctionType(kind, [kind])
        return builder.call(cgutils.get_or_insert_function(builder.module, form, f"llvm.sqrt.{suffix}"), values)

    return value(value), generate


def _compiled_as(intrinsic: Any) -> Callable[[F], F]:
    """Decorator: compiled code calls an intrinsic; the function is for a core that runs as Python."""

    def decorate(function: F) -> F:
        return function if is_interpreted() else cast(F, intrinsic)

    return decorate


@_compiled_as(_load)
def load(row: np.ndarray) -> Number:
    """Lanes from a row of memory.

    Args:
        row: contiguous array, shape (WIDTH,).
    """
    return row.copy()


@_compiled_as(_spread_out)
def spread(value: float) -> Number:
    """Lanes that all hold the same number.

    Args:
        value: the number.
    """
    return np.full(WIDTH, float(value))


@_compiled_as(_store)
def store(row: np.ndarray, value: Number) -> None:
    """Write lanes to a row of memory.

    Args:
        row: contiguous array, written, shape (WIDTH,).
        value: lanes, or one number for all.
    """
    row[:] = value


@_compiled_as(_choose)
def choose(condition: Truth, then: Number, otherwise: Number) -> Number:
    """One of two numbers, in each lane.

    Args:
        condition: which of them.
        then: the number where the condition holds.
        otherwise: the number where it does not.
    """
    return np.where(condition, then, otherwise) if np.ndim(condition) else (then if condition else otherwise)


@_compiled_as(_holds_in_any)
def holds_in_any(condition: Truth) -> bool:
    """Whether a condition holds in any lane.

    Args:
        condition: lanes of bools.
    """
    return bool(np.any(condition))


@_compiled_as(_root)
def root(x: Number) -> Number:
    """Square root, in each lane.

    Args:
        x: a number, or lanes.
    """
    return np.sqrt(x)
