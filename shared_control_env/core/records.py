"""The records that the loop reads and writes: what each holds, and the structured types made of that.

A record is one entry of a structured array. The single environment has arrays of one entry, the vectorised one of
many; compiled functions take a record and see its fields as attributes, as those of the classes here. The classes say
names, units and shapes, for readers and for mypy; nobody makes an object of them.
"""

from __future__ import annotations

from functools import cache
from typing import Annotated, Any, NamedTuple, TypeAlias, get_args, get_origin, get_type_hints

import numpy as np

MAX_HORIZON = 30
"""Longest prediction horizon H_p [steps]."""

MAX_CONTROL = 10
"""Longest control horizon H_c [steps]."""

MAX_DELAY = 21
"""Time steps of the command that a delay can reach back to, the present one included."""

MAX_CHAIN = 20
"""Vertices kept of a boundary of the safe area; shorter ones repeat their last vertex."""

MAX_TERMS = 12
"""Most terms of a reward."""

X, Y, HEADING, SPEED, ACCELERATION, YAW_RATE, BODY_LENGTH, BODY_WIDTH = range(8)
"""Columns of the traffic array: Cartesian pose [m, rad], motion [m/s, m/s^2, rad/s], body [m]."""

PRESENT, NEAR_S, NEAR_D, NEAR_SPEED, NEAR_ROW = range(5)
"""Columns of a scene's neighbours: 1 if there is one, road-frame position [m], speed [m/s], traffic row."""

FOLLOWER, LEADER, PRECEDING = range(3)
"""Order of the neighbours in every array: follower, leader, preceding, as the weights in Eq. 7."""

Int32: TypeAlias = Annotated[int, np.int32]
Vector2: TypeAlias = Annotated[np.ndarray, (2,)]
Vector6: TypeAlias = Annotated[np.ndarray, (6,)]
Chain: TypeAlias = Annotated[np.ndarray, (MAX_CHAIN, 2)]


@cache
def record_dtype(fields_of: type) -> np.dtype:
    """Aligned structured type with the fields of a class, nested classes included.

    A field is a number (``float``, ``int``, ``bool``, or ``Annotated[int, dtype]``), an array
    (``Annotated[np.ndarray, shape]``, of floats unless ``Annotated[np.ndarray, shape, dtype]``), a class of this kind,
    or a structured type (``Annotated[Any, dtype]``).
    """
    hints = get_type_hints(fields_of, include_extras=True)
    return np.dtype([(name, *_field(hint)) for name, hint in hints.items()], align=True)


def _field(hint: Any) -> tuple[Any, ...]:
    """Type of a field, and its shape where it is an array."""
    if get_origin(hint) is not Annotated:
        return (record_dtype(hint) if hasattr(hint, "__annotations__") else np.dtype(hint),)
    kind, first, *more = get_args(hint)
    if kind is np.ndarray:
        return np.dtype(more[0] if more else np.float64), first
    return (np.dtype(first) if isinstance(first, type | np.dtype) else np.dtype(kind),)


def pack(parameters: NamedTuple) -> np.ndarray:
    """Record that holds a (nested) named tuple's values, as a 0-d array."""
    return np.array(_plain(parameters), dtype=record_dtype(type(parameters)))


def _plain(value: object) -> object:
    """Named tuples as plain nested tuples, which NumPy assigns to a record by position."""
    return tuple(_plain(item) for item in value) if isinstance(value, tuple) else value


class SafeArea:
    """The safe area C in the road frame.

    Attributes:
        lower: lower (right) boundary, vertices (s, d) [m].
        upper: upper (left) boundary, vertices (s, d) [m].
        start, end: s where the area begins and ends [m].
        outcome: safe_area.REACHED or safe_area.BLOCKED.
    """

    lower: Chain
    upper: Chain
    start: float
    end: float
    outcome: int


class Scene:
    """What is perceived at one time step, of the road and of the automation; the fault is not in it.

    Attributes:
        k: time step.
        t: time [s].
        state: ego [x, y, psi, v_x, v_y, r], Cartesian frame.
        z: ego [s, y, psi, v_x, v_y, r], road frame.
        kappa: curvature at the stages of the horizon [1/m].
        y_target: lateral position to track [m].
        v_target: speed to track [m/s].
        changing: whether a lane change is under way.
        felt: the automation's actual command of the step before, felt at wheel and pedal [m/s^2, rad].
        displayed: alpha_a of the step before, as the driver sees it on display [-].
        neighbours: rows of follower, leader, preceding.
        bodies: half the lengths of the ego and of the preceding vehicle, which their distance has to be less [m].
        region: driving region: start, end, low, high [m].
        area: the safe area C.
    """

    k: int
    t: float
    state: Vector6
    z: Vector6
    kappa: Annotated[np.ndarray, (MAX_HORIZON,)]
    y_target: float
    v_target: float
    changing: bool
    felt: Vector2
    displayed: float
    neighbours: Annotated[np.ndarray, (3, 5)]
    bodies: float
    region: Annotated[np.ndarray, (4,)]
    area: SafeArea


