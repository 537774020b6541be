"""Replay of recorded vehicles: each follows its track until the ego makes that impossible, and reacts from then on.

A track that is followed whatever happens drives through an ego that is slower than the recorded car was. A vehicle
therefore leaves its track, and follows by the Intelligent Driver Model, once another one is in its way that was not
there in the record: the ego, or a vehicle that has left its own track.
"""

from __future__ import annotations

from math import cos, sin

import numpy as np

from shared_control_env.core.compile.calls import MATRIX, VECTOR, Interface, array_of
from shared_control_env.core.compile.jit import jit
from shared_control_env.core.compile.memory import number_at
from shared_control_env.core.parameters import TrafficParameters
from shared_control_env.core.records import BODY_LENGTH, BODY_WIDTH, HEADING, SPEED, X, Y
from shared_control_env.core.world.collision import overlap
from shared_control_env.core.world.road import locate
from shared_control_env.core.world.traffic import decide_acceleration, desired_gap, move_along

TRACK_COLUMNS = 6
"""Number of columns of a track: X to YAW_RATE of the traffic array."""

AWAY = 1e7
"""Where a vehicle is before and after its record [m]: too far for anything to notice it."""

TOLERANCE = 0.5
"""How much nearer than in the record a vehicle must be to be in the way [m]."""

LOOK_AHEAD = 1.0
"""Time for which a replayed vehicle looks ahead along its track for a collision [s]."""

SIDE = 0.3
"""Lateral distance that counts as room between two vehicles [m]."""


@jit
def is_replayed(plan: TrafficParameters) -> bool:
    """Whether a vehicle follows its recorded track.

    Args:
        plan: plan of the vehicle.
    """
    return plan.track != 0 and not plan.follows


@jit
def read_track(address: int, step: int, steps: int, row: np.ndarray) -> None:
    """Read a row of a track, the first or last one beyond its ends.

    Args:
        address: address of the track.
        step: simulation step.
        steps: number of rows of the track.
        row: row of the traffic array, written but for the body, shape (8,).
    """
    at = min(max(step, 0), steps - 1)
    for i in range(TRACK_COLUMNS):
        row[i] = number_at(address, TRACK_COLUMNS * at + i)


@jit
def play(row: np.ndarray, plan: TrafficParameters, step: int, ego: np.ndarray, traffic: np.ndarray, me: int) -> None:
    """Put a replayed vehicle where it was at a simulation step; away before and after its record.

    A vehicle whose place at its first step is taken stays away until the place is free.

    Args:
        row: the vehicle's row of the traffic array, overwritten but for the body, shape (8,).
        plan: plan of the vehicle.
        step: simulation step.
        ego: the ego as a row of the traffic array, shape (8,).
        traffic: all other vehicles, shape (n, 8).
        me: index of the vehicle in the traffic array.
    """
    was_away = row[X] == AWAY
    read_track(plan.track, step, plan.steps, row)
    if step < plan.first or step > plan.last or (was_away and _is_taken(row, ego, traffic, me)):
        row[X], row[Y], row[HEADING] = AWAY, AWAY, 0.0
        for i in range(HEADING + 1, TRACK_COLUMNS):
            row[i] = 0.0


@jit
def _is_taken(row: np.ndarray, ego: np.ndarray, traffic: np.ndarray, me: int) -> bool:
    if overlap(row, ego):
        return True
    taken = False
    for i in range(traffic.shape[0]):
        taken = taken or (i != me and overlap(row, traffic[i]))
    return taken


@jit
def is_in_the_way(
    row: np.ndarray,
    plan: TrafficParameters,
    other: np.ndarray,
    track: int,
    step: int,
    dt: float,
    line: np.ndarray,
    work: np.ndarray,
) -> bool:
    """Whether another vehicle makes the record of a replayed one impossible.

    It does if it is ahead, nearer than the desired gap of the Intelligent Driver Model, and nearer than it was in the
    record; or if the replayed vehicle would drive into it within the look-ahead, where the record has no collision.

    Args:
        row: the replayed vehicle's row of the traffic array, shape (8,).
        plan: its plan.
        other: the other vehicle's row, shape (8,).
        track: address of the other vehicle's own track; 0 if it has none.
        step: simulation step.
        dt: simulation step [s].
        line: reference line, shape (n, 12).
        work: scratch, shape (3, 8).
    """
    there, mine, moved = work[0], work[1], work[2]
    s, d, _, _ = locate(line, row[X], row[Y])
    s_other, d_other, psi, _ = locate(line, other[X], other[Y])
    half = 0.5 * (row[BODY_LENGTH] + other[BODY_LENGTH])
    room = 0.5 * (row[BODY_WIDTH] + other[BODY_WIDTH]) + SIDE
    there[BODY_LENGTH], there[BODY_WIDTH] = other[BODY_LENGTH], other[BODY_WIDTH]
    if s_other > s and abs(d_other - d) < room:
        gap = s_other - s - half
        if gap < desired_gap(row[SPEED], other[SPEED] * cos(other[HEADING] - psi)):
            if track == 0:
                return True
            read_track(track, step, plan.steps, there)
            s_there, _, _, _ = locate(line, there[X], there[Y])
            if gap < s_there - s - half - TOLERANCE:
                return True
    if abs(s_other - s) > half + LOOK_AHEAD * (row[SPEED] + other[SPEED]):
        return False
    later = step + round(LOOK_AHEAD / dt)
    for i in range(8):
        mine[i], moved[i] = row[i], other[i]
    read_track(plan.track, later, plan.steps, mine)
    moved[X] += LOOK_AHEAD * other[SPEED] * cos(other[HEADING])
    moved[Y] += LOOK_AHEAD * other[SPEED] * sin(other[HEADING])
    if not overlap(mine, moved):
        return False
    if track == 0:
        return True
    read_track(track, later, plan.steps, there)
    return not overlap(mine, there)


