"""Result of a predictive controller."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Solution(NamedTuple):
    """Outcome of one solve.

    Attributes:
        command: ``[a, delta]`` [m/s^2, rad], shape (2,); the last feasible command where ``found`` is False.
        found: whether the solver found a usable command.
        status: the solver's own status code; see the controller.
        iterations: number of iterations.
        primal_residual: violation of the constraints; 0 for a method whose iterates stay feasible.
        dual_residual: residual of the stationarity condition.
        time: wall time [s]. It differs from run to run, so it never enters ``info``.
    """

    command: np.ndarray
    found: bool
    status: int
    iterations: int
    primal_residual: float
    dual_residual: float
    time: float
