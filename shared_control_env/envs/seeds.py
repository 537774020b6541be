"""Seeds as users give them."""

from __future__ import annotations

from operator import index
from typing import Any


def checked_seed(seed: Any, what: str = "seed") -> int | None:
    """A seed as a Python integer; NumPy's integers and arrays without dimensions are such too.

    Raises:
        ValueError: if it is neither None nor an integer from 0 on.
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
