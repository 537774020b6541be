"""Structured arrays that the compiled functions read and write: one record an environment.

The single environment holds arrays of no dimension, the vectorised one arrays of many records, and both
run the same functions on a record. Inside compiled functions the fields are attributes, as those of the
named tuples they mirror.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple, TypeAlias, get_type_hints

import numpy as np

Record: TypeAlias = Any
"""A record of one of the structured types below, or the named tuple it mirrors; its fields are attributes."""

MAX_HORIZON = 30
"""Longest prediction horizon H_p [steps]."""

MAX_CONTROL = 10
"""Longest control horizon H_c [steps]."""

MAX_DELAY = 21
"""Time steps of the command that a delay can reach back to, the present one included."""

MAX_CHAIN = 20
"""Vertices kept of a boundary of the safe area; shorter ones repeat their last vertex."""

X, Y, HEADING, SPEED, ACCELERATION, YAW_RATE, BODY_LENGTH, BODY_WIDTH = range(8)
"""Columns of the traffic array: Cartesian pose [m, rad], motion [m/s, m/s^2, rad/s], body [m]."""

PRESENT, NEAR_S, NEAR_D, NEAR_SPEED, NEAR_ROW = range(5)
"""Columns of a scene's neighbours: 1 if there is one, road-frame position [m], speed [m/s], traffic row."""


@cache
def record_dtype(parameters: type) -> np.dtype:
    """Aligned structured type with the fields of a named-tuple class, nested classes included."""
    fields = []
    for name, kind in get_type_hints(parameters).items():
        fields.append((name, record_dtype(kind) if hasattr(kind, "_fields") else np.dtype(kind)))
    return np.dtype(fields, align=True)


def pack(parameters: NamedTuple) -> np.ndarray:
    """Record that holds a (nested) named tuple's values, as an array of no dimension."""
    return np.array(_plain(parameters), dtype=record_dtype(type(parameters)))


def _plain(value: object) -> object:
    """Named tuples as plain nested tuples, which NumPy assigns to a record by position."""
    return tuple(_plain(item) for item in value) if isinstance(value, tuple) else value


SAFE_AREA = np.dtype(
    [
        ("lower", np.float64, (MAX_CHAIN, 2)),  # lower (right) boundary, vertices (s, d) [m]
        ("upper", np.float64, (MAX_CHAIN, 2)),  # upper (left) boundary, vertices (s, d) [m]
        ("start", np.float64),  # s where the area begins [m]
        ("end", np.float64),  # s where it ends [m]
        ("outcome", np.int64),  # safe_area.REACHED or safe_area.BLOCKED
    ],
    align=True,
)
"""The safe area C in the road frame."""

SCENE = np.dtype(
    [
        ("k", np.int64),  # time step
        ("t", np.float64),  # time [s]
        ("state", np.float64, (6,)),  # ego [x, y, psi, v_x, v_y, r], Cartesian frame
        ("z", np.float64, (6,)),  # ego [s, y, psi, v_x, v_y, r], road frame
        ("kappa", np.float64, (MAX_HORIZON,)),  # curvature at the stages of the horizon [1/m]
        ("y_target", np.float64),  # lateral position to track [m]
        ("v_target", np.float64),  # speed to track [m/s]
        ("changing", np.bool_),  # whether a lane change is under way
        ("felt", np.float64, (2,)),  # automation's actual command of the step before, felt at wheel and pedal
        ("neighbours", np.float64, (3, 5)),  # follower, leader, preceding
        ("region", np.float64, (4,)),  # driving region: start, end, low, high [m]
        ("area", SAFE_AREA),
    ],
    align=True,
)
"""What the vehicle's sensors give at one time step; the fault is not in it."""

SIGNALS = np.dtype(
    [
        ("u_a_des", np.float64, (2,)),  # automation's desired command [m/s^2, rad]
        ("u_a_f", np.float64, (2,)),  # the same, degraded
        ("fault", np.float64, (2,)),  # what the degradations add to the command, wherever they act
        ("misperception", np.float64, (2,)),  # of the automation: lane offset [m], 1 where it misses its lead
        ("prediction", np.float64, (6,)),  # xi = [x, y, psi, v, a, r] after tau_p, Cartesian frame
        ("prediction_road", np.float64, (2,)),  # its (s, d) [m]
        ("predicted_neighbours", np.float64, (3, 3)),  # after tau_p: 1 if there is one, s [m], speed [m/s]
        ("r_x", np.float64),  # longitudinal risk
        ("r_y", np.float64),  # lateral risk
        ("alpha_a", np.float64),  # authority of the automation
        ("u_a_act", np.float64, (2,)),  # automation's actual command
        ("u_h_des", np.float64, (2,)),  # driver's desired command
        ("u_h_act", np.float64, (2,)),  # driver's actual command
        ("u", np.float64, (2,)),  # command that drives the vehicle
        ("status", np.int32),  # automation_mpc.CONVERGED, ITERATION_LIMIT or FAILED
        ("iterations", np.int32),  # Gauss-Newton iterations
        ("residual", np.float64),  # projected gradient
    ],
    align=True,
)
"""Every signal of one time step."""

FAULT_MEMORY = np.dtype(
    [
        ("acting", np.bool_),  # whether it acted in the step before
        ("kept", np.float64, (2,)),  # command at the moment it set in, of a stuck one; state of coloured noise
        ("last", np.float64, (2,)),  # its last output
        ("past", np.float64, (MAX_DELAY, 2)),  # commands of the last steps, step k in row k % MAX_DELAY
    ],
    align=True,
)
"""What a degradation carries from one time step to the next."""

AUTOMATION_MEMORY = np.dtype(
    [
        ("U", np.float64, (MAX_CONTROL, 2)),  # command sequence, for the warm start
        ("u_a_des", np.float64, (2,)),  # last feasible command
        ("failures", np.int64),  # steps at which the solver failed
    ],
    align=True,
)
"""What the automation carries from one time step to the next."""

MEMORY = np.dtype(
    [
        ("u_h_act", np.float64, (2,)),  # state of the driver's lag
        ("u_h_des", np.float64, (2,)),  # driver's last desired command
        ("u", np.float64, (2,)),  # last command of the vehicle
        ("alpha_a", np.float64),  # authority last displayed
        ("in_lane", np.bool_),  # whether the ego's centre is in the lane to keep
        ("lane_departures", np.int32),  # times that it has left the lane
        ("driver_failures", np.int32),  # steps at which the vectorised driver's solver failed
    ],
    align=True,
)
"""What the rest of the loop carries from one time step to the next."""

PERSON_MEMORY = np.dtype(
    [
        ("past", np.float64, (MAX_DELAY, 6)),  # states of the last steps, that of step k in row k % MAX_DELAY
        ("commands", np.float64, (MAX_DELAY, 2)),  # commands that drove the car in them
        ("error", np.float64, (4,)),  # of perception: lateral, heading, speed; of the arm; in units of their deviation
        ("engaged", np.bool_),  # whether the person drives; else the hands rest
        ("noticed", np.float64),  # when something was noticed [s]; infinite before
        ("reason", np.int64),  # what it was, index in person.REASONS
    ],
    align=True,
)
"""What a person at the wheel carries from one time step to the next."""
