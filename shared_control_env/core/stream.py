"""NumPy's default generator in compiled code: the same numbers from the same state, for many generators in one array.

The state of a generator is a row of words: the 128-bit state and increment of PCG64 (M. E. O'Neill, *PCG: A family of
simple fast space-efficient statistically good algorithms for random number generation*, 2014, variant XSL-RR), each as
its high and its low word; then whether half a word is left over, and that half.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from shared_control_env.core.compile.jit import jit

WORDS = 6
"""Length of a generator's row."""

_HIGH, _LOW, _INC_HIGH, _INC_LOW, _HAS_HALF, _HALF = range(WORDS)

_MULTIPLIER = np.uint64(0x2360ED051FC65DA4), np.uint64(0x4385DF649FCCF645)
_MASK = np.uint64(0xFFFFFFFF)
_32, _58, _63, _64, _11 = (np.uint64(n) for n in (32, 58, 63, 64, 11))
_UNIT = 2.0**-53
_ZERO, _ONE = np.uint64(0), np.uint64(1)
_WORD = 1 << 64


def state_of(generator: np.random.Generator, row: np.ndarray) -> None:
    """Write the state of a generator to a row.

    Args:
        generator: a generator on PCG64.
        row: written, uint64, shape (WORDS,).
    """
    state: Any = generator.bit_generator.state
    for i, word in enumerate((state["state"]["state"], state["state"]["inc"])):
        row[2 * i], row[2 * i + 1] = divmod(word, _WORD)
    row[_HAS_HALF], row[_HALF] = state["has_uint32"], state["uinteger"]


def set_state(generator: np.random.Generator, row: np.ndarray) -> None:
    """Give a generator the state of a row.

    Args:
        generator: a generator on PCG64.
        row: uint64, shape (WORDS,).
    """
    words = [int(word) for word in row]
    generator.bit_generator.state = {
        "bit_generator": "PCG64",
        "state": {"state": words[_HIGH] * _WORD + words[_LOW], "inc": words[_INC_HIGH] * _WORD + words[_INC_LOW]},
        "has_uint32": words[_HAS_HALF],
        "uinteger": words[_HALF],
    }


@jit
def _product_high(a: np.uint64, b: np.uint64) -> np.uint64:
    """High word of the product of two words."""
    a_high, a_low, b_high, b_low = a >> _32, a & _MASK, b >> _32, b & _MASK
    middle = a_high * b_low + ((a_low * b_low) >> _32)
    return a_high * b_high + (middle >> _32) + (((middle & _MASK) + a_low * b_high) >> _32)


@jit
def _next_word(row: np.ndarray) -> np.uint64:
    """Advance a generator, and return its next word: ``s <- s m + c``, then the rotated fold of s."""
    high, low = row[_HIGH], row[_LOW]
    new_low = low * _MULTIPLIER[1]
    new_high = _product_high(low, _MULTIPLIER[1]) + high * _MULTIPLIER[1] + low * _MULTIPLIER[0]
    new_low += row[_INC_LOW]
    new_high += row[_INC_HIGH] + (_ONE if new_low < row[_INC_LOW] else _ZERO)
    row[_HIGH], row[_LOW] = new_high, new_low
    folded, turn = new_high ^ new_low, new_high >> _58
    return (folded >> turn) | (folded << ((_64 - turn) & _63))


@jit
def _next_half(row: np.ndarray) -> np.uint64:
    """The next 32 bits of a generator: the low half of a word, then its high half."""
    if row[_HAS_HALF] != _ZERO:
        row[_HAS_HALF] = _ZERO
        return row[_HALF]
    word = _next_word(row)
    row[_HAS_HALF], row[_HALF] = _ONE, word >> _32
    return word & _MASK


@jit
def random(row: np.ndarray) -> float:
    """``Generator.random()``: uniform in [0, 1).

    Args:
        row: state of the generator, advanced, uint64, shape (WORDS,).
    """
    return np.float64(_next_word(row) >> _11) * _UNIT


@jit
def integer(row: np.ndarray, n: int) -> np.int64:
    """``Generator.integers(n)``: uniform in 0 to n - 1, by Lemire's method; a single value needs no number.

    Args:
        row: state of the generator, advanced, uint64, shape (WORDS,).
        n: number of values, 1 to 2^32 - 1.
    """
    if n <= 1:
        return np.int64(0)
    count = np.uint64(n)
    product = _next_half(row) * count
    if (product & _MASK) < count:
        threshold = (_MASK + _ONE - count) % count
        while (product & _MASK) < threshold:
            product = _next_half(row) * count
    return np.int64(product >> _32)
