"""Numbers that users' code gives, as arrays of NumPy."""

from __future__ import annotations

from typing import Any

import numpy as np


def as_array(value: Any) -> Any:
    """A tensor of PyTorch as an array of NumPy, which NumPy by itself warns of; anything else as it is."""
    return value.detach().cpu().numpy() if hasattr(value, "detach") else value


def as_numbers(value: Any) -> np.ndarray:
    """Numbers as an array of floats; an empty one where they are none."""
    try:
        return np.asarray(as_array(value), dtype=float)
    except (TypeError, ValueError):
        return np.zeros(0)
