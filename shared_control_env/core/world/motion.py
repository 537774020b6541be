"""Motion of all vehicles through one decision, and the ego's collisions."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from shared_control_env.core.compile.calls import MATRIX, VECTOR, Interface, array_of
from shared_control_env.core.parameters import Parameters, TrafficParameters
from shared_control_env.core.records import (
    BODY_LENGTH,
    BODY_WIDTH,
    HEADING,
    SPEED,
    Memory,
    Signals,
    Transition,
    X,
    Y,
)
from shared_control_env.core.world.actuator import actuate
from shared_control_env.core.world.collision import overlap
from shared_control_env.core.world.replay import ADVANCE, AWAY, DECIDE
from shared_control_env.core.world.traffic import decide_acceleration, move_along
from shared_control_env.core.world.vehicle import plant_step

decide, advance = DECIDE.call, ADVANCE.call


class Motion:
    """Scratch of one environment's motion.

    Attributes:
        row: the ego as a row of the traffic array.
        trial: scratch of replayed vehicles that look ahead.
    """

    row: Annotated[np.ndarray, (8,)]
    trial: Annotated[np.ndarray, (3, 8)]


def move(
    k: int,
    frames: int,
    dt: float,
    signals: Signals,
    p: Parameters,
    state: np.ndarray,
    traffic: np.ndarray,
    plans: np.ndarray,
    line: np.ndarray,
    memory: Memory,
    transition: Transition,
    work: Motion,
) -> None:
    """Move all vehicles through the simulation steps of one decision, and detect collisions of the ego.

    Args:
        k: time step of the decision.
        frames: number of simulation steps.
        dt: duration of a simulation step [s].
        signals: record of :data:`records.SIGNALS`; its ``u`` commands the ego.
        p: parameters.
        state: ego ``[x, y, psi, v_x, v_y, r]``, overwritten, shape (6,).
        traffic: other vehicles, overwritten, shape (M, 8).
        plans: their plans, records of :class:`core.parameters.TrafficParameters`, shape (M,).
        line: reference line of the road, shape (n, 12).
        memory: record of :data:`records.MEMORY`; the output of the actuators, ``realised``, is updated.
        transition: record of :data:`records.TRANSITION`; ``crashed`` is set on a collision.
        work: scratch.
    """
    realised, row = memory.realised, work.row[:]
    row[BODY_LENGTH], row[BODY_WIDTH] = p.vehicle.length, p.vehicle.width
    for frame in range(frames):
        row[X], row[Y], row[HEADING], row[SPEED] = state[0], state[1], state[2], state[3]
        step = k * frames + frame
        for j in range(traffic.shape[0]):
            if plans[j].track != 0:
                decide(plans[j].decide, j, plans, traffic, row, step, dt, line, work.trial[:])
            elif traffic[j, X] != AWAY:
                decide_acceleration(traffic[j], plans[j], step * dt, row, traffic, line)
        actuate(signals.u, dt, p.actuator, realised)
        plant_step(state, realised[0], realised[1], dt, p.vehicle)
        row[X], row[Y], row[HEADING] = state[0], state[1], state[2]
        for j in range(traffic.shape[0]):
            if plans[j].track != 0:
                advance(plans[j].advance, j, plans, traffic, row, step, dt, line)
            elif traffic[j, X] != AWAY:
                move_along(traffic[j], plans[j], line, step * dt, dt)
        for j in range(traffic.shape[0]):
            if overlap(row, traffic[j]):
                transition.crashed = True


_PLANS = array_of(TrafficParameters)

MOVE = Interface(None, int, int, float, Signals, Parameters, VECTOR, MATRIX, _PLANS, MATRIX, Memory, Transition, Motion)
"""``move(k, frames, dt, signals, p, state, traffic, plans, line, memory, transition, work)``, compiled by itself."""
