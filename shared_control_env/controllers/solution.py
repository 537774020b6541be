"""What a predictive controller returns."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Solution(NamedTuple):
    """Outcome of one solve.

    Attributes:
        command: ``[a, delta]`` [m/s^2, rad], shape (2,); the last feasible one where ``found`` is false.
        found: whether the solver gave a usable command.
        status: the solver's own code, see the controller.
        iterations: iterations done.
        primal_residual: violation of the constraints; 0 for a method that keeps them.
        dual_residual: stationarity.
        time: wall time [s]. It differs from run to run, so it never enters ``info``.
    """

    command: np.ndarray
    found: bool
    status: int
    iterations: int
    primal_residual: float
    dual_residual: float
    time: float