class Signals:
    """Every signal of one time step.

    Attributes:
        u_a_des: the automation's desired command [m/s^2, rad].
        u_a_f: the same, degraded.
        fault: what the degradations add to the command, wherever they act.
        misperception: of the automation: lane offset [m], 1 where it misses its lead.
        prediction: xi = [x, y, psi, v, a, r] after tau_p, Cartesian frame.
        prediction_road: its (s, d) [m].
        predicted_neighbours: after tau_p: 1 if there is one, s [m], speed [m/s].
        r_x, r_y: longitudinal and lateral risk [-].
        alpha_a: authority of the automation [-].
        u_a_act: the automation's actual command.
        u_h_des: the driver's desired command.
        u_h_act: the driver's actual command.
        u: command that drives the vehicle.
        status: control.automation.CONVERGED, ITERATION_LIMIT or FAILED.
        iterations: Gauss-Newton iterations.
        residual: projected gradient.
    """

    u_a_des: Vector2
    u_a_f: Vector2
    fault: Vector2
    misperception: Vector2
    prediction: Vector6
    prediction_road: Vector2
    predicted_neighbours: Annotated[np.ndarray, (3, 3)]
    r_x: float
    r_y: float
    alpha_a: float
    u_a_act: Vector2
    u_h_des: Vector2
    u_h_act: Vector2
    u: Vector2
    status: Int32
    iterations: Int32
    residual: float


class FaultMemory:
    """What a degradation carries from one time step to the next.

    Attributes:
        acting: whether it acted in the step before.
        kept: the command at the moment it set in [m/s^2, rad].
        noise: state of coloured noise, in units of its standard deviation.
        last: its last output.
        past: commands of the last steps, step k in row k % MAX_DELAY.
    """

    acting: bool
    kept: Vector2
    noise: Vector2
    last: Vector2
    past: Annotated[np.ndarray, (MAX_DELAY, 2)]


class AutomationMemory:
    """What the automation carries from one time step to the next.

    Attributes:
        U: command sequence, for the warm start.
        u_a_des: last feasible command.
        failures: steps at which the solver failed.
    """

    U: Annotated[np.ndarray, (MAX_CONTROL, 2)]
    u_a_des: Vector2
    failures: int


class Memory:
    """What the rest of the loop carries from one time step to the next.

    Attributes:
        u_h_act: state of the driver's lag.
        u_h_des: the driver's last desired command.
        u: last command of the vehicle.
        in_lane: whether the ego's centre is in the lane to keep.
        lane_departures: times that it has left the lane.
        driver_failures: steps at which the kernel's driver's solver failed.
    """

    u_h_act: Vector2
    u_h_des: Vector2
    u: Vector2
    in_lane: bool
    lane_departures: Int32
    driver_failures: Int32


class PersonMemory:
    """What a person at the wheel carries from one time step to the next.

    Attributes:
        past: states of the last steps, that of step k in row k % MAX_DELAY.
        commands: commands that drove the car in them.
        error: of perception: lateral, heading, speed; of the arm; in units of their deviation.
        engaged: whether the person drives; else the hands rest.
        noticed: when something was noticed [s]; infinite before.
        reason: what it was, index in person.REASONS.
    """

    past: Annotated[np.ndarray, (MAX_DELAY, 6)]
    commands: Annotated[np.ndarray, (MAX_DELAY, 2)]
    error: Annotated[np.ndarray, (4,)]
    engaged: bool
    noticed: float
    reason: int


class Transition:
    """What a step led from and to, as the reward's terms see it beside scene and signals.

    Attributes:
        previous_s: path length before the step [m].
        last_a: acceleration command of the step before [m/s^2].
        crashed: whether the ego has collided.
        on_road: whether the ego's centre is between the road's edges, in a state that is finite.
        failed: whether the step ended in a collision or off the road.
        terms: of the reward, unweighted, in the order that the settings name them.
    """

    previous_s: float
    last_a: float
    crashed: bool
    on_road: bool
    failed: bool
    terms: Annotated[np.ndarray, (MAX_TERMS,)]


SAFE_AREA = record_dtype(SafeArea)
SCENE = record_dtype(Scene)
SIGNALS = record_dtype(Signals)
FAULT_MEMORY = record_dtype(FaultMemory)
AUTOMATION_MEMORY = record_dtype(AutomationMemory)
MEMORY = record_dtype(Memory)
PERSON_MEMORY = record_dtype(PersonMemory)
TRANSITION = record_dtype(Transition)
