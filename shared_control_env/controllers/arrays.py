"""Arrays between the package and user code: numbers that user code returns, and views that it must not change."""

from __future__ import annotations

from typing import Any

import numpy as np


def as_array(value: Any) -> Any:
    """Convert a PyTorch tensor to a NumPy array; return any other value unchanged.

    NumPy's own conversion of a tensor would give a warning.

    Args:
        value: any value.
    """
    return value.detach().cpu().numpy() if hasattr(value, "detach") else value


def as_numbers(value: Any) -> np.ndarray:
    """Convert numbers to an array of floats; the array is empty if the value is not numeric.

    Args:
        value: any value.
    """
    try:
        return np.asarray(as_array(value), dtype=float)
    except (TypeError, ValueError):
        return np.zeros(0)


def read_only(array: np.ndarray) -> np.ndarray:
    """A read-only view of an array.

    Args:
        array: the array, of any shape.
    """
    view = array.view()
    view.flags.writeable = False
    return view
