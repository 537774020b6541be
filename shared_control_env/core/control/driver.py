"""The driver's predictive controller (Eq. 14, 15) as a quadratic program.

The cost is that of the automation without the potential field. The model is linearised about the current state and the
last command, so that the program is quadratic. Its variables are the H_c commands, divided by their limits, and two
slacks: eps >= 0 softens the rows of C's sides, eta >= 0 that of its end. Both have an exact (linear) penalty. The
program is thus always feasible, and a slack is 0 where its rows can be satisfied at a lower cost than that of the
penalty. Two slacks, since a car that cannot stop before the end of C must still keep to its sides.

::

    min  x^T P x / 2 + q^T x      subject to   low <= A x <= high,    x = [U / bound, eps, eta]
    rows:  y(i) - eps <= upper(i),   y(i) + eps >= lower(i),   s(H_p) + l / 2 - eta <= end,
           -1 <= U / bound <= 1,   eps >= 0,   eta >= 0

Eq. 15 keeps the predicted (x, y) in C, which ends at the clearance d_o behind the preceding vehicle. Readings: the
car's centre, or its front. With the centre the car would already touch the other, so the row of s keeps the front,
half the car's length l ahead. That row is for the last stage alone, the farthest while the car drives forwards.

The paper's driver assumes that its desired command drives the car. It knows neither its own lag nor the automation's
command. The internal model adds both to the program; the variables are still u_h,des::

    u(i)         = u_a,act + u_h,act(i)             u_a,act: as felt last, held over the horizon
    u_h,act(i+1) = phi u_h,act(i) + K_h (1 - phi) (u_h,des(i) - u_a,act),   phi = exp(-dt / T_h)
    z(i+1)       = A z(i) + B u(i) + affine

with K_h and T_h as the driver assumes them. The effort then has two parts: the command that drives the car, at H_c
stages from the first stage on that the driver can still influence; and u_h,des with a small weight.
"""

from __future__ import annotations

from math import cos, exp, sin

import numpy as np

from shared_control_env.core.compile.jit import jit, jit_inlined
from shared_control_env.core.control.condensing import (
    Workspace,
    add_effort,
    add_square,
    add_tracking,
    carry,
    clear,
    propagate,
)
from shared_control_env.core.control.qp.active_set import UNBOUNDED
from shared_control_env.core.parameters import Parameters
from shared_control_env.core.records import Scene
from shared_control_env.core.risk.safe_area import lateral_bounds
from shared_control_env.core.world.vehicle import PSI, V_X, V_Y, R, S, Y, implicit_step_jacobian

SLACK_LINEAR = 200.0
"""Linear penalty of a slack [1/m]. The penalty is exact where the sum of the rows' multipliers is smaller.

In 50 000 random scenes this sum was at most 61 within 1.9 m of the centre of the lane. Beyond the edge of the lane the
sum grows without bound, since large steering is needed to change the first row; there the slack becomes some
centimetres instead. With a penalty of 2000, OSQP sometimes misses its tolerance.
"""

SLACK_QUADRATIC = 1.0
"""Quadratic penalty of a slack [1/m^2], which makes the program strictly convex."""

SLACKS = 2
"""Number of slacks [-]: one for the sides of C, one for its end."""


SHARE_OF_DESIRED = 0.01
"""Weight of u_h,des divided by the weight of the command that drives the car, with the internal model [-]."""


@jit
def count_rows(p: Parameters) -> int:
    """Number of rows of the program.

    There is one row for each side of C at every stage, one for the end of C, and one for each variable.

    Args:
        p: parameters.
    """
    return 2 * p.driver.H_p + 1 + count_variables(p)


@jit
def count_variables(p: Parameters) -> int:
    """Number of variables of the program: H_c commands with two entries each, and the slacks.

    Args:
        p: parameters.
    """
    return 2 * p.driver.H_c + SLACKS


@jit_inlined
def add_arm(i: int, command: tuple[float, float], p: Parameters, n: int, work: Workspace) -> None:
    """Add the effect and the effort of the command u(i) that drives the car at stage i, with the internal model.

    Args:
        i: index of the stage.
        command: u(i) for u_h,des = 0, ``(a, delta)`` [m/s^2, rad].
        p: parameters.
        n: number of columns of the program, 2 H_c.
        work: record of :data:`condensing.WORKSPACE`. ``gain`` holds du_h,act(i)/dU. The effect is added to the
            sensitivities of the next state, the effort to the quadratic model.
    """
    B, sens, gain = work.B, work.sensitivity, work.gain
    for c in range(n):
        for j in range(6):
            sens[j, c] += B[j, c % 2] * gain[c]
        work.yaw_step[c] += B[R, c % 2] * gain[c]
    if i < 1 or i > p.driver.H_c:
        return
    for channel in range(2):
        for c in range(work.row.shape[0]):
            work.row[c] = gain[c] if c % 2 == channel and c < n else 0.0
        add_square(work, p.driver.Q_a if channel == 0 else p.driver.Q_delta, command[channel], n)


