"""Allocation by control barrier functions: as much of u_a,f as keeps the car in C and off the vehicle ahead.

Control barrier functions: Ames et al., Control Barrier Functions: Theory and Applications, European Control Conference
2019. Each channel has its own authority, so a bad steering command does not cost the braking.
"""

from __future__ import annotations

from math import cos, inf, sin

from shared_control_env.core.authority.alerts import NO_ALERT
from shared_control_env.core.authority.allocators import Situation
from shared_control_env.core.compile.jit import jit
from shared_control_env.core.parameters import Parameters
from shared_control_env.core.records import NEAR_SPEED, PRECEDING, Scene
from shared_control_env.core.risk.safe_area import lateral_bounds
from shared_control_env.core.world.lane_change import change_progress
from shared_control_env.core.world.scene import gap_ahead
from shared_control_env.core.world.vehicle import PSI, SLOWEST_SLIP, V_X, V_Y, R, S, Y, linear_axles

DRIFT_RATE = 0.2
"""Largest lateral speed towards a boundary over the distance to it, range (0, 5] [1/s]; ours.

A share of u_a,f can only push the other way less, not back: once the car drifts it goes on until the driver steers. The
rate is therefore slow, the inverse of a driver's response.
"""

RETURN_RATE = 4.0
"""Further lateral speed over the distance from the middle of the lane on the way back, range [0, 5] [1/s]; ours."""

RESPONSE_RATE = 10.0
"""Rate at which the lateral speed may approach its bound, range (0, 20] [1/s]; ours."""

GAP_RATE = 0.5
"""Rate gamma at which the surplus of the gap may decay, range (0, 20] [1/s]; ours."""

GAP_AT_REST = 2.0
"""Gap d_0 that is kept at standstill, range [0, inf) [m]; ours."""

HEADWAY = 0.6
"""Time headway tau that is kept, range (0, inf) [s]; ours: half of what the sound automation keeps."""


@jit
def target_motion(scene: Scene, p: Parameters) -> tuple[float, float]:
    """Lateral speed [m/s] and acceleration [m/s^2] of the position to track, which moves in a lane change.

    Args:
        scene: record of :data:`records.SCENE`.
        p: parameters.
    """
    task = p.task
    if not scene.changing:
        return 0.0, 0.0
    dt, way = task.dt, task.y_goal - task.y_target
    before = change_progress(scene.t - dt, task.change_onset, task.change_duration)
    now = change_progress(scene.t, task.change_onset, task.change_duration)
    after = change_progress(scene.t + dt, task.change_onset, task.change_duration)
    return way * (after - before) / (2.0 * dt), way * (after - 2.0 * now + before) / (dt * dt)


@jit
def growth_bound(h: float, e: float, w: float) -> float:
    """Largest lateral acceleration towards a boundary that satisfies its barrier row [m/s^2].

    Args:
        h: distance of the body's edge to the boundary [m].
        e: distance of the car from the middle of the lane, positive on the side of the boundary [m].
        w: lateral speed towards the boundary [m/s].
    """
    slope = DRIFT_RATE if e >= 0.0 else DRIFT_RATE + RETURN_RATE
    return RESPONSE_RATE * (DRIFT_RATE * h + RETURN_RATE * max(0.0, -e) - w) - slope * w


@jit
def steering_bounds(scene: Scene, p: Parameters) -> tuple[float, float]:
    """Smallest and largest steering angle that satisfy the barrier rows of both boundaries.

    The boundaries are those of C, and of the lane to keep, which moves with y_target in a lane change. The barrier
    bounds the lateral speed w towards a boundary by that from which a driver still brings the car back. With the
    distance h of the body's edge to the boundary, taken as parallel to the road, and the distance e of the car from the
    middle of the lane on the side of the boundary::

        w <= w_max = k h + j max(0, -e)
        w' <= w_max' - l (w - w_max)          drift rate k, return rate j, response rate l
        y'  = v_x sin(psi) + v_y cos(psi) - y_target'
        y'' = cos(psi) (K_f delta + F_0) / m - kappa v_x^2 - y_target''   with linear tyres and cos(delta) = 1

    F_0 is the lateral force at delta = 0. The rows are linear in delta.

    Args:
        scene: record of :data:`records.SCENE` with the safe area.
        p: parameters; the car is the controllers' model.

    Returns:
        ``low, high`` [rad]; low > high where the rows contradict each other.
    """
    z, car = scene.z, p.model
    low, high = lateral_bounds(scene.area, z[S])
    low, high = max(low, scene.y_target - 0.5 * scene.lane_width), min(high, scene.y_target + 0.5 * scene.lane_width)
    half = 0.5 * p.vehicle.width
    K_f, K_r, _ = linear_axles(car)
    v = max(z[V_X], SLOWEST_SLIP)
    F_0 = -K_f * (z[V_Y] + car.l_f * z[R]) / v - K_r * (z[V_Y] - car.l_r * z[R]) / v
    target_rate, target_growth = target_motion(scene, p)
    rate = z[V_X] * sin(z[PSI]) + z[V_Y] * cos(z[PSI]) - target_rate
    needed = scene.kappa[0] * z[V_X] * z[V_X] + target_growth
    offset = z[Y] - scene.y_target
    most = growth_bound(high - half - z[Y], offset, rate)
    least = -growth_bound(z[Y] - half - low, -offset, -rate)
    lever = max(cos(z[PSI]), 0.1)
    return ((least + needed) * car.m / lever - F_0) / K_f, ((most + needed) * car.m / lever - F_0) / K_f


@jit
def acceleration_bound(scene: Scene) -> float:
    """Largest acceleration that keeps the gap to the vehicle ahead [m/s^2]; infinite without one.

    ``a <= (v_l - v + gamma (gap - d_0 - tau v)) / tau``: the barrier row of ``h = gap - d_0 - tau v``.

    Args:
        scene: record of :data:`records.SCENE`.
    """
    gap = gap_ahead(scene)
    if gap == inf:
        return inf
    v = scene.z[V_X]
    surplus = gap - GAP_AT_REST - HEADWAY * v
    return (scene.neighbours[PRECEDING, NEAR_SPEED] - v + GAP_RATE * surplus) / HEADWAY


@jit
def largest_share(u_f: float, u_h: float, low: float, high: float) -> float:
    """Largest alpha in [0, 1] for which ``low <= alpha u_f + u_h <= high``.

    Readings where no alpha does: 0, or the alpha that misses the bounds by least. With 0 a braking command would be
    taken away where it brakes too little, which is why the second reading is taken.

    Args:
        u_f: degraded command [m/s^2 or rad].
        u_h: the driver's actual command [m/s^2 or rad].
        low, high: bounds [m/s^2 or rad]; low > high stands for their mean.

    Returns:
        alpha [-].
    """
    if low > high:
        low = high = 0.5 * (low + high)
    if low <= u_f + u_h <= high or u_f == 0.0:
        return 1.0
    nearer = high if u_f + u_h > high else low
    return min(max((nearer - u_h) / u_f, 0.0), 1.0)


def barrier(now: Situation) -> tuple[float, float, int]:
    """Largest authority in each channel that satisfies the barrier rows.

    Args:
        now: the situation.

    Returns:
        alpha over acceleration and over steering [-]; no alert.
    """
    u_f, u_h = now.signals.u_a_f, now.memory.u_h_act
    low, high = steering_bounds(now.scene, now.p)
    over_a = largest_share(u_f[0], u_h[0], -inf, acceleration_bound(now.scene))
    return over_a, largest_share(u_f[1], u_h[1], low, high), NO_ALERT
