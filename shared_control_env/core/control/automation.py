"""The automation: nonlinear model predictive control (Eq. 12, 13) by Gauss-Newton SQP.

The cost is a sum of squares. Each iteration linearises the residuals along the rollout of the implicit model, solves
the quadratic program with box bounds for a step, and makes a line search along the step.

A stage of the horizon is one implicit step, which damps the yaw rate more than the plant's finer steps do. With the
plant's steps as model, the first steering command off the centre of the lane is 13 % smaller at 8 and 15 m/s, and 39 %
larger at 25 m/s. In closed loop the difference is small: after a lane error of 1 m the overshoot is 0.19 m, not 0.22 m,
at 15 m/s, and 0.99 m, not 0.86 m, at 25 m/s; the car settles 0.1 to 0.25 s earlier.
"""

from __future__ import annotations

from math import cos, sin

import numpy as np

from shared_control_env.core.compile.calls import Interface
from shared_control_env.core.compile.jit import jit, jit_inlined
from shared_control_env.core.control.condensing import Workspace, add_effort, add_square, add_tracking, clear, propagate
from shared_control_env.core.control.qp.box import solve_box_qp
from shared_control_env.core.parameters import Limits, Parameters
from shared_control_env.core.records import AutomationMemory, Scene
from shared_control_env.core.risk.lateral import continuous_field
from shared_control_env.core.world.vehicle import PSI, V_X, R, S, Y, implicit_step, implicit_step_jacobian

CONVERGED, ITERATION_LIMIT, FAILED = 0, 1, 2
"""Statuses: stationary to :data:`TOLERANCE`; stopped before that; a value that is not finite."""

TOLERANCE = 1e-8
"""Projected gradient below which the solution counts as stationary [-], with commands divided by their limits."""

_ARMIJO = 1e-4
_SHORTEST_STEP = 1e-3


@jit
def cost(U: np.ndarray, scene: Scene, p: Parameters, work: Workspace) -> float:
    """Cost of a command sequence, Eq. 13.

    ::

        J = sum_{i=1}^{H_p} R P(i)^2 + W (y(i) - y_target)^2 + H (v_x(i) - v_target)^2 + N r'(i)^2
            + sum_{j=0}^{H_c-1} Q_a a(j)^2 + Q_delta delta(j)^2

    where P is the field of the boundaries minus its value at the cut-off, and ``r'(i) = (r(i) - r(i-1)) / dt``.

    Args:
        U: commands ``[a, delta]`` [m/s^2, rad], shape (>= H_c, 2).
        scene: record of :data:`records.SCENE`.
        p: record or named tuple of :class:`Parameters`.
        work: record of :data:`condensing.WORKSPACE`.

    Returns:
        J [-].
    """
    w = p.automation
    z, z_next = work.z, work.z_next
    for i in range(6):
        z[i] = scene.z[i]
    heading = cos(z[PSI]), sin(z[PSI])
    wheel = heading
    total = 0.0
    for i in range(w.H_p):
        j = min(i, w.H_c - 1)
        if i == j:
            wheel = cos(U[j, 1]), sin(U[j, 1])
        heading = implicit_step(z, heading, U[j, 0], U[j, 1], wheel, scene.kappa[i], p.task.dt, p.model, z_next)
        P = continuous_field(scene.area, z_next[S], z_next[Y], p.lateral)[0]
        yaw_acceleration = (z_next[R] - z[R]) / p.task.dt
        total += (
            w.R * P * P
            + w.W * (z_next[Y] - scene.y_target) ** 2
            + w.H * (z_next[V_X] - scene.v_target) ** 2
            + w.N * yaw_acceleration**2
        )
        z, z_next = z_next, z
    for j in range(w.H_c):
        total += w.Q_a * U[j, 0] ** 2 + w.Q_delta * U[j, 1] ** 2
    return total


