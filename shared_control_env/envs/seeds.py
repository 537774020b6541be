"""The check of seeds that users give."""

from __future__ import annotations

from operator import index
from typing import Any


def checked_seed(seed: Any, what: str = "seed") -> int | None:
    """Check a seed and convert it to a Python integer. NumPy integers and 0-d integer arrays are accepted.

    Args:
        seed: the seed, or None.
        what: name of the seed for the error message.

    Returns:
        The seed, or None if none is given.

    Raises:
        ValueError: if the seed is neither None nor a non-negative integer.
    """
    if seed is None:
        return None
    try:
        number = index(seed)
    except TypeError:
        number = -1
    if number < 0 or isinstance(seed, bool):
        raise ValueError(f"{what} = {seed!r} must be an integer from 0 on, or None")
    return number
