"""Solver for small, dense, strictly convex quadratic programs: the dual active-set method of Goldfarb and Idnani.

::

    min  x^T P x / 2 + q^T x      subject to   low <= A x <= high
    P x + q + A^T multipliers = 0,   a multiplier is >= 0 at the upper and <= 0 at the lower bound (OSQP's sign)

The method (Goldfarb & Idnani, A numerically stable dual method for solving strictly convex quadratic programs,
Mathematical Programming 27, 1983) starts at the unconstrained minimum and adds one violated row after the other.
Programs with few binding rows therefore take few iterations. The method needs no feasible starting point.

Every active row is stored as ``normal^T x <= c`` with a multiplier ``u >= 0``: the row itself at its upper bound, the
negative row at its lower bound. A matrix T with ``T P T^T = I`` transforms x to ``y``, ``x = T^T y``. In y the level
sets of the cost are spheres. T is rotated so that the matrix N of the active normals occupies only the first of the new
axes, ``T N = [R; 0]`` with R upper triangular. The active rows then fix the first entries of y; the others are free.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np

from shared_control_env.core.compile.jit import jit, jit_inlined
from shared_control_env.core.records import MAX_CONTROL, MAX_HORIZON, record_dtype

SOLVED, ITERATION_LIMIT, FAILED = 0, 1, 2
"""Statuses. FAILED: infeasible, not strictly convex, too large, not finite, or too ill-conditioned to solve."""

MAX_VARIABLES = 2 * MAX_CONTROL + 2
"""Largest number of variables: the commands and two slacks."""

MAX_ROWS = 2 * MAX_HORIZON + 1 + MAX_VARIABLES
"""Largest number of rows: both sides of the safe area at every stage, its end, and one bound per variable."""

UNBOUNDED = 1e20
"""A bound of at least this size, an infinite one included, means no bound, as in OSQP: no row reaches this value."""

FEASIBLE = 1e-10
"""Largest violation that counts as feasible, relative to the row's absolute sum times max(1, |x|) [-]."""

ACCURATE = 1e-8
"""Largest relative residual of a solution [-]; with a larger one the status is FAILED."""

_NEGLIGIBLE = 1e-11
"""Relative size below which a value counts as rounding error [-].

Such a normal depends linearly on the active normals. Such a rate leaves its multiplier unchanged.
"""

_SINGULAR = 1e-14
"""Relative size of a Cholesky pivot below which P counts as not positive definite [-]."""


class Workspace:
    """Scratch memory of one solver; one record per thread.

    Attributes:
        T: transformation with T P T^T = I.
        R: upper triangular matrix of the active normals; at the beginning the Cholesky factor of P.
        y: transformed point, x = T^T y.
        d: T times the normal of the row to add.
        r: rates at which the active multipliers decrease.
        u: multipliers of the active rows, in the order of the columns of R.
        row: indices of the active rows, in the same order.
        side: state of every row: 1 active at its upper bound, -1 active at its lower bound, 0 not active.
        size: sum of the absolute entries of every row.
        dual: residual P x + q + N u.
        gap: residual c - N^T x.
    """

    T: Annotated[np.ndarray, (MAX_VARIABLES, MAX_VARIABLES)]
    R: Annotated[np.ndarray, (MAX_VARIABLES, MAX_VARIABLES)]
    y: Annotated[np.ndarray, (MAX_VARIABLES,)]
    d: Annotated[np.ndarray, (MAX_VARIABLES,)]
    r: Annotated[np.ndarray, (MAX_VARIABLES,)]
    u: Annotated[np.ndarray, (MAX_VARIABLES,)]
    row: Annotated[np.ndarray, (MAX_VARIABLES,), np.int64]
    side: Annotated[np.ndarray, (MAX_ROWS,), np.int64]
    size: Annotated[np.ndarray, (MAX_ROWS,)]
    dual: Annotated[np.ndarray, (MAX_VARIABLES,)]
    gap: Annotated[np.ndarray, (MAX_VARIABLES,)]


WORKSPACE = record_dtype(Workspace)


