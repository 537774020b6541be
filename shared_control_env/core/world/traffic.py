"""Motion of the other vehicles: the acceleration that each one decides on, and its motion along the road."""

from __future__ import annotations

from math import atan2, sqrt

import numpy as np

from shared_control_env.core.compile.jit import jit
from shared_control_env.core.parameters import TrafficParameters
from shared_control_env.core.records import ACCELERATION, BODY_LENGTH, HEADING, SPEED, YAW_RATE, X, Y
from shared_control_env.core.world.lane_change import change_progress
from shared_control_env.core.world.road import locate, point_at, width_at

TIME_HEADWAY = 1.5
"""Time headway T of the Intelligent Driver Model [s]; that of highway-env's IDMVehicle."""

STANDSTILL_GAP = 2.0
"""Gap at standstill s_0 [m]; Treiber et al., Table I."""

LARGEST_ACCELERATION = 1.5
"""Largest acceleration a [m/s^2]; between the values of Treiber et al. (0.73) and of highway-env (3 to 6)."""

COMFORTABLE_DECELERATION = 2.0
"""Comfortable deceleration b [m/s^2]; Treiber et al. have 1.67."""

LARGEST_DECELERATION = 8.0
"""Largest deceleration of a following vehicle [m/s^2]; about the limit of a dry road."""


@jit
def idm_acceleration(v: float, v_0: float, gap: float, v_lead: float) -> float:
    """Acceleration of the Intelligent Driver Model.

    ``a (1 - (v / v_0)^4 - (s* / s)^2)`` with ``s* = s_0 + max(0, v T + v (v - v_lead) / (2 sqrt(a b)))`` (Treiber,
    Hennecke & Helbing, Congested Traffic States in Empirical Observations, Phys. Rev. E 62, 2000, Eq. 1-4).

    Args:
        v, v_0: speed and desired speed [m/s].
        gap: gap s to the vehicle ahead, bumper to bumper [m]; infinite without a vehicle ahead.
        v_lead: speed of the vehicle ahead [m/s].

    Returns:
        Acceleration [m/s^2], not below ``-LARGEST_DECELERATION``.
    """
    wanted = desired_gap(v, v_lead)
    a = LARGEST_ACCELERATION * (1.0 - (v / v_0) ** 4 - (wanted / max(gap, 0.1)) ** 2)
    return max(a, -LARGEST_DECELERATION)


@jit
def desired_gap(v: float, v_lead: float) -> float:
    """Desired gap s* of the Intelligent Driver Model [m].

    Args:
        v, v_lead: speeds of the vehicle and of the one ahead [m/s].
    """
    approach = v * (v - v_lead) / (2.0 * sqrt(LARGEST_ACCELERATION * COMFORTABLE_DECELERATION))
    return STANDSTILL_GAP + max(0.0, v * TIME_HEADWAY + approach)


@jit
def _gap_ahead(row: np.ndarray, s: float, d: float, other: np.ndarray, line: np.ndarray) -> float:
    """Distance from a vehicle's front to another's rear [m]; infinite if the other is not ahead in the same lane."""
    s_other, d_other, _, _ = locate(line, other[X], other[Y])
    if s_other <= s or abs(d_other - d) > 0.5 * width_at(line, s):
        return np.inf
    return s_other - s - 0.5 * (row[BODY_LENGTH] + other[BODY_LENGTH])


@jit
def follow(row: np.ndarray, v_0: float, ego: np.ndarray, traffic: np.ndarray, line: np.ndarray) -> float:
    """Acceleration [m/s^2] of a vehicle that follows the nearest vehicle ahead in its lane, the ego included.

    Args:
        row: the following vehicle's row of the traffic array, shape (8,).
        v_0: desired speed [m/s].
        ego: the ego as a row of the traffic array, shape (8,).
        traffic: all other vehicles, shape (n, 8).
        line: reference line, shape (m, 12).
    """
    s, d, _, _ = locate(line, row[X], row[Y])
    gap, v_lead = _gap_ahead(row, s, d, ego, line), ego[SPEED]
    for i in range(traffic.shape[0]):
        other = _gap_ahead(row, s, d, traffic[i], line)
        if other < gap:
            gap, v_lead = other, traffic[i, SPEED]
    return idm_acceleration(row[SPEED], v_0, gap, v_lead)


@jit
def decide_acceleration(
    row: np.ndarray,
    plan: TrafficParameters,
    t: float,
    ego: np.ndarray,
    traffic: np.ndarray,
    line: np.ndarray,
) -> None:
    """Compute the acceleration of a vehicle from its plan, and write it into the vehicle's row.

    The vehicle follows the vehicle ahead or holds its speed. From the onset of its braking on, it brakes at least as
    hard as planned.

    Args:
        row: the vehicle's row of the traffic array, shape (8,); the acceleration is written.
        plan: plan of the vehicle.
        t: time [s].
        ego: the ego as a row of the traffic array, shape (8,).
        traffic: all other vehicles, this one among them, shape (n, 8).
        line: reference line, shape (m, 12).
    """
    row[ACCELERATION] = 0.0
    if plan.follows:
        row[ACCELERATION] = follow(row, plan.desired_speed, ego, traffic, line)
    if t >= plan.brake_onset:
        row[ACCELERATION] = min(row[ACCELERATION], -plan.deceleration)
    if row[SPEED] <= 0.0:
        row[ACCELERATION] = max(row[ACCELERATION], 0.0)


@jit
def follow_lane(row: np.ndarray, line: np.ndarray, dt: float, shift: float) -> None:
    """Move a vehicle along the road at its acceleration, and change its offset from the reference line by a shift.

    ``s' = v / (1 - kappa d)`` with the mean speed of the step. The yaw rate is that of the path,
    ``r = v kappa / (1 - kappa d)``. The vehicle stops at speed 0 and does not reverse.

    Args:
        row: the vehicle's row of the traffic array, overwritten, shape (8,).
        line: reference line, shape (m, 12).
        dt: step [s].
        shift: change of the offset, positive to the left [m].
    """
    s, d, _, kappa = locate(line, row[X], row[Y])
    v_next = max(row[SPEED] + row[ACCELERATION] * dt, 0.0)
    rate = 0.5 * (row[SPEED] + v_next) / (1.0 - kappa * d)
    row[SPEED] = v_next
    row[X], row[Y], row[HEADING] = point_at(line, s + rate * dt, d + shift)
    if shift != 0.0:
        row[HEADING] += atan2(shift, rate * dt)
    row[YAW_RATE] = rate * kappa


@jit
def move_along(row: np.ndarray, plan: TrafficParameters, line: np.ndarray, t: float, dt: float) -> None:
    """Move a vehicle by one step, along its lane or towards the lane that its plan names.

    Args:
        row: the vehicle's row of the traffic array, overwritten, shape (8,).
        plan: plan of the vehicle.
        line: reference line, shape (m, 12).
        t: time at the start of the step [s].
        dt: step [s].
    """
    shift = 0.0
    if t + dt > plan.change_onset:
        done = change_progress(t, plan.change_onset, plan.change_duration)
        shift = plan.shift * (change_progress(t + dt, plan.change_onset, plan.change_duration) - done)
    follow_lane(row, line, dt, shift)
