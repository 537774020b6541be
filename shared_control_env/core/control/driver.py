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

from math import exp
from typing import Annotated

import numpy as np

from shared_control_env.core.compile.jit import jit, jit_inlined
from shared_control_env.core.compile.lanes import WIDTH, Number, choose, holds_in_any, load, spread, store
from shared_control_env.core.control import block as blocks
from shared_control_env.core.control.block import (
    COLUMNS,
    EFFORT_A,
    Column,
    Lane,
    add_effort,
    add_square,
    add_tracking,
    clear,
    dynamics_of,
    propagate,
    state_of,
)
from shared_control_env.core.control.qp.active_set import UNBOUNDED
from shared_control_env.core.parameters import Parameters
from shared_control_env.core.records import MAX_HORIZON, Scene, record_dtype
from shared_control_env.core.risk.safe_area import lateral_bounds
from shared_control_env.core.world.vehicle import (
    V_X,
    V_Y,
    Derivatives,
    R,
    S,
    State,
    Y,
    derivatives,
    implicit_step,
    less,
    linear_axles,
    plus,
    through_step,
    turned,
)

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


class Drivers:
    """The drivers' problems of a block of environments; one record per thread.

    Attributes:
        block: the block; its weights and horizons are those of Eq. 15.
        felt: the automation's actual command as felt last [m/s^2, rad].
        arm: the driver's actual command [m/s^2, rad].
        last: the driver's last desired command [m/s^2, rad].
        phi, rise: the arm's response as the internal model has it [-].
        gain: derivative of the arm's command with respect to U.
        station: path length at which the rows of C are evaluated [m].
        side: rows of the sides of C, one for each stage.
        lower, upper: sides of C less the position for U = 0, at each stage [m].
        end: row of the end of C.
        end_of_area: path length of the car's centre when its front reaches the end of C [m].
        room: end_of_area less the path length for U = 0 at the last stage [m].
        command: the drivers' desired commands ``[a, delta]`` [m/s^2, rad].
    """

    block: blocks.Block
    felt: Annotated[np.ndarray, (2, WIDTH)]
    arm: Annotated[np.ndarray, (2, WIDTH)]
    last: Annotated[np.ndarray, (2, WIDTH)]
    phi: Lane
    rise: Lane
    gain: Column
    station: Lane
    side: Annotated[np.ndarray, (MAX_HORIZON, COLUMNS, WIDTH)]
    lower: Annotated[np.ndarray, (MAX_HORIZON, WIDTH)]
    upper: Annotated[np.ndarray, (MAX_HORIZON, WIDTH)]
    end: Column
    end_of_area: Lane
    room: Lane
    command: Annotated[np.ndarray, (WIDTH, 2)]


DRIVERS = record_dtype(Drivers)


@jit
def enter(
    lane: int, index: int, scene: Scene, u_last: np.ndarray, u_h_act: np.ndarray, p: Parameters, work: Drivers
) -> None:
    """Let the driver of an environment enter a lane.

    Args:
        lane: index of the lane.
        index: index of the environment.
        scene: record of :data:`records.SCENE` as the driver perceives it.
        u_last: the driver's last desired command [m/s^2, rad], shape (2,).
        u_h_act: the driver's present actual command u_h,act(k) [m/s^2, rad], shape (2,).
        p: parameters.
        work: record of :data:`DRIVERS`, written.
    """
    blocks.enter(lane, index, int(p.internal_model.active), scene, p.driver, p, work.block)
    for channel in range(2):
        work.felt[channel, lane], work.arm[channel, lane] = scene.felt[channel], u_h_act[channel]
        work.last[channel, lane] = u_last[channel]
    work.phi[lane] = exp(-p.task.dt / p.internal_model.T_h)
    work.rise[lane] = p.internal_model.K_h * (1.0 - work.phi[lane])
    work.end_of_area[lane] = scene.area.end - 0.5 * p.model.length


