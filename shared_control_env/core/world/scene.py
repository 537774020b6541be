"""Perception of the scene from poses and speeds: road frame, neighbours, driving region, targets and preview."""

from __future__ import annotations

from math import cos, isnan, sin

import numpy as np

from shared_control_env.core.compile.jit import jit, jit_inlined
from shared_control_env.core.parameters import Parameters, TaskParameters
from shared_control_env.core.records import (
    BODY_LENGTH,
    BODY_WIDTH,
    FOLLOWER,
    HEADING,
    LEADER,
    NEAR_D,
    NEAR_ROW,
    NEAR_S,
    NEAR_SPEED,
    PRECEDING,
    PRESENT,
    SPEED,
    Scene,
    X,
    Y,
)
from shared_control_env.core.world.lane_change import change_progress, change_weight
from shared_control_env.core.world.road import curvature_at, edges_at, locate, width_at, wrap_angle

_SHORTEST_REGION = 0.5
"""Smallest length of the driving region [m], used when the preceding vehicle is almost touched."""


@jit_inlined
def road_frame(line: np.ndarray, state: np.ndarray, z: np.ndarray) -> None:
    """Transform the ego state from the Cartesian frame to the road frame.

    Args:
        line: reference line, shape (n, 12).
        state: Cartesian state ``[x, y, psi, v_x, v_y, r]`` [m, rad, m/s, rad/s], shape (6,).
        z: state ``[s, y, psi - psi_road, v_x, v_y, r]`` in the road frame, written, shape (6,).
    """
    s, d, psi_road, _ = locate(line, state[0], state[1])
    z[0], z[1], z[2] = s, d, wrap_angle(state[2] - psi_road)
    z[3], z[4], z[5] = state[3], state[4], state[5]


@jit
def _keep_nearest(neighbours: np.ndarray, which: int, row: int, s: float, d: float, v: float, s_e: float) -> None:
    """Record a vehicle as a neighbour, unless a nearer vehicle is already recorded."""
    near = neighbours[which]
    if near[PRESENT] == 0.0 or abs(s - s_e) < abs(near[NEAR_S] - s_e):
        near[PRESENT], near[NEAR_S], near[NEAR_D], near[NEAR_SPEED], near[NEAR_ROW] = 1.0, s, d, v, row


@jit_inlined
def find_neighbours(
    line: np.ndarray,
    traffic: np.ndarray,
    s_e: float,
    y_target: float,
    y_goal: float,
    neighbours: np.ndarray,
) -> None:
    """Find the preceding vehicle in the lane to keep, and the leader and the follower in the adjacent lanes.

    A vehicle belongs to the lane that contains its centre. Positions are those of the centres. During a lane change the
    follower is that in the lane changed to, from the first to the last step: it is the vehicle that the change can cut
    off, even when the lane to keep is already the new one.

    Args:
        line: reference line, shape (m, 12).
        traffic: other vehicles, columns as in :mod:`records`, shape (n, 8).
        s_e: the ego's path length [m].
        y_target: lateral position of the centre of the lane to keep [m].
        y_goal: lateral position of the centre of the lane changed to [m]; NaN if no change is under way.
        neighbours: rows of follower, leader and preceding vehicle, columns PRESENT to NEAR_ROW of :mod:`records`,
            written, shape (3, 5).
    """
    for which in range(3):
        neighbours[which, PRESENT] = 0.0
    for row in range(traffic.shape[0]):
        s, d, psi_road, _ = locate(line, traffic[row, X], traffic[row, Y])
        v = traffic[row, SPEED] * cos(traffic[row, HEADING] - psi_road)
        offset, lane_width = abs(d - y_target), width_at(line, s)
        if s >= s_e:
            if offset <= 1.5 * lane_width:
                _keep_nearest(neighbours, PRECEDING if offset <= 0.5 * lane_width else LEADER, row, s, d, v, s_e)
        elif abs(d - y_goal) <= 0.5 * lane_width or (isnan(y_goal) and 0.5 * lane_width < offset <= 1.5 * lane_width):
            _keep_nearest(neighbours, FOLLOWER, row, s, d, v, s_e)


@jit
def following_speed(v_lead: float, gap: float, v: float, task: TaskParameters) -> float:
    """Target speed behind a vehicle [m/s]: the vehicle's speed, or the speed that brings the gap to a time headway.

    ::

        v_target = v_lead                                      as in the paper ("drive consistently")
        v_target = v_lead + (gap - d_0 - tau_h v) / tau_g      with a time headway tau_h

    The result is clipped to the range from 0 to the task's target speed. The second line is a constant-time-gap law
    (Ioannou & Chien, Autonomous Intelligent Cruise Control, IEEE Transactions on Vehicular Technology 42(4), 1993).

    Args:
        v_lead: speed of the vehicle ahead along the road [m/s].
        gap: gap to the vehicle ahead, bumper to bumper [m].
        v: own speed [m/s].
        task: time headway tau_h, standstill gap d_0, closing time tau_g and target speed.
    """
    v_target = v_lead
    if task.time_headway > 0.0:
        v_target += (gap - task.standstill_gap - task.time_headway * v) / task.closing_time
    return min(task.target_speed, max(v_target, 0.0))


