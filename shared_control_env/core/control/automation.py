"""The automation: nonlinear model predictive control (Eq. 12, 13) by Gauss-Newton SQP.

The cost is a sum of squares. Each iteration linearises the residuals along the rollout of the implicit model, solves
the quadratic program with box bounds for a step, and makes a line search along the step.

A stage of the horizon is one implicit step, which damps the yaw rate more than the plant's finer steps do. With the
plant's steps as model, the first steering command off the centre of the lane is 13 % smaller at 8 and 15 m/s, and 39 %
larger at 25 m/s. In closed loop the difference is small: after a lane error of 1 m the overshoot is 0.19 m, not 0.22 m,
at 15 m/s, and 0.99 m, not 0.86 m, at 25 m/s; the car settles 0.1 to 0.25 s earlier.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np

from shared_control_env.core.compile.calls import Interface, array_of
from shared_control_env.core.compile.jit import jit, jit_inlined
from shared_control_env.core.compile.lanes import WIDTH, Number, Truth, choose, holds_in_any, load, spread, store
from shared_control_env.core.control import block as blocks
from shared_control_env.core.control.block import (
    FIELD,
    Column,
    Commands,
    Lane,
    add_effort,
    add_square,
    add_tracking,
    clear,
    dynamics_of,
    gather,
    propagate,
    state_of,
)
from shared_control_env.core.control.qp import box
from shared_control_env.core.control.qp.box import solve_box_qp
from shared_control_env.core.parameters import Parameters
from shared_control_env.core.records import AutomationMemory, Scene, Signals, record_dtype
from shared_control_env.core.risk.lateral import continuous_field, cut_off
from shared_control_env.core.risk.safe_area import free_rectangle
from shared_control_env.core.world.vehicle import V_X, R, S, Y, derivatives, implicit_step, linear_axles, turned

CONVERGED, ITERATION_LIMIT, FAILED = 0, 1, 2
"""Statuses: stationary to :data:`TOLERANCE`; stopped before that; a value that is not finite."""

TOLERANCE = 1e-8
"""Projected gradient below which the solution counts as stationary [-], with commands divided by their limits."""

_ARMIJO = 1e-4
_SHORTEST_STEP = 1e-3


class Automations:
    """The automation's problems of a block of environments, and their solutions; one record per thread.

    Attributes:
        block: the block; its weights and horizons are those of Eq. 13.
        unaffected: rectangle [start, end, low, high] in the road frame in which the field is 0 [m].
        point: position (s, d) at a stage [m].
        field: field P at a stage [-] and its derivatives with respect to s and d [1/m].
        limit: largest number of iterations.
        status: CONVERGED, ITERATION_LIMIT or FAILED.
        iterations: number of Gauss-Newton iterations.
        residual: projected gradient at the last linearisation [-].
        cost: J at the solution [-].
        step: step of the commands.
        low, high: bounds of the step.
        trial: commands from which the step starts.
        box: scratch of the solver of the quadratic program.
    """

    block: blocks.Block
    unaffected: Annotated[np.ndarray, (4, WIDTH)]
    point: Annotated[np.ndarray, (2, WIDTH)]
    field: Annotated[np.ndarray, (3, WIDTH)]
    limit: Lane
    status: Lane
    iterations: Lane
    residual: Lane
    cost: Lane
    step: Column
    low: Column
    high: Column
    trial: Commands
    box: box.Workspace


AUTOMATIONS = record_dtype(Automations)


@jit
def enter(lane: int, index: int, scene: Scene, p: Parameters, U: np.ndarray, work: Automations) -> None:
    """Let the automation of an environment enter a lane: its problem, with the warm start.

    Args:
        lane: index of the lane.
        index: index of the environment.
        scene: record of :data:`records.SCENE` as the automation perceives it, with the safe area.
        p: parameters.
        U: guess of the commands ``[a, delta]`` [m/s^2, rad], shape (>= H_c, 2).
        work: record of :data:`AUTOMATIONS`, written.
    """
    block = work.block
    blocks.enter(lane, index, 0, scene, p.automation, p, block)
    for j in range(p.automation.H_c):
        block.U[j, 0, lane], block.U[j, 1, lane] = U[j, 0], U[j, 1]
    work.limit[lane] = p.solver.first_iterations if scene.k == 0 else p.solver.iterations
    rectangle = free_rectangle(scene.area, cut_off(p.lateral))
    for i in range(4):
        work.unaffected[i, lane] = rectangle[i]


@jit
def roll_out(with_model: bool, scenes: np.ndarray, parameters: np.ndarray, work: Automations) -> None:
    """Compute the cost of the commands, Eq. 13, and the quadratic model of half the cost about them, in every lane.

    ::

        J = sum_{i=1}^{H_p} R P(i)^2 + W (y(i) - y_target)^2 + H (v_x(i) - v_target)^2 + N r'(i)^2
            + sum_{j=0}^{H_c-1} Q_a a(j)^2 + Q_delta delta(j)^2

    where P is the field of the boundaries minus its value at the cut-off, and ``r'(i) = (r(i) - r(i-1)) / dt``.

    Args:
        with_model: whether to write ``block.gradient`` and ``block.hessian``; J is the same to the bit if not.
        scenes: records of :data:`records.SCENE`, shape (N,).
        parameters: records of :class:`Parameters`, shape (N,).
        work: record of :data:`AUTOMATIONS`; ``block.value`` is written.
    """
    block = work.block
    dt, car = block.dt, dynamics_of(block)
    axles = linear_axles(car)
    if with_model:
        clear(block)
    z = state_of(block.z)
    heading = load(block.heading[0]), load(block.heading[1])
    wheel = heading
    total = spread(0.0)
    for i in range(block.H_p):
        j = min(i, block.H_c - 1)
        n = 2 * j + 2 if with_model else 0
        a, delta, kappa = load(block.U[j, 0]), load(block.U[j, 1]), load(block.kappa[i])
        if i == j:
            wheel = turned((spread(1.0), spread(0.0)), delta)
        z_next, heading_next, inner = implicit_step(z, heading, a, delta, wheel, kappa, dt, car, axles)
        if with_model:
            step = derivatives(z, heading, a, delta, wheel, kappa, dt, car, z_next, heading_next, inner)
            propagate(block, n, step, True)
        y_error, v_error = z_next[Y] - load(block.y_target), z_next[V_X] - load(block.v_target)
        total = total + add_tracking(block, y_error, v_error, z_next[R] - z[R], n)
        if holds_in_any(_affected(z_next[S], z_next[Y], work)):
            total = total + _add_field(z_next[S], z_next[Y], n, scenes, parameters, work)
        z, heading = z_next, heading_next
    store(block.value, total + add_effort(block, with_model))


@jit_inlined
def _affected(s: Number, d: Number, work: Automations) -> Truth:
    """Whether the field may be larger than 0 at a position."""
    start, end, low, high = work.unaffected[0], work.unaffected[1], work.unaffected[2], work.unaffected[3]
    inside = (s > load(start)) & (s < load(end)) & (d > load(low)) & (d < load(high))
    return (load(work.block.entered) > 0.0) & ~inside


@jit
def _add_field(s: Number, d: Number, n: int, scenes: np.ndarray, parameters: np.ndarray, work: Automations) -> Number:
    """Add the field's term at a position in every lane in use, and return its value."""
    block = work.block
    store(work.point[0], s)
    store(work.point[1], d)
    for lane in range(WIDTH):
        if block.entered[lane] == 0.0:
            continue  # what an earlier environment left there is not used
        index = block.index[lane]
        work.field[0, lane], work.field[1, lane], work.field[2, lane] = continuous_field(
            scenes[index].area, work.point[0, lane], work.point[1, lane], parameters[index].lateral
        )
    P, P_s, P_d = load(work.field[0]), load(work.field[1]), load(work.field[2])
    weight = load(block.weights[FIELD])
    for c in range(n):
        store(block.row[c], P_s * load(block.sensitivity[c, S]) + P_d * load(block.sensitivity[c, Y]))
    add_square(block, weight, P, n)
    return weight * (P * P)


