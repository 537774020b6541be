"""Solver for strictly convex quadratic programs with bounds, by a primal active-set method, one program per lane."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from shared_control_env.core.compile.jit import jit, jit_inlined
from shared_control_env.core.compile.lanes import WIDTH, Truth, choose, holds_in_any, load, root, spread, store
from shared_control_env.core.records import MAX_CONTROL, record_dtype

_N = 2 * MAX_CONTROL


class Workspace:
    """Scratch memory of the solver.

    Attributes:
        held: -1 where a variable is held at its lower bound, 1 at its upper bound, 0 where it is free.
        factor: Cholesky factor of the free variables' part of the matrix; a held variable has a row of the unit matrix.
            The diagonal holds reciprocals, which avoids repeated divisions.
        solution: minimiser over the free variables; the held variables keep their values.
    """

    held: Annotated[np.ndarray, (_N, WIDTH)]
    factor: Annotated[np.ndarray, (_N, _N, WIDTH)]
    solution: Annotated[np.ndarray, (_N, WIDTH)]


WORKSPACE = record_dtype(Workspace)


@jit_inlined
def _solve_free(n: int, H: np.ndarray, g: np.ndarray, x: np.ndarray, work: Workspace) -> None:
    """Minimise over the free variables, with the others held, and write the minimiser to ``work.solution``."""
    held, factor, solution = work.held, work.factor, work.solution
    for i in range(n):
        free = load(held[i]) == 0.0
        rhs = -load(g[i])
        for j in range(n):
            entry = load(H[max(i, j), min(i, j)]) * load(x[j])
            rhs = rhs - choose(load(held[j]) == 0.0, 0.0, entry)
        rhs = choose(free, rhs, load(x[i]))
        for j in range(i):
            entry = choose(free & (load(held[j]) == 0.0), load(H[i, j]), 0.0)
            for k in range(j):
                entry = entry - load(factor[i, k]) * load(factor[j, k])
            entry = entry * load(factor[j, j])
            store(factor[i, j], entry)
            rhs = rhs - entry * load(solution[j])
        pivot = choose(free, load(H[i, i]), 1.0)
        for k in range(i):
            pivot = pivot - load(factor[i, k]) * load(factor[i, k])
        pivot = 1.0 / root(pivot)
        store(factor[i, i], pivot)
        store(solution[i], rhs * pivot)
    for i in range(n - 1, -1, -1):
        value = load(solution[i])
        for j in range(i + 1, n):
            value = value - load(factor[j, i]) * load(solution[j])
        store(solution[i], value * load(factor[i, i]))


@jit
def solve_box_qp(
    n: int,
    H: np.ndarray,
    g: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    wanted: Truth,
    x: np.ndarray,
    work: Workspace,
) -> None:
    """Minimise ``x^T H x / 2 + g^T x`` subject to ``low <= x <= high`` in every lane.

    The method starts at 0, which must lie within the bounds. It moves to the minimum over the free variables, or to the
    first bound on the way. At a minimum it frees the variable whose multiplier violates its sign condition most. It
    ends when no multiplier does (Nocedal & Wright, Numerical Optimization, Algorithm 16.3, for bounds alone).

    Args:
        n: number of variables; the arrays may be longer.
        H: positive definite matrices; the entries [i, j] with j <= i are used, shape (n, n, WIDTH).
        g: linear terms, shape (n, WIDTH).
        low, high: bounds with ``low <= 0 <= high``, shape (n, WIDTH).
        wanted: lanes whose program is solved; the others need not hold one.
        x: minimisers, written, shape (n, WIDTH).
        work: record of :data:`WORKSPACE`.
    """
    held, solution = work.held, work.solution
    for i in range(n):
        store(x[i], 0.0)
        store(held[i], 0.0)
    for _ in range(6 * n):
        _solve_free(n, H, g, x, work)
        length, blocking = spread(1.0), spread(-1.0)
        for i in range(n):
            at = load(x[i])
            step = load(solution[i]) - at
            room = choose(step < 0.0, load(low[i]) - at, load(high[i]) - at) / step
            nearer = (load(held[i]) == 0.0) & ((step < 0.0) | (step > 0.0)) & (room < length)
            length, blocking = choose(nearer, room, length), choose(nearer, 1.0 * i, blocking)
        blocked = wanted & (blocking >= 0.0)
        at_minimum = wanted & (blocking < 0.0)
        for i in range(n):
            at, bottom, top = load(x[i]), load(low[i]), load(high[i])
            moved = wanted & (load(held[i]) == 0.0)
            at = choose(moved, at + length * (load(solution[i]) - at), at)
            hit = blocked & (blocking == 1.0 * i)
            below = top - at > at - bottom
            store(held[i], choose(hit, choose(below, -1.0, spread(1.0)), load(held[i])))
            store(x[i], choose(hit, choose(below, bottom, top), at))
        wrong, worst = spread(-1.0), spread(-1e-12)
        if holds_in_any(at_minimum):
            for i in range(n):
                side = load(held[i])
                multiplier = load(g[i])
                for j in range(n):
                    multiplier = multiplier + load(H[max(i, j), min(i, j)]) * load(x[j])
                multiplier = choose(side > 0.0, -multiplier, multiplier)
                worse = at_minimum & ~(side == 0.0) & (multiplier < worst)
                worst, wrong = choose(worse, multiplier, worst), choose(worse, 1.0 * i, wrong)
            for i in range(n):
                store(held[i], choose(at_minimum & (wrong == 1.0 * i), 0.0, load(held[i])))
        wanted = wanted & ~(at_minimum & (wrong < 0.0))
        if not holds_in_any(wanted):
            return