@jit_inlined
def solve_qp(
    n: int,
    m: int,
    P: np.ndarray,
    q: np.ndarray,
    A: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    x: np.ndarray,
    multipliers: np.ndarray,
    work: Workspace,
) -> tuple[int, int, float, float]:
    """Minimise ``x^T P x / 2 + q^T x`` subject to ``low <= A x <= high``.

    The variables should be of order one, since the tolerances are relative to max(1, |x|). The function never raises
    an exception.

    Args:
        n, m: numbers of variables and rows, 1 <= n <= MAX_VARIABLES, 0 <= m <= MAX_ROWS; the arrays may be longer.
        P: quadratic cost, symmetric and positive definite, shape (n, n).
        q: linear cost, shape (n,).
        A: constraint matrix, shape (m, n).
        low, high: bounds of the rows, shape (m,); equal for an equality, beyond +-UNBOUNDED for no bound.
        x: minimiser, written, shape (n,); not feasible if the status is not SOLVED.
        multipliers: multipliers of the rows, written, shape (m,).
        work: record of :data:`WORKSPACE`.

    Returns:
        Status (SOLVED, ITERATION_LIMIT or FAILED), number of rows added and dropped, largest violation of a row, and
        largest entry of ``|P x + q + A^T multipliers|``; both residuals are infinite for invalid data.
    """
    if not (_begin(n, m, P, q, A, low, high, work) and _factorise(n, P, work)):
        x[:n] = 0.0
        multipliers[:m] = 0.0
        return FAILED, 0, np.inf, np.inf
    status, iterations, active = _iterate(n, m, q, A, low, high, x, work)
    _refine(n, active, P, q, A, low, high, x, work)
    _write_multipliers(m, active, low, high, multipliers, work)
    primal, relative_primal = _primal_residual(n, m, A, low, high, x, work)
    dual, relative_dual = _dual_residual(n, active, P, q, A, x, multipliers, work)
    # The comparison is written so that a residual that is not a number also fails.
    if status == SOLVED and not (relative_primal <= ACCURATE and relative_dual <= ACCURATE):
        status = FAILED
    return status, iterations, primal, dual


@jit
def _begin(
    n: int,
    m: int,
    P: np.ndarray,
    q: np.ndarray,
    A: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    work: Workspace,
) -> bool:
    """Clear the active set and compute the row sizes; False if the data are too large, not finite or contradictory."""
    if not (1 <= n <= MAX_VARIABLES and 0 <= m <= MAX_ROWS):
        return False
    for i in range(m):
        size = 0.0
        for j in range(n):
            size += abs(A[i, j])
        work.size[i] = size
        work.side[i] = 0
        if not (size < np.inf and low[i] <= high[i] and low[i] < UNBOUNDED and high[i] > -UNBOUNDED):
            return False
    for i in range(n):
        size = abs(q[i])
        for j in range(n):
            size += abs(P[i, j])
        if not size < np.inf:
            return False
    return True


@jit
def _factorise(n: int, P: np.ndarray, work: Workspace) -> bool:
    """Compute T = L^-1 from the Cholesky factor L, P = L L^T; False if P is not positive definite."""
    L, T = work.R, work.T
    for i in range(n):
        for j in range(i):
            entry = P[i, j]
            for k in range(j):
                entry -= L[i, k] * L[j, k]
            L[i, j] = entry * T[j, j]
        pivot = P[i, i]
        for k in range(i):
            pivot -= L[i, k] * L[i, k]
        if not pivot > _SINGULAR * P[i, i]:
            return False
        T[i, i] = 1.0 / pivot**0.5
        for j in range(n):
            if j != i:
                T[i, j] = 0.0
        for k in range(i):
            scaled = L[i, k] * T[i, i]
            for j in range(k + 1):
                T[i, j] -= scaled * T[k, j]
    return True


@jit
def _iterate(
    n: int,
    m: int,
    q: np.ndarray,
    A: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    x: np.ndarray,
    work: Workspace,
) -> tuple[int, int, int]:
    """Main iteration: add violated rows, and drop active rows where needed, until no row is violated.

    Returns:
        Status, number of rows added and dropped, and number of active rows.
    """
    y, d, r, u = work.y, work.d, work.r, work.u
    for j in range(n):
        y[j] = -_dot(n, work.T[j], q)
    active, p, side, u_p = 0, -1, 0, 0.0
    limit = 4 * (n + m)
    for iteration in range(limit + 1):
        _to_x(n, work, x)
        if p < 0:
            p, side = _most_violated(n, m, A, low, high, x, work)
            u_p = 0.0
        if p < 0:
            return SOLVED, iteration, active
        if iteration == limit:
            break
        free, total = _transform_normal(n, active, A[p], side, work)
        _solve_upper(active, work.R, d, r)
        to_drop, dropped = _until_multiplier_vanishes(active, low, high, work)
        # If the normal depends linearly on the active normals, only the multipliers change.
        independent = free > _NEGLIGIBLE * _NEGLIGIBLE * total
        violation = side * (_dot(n, A[p], x) - (high[p] if side > 0 else low[p]))
        to_add = violation / free if independent else np.inf
        step = min(to_add, to_drop)
        if step == np.inf:
            return FAILED, iteration, active  # no point satisfies both this row and the active rows
        if independent:
            for j in range(active, n):
                y[j] -= step * d[j]
        for k in range(active):
            moved = u[k] - step * r[k]
            u[k] = moved if low[work.row[k]] == high[work.row[k]] else max(moved, 0.0)
        u_p += step
        if to_add <= to_drop:
            _add(n, active, p, side, u_p, free, work)
            active += 1
            p = -1
        else:
            _drop(n, active, dropped, work)
            active -= 1
    return ITERATION_LIMIT, limit, active


