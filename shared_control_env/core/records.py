"""The records that the loop reads and writes: their fields, and the structured types built from them.

A record is one entry of a structured array. The single environment has arrays of one entry, the vectorised environment
arrays of many. Compiled functions take a record and access its fields as attributes. The classes here give the names,
units and shapes of the fields, for readers and for mypy. They are never instantiated.
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
"""Number of time steps kept for a delay, the present one included."""

MAX_CHAIN = 20
"""Number of vertices kept of each boundary of the safe area; a shorter boundary repeats its last vertex."""

MAX_TERMS = 12
"""Largest number of terms of a reward."""

X, Y, HEADING, SPEED, ACCELERATION, YAW_RATE, BODY_LENGTH, BODY_WIDTH = range(8)
"""Columns of the traffic array: Cartesian pose [m, rad], motion [m/s, m/s^2, rad/s], body length and width [m]."""

PRESENT, NEAR_S, NEAR_D, NEAR_SPEED, NEAR_ROW = range(5)
"""Columns of a scene's neighbours: 1 if present, position (s, d) in the road frame [m], speed [m/s], traffic row."""

FOLLOWER, LEADER, PRECEDING = range(3)
"""Order of the neighbours in every array: follower, leader, preceding vehicle, as the weights in Eq. 7."""

Int32: TypeAlias = Annotated[int, np.int32]
Vector2: TypeAlias = Annotated[np.ndarray, (2,)]
Vector6: TypeAlias = Annotated[np.ndarray, (6,)]
Chain: TypeAlias = Annotated[np.ndarray, (MAX_CHAIN, 2)]


@cache
def record_dtype(fields_of: type) -> np.dtype:
    """Aligned structured type with the fields of a class, nested classes included.

    A field is one of the following: a number (``float``, ``int``, ``bool`` or ``Annotated[int, dtype]``); an array of
    floats (``Annotated[np.ndarray, shape]``) or of another type (``Annotated[np.ndarray, shape, dtype]``); another
    class of fields; or a structured type (``Annotated[Any, dtype]``).

    Args:
        fields_of: class whose annotations name the fields and their types.
    """
    hints = get_type_hints(fields_of, include_extras=True)
    return np.dtype([(name, *_field(hint)) for name, hint in hints.items()], align=True)


def _field(hint: Any) -> tuple[Any, ...]:
    """Type of a field, followed by its shape if the field is an array."""
    if get_origin(hint) is not Annotated:
        return (record_dtype(hint) if hasattr(hint, "__annotations__") else np.dtype(hint),)
    kind, first, *more = get_args(hint)
    if kind is np.ndarray:
        return np.dtype(more[0] if more else np.float64), first
    return (np.dtype(first) if isinstance(first, type | np.dtype) else np.dtype(kind),)


def pack(parameters: NamedTuple) -> np.ndarray:
    """Record with the values of a named tuple, nested ones included, as a 0-d array.

    Args:
        parameters: named tuple, such as :class:`core.parameters.Parameters`.
    """
    record = np.zeros((), dtype=record_dtype(type(parameters)))  # zeros between the fields too, so that bytes compare
    record[()] = _plain(parameters)
    return record


def _plain(value: object) -> object:
    """Convert named tuples to plain nested tuples, which NumPy assigns to a record by position."""
    return tuple(_plain(item) for item in value) if isinstance(value, tuple) else value


class SafeArea:
    """The safe area C in the road frame.

    Attributes:
        lower: lower (right) boundary, vertices (s, d) [m].
        upper: upper (left) boundary, vertices (s, d) [m].
        start, end: path length s at which the area begins and ends [m].
        outcome: safe_area.REACHED or safe_area.BLOCKED.
    """

    lower: Chain
    upper: Chain
    start: float
    end: float
    outcome: int