@jit
def condense(scenes: np.ndarray, work: Drivers) -> None:
    """Compute the quadratic models and the rows of the sides and the end of C, in every lane.

    The paper's model is linearised about the driver's last desired command. The internal model is linearised about the
    sum of the driver's present actual command and the automation's command as last felt.

    Args:
        scenes: records of :data:`records.SCENE` with the safe areas, shape (N,).
        work: record of :data:`DRIVERS`, written.
    """
    block, sens = work.block, work.block.sensitivity
    dt, car = block.dt, dynamics_of(block)
    axles = linear_axles(car)
    n, internal = 2 * block.H_c, block.kind == 1
    start, heading = state_of(block.z), (load(block.heading[0]), load(block.heading[1]))
    arm_a, arm_delta = load(work.arm[0]), load(work.arm[1])
    felt_a, felt_delta = load(work.felt[0]), load(work.felt[1])
    last_a, last_delta = load(work.last[0]), load(work.last[1])
    a, delta = last_a, last_delta
    if internal:
        a, delta = felt_a + arm_a, felt_delta + arm_delta
    # A command that would stop the car within the step hides that the car can start to move. Linearise at rest instead.
    stopping = -start[V_X] / dt - start[R] * start[V_Y]
    a = choose(a < stopping, stopping, a)
    # The rows of C are evaluated at the path length that the car reaches under this command.
    expected_a, expected_delta = (last_a, last_delta) if internal else (a, delta)
    wheel = turned((spread(1.0), spread(0.0)), delta)
    phi, rise = load(work.phi), load(work.rise)
    clear(block)
    for c in range(n):
        store(work.gain[c], 0.0)
    z = start
    for i in range(block.H_p):
        # z(i+1) = A z(i) + B u(i) + affine, with A, B and affine at the current state; they vary only with kappa.
        kappa = load(block.kappa[i])
        if i == 0 or holds_in_any(~(kappa == load(block.kappa[i - 1]))):
            z_next, heading_next, inner = implicit_step(start, heading, a, delta, wheel, kappa, dt, car, axles)
            step = derivatives(start, heading, a, delta, wheel, kappa, dt, car, z_next, heading_next, inner)
            affine = less(less(z_next, through_step(start, step)), _by_command(a, delta, step))
        z_next = plus(affine, through_step(z, step))
        columns = n if internal else 2 * min(i, block.H_c - 1) + 2
        propagate(block, columns, step, not internal)
        if internal:
            u_a, u_delta = felt_a + arm_a, felt_delta + arm_delta
            z_next = plus(z_next, _by_command(u_a, u_delta, step))
            _add_arm(i, u_a, u_delta, step, work)
            arm_a, arm_delta = phi * arm_a - rise * felt_a, phi * arm_delta - rise * felt_delta
            for c in range(n):
                gain = phi * load(work.gain[c])
                store(work.gain[c], gain + rise if c // 2 == min(i, block.H_c - 1) else gain)
        y_error, v_error = z_next[Y] - load(block.y_target), z_next[V_X] - load(block.v_target)
        add_tracking(block, y_error, v_error, z_next[R] - z[R], columns)
        station = z_next[S]
        for c in range(columns):
            station = station + load(sens[c, S]) * (expected_a if c % 2 == 0 else expected_delta)
            store(work.side[i, c], load(sens[c, Y]) * load(block.bounds[c % 2]))
        for c in range(columns, n):
            store(work.side[i, c], 0.0)
        store(work.station, station)
        for lane in range(WIDTH):
            if block.entered[lane] > 0.0:
                work.lower[i, lane], work.upper[i, lane] = lateral_bounds(
                    scenes[block.index[lane]].area, work.station[lane]
                )
        store(work.lower[i], load(work.lower[i]) - z_next[Y])
        store(work.upper[i], load(work.upper[i]) - z_next[Y])
        z = z_next
    store(work.room, load(work.end_of_area) - z[S])
    for c in range(n):
        store(work.end[c], load(sens[c, S]) * load(block.bounds[c % 2]))
    if internal:
        for c in range(n):
            share = SHARE_OF_DESIRED * load(block.weights[EFFORT_A + c % 2])
            store(block.hessian[c, c], load(block.hessian[c, c]) + share)
    else:
        for c in range(n):
            store(block.U[c // 2, c % 2], 0.0)
        add_effort(block, True)


@jit_inlined
def _by_command(a: Number, delta: Number, step: Derivatives) -> State:
    """Change of the new state that a command makes."""
    x, y = step.a, step.delta
    return (
        a * x[0] + delta * y[0],
        a * x[1] + delta * y[1],
        a * x[2] + delta * y[2],
        a * x[3] + delta * y[3],
        a * x[4] + delta * y[4],
        a * x[5] + delta * y[5],
    )


@jit_inlined
def _add_arm(i: int, a: Number, delta: Number, step: Derivatives, work: Drivers) -> None:
    """Add the effect and the effort of the command u(i) that drives the car at stage i, with the internal model.

    Args:
        i: index of the stage.
        a, delta: u(i) for u_h,des = 0 [m/s^2, rad].
        step: derivatives of the step.
        work: record of :data:`DRIVERS`. ``gain`` holds du_h,act(i)/dU. The effect is added to the sensitivities of the
            next state, the effort to the quadratic model.
    """
    block = work.block
    n = 2 * block.H_c
    for c in range(n):
        by = step.a if c % 2 == 0 else step.delta
        gain = load(work.gain[c])
        for j in range(6):
            store(block.sensitivity[c, j], load(block.sensitivity[c, j]) + by[j] * gain)
        store(block.yaw_step[c], load(block.yaw_step[c]) + by[R] * gain)
    if i < 1 or i > block.H_c:
        return
    for channel in range(2):
        for c in range(n):
            store(block.row[c], load(work.gain[c]) if c % 2 == channel else spread(0.0))
        add_square(block, load(block.weights[EFFORT_A + channel]), a if channel == 0 else delta, n)


@jit
def program_of(
    lane: int,
    p: Parameters,
    work: Drivers,
    P: np.ndarray,
    q: np.ndarray,
    A: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
) -> None:
    """Write the program of one lane as dense matrices.

    Args:
        lane: index of the lane.
        p: parameters.
        work: record of :data:`DRIVERS`, condensed.
        P: quadratic cost, symmetric, written, shape (n, n) with n = :func:`count_variables`.
        q: linear cost, written, shape (n,).
        A: constraint matrix, written, shape (:func:`count_rows`, n).
        low, high: bounds of the rows of A, written, one entry per row.
    """
    block, H_p = work.block, p.driver.H_p
    n = 2 * p.driver.H_c
    for i in range(H_p):
        for c in range(n):
            A[i, c] = A[H_p + i, c] = work.side[i, c, lane]
        A[i, n], A[H_p + i, n] = -1.0, 1.0
        A[i, n + 1] = A[H_p + i, n + 1] = 0.0
        low[i], high[i] = -UNBOUNDED, work.upper[i, lane]
        low[H_p + i], high[H_p + i] = work.lower[i, lane], UNBOUNDED
    first = 2 * H_p
    for c in range(n):
        A[first, c] = work.end[c, lane]
    A[first, n], A[first, n + 1] = 0.0, -1.0
    low[first], high[first] = -UNBOUNDED, work.room[lane]
    first += 1
    for c in range(n + SLACKS):
        for e in range(n + SLACKS):
            A[first + c, e] = 1.0 if c == e else 0.0
        low[first + c], high[first + c] = (-1.0, 1.0) if c < n else (0.0, UNBOUNDED)
        for e in range(n, n + SLACKS):
            P[c, e] = P[e, c] = 0.0
    for c in range(n):
        bound_c = block.bounds[c % 2, lane]
        q[c] = 2.0 * block.gradient[c, lane] * bound_c
        for e in range(c + 1):
            P[c, e] = P[e, c] = 2.0 * block.hessian[c, e, lane] * bound_c * block.bounds[e % 2, lane]
    for e in range(n, n + SLACKS):
        P[e, e], q[e] = 2.0 * SLACK_QUADRATIC, SLACK_LINEAR
