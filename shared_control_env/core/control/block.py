"""A block of eight environments, and their quadratic models: the common part of both predictive controllers.

A lane of the block is one environment (:mod:`compile.lanes`). The variables of a model are ``U``, H_c commands
``[a, delta]``, which make n = 2 H_c columns. The last command is held to the end of the horizon. The sensitivities
``dz(i)/dU`` follow from the linearised steps. The square of each residual of the cost is added to the gradient and to
the Gauss-Newton Hessian of half the cost (condensing).
"""

from __future__ import annotations

from math import cos, sin
from typing import Annotated, TypeAlias

import numpy as np

from shared_control_env.core.compile.jit import jit, jit_inlined
from shared_control_env.core.compile.lanes import WIDTH, Number, load, spread, store
from shared_control_env.core.parameters import Parameters, PredictiveParameters
from shared_control_env.core.records import MAX_CONTROL, MAX_HORIZON, Scene, record_dtype
from shared_control_env.core.world.vehicle import PSI, V_X, Derivatives, Dynamics, R, State, Y, plus, through_step

COLUMNS = 2 * MAX_CONTROL
"""Largest number of columns."""

Lane: TypeAlias = Annotated[np.ndarray, (WIDTH,)]
Commands: TypeAlias = Annotated[np.ndarray, (MAX_CONTROL, 2, WIDTH)]
Column: TypeAlias = Annotated[np.ndarray, (COLUMNS, WIDTH)]
Square: TypeAlias = Annotated[np.ndarray, (COLUMNS, COLUMNS, WIDTH)]


class Block:
    """A controller's problems of eight environments, one per lane; one record per thread serves any number of blocks.

    Attributes:
        waiting: 1 where an environment waits in the lane for its solution.
        entered: 1 where the environment is among those that are solved together.
        index: index of the environment.
        structures: horizons H_p and H_c of each lane, and the kind of its model.
        H_p, H_c, kind: those of the lanes that are solved together.
        dt: step [s], the same for all lanes.
        z: states at the present.
        heading: cosine and sine of their psi.
        kappa: curvature at the stages of the horizon [1/m].
        y_target, v_target: lateral position [m] and speed [m/s] to track.
        dynamics: parameters of the vehicle, in the order of :class:`world.vehicle.Dynamics`.
        weights: W, H and N / dt^2 of the terms of tracking, Q_a and Q_delta of the effort, R of the field.
        bounds: largest acceleration [m/s^2] and steering angle [rad].
        U: commands.
        value: cost at U.
        sensitivity: derivative of the state with respect to U, a state for each column.
        yaw_step: derivative of the change of the yaw rate over the last step with respect to U.
        row: derivative of one residual with respect to U.
        gradient: gradient of half the cost.
        hessian: Gauss-Newton Hessian of half the cost; the entries [c, e] with e <= c are used.
    """

    waiting: Lane
    entered: Lane
    index: Annotated[np.ndarray, (WIDTH,), np.int64]
    structures: Annotated[np.ndarray, (3, WIDTH), np.int64]
    H_p: int
    H_c: int
    kind: int
    dt: float
    z: Annotated[np.ndarray, (6, WIDTH)]
    heading: Annotated[np.ndarray, (2, WIDTH)]
    kappa: Annotated[np.ndarray, (MAX_HORIZON, WIDTH)]
    y_target: Lane
    v_target: Lane
    dynamics: Annotated[np.ndarray, (6, WIDTH)]
    weights: Annotated[np.ndarray, (6, WIDTH)]
    bounds: Annotated[np.ndarray, (2, WIDTH)]
    U: Commands
    value: Lane
    sensitivity: Annotated[np.ndarray, (COLUMNS, 6, WIDTH)]
    yaw_step: Column
    row: Column
    gradient: Column
    hessian: Square


BLOCK = record_dtype(Block)

TRACK_Y, TRACK_V, TRACK_R, EFFORT_A, EFFORT_DELTA, FIELD = range(6)
"""Rows of a block's weights."""


