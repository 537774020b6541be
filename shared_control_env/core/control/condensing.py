"""Condensing: the quadratic model of a predictive controller's cost in its commands alone.

Shared by both controllers. The decision is ``U``, H_c commands ``[a, delta]``, the last held to the end of
the horizon; n = 2 H_c columns. Sensitivities ``dz(i)/dU`` follow the linearised step, and every residual
of the least-squares cost adds its square to the gradient and the Gauss-Newton Hessian of half the cost.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np

from shared_control_env.core.compile.jit import jit, jit_inlined
from shared_control_env.core.parameters import PredictiveParameters
from shared_control_env.core.records import MAX_CONTROL, record_dtype
from shared_control_env.core.world.vehicle import PSI, V_X, V_Y, R, S, Y

_N = 2 * MAX_CONTROL

_LANES = 4
"""Loops run over whole fours of columns, of which LLVM makes vector instructions; those beyond n are zero."""


class Workspace:
    """Scratch of one solver; one record a thread serves any number of environments.

    Attributes:
        z: states along the rollout.
        z_next: see above.
        A: derivatives of one step.
        B: see above.
        affine: of one step linearised, A z + B u + affine.
        sensitivity: derivative of the state with respect to U.
        yaw_step: the same of the change of the yaw rate over the last step.
        row: derivative of one residual.
        gain: derivative of the arm's command, of a driver who models it.
        gradient: of half the cost.
        hessian: Gauss-Newton, of half the cost.
        step: of the commands.
        low: bounds of the step.
        high: see above.
        trial: commands that a step starts from.
        factor: scratch of the quadratic program.
        solution: see above.
        bound: see above.
    """

    z: Annotated[np.ndarray, (6,)]
    z_next: Annotated[np.ndarray, (6,)]
    A: Annotated[np.ndarray, (6, 6)]
    B: Annotated[np.ndarray, (6, 2)]
    affine: Annotated[np.ndarray, (6,)]
    sensitivity: Annotated[np.ndarray, (6, _N)]
    yaw_step: Annotated[np.ndarray, (_N,)]
    row: Annotated[np.ndarray, (_N,)]
    gain: Annotated[np.ndarray, (_N,)]
    gradient: Annotated[np.ndarray, (_N,)]
    hessian: Annotated[np.ndarray, (_N, _N)]
    step: Annotated[np.ndarray, (_N,)]
    low: Annotated[np.ndarray, (_N,)]
    high: Annotated[np.ndarray, (_N,)]
    trial: Annotated[np.ndarray, (MAX_CONTROL, 2)]
    factor: Annotated[np.ndarray, (_N, _N)]
    solution: Annotated[np.ndarray, (_N,)]
    bound: Annotated[np.ndarray, (_N,), np.int64]


WORKSPACE = record_dtype(Workspace)


@jit_inlined
def clear(work: Workspace, n: int) -> None:
    """Start a condensation of n columns: zero gradient, Hessian and sensitivities of a :data:`WORKSPACE` record."""
    for c in range(_whole_lanes(n)):
        work.gradient[c] = work.yaw_step[c] = 0.0
        for e in range(_whole_lanes(n)):
            work.hessian[c, e] = 0.0
        for i in range(6):
            work.sensitivity[i, c] = 0.0


@jit
def _whole_lanes(n: int) -> int:
    """Columns up to which a loop over n of them runs."""
    return (n + _LANES - 1) // _LANES * _LANES


@jit_inlined
def propagate(work: Workspace, n: int) -> None:
    """Carry the sensitivity over a step: ``A sens``, plus B in the last two of the n columns in play.

    Uses the zeros of A: nothing but s depends on s, and the velocities depend on velocities alone.

    Args:
        work: record of :data:`WORKSPACE`; ``A`` and ``B`` hold the step's derivatives, ``sensitivity`` and
            ``yaw_step`` are written.
        n: columns in play: 2 for every command used so far.
    """
    B, sens, yaw_step = work.B, work.sensitivity, work.yaw_step
    carry(work, n)
    for column in range(2):
        for i in range(6):
            sens[i, n - 2 + column] += B[i, column]
        yaw_step[n - 2 + column] += B[R, column]


@jit_inlined
def carry(work: Workspace, n: int) -> None:
    """The part of :func:`propagate` that is ``A sens``; arguments as there."""
    A, sens, yaw_step = work.A, work.sensitivity, work.yaw_step
    a_s = A[S, Y], A[S, PSI], A[S, V_X], A[S, V_Y], A[S, R]
    a_y = A[Y, Y], A[Y, PSI], A[Y, V_X], A[Y, V_Y], A[Y, R]
    a_psi = A[PSI, Y], A[PSI, PSI], A[PSI, V_X], A[PSI, V_Y], A[PSI, R]
    a_vx = A[V_X, V_X], A[V_X, V_Y], A[V_X, R]
    a_vy = A[V_Y, V_X], A[V_Y, V_Y], A[V_Y, R]
    a_r = A[R, V_X], A[R, V_Y], A[R, R]
    for c in range(_whole_lanes(n)):
        s, y, psi, v_x, v_y, r = sens[S, c], sens[Y, c], sens[PSI, c], sens[V_X, c], sens[V_Y, c], sens[R, c]
        sens[S, c] = s + a_s[0] * y + a_s[1] * psi + a_s[2] * v_x + a_s[3] * v_y + a_s[4] * r
        sens[Y, c] = a_y[0] * y + a_y[1] * psi + a_y[2] * v_x + a_y[3] * v_y + a_y[4] * r
        sens[PSI, c] = a_psi[0] * y + a_psi[1] * psi + a_psi[2] * v_x + a_psi[3] * v_y + a_psi[4] * r
        sens[V_X, c] = a_vx[0] * v_x + a_vx[1] * v_y + a_vx[2] * r
        sens[V_Y, c] = a_vy[0] * v_x + a_vy[1] * v_y + a_vy[2] * r
        r_next = a_r[0] * v_x + a_r[1] * v_y + a_r[2] * r
        sens[R, c], yaw_step[c] = r_next, r_next - r


@jit_inlined
def add_square(work: Workspace, weight: float, residual: float, n: int) -> float:
    """Add ``weight (residual + row . dU)^2`` to the model.

    Args:
        work: record of :data:`WORKSPACE`; ``row`` holds the residual's derivative, zero beyond n.
        weight, residual: of the term.
        n: columns in play.

    Returns:
        The term's value, ``weight residual^2``.
    """
    row, gradient, hessian = work.row, work.gradient, work.hessian
    for c in range(n):
        scaled = weight * row[c]
        gradient[c] += scaled * residual
        for e in range(_whole_lanes(n)):
            hessian[c, e] += scaled * row[e]
    return weight * residual * residual


@jit_inlined
def add_tracking(
    work: Workspace,
    weights: PredictiveParameters,
    dt: float,
    z: np.ndarray,
    z_next: np.ndarray,
    y_target: float,
    v_target: float,
    n: int,
) -> float:
    """Add the terms of one stage that Eq. 13 and Eq. 15 share.

    ``W (y - y_target)^2 + H (v_x - v_target)^2 + N r'^2`` with ``r'(i) = (r(i) - r(i-1)) / dt``, which is exact
    for the implicit step.

    Args:
        work: record of :data:`WORKSPACE`, its ``sensitivity`` and ``yaw_step`` those after the stage.
        weights: W, H and N.
        dt: step [s].
        z, z_next: state before and after the stage, shape (6,).
        y_target, v_target: lateral position [m] and speed [m/s] to track.
        n: columns in play.

    Returns:
        The terms' value.
    """
    gradient, hessian, sens, yaw_step = work.gradient, work.hessian, work.sensitivity, work.yaw_step
    W, H, N = weights.W, weights.H, weights.N / (dt * dt)
    y_error, v_error, r_change = z_next[Y] - y_target, z_next[V_X] - v_target, z_next[R] - z[R]
    for c in range(n):
        w_y, w_v, w_r = W * sens[Y, c], H * sens[V_X, c], N * yaw_step[c]
        gradient[c] += w_y * y_error + w_v * v_error + w_r * r_change
        for e in range(_whole_lanes(n)):
            hessian[c, e] += w_y * sens[Y, e] + w_v * sens[V_X, e] + w_r * yaw_step[e]
    return W * y_error**2 + H * v_error**2 + N * r_change**2


@jit_inlined
def add_effort(work: Workspace, weights: PredictiveParameters, U: np.ndarray) -> float:
    """Add the effort ``sum_j Q_a a(j)^2 + Q_delta delta(j)^2`` of the commands; return its value."""
    value = 0.0
    for j in range(weights.H_c):
        for channel in range(2):
            weight = weights.Q_a if channel == 0 else weights.Q_delta
            c = 2 * j + channel
            work.gradient[c] += weight * U[j, channel]
            work.hessian[c, c] += weight
            value += weight * U[j, channel] ** 2
    return value
