"""The order of the conditions: Williams Latin squares, balanced for position and for what came just before."""

from __future__ import annotations

import numpy as np


def williams(n: int) -> np.ndarray:
    """Williams Latin square of n conditions.

    Every condition stands in every position equally often, and follows every other one equally often (Williams,
    Australian Journal of Scientific Research A 2, 1949). The first row is 0, 1, n-1, 2, n-2, ...; the others add 1. An
    odd n needs the mirrored rows too.

    Args:
        n: number of conditions.

    Returns:
        Orders, one per row, shape (n, n) for an even n and for n = 1, else (2 n, n).
    """
    first = [0]
    low, high = 1, n - 1
    while low <= high:
        first.append(low)
        if low < high:
            first.append(high)
        low, high = low + 1, high - 1
    square = (np.array(first)[None] + np.arange(n)[:, None]) % n
    return square if n % 2 == 0 or n == 1 else np.vstack([square, square[:, ::-1]])


def order_of(number: int, n: int, seed: int) -> list[int]:
    """Order of the conditions for a person.

    The seed shuffles which condition is which, and the rows.

    Args:
        number: number of the person, from 0 in the order of enrolment.
        n: number of conditions.
        seed: seed of the plan.

    Returns:
        Indices of the conditions.
    """
    rng = np.random.default_rng(seed)
    square = williams(n)
    names, rows = rng.permutation(n), rng.permutation(len(square))
    return names[square[rows[number % len(square)]]].tolist()