@jit
def _dot(n: int, a: np.ndarray, b: np.ndarray) -> float:
    """Scalar product of the first n entries of two vectors."""
    value = 0.0
    for j in range(n):
        value += a[j] * b[j]
    return value


@jit
def _to_x(n: int, work: Workspace, x: np.ndarray) -> None:
    """Transform the point y to x = T^T y."""
    T, y = work.T, work.y
    for c in range(n):
        x[c] = 0.0
    for j in range(n):
        for c in range(n):
            x[c] += y[j] * T[j, c]


@jit
def _norm(n: int, x: np.ndarray) -> float:
    """Reference size for violations: the largest absolute entry of x, and at least 1."""
    size = 1.0
    for j in range(n):
        size = max(size, abs(x[j]))
    return size


@jit
def _most_violated(
    n: int,
    m: int,
    A: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    x: np.ndarray,
    work: Workspace,
) -> tuple[int, int]:
    """Row that x violates most, relative to the row's size, and the violated bound, 1 or -1; or -1, 0."""
    row, side, worst = -1, 0, FEASIBLE * _norm(n, x)
    for i in range(m):
        if work.side[i] != 0:
            continue
        value = _dot(n, A[i], x)
        allowed = worst * work.size[i]
        if value - high[i] > allowed:
            worst = (value - high[i]) / work.size[i]
            row, side = i, 1
        elif low[i] - value > allowed:
            worst = (low[i] - value) / work.size[i]
            row, side = i, -1
    return row, side


@jit
def _transform_normal(n: int, active: int, a: np.ndarray, side: int, work: Workspace) -> tuple[float, float]:
    """Compute d = T normal; return the squared norms of its part outside the active normals and of the whole vector."""
    d = work.d
    fixed, free = 0.0, 0.0
    for j in range(n):
        d[j] = side * _dot(n, work.T[j], a)
        if j < active:
            fixed += d[j] * d[j]
        else:
            free += d[j] * d[j]
    return free, fixed + free


@jit
def _solve_upper(k: int, R: np.ndarray, rhs: np.ndarray, out: np.ndarray) -> None:
    """Solve ``R out = rhs`` with the leading k by k upper triangle; ``out`` may be ``rhs``."""
    for i in range(k - 1, -1, -1):
        value = rhs[i]
        for j in range(i + 1, k):
            value -= R[i, j] * out[j]
        out[i] = value / R[i, i]


@jit
def _until_multiplier_vanishes(active: int, low: np.ndarray, high: np.ndarray, work: Workspace) -> tuple[float, int]:
    """Longest step that keeps all multipliers >= 0, and the active row that limits the step; or inf, -1.

    The multipliers of equalities may have either sign. Multipliers that decrease only by rounding are skipped. They are
    recognised by the rate times the row's size, which does not depend on the row's unit.
    """
    u, r = work.u, work.r
    largest = 0.0
    for k in range(active):
        largest = max(largest, abs(r[k]) * work.size[work.row[k]])
    step, found = np.inf, -1
    for k in range(active):
        i = work.row[k]
        if r[k] * work.size[i] > _NEGLIGIBLE * largest and low[i] < high[i] and u[k] < step * r[k]:
            step, found = u[k] / r[k], k
    return step, found


@jit
def _add(n: int, active: int, p: int, side: int, u_p: float, free: float, work: Workspace) -> None:
    """Make row p the last active row; a Householder reflection turns the free part of d onto one axis."""
    T, R, y, d = work.T, work.R, work.y, work.d
    length = free**0.5
    pivot = d[active]
    R[active, active] = -length if pivot > 0.0 else length
    for j in range(active):
        R[j, active] = d[j]
    # The reflection is I - scale v v^T; v overwrites the free part of d.
    d[active] -= R[active, active]
    scale = 1.0 / (length * (length + abs(pivot)))
    along = 0.0
    for j in range(active, n):
        along += d[j] * y[j]
    projected = work.r  # the rates are not needed any more
    for c in range(n):
        projected[c] = 0.0
    for j in range(active, n):
        y[j] -= scale * along * d[j]
        for c in range(n):
            projected[c] += d[j] * T[j, c]
    for j in range(active, n):
        factor = scale * d[j]
        for c in range(n):
            T[j, c] -= factor * projected[c]
    work.row[active], work.u[active] = p, u_p
    work.side[p] = side