@jit_inlined
def build_program(
    scene: Scene,
    u_last: np.ndarray,
    u_h_act: np.ndarray,
    p: Parameters,
    work: Workspace,
    P: np.ndarray,
    q: np.ndarray,
    A: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
) -> None:
    """Condense the driver's problem into dense matrices.

    The paper's model is linearised about the driver's last desired command. The internal model is linearised about the
    sum of the driver's present actual command and the automation's command as last felt.

    Args:
        scene: record of :data:`records.SCENE` with the safe area.
        u_last: the driver's last desired command [m/s^2, rad], shape (2,).
        u_h_act: the driver's present actual command u_h,act(k) [m/s^2, rad], shape (2,).
        p: parameters.
        work: record of :data:`condensing.WORKSPACE`.
        P: quadratic cost, symmetric, written, shape (n, n) with n = :func:`count_variables`.
        q: linear cost, written, shape (n,).
        A: constraint matrix, written, shape (:func:`count_rows`, n).
        low, high: bounds of the rows of A, written, one entry per row.
    """
    w, dt = p.driver, p.task.dt
    n = 2 * w.H_c
    H_p = w.H_p
    z, z_next = work.z, work.z_next
    sens, affine = work.sensitivity, work.affine
    clear(work, n)
    for i in range(6):
        z[i] = scene.z[i]
    internal = p.internal_model.active
    phi = exp(-dt / p.internal_model.T_h)
    rise = p.internal_model.K_h * (1.0 - phi)
    arm_a, arm_delta = u_h_act[0], u_h_act[1]
    a, delta = u_last[0], u_last[1]
    if internal:
        a, delta = scene.felt[0] + arm_a, scene.felt[1] + arm_delta
        for c in range(n):
            work.gain[c] = 0.0
    # A command that would stop the car within the step hides that the car can start to move. Linearise at rest instead.
    a = max(a, -z[V_X] / dt - z[R] * z[V_Y])
    heading, wheel = (cos(scene.z[PSI]), sin(scene.z[PSI])), (cos(delta), sin(delta))
    rows = count_rows(p)
    for i in range(rows):
        for c in range(n + SLACKS):
            A[i, c] = 0.0
    for i in range(H_p):
        columns = 2 * min(i, w.H_c - 1) + 2
        # z(i+1) = A z(i) + B u(i) + affine, with A, B and affine at the current state; they vary only with kappa.
        if i == 0 or scene.kappa[i] != scene.kappa[i - 1]:
            implicit_step_jacobian(
                scene.z, heading, a, delta, wheel, scene.kappa[i], dt, p.model, affine, work.A, work.B
            )
            for j in range(6):
                for m in range(6):
                    affine[j] -= work.A[j, m] * scene.z[m]
                affine[j] -= work.B[j, 0] * a + work.B[j, 1] * delta
        for j in range(6):
            z_next[j] = affine[j]
            for m in range(6):
                z_next[j] += work.A[j, m] * z[m]
        if internal:
            command = scene.felt[0] + arm_a, scene.felt[1] + arm_delta
            for j in range(6):
                z_next[j] += work.B[j, 0] * command[0] + work.B[j, 1] * command[1]
            carry(work, n)
            add_arm(i, command, p, n, work)
            columns = n
            arm_a = phi * arm_a - rise * scene.felt[0]
            arm_delta = phi * arm_delta - rise * scene.felt[1]
            for c in range(n):
                work.gain[c] *= phi
            for channel in range(2):
                work.gain[2 * min(i, w.H_c - 1) + channel] += rise
        else:
            propagate(work, columns)
        add_tracking(work, w, dt, z, z_next, scene.y_target, scene.v_target, columns)
        # The rows of C are evaluated at the path length that the car reaches under the last command.
        station = z_next[S]
        for c in range(columns):
            if internal:
                station += sens[S, c] * u_last[c % 2]
            else:
                station += sens[S, c] * (a if c % 2 == 0 else delta)
            bound = p.limits.a_max if c % 2 == 0 else p.limits.delta_max
            A[i, c] = sens[Y, c] * bound
            A[H_p + i, c] = A[i, c]
        lower, upper = lateral_bounds(scene.area, station)
        A[i, n], A[H_p + i, n] = -1.0, 1.0
        low[i], high[i] = -UNBOUNDED, upper - z_next[Y]
        low[H_p + i], high[H_p + i] = lower - z_next[Y], UNBOUNDED
        z, z_next = z_next, z
    first = 2 * H_p
    for c in range(n):
        A[first, c] = sens[S, c] * (p.limits.a_max if c % 2 == 0 else p.limits.delta_max)
    A[first, n + 1] = -1.0
    low[first], high[first] = -UNBOUNDED, scene.area.end - 0.5 * p.model.length - z[S]
    first += 1
    if internal:
        for c in range(n):
            work.hessian[c, c] += SHARE_OF_DESIRED * (w.Q_a if c % 2 == 0 else w.Q_delta)
    else:
        for j in range(w.H_c):
            work.trial[j, 0] = work.trial[j, 1] = 0.0
        add_effort(work, w, work.trial)
    for c in range(n + SLACKS):
        A[first + c, c] = 1.0
        low[first + c], high[first + c] = (-1.0, 1.0) if c < n else (0.0, UNBOUNDED)
        for e in range(n, n + SLACKS):
            P[c, e] = P[e, c] = 0.0
    for c in range(n):
        bound_c = p.limits.a_max if c % 2 == 0 else p.limits.delta_max
        q[c] = 2.0 * work.gradient[c] * bound_c
        for e in range(n):
            bound_e = p.limits.a_max if e % 2 == 0 else p.limits.delta_max
            P[c, e] = 2.0 * work.hessian[c, e] * bound_c * bound_e
    for e in range(n, n + SLACKS):
        P[e, e], q[e] = 2.0 * SLACK_QUADRATIC, SLACK_LINEAR