@jit
def gap_ahead(scene: Scene) -> float:
    """Gap to the preceding vehicle, bumper to bumper [m]; infinite without a preceding vehicle.

    Args:
        scene: record of :data:`records.SCENE`.
    """
    preceding = scene.neighbours[PRECEDING]
    return preceding[NEAR_S] - scene.z[0] - scene.bodies if preceding[PRESENT] > 0.0 else np.inf


@jit
def perceive(k: int, state: np.ndarray, traffic: np.ndarray, line: np.ndarray, p: Parameters, scene: Scene) -> None:
    """Fill the scene at one time step, except for its safe area.

    Behind a vehicle the target speed is that of :func:`following_speed` (Section VI: "follow the preceding"). The
    driving region is the lane to keep, from the ego to d_o behind the rear of the preceding vehicle, or to the
    look-ahead (Section III-B). During a lane change the region covers both lanes up to the look-ahead, with the
    vehicles as holes. The lane to keep is the old lane during the first half of the change, then the new lane.

    Args:
        k: time step.
        state: ego ``[x, y, psi, v_x, v_y, r]`` [m, rad, m/s, rad/s], shape (6,).
        traffic: other vehicles, shape (n, 8).
        line: reference line, shape (m, 12).
        p: parameters.
        scene: record of :data:`records.SCENE`, written.
    """
    task = p.task
    scene.k = k
    scene.t = k * task.dt
    for i in range(6):
        scene.state[i] = state[i]
    road_frame(line, state, scene.z)
    s_e = scene.z[0]
    scene.lane_width = width_at(line, s_e)
    scene.road_low, scene.road_high = edges_at(line, s_e)
    for i in range(max(p.automation.H_p, p.driver.H_p)):
        scene.kappa[i] = curvature_at(line, s_e + i * task.dt * state[3], 0.0)
    progress = change_progress(scene.t, task.change_onset, task.change_duration)
    scene.changing = 0.0 < progress < 1.0
    scene.change_weight = change_weight(scene.t, task.change_onset, task.change_duration)
    scene.y_target = task.y_target + (task.y_goal - task.y_target) * progress
    lane = task.y_target if progress < 0.5 else task.y_goal
    goal = task.y_goal if scene.changing else np.nan
    find_neighbours(line, traffic, s_e, lane, goal, scene.neighbours)
    preceding = scene.neighbours[PRECEDING]
    scene.v_target = task.target_speed
    end = s_e + p.safe_area.look_ahead
    if preceding[PRESENT] > 0.0:
        scene.bodies = 0.5 * (p.vehicle.length + traffic[int(preceding[NEAR_ROW]), BODY_LENGTH])
        scene.v_target = following_speed(preceding[NEAR_SPEED], gap_ahead(scene), state[3], task)
        if not scene.changing:
            rear = preceding[NEAR_S] - 0.5 * traffic[int(preceding[NEAR_ROW]), BODY_LENGTH]
            end = min(end, rear - p.safe_area.d_o)
    rightmost = min(task.y_target, task.y_goal) if scene.changing else lane
    leftmost = max(task.y_target, task.y_goal) if scene.changing else lane
    scene.region[0] = s_e
    scene.region[1] = max(end, s_e + _SHORTEST_REGION)
    scene.region[2] = rightmost - 0.5 * scene.lane_width
    scene.region[3] = leftmost + 0.5 * scene.lane_width


@jit
def holes_in_region(traffic: np.ndarray, line: np.ndarray, region: np.ndarray, corners: np.ndarray) -> int:
    """Find the corners, in the road frame, of the vehicles that reach into the driving region.

    Args:
        traffic: other vehicles, shape (n, 8).
        line: reference line, shape (l, 12).
        region: driving region: start, end, low, high [m], shape (4,).
        corners: corners (s, d) [m] of each vehicle, written, shape (m, 4, 2); further vehicles are left out.

    Returns:
        Number of vehicles written, at most m.
    """
    count = 0
    for row in range(traffic.shape[0]):
        if count == corners.shape[0]:
            break
        s, d, psi_road, _ = locate(line, traffic[row, X], traffic[row, Y])
        psi = traffic[row, HEADING] - psi_road
        half_length, half_width = 0.5 * traffic[row, BODY_LENGTH], 0.5 * traffic[row, BODY_WIDTH]
        reach_s = abs(half_length * cos(psi)) + abs(half_width * sin(psi))
        reach_d = abs(half_length * sin(psi)) + abs(half_width * cos(psi))
        if s + reach_s <= region[0] or s - reach_s >= region[1]:
            continue
        if d + reach_d <= region[2] or d - reach_d >= region[3]:
            continue
        for i in range(4):
            along = half_length if i < 2 else -half_length
            across = half_width if i == 0 or i == 3 else -half_width
            corners[count, i, 0] = s + along * cos(psi) - across * sin(psi)
            corners[count, i, 1] = d + along * sin(psi) + across * cos(psi)
        count += 1
    return count
