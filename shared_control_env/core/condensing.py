"""Condensing: the quadratic model of a predictive controller's cost in its commands alone.

Shared by both controllers. The decision is ``U``, H_c commands ``[a, delta]``, the last held to the end of
the horizon; n = 2 H_c columns. Sensitivities ``dz(i)/dU`` follow the linearised step, and every residual
of the least-squares cost adds its square to the gradient and the Gauss-Newton Hessian of half the cost.
"""

from __future__ import annotations

import numpy as np

from shared_control_env.core.dynamics import PSI, V_X, V_Y, R, S, Y
from shared_control_env.core.jit import jit
from shared_control_env.core.parameters import PredictiveParameters
from shared_control_env.core.records import MAX_CONTROL, Record

_N = 2 * MAX_CONTROL

WORKSPACE = np.dtype(
    [
        ("z", np.float64, (6,)),  # states along the rollout
        ("z_next", np.float64, (6,)),
        ("A", np.float64, (6, 6)),  # derivatives of one step
        ("B", np.float64, (6, 2)),
        ("affine", np.float64, (6,)),  # of one step linearised, A z + B u + affine
        ("sensitivity", np.float64, (6, _N)),  # derivative of the state with respect to U
        ("sensitivity_next", np.float64, (6, _N)),
        ("row", np.float64, (_N,)),  # derivative of one residual
        ("gradient", np.float64, (_N,)),  # of half the cost
        ("hessian", np.float64, (_N, _N)),  # Gauss-Newton, of half the cost
        ("step", np.float64, (_N,)),  # of the commands
        ("low", np.float64, (_N,)),  # bounds of the step
        ("high", np.float64, (_N,)),
        ("trial", np.float64, (MAX_CONTROL, 2)),  # commands that a step starts from
        ("factor", np.float64, (_N, _N)),  # scratch of the quadratic program
        ("solution", np.float64, (_N,)),
        ("bound", np.int64, (_N,)),
    ],
    align=True,
)
"""Scratch of one solver; one record a thread serves any number of environments."""


@jit
def clear(work: Record, n: int) -> None:
    """Start a condensation of n columns: zero gradient, Hessian and sensitivities of a :data:`WORKSPACE` record."""
    for c in range(n):
        work.gradient[c] = 0.0
        for e in range(n):
            work.hessian[c, e] = 0.0
        for i in range(6):
            work.sensitivity[i, c] = work.sensitivity_next[i, c] = 0.0


@jit
def propagate(A: np.ndarray, B: np.ndarray, sens: np.ndarray, sens_next: np.ndarray, n: int) -> None:
    """Sensitivity of the next state, ``A sens`` plus B in the last two of the n columns in play.

    Uses the zeros of A: nothing but s depends on s, and the velocities depend on velocities alone.

    Args:
        A, B: derivatives of one step, shapes (6, 6) and (6, 2).
        sens: sensitivity of the state, shape (6, >= n).
        sens_next: written.
        n: columns in play: 2 for every command used so far.
    """
    for c in range(n):
        y, psi, v_x, v_y, r = sens[Y, c], sens[PSI, c], sens[V_X, c], sens[V_Y, c], sens[R, c]
        for i in (V_X, V_Y, R):
            sens_next[i, c] = A[i, V_X] * v_x + A[i, V_Y] * v_y + A[i, R] * r
        for i in (S, Y, PSI):
            sens_next[i, c] = A[i, Y] * y + A[i, PSI] * psi + A[i, V_X] * v_x + A[i, V_Y] * v_y + A[i, R] * r
        sens_next[S, c] += sens[S, c]
    for i in range(6):
        sens_next[i, n - 2] += B[i, 0]
        sens_next[i, n - 1] += B[i, 1]


@jit
def add_square(work: Record, weight: float, residual: float, n: int) -> float:
    """Add ``weight (residual + row . dU)^2`` to the model; fills the Hessian's lower triangle.

    Args:
        work: record of :data:`WORKSPACE`; ``row`` holds the residual's derivative.
        weight, residual: of the term.
        n: columns in play.

    Returns:
        The term's value, ``weight residual^2``.
    """
    row, gradient, hessian = work.row, work.gradient, work.hessian
    for c in range(n):
        scaled = weight * row[c]
        gradient[c] += scaled * residual
        for e in range(c + 1):
            hessian[c, e] += scaled * row[e]
    return weight * residual * residual


@jit
def add_tracking(
    work: Record,
    weights: PredictiveParameters,
    dt: float,
    z: np.ndarray,
    z_next: np.ndarray,
    sens: np.ndarray,
    sens_next: np.ndarray,
    y_target: float,
    v_target: float,
    n: int,
) -> float:
    """Add the terms of one stage that Eq. 13 and Eq. 15 share.

    ``W (y - y_target)^2 + H (v_x - v_target)^2 + N r'^2`` with ``r'(i) = (r(i) - r(i-1)) / dt``, which is exact
    for the implicit step.

    Args:
        work: record of :data:`WORKSPACE`.
        weights: W, H and N.
        dt: step [s].
        z, z_next: state before and after the stage, shape (6,).
        sens, sens_next: their sensitivities.
        y_target, v_target: lateral position [m] and speed [m/s] to track.
        n: columns in play.

    Returns:
        The terms' value.
    """
    gradient, hessian = work.gradient, work.hessian
    y_error, v_error = z_next[Y] - y_target, z_next[V_X] - v_target
    yaw_acceleration = (z_next[R] - z[R]) / dt
    for c in range(n):
        wy, wv = weights.W * sens_next[Y, c], weights.H * sens_next[V_X, c]
        wr = weights.N * (sens_next[R, c] - sens[R, c]) / (dt * dt)
        gradient[c] += wy * y_error + wv * v_error + wr * yaw_acceleration * dt
        for e in range(c + 1):
            hessian[c, e] += wy * sens_next[Y, e] + wv * sens_next[V_X, e] + wr * (sens_next[R, e] - sens[R, e])
    return weights.W * y_error**2 + weights.H * v_error**2 + weights.N * yaw_acceleration**2


@jit
def add_effort(work: Record, weights: PredictiveParameters, U: np.ndarray) -> float:
    """Add the effort ``sum_j Q_a a(j)^2 + Q_delta delta(j)^2`` and complete the symmetric Hessian; return its value."""
    value = 0.0
    for j in range(weights.H_c):
        for channel in range(2):
            weight = weights.Q_a if channel == 0 else weights.Q_delta
            c = 2 * j + channel
            work.gradient[c] += weight * U[j, channel]
            work.hessian[c, c] += weight
            value += weight * U[j, channel] ** 2
    for c in range(2 * weights.H_c):
        for e in range(c):
            work.hessian[e, c] = work.hessian[c, e]
    return value