@jit_inlined
def empty(block: Block) -> None:
    """Let all environments leave a block.

    Args:
        block: record of :data:`BLOCK`, written.
    """
    for lane in range(WIDTH):
        block.waiting[lane] = block.entered[lane] = 0.0


@jit
def enter(
    lane: int, index: int, kind: int, scene: Scene, weights: PredictiveParameters, p: Parameters, block: Block
) -> None:
    """Let an environment enter a lane of a block.

    Args:
        lane: index of the lane.
        index: index of the environment.
        kind: number that tells models of different structure apart.
        scene: record of :data:`records.SCENE` as the controller perceives it.
        weights: horizons and weights of the controller.
        p: parameters of the environment.
        block: record of :data:`BLOCK`, written.
    """
    block.waiting[lane], block.index[lane], block.dt = 1.0, index, p.task.dt
    block.structures[0, lane], block.structures[1, lane] = weights.H_p, weights.H_c
    block.structures[2, lane] = kind
    for i in range(6):
        block.z[i, lane] = scene.z[i]
    block.heading[0, lane], block.heading[1, lane] = cos(scene.z[PSI]), sin(scene.z[PSI])
    for i in range(weights.H_p):
        block.kappa[i, lane] = scene.kappa[i]
    block.y_target[lane], block.v_target[lane] = scene.y_target, scene.v_target
    car = p.model
    block.dynamics[0, lane], block.dynamics[1, lane] = car.m, car.I_z
    block.dynamics[2, lane], block.dynamics[3, lane] = car.l_f, car.l_r
    block.dynamics[4, lane], block.dynamics[5, lane] = car.C_f, car.C_r
    block.weights[TRACK_Y, lane], block.weights[TRACK_V, lane] = weights.W, weights.H
    block.weights[TRACK_R, lane] = weights.N / (p.task.dt * p.task.dt)
    block.weights[EFFORT_A, lane], block.weights[EFFORT_DELTA, lane] = weights.Q_a, weights.Q_delta
    block.weights[FIELD, lane] = weights.R
    block.bounds[0, lane], block.bounds[1, lane] = p.limits.a_max, p.limits.delta_max


@jit
def gather(block: Block) -> bool:
    """Choose the lanes that are solved together next: those with the structure of the first one that waits.

    Args:
        block: record of :data:`BLOCK`; ``entered`` and the structure are written.

    Returns:
        Whether an environment waited.
    """
    found = False
    for lane in range(WIDTH):
        block.entered[lane] = 0.0
        if block.waiting[lane] == 0.0:
            continue
        H_p, H_c, kind = block.structures[0, lane], block.structures[1, lane], block.structures[2, lane]
        if not found:
            found, block.H_p, block.H_c, block.kind = True, H_p, H_c, kind
        if H_p == block.H_p and H_c == block.H_c and kind == block.kind:
            block.waiting[lane], block.entered[lane] = 0.0, 1.0
    return found


@jit_inlined
def state_of(rows: np.ndarray) -> State:
    """A state, or a column of the sensitivities, as lanes.

    Args:
        rows: array, shape (6, WIDTH).
    """
    return load(rows[0]), load(rows[1]), load(rows[2]), load(rows[3]), load(rows[4]), load(rows[5])


@jit_inlined
def dynamics_of(block: Block) -> Dynamics:
    """Parameters of the vehicles of a block.

    Args:
        block: record of :data:`BLOCK`.
    """
    m, I_z, l_f, l_r, C_f, C_r = state_of(block.dynamics)
    return Dynamics(m, I_z, l_f, l_r, C_f, C_r)


@jit_inlined
def clear(block: Block) -> None:
    """Start condensing: set gradient, Hessian and sensitivities to zero.

    Args:
        block: record of :data:`BLOCK`, written.
    """
    zero = spread(0.0)
    for c in range(2 * block.H_c):
        store(block.gradient[c], zero)
        for i in range(6):
            store(block.sensitivity[c, i], zero)
        for e in range(c + 1):
            store(block.hessian[c, e], zero)


