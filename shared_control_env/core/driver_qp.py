"""The driver's predictive controller (Eq. 14, 15) as a quadratic program.

The costs are the automation's without the potential field; the model is linearised about the current
state and the last command, so that the program is quadratic. Its variables are the H_c commands, scaled
to their limits, and one slack eps >= 0 with an exact (linear) penalty that softens the rows of the safe area C:
the program is always feasible, and eps is 0 where the rows can be kept at a cost below the penalty's.

::

    min  x^T P x / 2 + q^T x      subject to   low <= A x <= high,    x = [U / bound, eps]
    rows:  y(i) - eps <= upper(i),   y(i) + eps >= lower(i),   -1 <= U / bound <= 1,   eps >= 0
"""

from __future__ import annotations

from math import cos, sin

import numpy as np

from shared_control_env.core.active_set_qp import UNBOUNDED
from shared_control_env.core.condensing import add_effort, add_tracking, clear, propagate
from shared_control_env.core.dynamics import PSI, V_X, V_Y, R, S, Y, implicit_step_jacobian
from shared_control_env.core.jit import jit_inlined
from shared_control_env.core.parameters import Parameters
from shared_control_env.core.records import Record
from shared_control_env.core.safe_area import lateral_bounds

SLACK_LINEAR = 200.0
"""Penalty of the slack [1/m]. It is exact where the rows' multipliers sum to less.

In 50 000 random scenes the sum was at most 61 within 1.9 m of the lane's centre; from the lane's edge on it grows
without bound, since the first row takes large steering to move, and there the slack gives way by some
centimetres instead. A penalty of 2000 makes OSQP miss its tolerance now and then.
"""

SLACK_QUADRATIC = 1.0
"""Curvature of the slack's penalty [1/m^2], which makes the program strictly convex."""


@jit_inlined
def build_program(
    scene: Record,
    u_last: np.ndarray,
    p: Parameters,
    work: Record,
    P: np.ndarray,
    q: np.ndarray,
    A: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
) -> None:
    """Condense the driver's problem into dense matrices.

    Args:
        scene: record of :data:`records.SCENE`, its safe area found.
        u_last: the last command u(k-1), about which the model is linearised, shape (2,).
        p: parameters.
        work: record of :data:`condensing.WORKSPACE`.
        P: written, symmetric, shape (n + 1, n + 1) with n = 2 H_c.
        q: written, shape (n + 1,).
        A: written, shape (2 H_p + n + 1, n + 1).
        low, high: written, shape (2 H_p + n + 1,).
    """
    w, dt = p.driver, p.task.dt
    n = 2 * w.H_c
    H_p = w.H_p
    z, z_next = work.z, work.z_next
    sens, affine = work.sensitivity, work.affine
    clear(work, n)
    for i in range(6):
        z[i] = scene.z[i]
    # A command that would stop the car within the step hides that it can start off: linearise at rest.
    a = max(u_last[0], -z[V_X] / dt - z[R] * z[V_Y])
    delta = u_last[1]
    heading, wheel = (cos(scene.z[PSI]), sin(scene.z[PSI])), (cos(delta), sin(delta))
    for i in range(2 * H_p + n + 1):
        for c in range(n + 1):
            A[i, c] = 0.0
    for i in range(H_p):
        columns = 2 * min(i, w.H_c - 1) + 2
        # z(i+1) = A z(i) + B u(i) + affine, with A, B and affine at the current state; they vary with kappa alone.
        if i == 0 or scene.kappa[i] != scene.kappa[i - 1]:
            implicit_step_jacobian(
                scene.z, heading, a, delta, wheel, scene.kappa[i], dt, p.vehicle, affine, work.A, work.B
            )
            for j in range(6):
                for m in range(6):
                    affine[j] -= work.A[j, m] * scene.z[m]
                affine[j] -= work.B[j, 0] * a + work.B[j, 1] * delta
        for j in range(6):
            z_next[j] = affine[j]
            for m in range(6):
                z_next[j] += work.A[j, m] * z[m]
        propagate(work, columns)
        add_tracking(work, w, dt, z, z_next, scene.y_target, scene.v_target, columns)
        # The rows of C are taken where the car gets to under the last command.
        station = z_next[S]
        for c in range(columns):
            station += sens[S, c] * (a if c % 2 == 0 else delta)
            bound = p.limits.a_max if c % 2 == 0 else p.limits.delta_max
            A[i, c] = sens[Y, c] * bound
            A[H_p + i, c] = A[i, c]
        lower, upper = lateral_bounds(scene.area, station)
        A[i, n], A[H_p + i, n] = -1.0, 1.0
        low[i], high[i] = -UNBOUNDED, upper - z_next[Y]
        low[H_p + i], high[H_p + i] = lower - z_next[Y], UNBOUNDED
        z, z_next = z_next, z
    for j in range(w.H_c):
        work.trial[j, 0] = work.trial[j, 1] = 0.0
    add_effort(work, w, work.trial)
    for c in range(n + 1):
        A[2 * H_p + c, c] = 1.0
        low[2 * H_p + c], high[2 * H_p + c] = -1.0, 1.0
    low[2 * H_p + n], high[2 * H_p + n] = 0.0, UNBOUNDED
    for c in range(n):
        P[c, n] = P[n, c] = 0.0
    for c in range(n):
        bound_c = p.limits.a_max if c % 2 == 0 else p.limits.delta_max
        q[c] = 2.0 * work.gradient[c] * bound_c
        for e in range(n):
            bound_e = p.limits.a_max if e % 2 == 0 else p.limits.delta_max
            P[c, e] = 2.0 * work.hessian[c, e] * bound_c * bound_e
    P[n, n], q[n] = 2.0 * SLACK_QUADRATIC, SLACK_LINEAR