class Scene:
    """What is perceived of the road and of the automation at one time step. It does not contain the fault.

    Attributes:
        k: time step.
        t: time [s].
        state: ego [x, y, psi, v_x, v_y, r] in the Cartesian frame [m, rad, m/s, rad/s].
        z: ego [s, y, psi, v_x, v_y, r] in the road frame [m, rad, m/s, rad/s].
        kappa: curvature of the road at the stages of the horizon [1/m].
        y_target: lateral position to track [m].
        v_target: speed to track [m/s].
        changing: whether a lane change is under way.
        alert: alert of the previous step, index in :data:`core.authority.alerts.ALERTS`.
        change_weight: share of the weights of a lane change in the longitudinal risk [-].
        felt: the automation's actual command of the previous step, felt at wheel and pedal [m/s^2, rad].
        displayed: alpha_a of the previous step, as displayed to the driver [-].
        neighbours: rows of the follower, the leader and the preceding vehicle, columns PRESENT to NEAR_ROW.
        bodies: half the sum of the lengths of the ego and of the preceding vehicle [m]: the distance between their
            centres minus their gap.
        lane_width: width of the lane at the ego [m].
        road_low, road_high: offsets of the road's right and left edge at the ego [m].
        region: driving region [start, end, low, high] in the road frame [m].
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
    alert: Int32
    change_weight: float
    felt: Vector2
    displayed: float
    neighbours: Annotated[np.ndarray, (3, 5)]
    bodies: float
    lane_width: float
    road_low: float
    road_high: float
    region: Annotated[np.ndarray, (4,)]
    area: SafeArea


class Signals:
    """All signals of one time step. Every command is ``[a, delta]`` [m/s^2, rad].

    Attributes:
        u_a_des: the automation's desired command.
        u_a_f: the automation's desired command after degradation.
        fault: change of the command that the degradations cause, wherever they act.
        misperception: errors of the automation's perception: lane offset [m]; 1 if the preceding vehicle is missed.
        prediction: predicted state of the ego after tau_p in the Cartesian frame, xi = [x, y, psi, v, a, r].
        prediction_road: predicted position (s, d) of the ego in the road frame [m].
        predicted_neighbours: rows [1 if present, s [m], speed [m/s]] of the neighbours after tau_p.
        r_x, r_y: longitudinal and lateral risk [-].
        alpha: authority of the automation over each channel, acceleration and steering [-].
        alpha_a: the smaller of the two [-].
        u_a_act: the automation's actual command.
        u_h_des: the driver's desired command.
        u_h_act: the driver's actual command.
        u: command that drives the vehicle.
        status: outcome of the automation's solver: control.automation.CONVERGED, ITERATION_LIMIT or FAILED.
        iterations: number of Gauss-Newton iterations.
        alert: what the allocator tells the driver, index in :data:`core.authority.alerts.ALERTS`.
        residual: projected gradient at the solution [-].
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
    alpha: Vector2
    alpha_a: float
    u_a_act: Vector2
    u_h_des: Vector2
    u_h_act: Vector2
    u: Vector2
    status: Int32
    iterations: Int32
    alert: Int32
    residual: float


class FaultMemory:
    """What a degradation carries from one time step to the next.

    Attributes:
        acting: whether the degradation acted in the previous step.
        kept: the command at the onset of the degradation [m/s^2, rad].
        noise: state of the coloured noise, in units of its standard deviation [-].
        last: last output of the degradation [m/s^2, rad].
        past: commands of the last steps [m/s^2, rad]; that of step k is in row k % MAX_DELAY.
    """

    acting: bool
    kept: Vector2
    noise: Vector2
    last: Vector2
    past: Annotated[np.ndarray, (MAX_DELAY, 2)]


class AutomationMemory:
    """What the automation carries from one time step to the next.

    Attributes:
        U: command sequence for the warm start [m/s^2, rad].
        u_a_des: last feasible command [m/s^2, rad].
        failures: number of steps at which the solver failed.
    """

    U: Annotated[np.ndarray, (MAX_CONTROL, 2)]
    u_a_des: Vector2
    failures: int


class Memory:
    """What the rest of the loop carries from one time step to the next.

    Attributes:
        u_h_act: state of the driver's lag [m/s^2, rad].
        u_h_des: the driver's last desired command [m/s^2, rad].
        u: last command of the vehicle [m/s^2, rad].
        realised: what the actuators have made of the commands u so far [m/s^2, rad].
        in_lane: whether the ego's centre is in the lane to keep.
        lane_departures: number of times that the ego's centre has left the lane to keep.
        driver_failures: number of steps at which the solver of the kernel's driver failed.
        resting: whether the driver's hands rest on the wheel, or are off it: u_h,des is then u_a,act.
    """

    u_h_act: Vector2
    u_h_des: Vector2
    u: Vector2
    realised: Vector2
    in_lane: bool
    lane_departures: Int32
    driver_failures: Int32
    resting: bool


class PersonMemory:
    """What a person at the wheel carries from one time step to the next.

    Attributes:
        past: ego states of the last steps in the road frame; that of step k is in row k % MAX_DELAY.
        commands: commands that drove the vehicle in these steps [m/s^2, rad].
        error: errors of perceived lateral position, heading and speed, and of the arm, in units of their standard
            deviation [-].
        engaged: whether the person drives; if not, the hands rest.
        noticed: time at which the person noticed something [s]; infinite before.
        response: this person's time from noticing to acting [s]; 0 for one who drives from the start.
        reason: what the person noticed, index in person.REASONS.
        alerted: time for which an alert has lasted [s].
    """

    past: Annotated[np.ndarray, (MAX_DELAY, 6)]
    commands: Annotated[np.ndarray, (MAX_DELAY, 2)]
    error: Annotated[np.ndarray, (4,)]
    engaged: bool
    noticed: float
    response: float
    reason: int
    alerted: float


class Transition:
    """What the terms of the reward need of a step, in addition to the scene and the signals.

    Attributes:
        previous_s: path length before the step [m].
        last_a: acceleration command of the previous step [m/s^2].
        crashed: whether the ego has collided.
        on_road: whether the ego's state is finite and its centre lies between the edges of the road.
        failed: whether the step ended in a collision or off the road.
        terms: unweighted terms of the reward [-], in the order of the settings.
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
