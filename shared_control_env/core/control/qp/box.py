"""Solver for strictly convex quadratic programs with bounds, by a primal active-set method."""

from __future__ import annotations

import numpy as np

from shared_control_env.core.compile.jit import jit

_FREE, _AT_LOW, _AT_HIGH = 0, 1, 2


@jit
def _solve_free(
    n: int,
    H: np.ndarray,
    g: np.ndarray,
    x: np.ndarray,
    bound: np.ndarray,
    factor: np.ndarray,
    solution: np.ndarray,
) -> None:
    """Minimise over the free variables, with the others held, by a Cholesky factorisation.

    The diagonal of ``factor`` holds the reciprocals of the Cholesky factor's diagonal, which avoids repeated divisions.
    The values of the free variables are written to ``solution``.
    """
    m = 0
    for i in range(n):
        if bound[i] != _FREE:
            continue
        rhs = -g[i]
        for j in range(n):
            if bound[j] != _FREE:
                rhs -= H[i, j] * x[j]
        k = 0
        for j in range(i + 1):
            if bound[j] == _FREE:
                entry = H[i, j]
                for q in range(k):
                    entry -= factor[m, q] * factor[k, q]
                factor[m, k] = entry * factor[k, k] if k < m else 1.0 / entry**0.5
                k += 1
        for q in range(m):
            rhs -= factor[m, q] * solution[q]
        solution[m] = rhs * factor[m, m]
        m += 1
    for k in range(m - 1, -1, -1):
        for q in range(k + 1, m):
            solution[k] -= factor[q, k] * solution[q]
        solution[k] *= factor[k, k]


@jit
def solve_box_qp(
    n: int,
    H: np.ndarray,
    g: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    x: np.ndarray,
    factor: np.ndarray,
    solution: np.ndarray,
    bound: np.ndarray,
) -> None:
    """Minimise ``x^T H x / 2 + g^T x`` subject to ``low <= x <= high``.

    The method starts at 0, which must lie within the bounds. It moves to the minimum over the free variables, or to the
    first bound on the way. At a minimum it frees the variable whose multiplier violates its sign condition most. It
    ends when no multiplier does (Nocedal & Wright, Numerical Optimization, Algorithm 16.3, for bounds alone).

    Args:
        n: number of variables; the arrays may be longer.
        H: positive definite matrix, shape (n, n).
        g: linear term, shape (n,).
        low, high: bounds with ``low <= 0 <= high``, shape (n,).
        x: minimiser, written, shape (n,).
        factor, solution: scratch, shapes (n, n) and (n,).
        bound: scratch, integer, shape (n,).
    """
    for i in range(n):
        x[i] = 0.0
        bound[i] = _FREE
    for _ in range(6 * n):
        _solve_free(n, H, g, x, bound, factor, solution)
        length, blocking = 1.0, -1
        k = 0
        for i in range(n):
            if bound[i] != _FREE:
                continue
            step = solution[k] - x[i]
            k += 1
            if step == 0.0:
                continue
            room = (low[i] - x[i] if step < 0.0 else high[i] - x[i]) / step
            if room < length:
                length, blocking = room, i
        k = 0
        for i in range(n):
            if bound[i] == _FREE:
                x[i] += length * (solution[k] - x[i])
                k += 1
        if blocking >= 0:
            below = high[blocking] - x[blocking] > x[blocking] - low[blocking]
            bound[blocking] = _AT_LOW if below else _AT_HIGH
            x[blocking] = low[blocking] if below else high[blocking]
            continue
        wrong, worst = -1, -1e-12
        for i in range(n):
            if bound[i] == _FREE:
                continue
            multiplier = g[i]
            for j in range(n):
                multiplier += H[i, j] * x[j]
            if bound[i] == _AT_HIGH:
                multiplier = -multiplier
            if multiplier < worst:
                wrong, worst = i, multiplier
        if wrong < 0:
            return
        bound[wrong] = _FREE