@jit
def must_react(
    me: int,
    plans: np.ndarray,
    traffic: np.ndarray,
    ego: np.ndarray,
    step: int,
    dt: float,
    line: np.ndarray,
    work: np.ndarray,
) -> bool:
    """Whether a replayed vehicle has to leave its track.

    Args:
        me: index of the vehicle.
        plans: plans of all vehicles, records of :class:`core.parameters.TrafficParameters`, shape (n,).
        traffic: all vehicles but the ego, shape (n, 8).
        ego: the ego as a row of the traffic array, shape (8,).
        step: simulation step.
        dt: simulation step [s].
        line: reference line, shape (m, 12).
        work: scratch, shape (3, 8).
    """
    row, plan = traffic[me], plans[me]
    if row[X] == AWAY:
        return False
    if is_in_the_way(row, plan, ego, plan.ego_track, step, dt, line, work):
        return True
    for i in range(traffic.shape[0]):
        left = i != me and plans[i].track != 0 and plans[i].follows
        if left and is_in_the_way(row, plan, traffic[i], plans[i].track, step, dt, line, work):
            return True
    return False


def decide(
    me: int,
    plans: np.ndarray,
    traffic: np.ndarray,
    ego: np.ndarray,
    step: int,
    dt: float,
    line: np.ndarray,
    work: np.ndarray,
) -> None:
    """Decide how a vehicle moves in a simulation step: along its track, or at an acceleration of its own.

    Args:
        me: index of the vehicle.
        plans: plans of all vehicles, records of :class:`core.parameters.TrafficParameters`, shape (n,); ``follows`` is
            set for a vehicle that leaves its track.
        traffic: all vehicles but the ego, shape (n, 8); the vehicle's acceleration is written.
        ego: the ego as a row of the traffic array, shape (8,).
        step: simulation step.
        dt: simulation step [s].
        line: reference line, shape (m, 12).
        work: scratch, shape (3, 8).
    """
    if is_replayed(plans[me]):
        if not must_react(me, plans, traffic, ego, step, dt, line, work):
            return
        plan = plans[me]
        plan.follows = True
    if traffic[me, X] == AWAY:
        return
    decide_acceleration(traffic[me], plans[me], step * dt, ego, traffic, line)


def advance(
    me: int, plans: np.ndarray, traffic: np.ndarray, ego: np.ndarray, step: int, dt: float, line: np.ndarray
) -> None:
    """Move a vehicle through a simulation step.

    Args:
        me: index of the vehicle.
        plans: plans of all vehicles, shape (n,).
        traffic: all vehicles but the ego, shape (n, 8); the vehicle's row is overwritten.
        ego: the ego as a row of the traffic array, after its own step, shape (8,).
        step: simulation step at the start of the motion.
        dt: simulation step [s].
        line: reference line, shape (m, 12).
    """
    if is_replayed(plans[me]):
        play(traffic[me], plans[me], step + 1, ego, traffic, me)
    elif traffic[me, X] != AWAY:
        move_along(traffic[me], plans[me], line, step * dt, dt)


_PLANS = array_of(TrafficParameters)

DECIDE = Interface(None, int, _PLANS, MATRIX, VECTOR, int, float, MATRIX, MATRIX)
"""``decide(me, plans, traffic, ego, step, dt, line, work)``, compiled only where there are recorded tracks."""

ADVANCE = Interface(None, int, _PLANS, MATRIX, VECTOR, int, float, MATRIX)
"""``advance(me, plans, traffic, ego, step, dt, line)``, compiled only where there are recorded tracks."""