@jit
def _drop(n: int, active: int, dropped: int, work: Workspace) -> None:
    """Remove a row from the active set; Givens rotations make R triangular again."""
    T, R, y = work.T, work.R, work.y
    work.side[work.row[dropped]] = 0
    for k in range(dropped, active - 1):
        work.row[k], work.u[k] = work.row[k + 1], work.u[k + 1]
        for i in range(k + 2):
            R[i, k] = R[i, k + 1]
    for k in range(dropped, active - 1):
        length = np.hypot(R[k, k], R[k + 1, k])
        cosine, sine = R[k, k] / length, R[k + 1, k] / length
        R[k, k] = length
        for c in range(k + 1, active - 1):
            R[k, c], R[k + 1, c] = (
                cosine * R[k, c] + sine * R[k + 1, c],
                cosine * R[k + 1, c] - sine * R[k, c],
            )
        for c in range(n):
            T[k, c], T[k + 1, c] = (
                cosine * T[k, c] + sine * T[k + 1, c],
                cosine * T[k + 1, c] - sine * T[k, c],
            )
        y[k], y[k + 1] = cosine * y[k] + sine * y[k + 1], cosine * y[k + 1] - sine * y[k]


@jit
def _refine(
    n: int,
    active: int,
    P: np.ndarray,
    q: np.ndarray,
    A: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    x: np.ndarray,
    work: Workspace,
) -> None:
    """Refine x and u on the active rows by one step, with residuals of the original data of the program.

    ``P dx + N du = -dual`` and ``N^T dx = gap`` become ``R^T y = gap`` on the fixed axes and ``y = -T dual`` on the
    free axes; then ``R du = -y - T dual`` and ``dx = T^T y``.
    """
    T, R, y, u, dual, gap = work.T, work.R, work.y, work.u, work.dual, work.gap
    for i in range(n):
        dual[i] = q[i] + _dot(n, P[i], x)
    for k in range(active):
        p = work.row[k]
        side = work.side[p]
        gap[k] = side * ((high[p] if side > 0 else low[p]) - _dot(n, A[p], x))
        for i in range(n):
            dual[i] += side * u[k] * A[p, i]
    for j in range(n):
        y[j] = -_dot(n, T[j], dual)
    for k in range(active):
        entry = gap[k]
        for i in range(k):
            entry -= R[i, k] * gap[i]
        gap[k] = entry / R[k, k]  # y on the fixed axes, in place
        work.r[k] = y[k] - gap[k]
        y[k] = gap[k]
    _solve_upper(active, R, work.r, work.r)
    for k in range(active):
        u[k] += work.r[k]
    for j in range(n):
        for c in range(n):
            x[c] += y[j] * T[j, c]


@jit
def _write_multipliers(
    m: int, active: int, low: np.ndarray, high: np.ndarray, multipliers: np.ndarray, work: Workspace
) -> None:
    """Write the multipliers of all rows.

    A multiplier that rounding made negative is set to zero; the dual residual contains the resulting error.
    """
    for i in range(m):
        multipliers[i] = 0.0
    for k in range(active):
        i = work.row[k]
        u = work.u[k] if low[i] == high[i] else max(work.u[k], 0.0)
        multipliers[i] = work.side[i] * u


@jit
def _primal_residual(
    n: int,
    m: int,
    A: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    x: np.ndarray,
    work: Workspace,
) -> tuple[float, float]:
    """Largest violation of a row, and largest violation relative to the row's size and max(1, |x|)."""
    largest, relative = 0.0, 0.0
    for i in range(m):
        value = _dot(n, A[i], x)
        violation = max(value - high[i], low[i] - value)
        largest = max(largest, violation)
        if violation > relative * work.size[i]:
            relative = violation / work.size[i]
    return largest, relative / _norm(n, x)


@jit
def _dual_residual(
    n: int,
    active: int,
    P: np.ndarray,
    q: np.ndarray,
    A: np.ndarray,
    x: np.ndarray,
    multipliers: np.ndarray,
    work: Workspace,
) -> tuple[float, float]:
    """Largest entry of ``|P x + q + A^T multipliers|``, absolute and relative to the largest sum of absolute terms."""
    largest, scale = 0.0, 0.0
    for i in range(n):
        residual, size = q[i], abs(q[i])
        for j in range(n):
            residual += P[i, j] * x[j]
            size += abs(P[i, j] * x[j])
        for k in range(active):
            p = work.row[k]
            residual += A[p, i] * multipliers[p]
            size += abs(A[p, i] * multipliers[p])
        if not np.isfinite(residual):
            return np.inf, np.inf
        largest, scale = max(largest, abs(residual)), max(scale, size)
    return largest, (largest / scale if scale > 0.0 else 0.0)