@jit
def linearise(U: np.ndarray, scene: Scene, p: Parameters, work: Workspace) -> float:
    """Write the quadratic model of half the cost about U to ``work.gradient`` and ``work.hessian``.

    Args:
        U: commands ``[a, delta]`` [m/s^2, rad], shape (>= H_c, 2).
        scene: record of :data:`records.SCENE`.
        p: record or named tuple of :class:`Parameters`.
        work: record of :data:`condensing.WORKSPACE`, written.

    Returns:
        The cost J at U, as :func:`cost`.
    """
    w = p.automation
    z, z_next = work.z, work.z_next
    sens = work.sensitivity
    clear(work, 2 * w.H_c)
    for i in range(6):
        z[i] = scene.z[i]
    heading = cos(z[PSI]), sin(z[PSI])
    wheel = heading
    total = 0.0
    for i in range(w.H_p):
        j = min(i, w.H_c - 1)
        n = 2 * j + 2
        if i == j:
            wheel = cos(U[j, 1]), sin(U[j, 1])
        heading = implicit_step_jacobian(
            z, heading, U[j, 0], U[j, 1], wheel, scene.kappa[i], p.task.dt, p.model, z_next, work.A, work.B
        )
        propagate(work, n)
        total += add_tracking(work, w, p.task.dt, z, z_next, scene.y_target, scene.v_target, n)
        P, P_s, P_d = continuous_field(scene.area, z_next[S], z_next[Y], p.lateral)
        if P > 0.0:
            for c in range(work.row.shape[0]):
                work.row[c] = P_s * sens[S, c] + P_d * sens[Y, c]
            total += add_square(work, w.R, P, n)
        z, z_next = z_next, z
    return total + add_effort(work, w, U)


@jit
def projected_gradient(U: np.ndarray, gradient: np.ndarray, H_c: int, limits: Limits) -> float:
    """Stationarity measure of a bounded problem: ``max |u - clip(u - g)|`` for commands u divided by their limits.

    Args:
        U: commands ``[a, delta]`` [m/s^2, rad], shape (>= H_c, 2).
        gradient: gradient of half the cost, shape (>= 2 H_c,).
        H_c: control horizon: number of commands [-].
        limits: bounds of the commands.

    Returns:
        The measure [-]; 0 at a stationary point.
    """
    largest = 0.0
    for j in range(H_c):
        for channel in range(2):
            bound = limits.a_max if channel == 0 else limits.delta_max
            u, g = U[j, channel] / bound, gradient[2 * j + channel] * bound
            largest = max(largest, abs(u - min(max(u - g, -1.0), 1.0)))
    return largest


