"""An atomic counter that several threads share."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic
from numba.np.arrayobj import make_array

from shared_control_env.core.compile.jit import is_interpreted


def _fetch_add(typing_context: Any, counts: Any, index: Any, amount: Any) -> Any:
    """Add to an entry of a contiguous int64 array and return its previous value, as one atomic operation."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        first = make_array(signature.args[0])(context, builder, values[0]).data
        return builder.atomic_rmw("add", builder.gep(first, [values[1]]), values[2], "monotonic")

    return types.int64(counts, types.int64, types.int64), generate


def _add(counts: np.ndarray, index: int, amount: int) -> int:
    """Add to an entry and return its previous value; used where the core runs as Python, in one thread."""
    before = int(counts[index])
    counts[index] += amount
    return before


fetch_add: Any = _add if is_interpreted() else intrinsic(_fetch_add)
"""``fetch_add(counts, index, amount)``: add to an entry and return its previous value, as one atomic operation."""
