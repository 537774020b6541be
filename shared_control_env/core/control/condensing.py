"""Condensing: a quadratic model of a predictive controller's cost as a function of its commands alone.

Both controllers use this model. The variables are ``U``, H_c commands ``[a, delta]``, which make n = 2 H_c columns. The
last command is held to the end of the horizon. The sensitivities ``dz(i)/dU`` follow from the linearised steps. The
square of each residual of the cost is added to the gradient and to the Gauss-Newton Hessian of half the cost.
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
"""Loops run over a multiple of this number of columns, so that LLVM vectorises them; columns beyond n are zero."""


class Workspace:
    """Scratch memory of one solver; one record per thread serves any number of environments.

    Attributes:
        z, z_next: states before and after one step of the rollout.
        A, B: derivatives of one step with respect to the state and to the command.
        affine: constant part of one linearised step, A z + B u + affine.
        sensitivity: derivative of the state with respect to U.
        yaw_step: derivative of the change of the yaw rate over the last step with respect to U.
        row: derivative of one residual with respect to U.
        gain: derivative of the arm's command with respect to U, for a driver with the internal model.
        gradient: gradient of half the cost.
        hessian: Gauss-Newton Hessian of half the cost.
        step: step of the commands.
        low, high: bounds of the step.
        trial: commands from which the step starts.
        factor, solution, bound: scratch of the solver of the quadratic program.
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
    """Start condensing: set gradient, Hessian and sensitivities to zero.

    Args:
        work: record of :data:`WORKSPACE`, written.
        n: number of columns, 2 H_c.
    """
    for c in range(_whole_lanes(n)):
        work.gradient[c] = work.yaw_step[c] = 0.0
        for e in range(_whole_lanes(n)):
            work.hessian[c, e] = 0.0
        for i in range(6):
            work.sensitivity[i, c] = 0.0


@jit
def _whole_lanes(n: int) -> int:
    """Number of columns over which a loop for n columns runs: n rounded up to a multiple of :data:`_LANES`."""
    return (n + _LANES - 1) // _LANES * _LANES


@jit_inlined
def propagate(work: Workspace, n: int) -> None:
    """Propagate the sensitivity over one step: ``A sens``, plus B in the last two of the n active columns.

    Args:
        work: record of :data:`WORKSPACE`; ``A`` and ``B`` hold the derivatives of the step, ``sensitivity`` and
            ``yaw_step`` are written.
        n: number of active columns: 2 for every command used so far.
    """
    B, sens, yaw_step = work.B, work.sensitivity, work.yaw_step
    carry(work, n)
    for column in range(2):
        for i in range(6):
            sens[i, n - 2 + column] += B[i, column]
        yaw_step[n - 2 + column] += B[R, column]


@jit_inlined
def carry(work: Workspace, n: int) -> None:
    """Propagate the sensitivity over one step without the effect of the command: ``A sens``.

    The function uses the zeros of A: only s depends on s, and the velocities depend only on velocities.

    Args:
        work: record of :data:`WORKSPACE`; ``A`` holds the derivative of the step, ``sensitivity`` and ``yaw_step`` are
            written.
        n: number of active columns.
    """
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
    """Add the term ``weight (residual + row . dU)^2`` to the quadratic model.

    Args:
        work: record of :data:`WORKSPACE`; ``row`` holds the derivative of the residual, with zeros beyond n.
        weight, residual: weight and residual of the term.
        n: number of active columns.

    Returns:
        Value of the term, ``weight residual^2``.
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
    """Add the terms of one stage that Eq. 13 and Eq. 15 have in common.

    ``W (y - y_target)^2 + H (v_x - v_target)^2 + N r'^2`` with ``r'(i) = (r(i) - r(i-1)) / dt``, which is exact
    for the implicit step.

    Args:
        work: record of :data:`WORKSPACE`; ``sensitivity`` and ``yaw_step`` hold their values after the stage.
        weights: parameters with the weights W, H and N.
        dt: step [s].
        z, z_next: state before and after the stage, shape (6,).
        y_target, v_target: lateral position [m] and speed [m/s] to track.
        n: number of active columns.

    Returns:
        Sum of the terms [-].
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
    """Add the effort ``sum_j Q_a a(j)^2 + Q_delta delta(j)^2`` of the commands.

    Args:
        work: record of :data:`WORKSPACE`; gradient and Hessian are written.
        weights: parameters with the weights Q_a and Q_delta and the control horizon H_c.
        U: commands ``[a, delta]`` [m/s^2, rad], shape (>= H_c, 2).

    Returns:
        Value of the effort [-].
    """
    value = 0.0
    for j in range(weights.H_c):
        for channel in range(2):
            weight = weights.Q_a if channel == 0 else weights.Q_delta
            c = 2 * j + channel
            work.gradient[c] += weight * U[j, channel]
            work.hessian[c, c] += weight
            value += weight * U[j, channel] ** 2
    return value
