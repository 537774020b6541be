"""Every signal of a step as one record, which both kinds of environment report as ``info``."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from shared_control_env.core.degradation import has_set_in
from shared_control_env.core.jit import jit
from shared_control_env.core.records import MAX_CHAIN, Record
from shared_control_env.core.reward import TERMS

INFO = np.dtype(
    [
        ("k", np.int64),  # time step of the signals
        ("t", np.float64),  # its time [s]
        ("state", np.float64, (6,)),  # ego [x, y, psi, v_x, v_y, r], Cartesian frame [m, rad, m/s, rad/s]
        ("z", np.float64, (6,)),  # ego [s, y, psi, v_x, v_y, r], road frame
        ("y_target", np.float64),  # lateral position to track [m]
        ("v_target", np.float64),  # speed to track [m/s]
        ("neighbours", np.float64, (3, 5)),  # follower, leader, preceding: present, s [m], d [m], speed, traffic row
        ("u_a_des", np.float64, (2,)),  # automation's desired command [m/s^2, rad]
        ("u_a_f", np.float64, (2,)),  # degraded
        ("u_a_act", np.float64, (2,)),  # limited
        ("u_h_des", np.float64, (2,)),  # driver's desired command
        ("u_h_act", np.float64, (2,)),  # driver's actual command
        ("u", np.float64, (2,)),  # command that drove the vehicle
        ("r_x", np.float64),  # longitudinal risk
        ("r_y", np.float64),  # lateral risk
        ("alpha_a", np.float64),  # authority of the automation
        ("prediction", np.float64, (6,)),  # xi(k + tau_p) = [x, y, psi, v, a, r], Cartesian frame
        ("prediction_road", np.float64, (2,)),  # its (s, d) [m]
        ("safe_area_lower", np.float64, (MAX_CHAIN, 2)),  # boundaries of C, vertices (s, d) [m]
        ("safe_area_upper", np.float64, (MAX_CHAIN, 2)),
        ("safe_area_outcome", np.int64),  # safe_area.REACHED or BLOCKED
        ("fault", np.float64, (2,)),  # what the degradations add to the command, u_a,f - u_a,des: ground truth
        ("misperception", np.float64, (2,)),  # automation's lane offset [m], 1 where it misses its lead: ground truth
        ("fault_active", np.bool_),  # whether any degradation has set in: ground truth
        (
            "automation",
            [
                ("status", np.int64),  # automation_mpc.CONVERGED, ITERATION_LIMIT or FAILED
                ("iterations", np.int64),
                ("residual", np.float64),  # projected gradient
                ("failures", np.int64),  # steps so far at which the last command was held
            ],
        ),
        ("speed", np.float64),  # v_x after the step [m/s]
        ("crashed", np.bool_),  # after the step
        ("on_road", np.bool_),
        ("in_lane", np.bool_),
        ("lane_departures", np.int64),  # times that the centre has left the lane to keep
        ("rewards", [(term, np.float64) for term in TERMS]),  # unweighted terms
    ],
    align=True,
)
"""Signals of the step just taken, from its start (k) on; from ``speed`` on, what it led to."""


@jit
def note_signals(scene: Record, signals: Record, faults: np.ndarray, failures: int, info: Record) -> None:
    """Copy the signals of a scene's time step.

    Args:
        scene: record of :data:`records.SCENE`.
        signals: record of :data:`records.SIGNALS`.
        faults: records of :class:`DegradationParameters`, shape (n,).
        failures: of the automation's solver so far.
        info: record of :data:`INFO`, written up to ``automation``.
    """
    info.k, info.t = scene.k, scene.t
    info.y_target, info.v_target = scene.y_target, scene.v_target
    for i in range(6):
        info.state[i], info.z[i], info.prediction[i] = scene.state[i], scene.z[i], signals.prediction[i]
    for i in range(2):
        info.u_a_des[i], info.u_a_f[i], info.u_a_act[i] = signals.u_a_des[i], signals.u_a_f[i], signals.u_a_act[i]
        info.u_h_des[i], info.u_h_act[i], info.u[i] = signals.u_h_des[i], signals.u_h_act[i], signals.u[i]
        info.fault[i] = signals.fault[i]
        info.prediction_road[i], info.misperception[i] = signals.prediction_road[i], signals.misperception[i]
    for i in range(3):
        for j in range(5):
            info.neighbours[i, j] = scene.neighbours[i, j]
    info.r_x, info.r_y, info.alpha_a = signals.r_x, signals.r_y, signals.alpha_a
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
def note_outcome(speed: float, crashed: bool, on_road: bool, memory: Record, terms: np.ndarray, info: Record) -> None:
    """Copy what a step led to.

    Args:
        speed: [m/s].
        crashed, on_road: after the step.
        memory: record of :data:`records.MEMORY`.
        terms: of the reward, shape (7,).
        info: record of :data:`INFO`, written from ``speed`` on.
    """
    info.speed, info.crashed, info.on_road = speed, crashed, on_road
    info.in_lane, info.lane_departures = memory.in_lane, memory.lane_departures
    r = info.rewards
    r.progress, r.lane, r.speed, r.effort = terms[0], terms[1], terms[2], terms[3]
    r.comfort, r.conflict, r.failure = terms[4], terms[5], terms[6]


def as_dict(info: np.ndarray) -> dict[str, Any]:
    """A record as a nested dict: plain numbers, and views of the record's arrays.

    Args:
        info: of :data:`INFO` or a part of it, a 0-d array.
    """
    return _named(info.item(), info.dtype)


def _named(values: tuple[Any, ...], dtype: np.dtype) -> dict[str, Any]:
    """A record's values by their names."""
    names, nested = _fields(dtype)
    named = dict(zip(names, values, strict=True))
    for name, inner in nested:
        named[name] = _named(named[name], inner)
    return named


@cache
def _fields(dtype: np.dtype) -> tuple[tuple[str, ...], tuple[tuple[str, np.dtype], ...]]:
    """Names of a record's fields, and those that are records themselves."""
    names = dtype.names or ()
    return names, tuple((name, dtype[name]) for name in names if dtype[name].names)