@jit_inlined
def projected_gradient(block: blocks.Block) -> Number:
    """Stationarity measure of a bounded problem: ``max |u - clip(u - g)|`` for commands u divided by their limits.

    Args:
        block: record of :data:`block.BLOCK` with the gradient at U.

    Returns:
        The measure [-]; 0 at a stationary point.
    """
    largest = spread(0.0)
    for c in range(2 * block.H_c):
        bound = load(block.bounds[c % 2])
        u, g = load(block.U[c // 2, c % 2]) / bound, load(block.gradient[c]) * bound
        moved = u - g
        moved = choose(moved < -1.0, -1.0, moved)
        moved = u - choose(moved > 1.0, 1.0, moved)
        moved = choose(moved < 0.0, -moved, moved)
        largest = choose(moved > largest, moved, largest)
    return largest


@jit_inlined
def _plan_step(wanted: Truth, work: Automations) -> Number:
    """Write the step to the quadratic model's bounded minimum to ``work.step``; return the cost's slope along it."""
    block, n = work.block, 2 * work.block.H_c
    for c in range(n):
        bound, u = load(block.bounds[c % 2]), load(block.U[c // 2, c % 2])
        store(work.low[c], -bound - u)
        store(work.high[c], bound - u)
        store(work.trial[c // 2, c % 2], u)
    solve_box_qp(n, block.hessian, block.gradient, work.low, work.high, wanted, work.step, work.box)
    slope = spread(0.0)
    for c in range(n):
        slope = slope + 2.0 * load(block.gradient[c]) * load(work.step[c])
    return slope


@jit_inlined
def _step_along(length: Number, wanted: Truth, work: Automations) -> None:
    """Move the commands of some lanes along the step."""
    U = work.block.U
    for c in range(2 * work.block.H_c):
        u = load(U[c // 2, c % 2])
        store(U[c // 2, c % 2], choose(wanted, load(work.trial[c // 2, c % 2]) + length * load(work.step[c]), u))


@jit_inlined
def _is_finite(x: Number) -> Truth:
    return x - x == 0.0


@jit_inlined
def solve(scenes: np.ndarray, parameters: np.ndarray, work: Automations) -> None:
    """Minimise Eq. 13 over the bounded commands in every lane, starting from the guess ``work.block.U``.

    Each step is halved until the cost decreases enough (Armijo). A trial point is linearised, since the next iteration
    needs the linearisation anyway; where no lane has a next iteration, only the cost is computed. A lane that is done
    waits for the others; its result does not depend on them.

    Args:
        scenes: records of :data:`records.SCENE`, shape (N,).
        parameters: records of :class:`Parameters`, shape (N,).
        work: record of :data:`AUTOMATIONS`; U, status, iterations, residual and cost are written.
    """
    block = work.block
    limit = load(work.limit)
    solved = load(block.entered) > 0.0
    going = solved
    roll_out(True, scenes, parameters, work)
    value, residual = load(block.value), projected_gradient(block)
    status, iterations = spread(ITERATION_LIMIT), spread(0.0)
    while True:
        going = going & (iterations < limit)
        failed = going & ~(_is_finite(value) & _is_finite(residual))
        converged = going & (residual <= TOLERANCE) & ~failed
        status = choose(failed, FAILED, choose(converged, CONVERGED, status))
        going = going & ~(failed | converged)
        if not holds_in_any(going):
            break
        slope = _plan_step(going, work)
        failed = going & ~_is_finite(slope)  # the Hessian is not positive definite in floating point
        status, going = choose(failed, FAILED, status), going & ~failed
        iterations = choose(going, iterations + 1.0, iterations)
        next_needed = going & (iterations < limit)
        with_model = holds_in_any(next_needed)
        length, searching = spread(1.0), going
        while holds_in_any(searching):
            _step_along(length, searching, work)
            roll_out(with_model, scenes, parameters, work)
            trial_value = load(block.value)
            accepted = searching & (trial_value <= value + _ARMIJO * length * slope)
            value, searching = choose(accepted, trial_value, value), searching & ~accepted
            length = choose(searching, 0.5 * length, length)
            too_short = searching & (length < _SHORTEST_STEP)
            if holds_in_any(too_short):
                _step_along(spread(0.0), too_short, work)
                going, searching = going & ~too_short, searching & ~too_short
        if with_model:
            residual = choose(going & next_needed, projected_gradient(block), residual)
    store(work.status, choose(solved, status, load(work.status)))
    store(work.iterations, choose(solved, iterations, load(work.iterations)))
    store(work.residual, choose(solved, residual, load(work.residual)))
    store(work.cost, choose(solved, value, load(work.cost)))


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


@jit
def leave(lane: int, work: Automations, memory: AutomationMemory, signals: Signals) -> None:
    """Let an environment's automation leave its lane: its desired command u_a,des, and the warm start of the next step.

    If the solver has failed, the last feasible command is held and the failure is counted.

    Args:
        lane: index of the lane.
        work: record of :data:`AUTOMATIONS`, solved.
        memory: record of :data:`records.AUTOMATION_MEMORY`, written.
        signals: record of :data:`records.SIGNALS`; ``u_a_des`` and the solver's outcome are written.
    """
    U, H_c = work.block.U, work.block.structures[1, lane]
    signals.status, signals.iterations = int(work.status[lane]), int(work.iterations[lane])
    signals.residual = work.residual[lane]
    if signals.status == FAILED:
        memory.failures += 1
        clear_sequence(memory.U)
    else:
        memory.u_a_des[0], memory.u_a_des[1] = U[0, 0, lane], U[0, 1, lane]
        for j in range(H_c):  # one step forward; the last command is repeated
            memory.U[j, 0], memory.U[j, 1] = U[min(j + 1, H_c - 1), 0, lane], U[min(j + 1, H_c - 1), 1, lane]
    signals.u_a_des[0], signals.u_a_des[1] = memory.u_a_des[0], memory.u_a_des[1]


def automate(scenes: np.ndarray, parameters: np.ndarray, work: Automations) -> None:
    """Solve the problems of all environments that wait, see :func:`solve`.

    Args:
        scenes: records of :data:`records.SCENE` with the safe areas, shape (N,).
        parameters: records of :class:`Parameters`, shape (N,).
        work: record of :data:`AUTOMATIONS`, written.
    """
    while gather(work.block):
        solve(scenes, parameters, work)


AUTOMATE = Interface(None, array_of(Scene), array_of(Parameters), Automations)
"""``automate(scenes, parameters, work)``, compiled separately from the loop."""