@jit_inlined
def propagate(block: Block, n: int, step: Derivatives, commanded: bool) -> None:
    """Propagate the sensitivities over one step: through the state, and from the command in the last two columns.

    Args:
        block: record of :data:`BLOCK`; ``sensitivity`` and ``yaw_step`` are written.
        n: number of active columns: 2 for every command used so far.
        step: derivatives of the step.
        commanded: whether the last two columns are the command of the step.
    """
    for c in range(n):
        x = state_of(block.sensitivity[c])
        before = x[R]
        x = through_step(x, step)
        if commanded and c == n - 2:
            x = plus(x, step.a)
        elif commanded and c == n - 1:
            x = plus(x, step.delta)
        for i in range(6):
            store(block.sensitivity[c, i], x[i])
        store(block.yaw_step[c], x[R] - before)


@jit_inlined
def add_tracking(block: Block, y_error: Number, v_error: Number, r_change: Number, n: int) -> Number:
    """Add the terms of one stage that Eq. 13 and Eq. 15 have in common.

    ``W (y - y_target)^2 + H (v_x - v_target)^2 + N r'^2`` with ``r'(i) = (r(i) - r(i-1)) / dt``, which is exact
    for the implicit step.

    Args:
        block: record of :data:`BLOCK`; ``sensitivity`` and ``yaw_step`` hold their values after the stage.
        y_error, v_error: errors of lateral position [m] and speed [m/s] after the stage.
        r_change: change of the yaw rate over the stage [rad/s].
        n: number of active columns; 0 to compute the value alone.

    Returns:
        Sum of the terms [-].
    """
    weights, sens, yaw_step = block.weights, block.sensitivity, block.yaw_step
    W, H, N = load(weights[TRACK_Y]), load(weights[TRACK_V]), load(weights[TRACK_R])
    for c in range(n):
        w_y, w_v, w_r = W * load(sens[c, Y]), H * load(sens[c, V_X]), N * load(yaw_step[c])
        store(block.gradient[c], load(block.gradient[c]) + (w_y * y_error + w_v * v_error + w_r * r_change))
        for e in range(c + 1):
            product = w_y * load(sens[e, Y]) + w_v * load(sens[e, V_X]) + w_r * load(yaw_step[e])
            store(block.hessian[c, e], load(block.hessian[c, e]) + product)
    return W * (y_error * y_error) + H * (v_error * v_error) + N * (r_change * r_change)


@jit_inlined
def add_square(block: Block, weight: Number, residual: Number, n: int) -> None:
    """Add the term ``weight (residual + row . dU)^2`` to the quadratic model.

    Args:
        block: record of :data:`BLOCK`; ``row`` holds the derivative of the residual.
        weight, residual: weight and residual of the term.
        n: number of active columns.
    """
    for c in range(n):
        scaled = weight * load(block.row[c])
        store(block.gradient[c], load(block.gradient[c]) + scaled * residual)
        for e in range(c + 1):
            store(block.hessian[c, e], load(block.hessian[c, e]) + scaled * load(block.row[e]))


@jit_inlined
def add_effort(block: Block, with_model: bool) -> Number:
    """Add the effort ``sum_j Q_a a(j)^2 + Q_delta delta(j)^2`` of the commands U.

    Args:
        block: record of :data:`BLOCK`; gradient and Hessian are written.
        with_model: whether to add to the quadratic model; if not, the value alone is computed.

    Returns:
        Value of the effort [-].
    """
    value = spread(0.0)
    for c in range(2 * block.H_c):
        weight, u = load(block.weights[EFFORT_A + c % 2]), load(block.U[c // 2, c % 2])
        value = value + weight * (u * u)
        if with_model:
            store(block.gradient[c], load(block.gradient[c]) + weight * u)
            store(block.hessian[c, c], load(block.hessian[c, c]) + weight)
    return value