@jit_inlined
def _plan_step(U: np.ndarray, p: Parameters, work: Workspace) -> float:
    """Write the step to the quadratic model's bounded minimum to ``work.step``; return the cost's slope along it."""
    n = 2 * p.automation.H_c
    for c in range(n):
        bound = p.limits.a_max if c % 2 == 0 else p.limits.delta_max
        work.low[c] = -bound - U[c // 2, c % 2]
        work.high[c] = bound - U[c // 2, c % 2]
        work.trial[c // 2, c % 2] = U[c // 2, c % 2]
    solve_box_qp(
        n,
        work.hessian,
        work.gradient,
        work.low,
        work.high,
        work.step,
        work.factor,
        work.solution,
        work.bound,
    )
    slope = 0.0
    for c in range(n):
        slope += 2.0 * work.gradient[c] * work.step[c]
    return slope


@jit_inlined
def solve(
    U: np.ndarray, scene: Scene, p: Parameters, iterations: int, work: Workspace
) -> tuple[int, int, float, float]:
    """Minimise Eq. 13 over the bounded commands, starting from the guess U.

    Each step is halved until the cost decreases enough (Armijo). A trial point is linearised, since the next iteration
    needs the linearisation anyway; in the last iteration only the cost is computed.

    Args:
        U: initial guess ``[a, delta]`` [m/s^2, rad], overwritten with the solution, shape (>= H_c, 2).
        scene: record of :data:`records.SCENE`.
        p: record or named tuple of :class:`Parameters`.
        iterations: largest number of Gauss-Newton iterations.
        work: record of :data:`condensing.WORKSPACE`.

    Returns:
        Status, number of iterations, projected gradient at the last linearisation [-], and cost [-].
    """
    H_c = p.automation.H_c
    value = linearise(U, scene, p, work)
    residual = projected_gradient(U, work.gradient, H_c, p.limits)
    for iteration in range(iterations):
        if not (np.isfinite(value) and np.isfinite(residual)):
            return FAILED, iteration, residual, value
        if residual <= TOLERANCE:
            return CONVERGED, iteration, residual, value
        slope = _plan_step(U, p, work)
        if not np.isfinite(slope):  # the Hessian is not positive definite in floating point
            return FAILED, iteration, residual, value
        last = iteration + 1 == iterations
        length, trial_value = 2.0, np.inf
        while not trial_value <= value + _ARMIJO * length * slope:
            length *= 0.5
            if length < _SHORTEST_STEP:
                length, trial_value = 0.0, value
            for c in range(2 * H_c):
                U[c // 2, c % 2] = work.trial[c // 2, c % 2] + length * work.step[c]
            if length == 0.0:
                return ITERATION_LIMIT, iteration + 1, residual, value
            trial_value = cost(U, scene, p, work) if last else linearise(U, scene, p, work)
        value = trial_value
        if not last:
            residual = projected_gradient(U, work.gradient, H_c, p.limits)
    return ITERATION_LIMIT, iterations, residual, value


@jit
def shift(U: np.ndarray, H_c: int) -> None:
    """Warm start: move the commands one step forward in place and repeat the last command.

    Args:
        U: commands ``[a, delta]`` [m/s^2, rad], overwritten, shape (>= H_c, 2).
        H_c: control horizon: number of commands [-].
    """
    for j in range(H_c - 1):
        U[j, 0], U[j, 1] = U[j + 1, 0], U[j + 1, 1]


@jit
def clear_sequence(U: np.ndarray) -> None:
    """Set a sequence of commands to zero.

    Args:
        U: commands ``[a, delta]`` [m/s^2, rad], overwritten, shape (n, 2).
    """
    for j in range(U.shape[0]):
        U[j, 0], U[j, 1] = 0.0, 0.0


@jit_inlined
def clear_automation(memory: AutomationMemory) -> None:
    """Reset the automation's memory to its state before the first step.

    Args:
        memory: record of :data:`records.AUTOMATION_MEMORY`, overwritten.
    """
    clear_sequence(memory.U)
    memory.u_a_des[0], memory.u_a_des[1] = 0.0, 0.0
    memory.failures = 0


def automate(scene: Scene, p: Parameters, memory: AutomationMemory, work: Workspace) -> tuple[int, int, float]:
    """Compute the automation's desired command u_a,des (Eq. 13) and write it to ``memory.u_a_des``.

    If the solver fails, the last feasible command is held and the failure is counted.

    Args:
        scene: record of :data:`records.SCENE` with the safe area.
        p: parameters.
        memory: record of :data:`records.AUTOMATION_MEMORY`, updated.
        work: record of :data:`condensing.WORKSPACE`.

    Returns:
        Status, number of iterations and residual of :func:`solve`.
    """
    iterations = p.solver.first_iterations if scene.k == 0 else p.solver.iterations
    status, done, residual, _ = solve(memory.U, scene, p, iterations, work)
    if status == FAILED:
        memory.failures += 1
        clear_sequence(memory.U)
    else:
        memory.u_a_des[0], memory.u_a_des[1] = memory.U[0, 0], memory.U[0, 1]
        shift(memory.U, p.automation.H_c)
    return status, done, residual


AUTOMATE = Interface((int, int, float), Scene, Parameters, AutomationMemory, Workspace)
"""``automate(scene, p, memory, work)``, compiled separately from the loop."""
