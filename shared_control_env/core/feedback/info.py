"""All signals of a step as one record, which the single and the vectorised environment report as ``info``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np

from shared_control_env.core.compile.jit import jit
from shared_control_env.core.faults.command import has_set_in
from shared_control_env.core.records import (
    MAX_CHAIN,
    MAX_TERMS,
    Chain,
    Memory,
    Scene,
    Signals,
    Transition,
    Vector2,
    Vector6,
    record_dtype,
)


class AutomationReport:
    """Outcome of the automation's solver.

    Attributes:
        status: control.automation.CONVERGED, ITERATION_LIMIT or FAILED.
        iterations: number of Gauss-Newton iterations.
        residual: projected gradient [-].
        failures: number of steps so far at which the solver failed, so that the last command was held.
    """

    status: int
    iterations: int
    residual: float
    failures: int


class Info:
    """Signals of the step just taken, at time step k, followed by the outcome of the step.

    The fields from ``speed`` on hold after the step. Every command is ``[a, delta]`` [m/s^2, rad].

    Attributes:
        k: index of the time step.
        t: time at the start of the step [s].
        state: ego [x, y, psi, v_x, v_y, r] in the Cartesian frame [m, rad, m/s, rad/s].
        z: ego [s, y, psi, v_x, v_y, r] in the road frame [m, rad, m/s, rad/s].
        y_target: lateral position to track [m].
        v_target: speed to track [m/s].
        neighbours: rows of follower, leader and preceding vehicle: [1 if present, s [m], d [m], speed [m/s], traffic
            row].
        u_a_des: the automation's desired command.
        u_a_f: the automation's desired command after degradation.
        u_a_act: the automation's actual command, after the authority law.
        u_h_des: the driver's desired command.
        u_h_act: the driver's actual command.
        u: command of the vehicle.
        r_x, r_y: longitudinal and lateral risk [-].
        alpha: authority of the automation over each channel, acceleration and steering [-].
        alpha_a: the smaller of the two [-].
        alert: alert to the driver, index in :data:`core.authority.alerts.ALERTS`.
        prediction: predicted state xi(k + tau_p) = [x, y, psi, v, a, r] in the Cartesian frame.
        prediction_road: predicted position (s, d) in the road frame [m].
        safe_area_lower, safe_area_upper: boundaries of the safe area C, vertices (s, d) [m].
        safe_area_outcome: safe_area.REACHED or BLOCKED.
        fault: change of the command that the degradations cause, wherever they act; ground truth.
        misperception: the automation's lane offset [m], and 1 if it misses the preceding vehicle; ground truth.
        fault_active: whether any degradation has set in; ground truth.
        automation: outcome of the automation's solver.
        speed: v_x after the step [m/s].
        u_realised: output of the car's actuators under the commands u; u itself without lag and rate limit. Tyres that
            slide may transmit less of it.
        crashed: whether the ego has collided, after the step.
        on_road: whether the ego's centre lies between the edges of the road, after the step.
        in_lane: whether the ego's centre is in the lane to keep, after the step.
        lane_departures: number of times that the ego's centre has left the lane to keep.
        rewards: unweighted terms of the reward [-], in the order of the settings.
    """

    k: int
    t: float
    state: Vector6
    z: Vector6
    y_target: float
    v_target: float
    neighbours: Annotated[np.ndarray, (3, 5)]
    u_a_des: Vector2
    u_a_f: Vector2
    u_a_act: Vector2
    u_h_des: Vector2
    u_h_act: Vector2
    u: Vector2
    r_x: float
    r_y: float
    alpha: Vector2
    alpha_a: float
    alert: int
    prediction: Vector6
    prediction_road: Vector2
    safe_area_lower: Chain
    safe_area_upper: Chain
    safe_area_outcome: int
    fault: Vector2
    misperception: Vector2
    fault_active: bool
    automation: AutomationReport
    speed: float
    u_realised: Vector2
    crashed: bool
    on_road: bool
    in_lane: bool
    lane_departures: int
    rewards: Annotated[np.ndarray, (MAX_TERMS,)]


INFO = record_dtype(Info)

_NAMES, _AUTOMATION = INFO.names or (), INFO["automation"].names or ()


@jit
def note_signals(scene: Scene, signals: Signals, faults: np.ndarray, failures: int, info: Info) -> None:
    """Copy the signals of the scene's time step to the info.

    Args:
        scene: record of :data:`records.SCENE`.
        signals: record of :data:`records.SIGNALS`.
        faults: records of :class:`DegradationParameters`, shape (n,).
        failures: number of steps so far at which the automation's solver failed.
        info: record of :data:`INFO`, written up to ``automation``.
    """
    info.k, info.t = scene.k, scene.t
    info.y_target, info.v_target = scene.y_target, scene.v_target
    for i in range(6):
        info.state[i], info.z[i], info.prediction[i] = scene.state[i], scene.z[i], signals.prediction[i]
    for i in range(2):
        info.u_a_des[i], info.u_a_f[i], info.u_a_act[i] = signals.u_a_des[i], signals.u_a_f[i], signals.u_a_act[i]
        info.u_h_des[i], info.u_h_act[i], info.u[i] = signals.u_h_des[i], signals.u_h_act[i], signals.u[i]
        info.fault[i], info.alpha[i] = signals.fault[i], signals.alpha[i]
        info.prediction_road[i], info.misperception[i] = signals.prediction_road[i], signals.misperception[i]
    for i in range(3):
        for j in range(5):
            info.neighbours[i, j] = scene.neighbours[i, j]
    info.r_x, info.r_y, info.alpha_a, info.alert = signals.r_x, signals.r_y, signals.alpha_a, signals.alert
    for k in range(MAX_CHAIN):
        for i in range(2):
            info.safe_area_lower[k, i] = scene.area.lower[k, i]
            info.safe_area_upper[k, i] = scene.area.upper[k, i]
    info.safe_area_outcome = scene.area.outcome
    info.fault_active = False
    for i in range(faults.shape[0]):
        if has_set_in(faults[i], scene.t):
            info.fault_active = True
    info.automation.status, info.automation.iterations = signals.status, signals.iterations
    info.automation.residual, info.automation.failures = signals.residual, failures


@jit
def note_outcome(speed: float, transition: Transition, memory: Memory, info: Info) -> None:
    """Copy the outcome of a step to the info.

    Args:
        speed: v_x after the step [m/s].
        transition: record of :data:`records.TRANSITION` after the step.
        memory: record of :data:`records.MEMORY`.
        info: record of :data:`INFO`, written from ``speed`` on.
    """
    info.speed, info.crashed, info.on_road = speed, transition.crashed, transition.on_road
    info.u_realised[0], info.u_realised[1] = memory.realised[0], memory.realised[1]
    info.in_lane, info.lane_departures = memory.in_lane, memory.lane_departures
    for i in range(MAX_TERMS):
        info.rewards[i] = transition.terms[i]


def as_dict(info: np.ndarray, terms: Sequence[str]) -> dict[str, Any]:
    """Info as a nested dict of plain numbers and views of the record's arrays.

    Args:
        info: record of :data:`INFO`, a 0-d array.
        terms: names of the reward's terms, in the order of the settings.
    """
    # The lengths are those of the structured type; to check them would cost a tenth of this function, every step.
    values = dict(zip(_NAMES, info.item()))  # noqa: B905
    values["automation"] = dict(zip(_AUTOMATION, values["automation"]))  # noqa: B905
    values["rewards"] = dict(zip(terms, values["rewards"].tolist()))  # noqa: B905
    return values


def as_batch(records: np.ndarray, mask: np.ndarray, terms: Sequence[str] = ()) -> dict[str, Any]:
    """Records as Gymnasium's nested dict of arrays, each array followed by the mask of the environments that have it.

    Args:
        records: records of a structured type, shape (N,).
        mask: whether each environment has a record, shape (N,).
        terms: names of the reward's terms, in the order of the settings; needed if the type is :data:`INFO`.
    """
    values: dict[str, Any] = {}
    for name in records.dtype.names or ():
        field: Any = records[name]
        if field.dtype.names:
            field = as_batch(field, mask)
        elif name == "rewards":
            field = _by_term(field, mask, terms)
        values[name], values[f"_{name}"] = field, mask
    return values


def _by_term(rewards: np.ndarray, mask: np.ndarray, terms: Sequence[str]) -> dict[str, Any]:
    """Columns of the reward's terms, shape (N, MAX_TERMS), by name, each followed by the mask."""
    values: dict[str, Any] = {}
    for i, term in enumerate(terms):
        values[term], values[f"_{term}"] = rewards[:, i], mask
    return values
