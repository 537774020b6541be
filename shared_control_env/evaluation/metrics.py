"""The metrics of an episode, each with its unit, direction and definition."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from shared_control_env.nearest import check_new_name, hint

LATERAL_ACCELERATION_LIMIT = 3.0
"""Largest lateral acceleration of a lane keeping system [m/s^2]; ISO 11270."""

LATERAL_JERK_LIMIT = 5.0
"""Largest lateral jerk of a lane keeping system, averaged over half a second [m/s^3]; ISO 11270."""

JERK_WINDOW = 0.5
"""Time over which jerk is averaged [s]; ISO 11270."""

REVERSAL_GAP = np.radians(0.2)
"""Smallest change of the front steering angle that counts as a reversal [rad]: 3 degrees at the wheel, ratio 16."""

DETECTION_LOSS = 0.2
"""Authority alpha_a that must be lost, against the same episode without a fault, to count as a detection [-]."""

EXPOSED_TTC = 3.0
"""Time to collision below which the car counts as exposed [s]; ours, within the 1.5 to 4 s that are in use."""

RECOVERED = 0.5
"""Lateral error within which the car counts as recovered [m]."""


@dataclass(frozen=True)
class Trajectory:
    """Signals of one episode of T time steps. States have one more row: the last is the state in which it ends.

    Attributes:
        dt: time step [s].
        lateral_error: y - y_target, shape (T + 1,) [m].
        lane_width: width of a lane [m].
        body_width: width of the ego's body [m].
        speed: longitudinal speed v_x, shape (T + 1,) [m/s].
        target_speed: target speed, shape (T + 1,) [m/s].
        lateral_speed: lateral velocity v_y in the body frame, shape (T + 1,) [m/s].
        yaw_rate: yaw rate r, shape (T + 1,) [rad/s].
        command: command u of the vehicle, ``[a, delta]`` as shares of the limits, shape (T, 2) [-].
        delta_max: limit of the steering angle [rad].
        a_max: limit of the acceleration [m/s^2].
        gap: gap to the vehicle ahead in the lane, bumper to bumper; inf without one, shape (T + 1,) [m]. After a
            collision the last entry is 0: the gap to the vehicle that was hit, wherever it was.
        lead_speed: speed of the vehicle ahead, shape (T + 1,) [m/s].
        driver, automation: actual commands u_h,act and u_a,act as shares of the limits, shape (T, 2) [-].
        authority: alpha_a, shape (T,) [-].
        sound_authority: alpha_a of the same episode without a fault, shape (T,) [-]; NaN where that is not known.
        alert: whether the driver is alerted, shape (T,).
        degraded: whether a degradation is active, shape (T,).
        crashed, left_road: whether the episode ended in a collision, or off the road.
        solver_failures: number of steps at which a solver of automation or driver failed, so that its last command was
            held.
        wall_time: computing time [s].
        human: distance [m] to the recorded vehicle whose place the ego has taken, and speed minus its speed [m/s],
            while it is recorded, shape (n, 2) with n at most T + 1; None without recorded traffic.
    """

    dt: float
    lateral_error: np.ndarray
    lane_width: float
    body_width: float
    speed: np.ndarray
    target_speed: np.ndarray
    lateral_speed: np.ndarray
    yaw_rate: np.ndarray
    command: np.ndarray
    delta_max: float
    a_max: float
    gap: np.ndarray
    lead_speed: np.ndarray
    driver: np.ndarray
    automation: np.ndarray
    authority: np.ndarray
    sound_authority: np.ndarray
    alert: np.ndarray
    degraded: np.ndarray
    crashed: bool
    left_road: bool
    solver_failures: int
    wall_time: float
    human: np.ndarray | None = None

    @property
    def onset(self) -> int | None:
        """Index of the first time step with a degradation; None without any."""
        return int(np.argmax(self.degraded)) if self.degraded.any() else None


class Metric(NamedTuple):
    """A metric.

    Attributes:
        unit: unit of the value.
        better: direction in which the metric is better: ``lower``, ``higher`` or ``neither``.
        definition: definition in a sentence.
        measure: function of a trajectory that returns the value; nan where the metric is not defined for the episode.
    """

    unit: str
    better: str
    definition: str
    measure: Callable[[Trajectory], float]


IDENTITY = (
    *("scenario", "degradation", "driver", "authority", "seed", "terminated", "duration"),
    *("K_h", "T_h", "person", "response", "noticed"),
    *("fault_kind", "fault_channel", "fault_size", "fault_onset", "fault_duration"),
    *("config_hash", "version", "versions"),
)
"""Columns of the table that are no metrics."""

BETTER = ("lower", "higher", "neither")
"""Directions in which a metric is better."""

METRICS: dict[str, Metric] = {}
"""All metrics by name, in the order of the tables."""


def metric(unit: str, better: str) -> Callable[[Callable[[Trajectory], float]], Callable[[Trajectory], float]]:
    """Decorator that enters a function into :data:`METRICS` under its name. Its docstring becomes the definition.

    Args:
        unit: unit of the value.
        better: direction in which the metric is better: ``lower``, ``higher`` or ``neither``.

    Raises:
        ValueError: for an unknown direction, a function without a docstring, or a name that is taken.
    """
    if better not in BETTER:
        raise ValueError(f"better = {better!r}; {hint(better, BETTER)}")

    def enter(measure: Callable[[Trajectory], float]) -> Callable[[Trajectory], float]:
        check_new_name("metric", measure.__name__, (*METRICS, *IDENTITY))
        if not measure.__doc__:
            raise ValueError(f"metric {measure.__name__!r} has no docstring, which is its definition")
        METRICS[measure.__name__] = Metric(unit, better, " ".join(measure.__doc__.split()), measure)
        return measure

    return enter


def measure_all(trajectory: Trajectory) -> dict[str, float]:
    """Compute all metrics of an episode.

    Args:
        trajectory: signals of the episode.

    Returns:
        Values by name of the metric.
    """
    return {name: float(entry.measure(trajectory)) for name, entry in METRICS.items()}


def _room(t: Trajectory) -> np.ndarray:
    """Distance from the body's edge to the nearer line of the lane to keep, taken as parallel to it, (T + 1,) [m]."""
    return 0.5 * (t.lane_width - t.body_width) - np.abs(t.lateral_error)


def _out_of_lane(t: Trajectory) -> np.ndarray:
    return _room(t) < 0.0


@metric("-", "lower")
def collisions(t: Trajectory) -> float:
    """1 if the episode ended in a collision, else 0."""
    return float(t.crashed)


@metric("-", "lower")
def road_departures(t: Trajectory) -> float:
    """1 if the episode ended off the road, else 0."""
    return float(t.left_road)


@metric("-", "higher")
def controlled(t: Trajectory) -> float:
    """1 if from the onset on there is no collision and the body stays on the road and in the lane to keep, else 0."""
    return float(not (t.crashed or t.left_road or _out_of_lane(t)[t.onset or 0 :].any()))


@metric("m", "higher")
def lane_room_min(t: Trajectory) -> float:
    """Smallest distance from the body's edge to the nearer line of the lane to keep; negative beyond the line."""
    return float(_room(t).min())


@metric("-", "lower")
def lane_departures(t: Trajectory) -> float:
    """Number of times that the body's edge crosses a line of the lane to keep outwards."""
    out = _out_of_lane(t)
    return float(np.count_nonzero(out[1:] & ~out[:-1]) + out[0])


@metric("s", "lower")
def time_out_of_lane(t: Trajectory) -> float:
    """Time with the body's edge beyond a line of the lane to keep."""
    return float(_out_of_lane(t)[1:].sum() * t.dt)


@metric("m", "lower")
def lateral_max(t: Trajectory) -> float:
    """Largest |y - y_target|."""
    return float(np.abs(t.lateral_error).max())


@metric("m", "lower")
def lateral_rms(t: Trajectory) -> float:
    """Root mean square of y - y_target."""
    return float(np.sqrt(np.mean(t.lateral_error**2)))


@metric("m", "higher")
def min_gap(t: Trajectory) -> float:
    """Smallest gap to the vehicle ahead in the lane, bumper to bumper; 0 in a collision; not defined without one."""
    return float(t.gap.min()) if np.isfinite(t.gap).any() else np.nan


@metric("s", "higher")
def min_thw(t: Trajectory) -> float:
    """Smallest time headway: the gap to the vehicle ahead over the ego's speed, while moving faster than 1 m/s."""
    following = np.isfinite(t.gap) & (t.speed > 1.0)
    return float((t.gap[following] / t.speed[following]).min()) if following.any() else np.nan


def _closing(t: Trajectory) -> np.ndarray:
    """Steps at which the gap to a vehicle ahead shrinks by more than 0.1 m/s."""
    return np.isfinite(t.gap) & (t.speed - t.lead_speed > 0.1)


def _ttc(t: Trajectory) -> np.ndarray:
    """Time to collision with the vehicle ahead, infinite where the gap does not shrink, shape (T + 1,) [s]."""
    ttc, closing = np.full(len(t.gap), np.inf), _closing(t)
    ttc[closing] = np.maximum(t.gap, 0.0)[closing] / (t.speed - t.lead_speed)[closing]
    if t.crashed:
        ttc[-1] = 0.0
    return ttc


@metric("s", "higher")
def min_ttc(t: Trajectory) -> float:
    """Smallest time to collision: the gap over the closing speed, while that is above 0.1 m/s; 0 in a collision."""
    ttc = _ttc(t)
    return float(ttc.min()) if np.isfinite(ttc).any() else np.nan


@metric("s", "lower")
def exposed_time(t: Trajectory) -> float:
    """Time with a time to collision below 3 s (TET; Minderhoud & Bovy 2001)."""
    return float((_ttc(t)[1:] < EXPOSED_TTC).sum() * t.dt)


@metric("s^2", "lower")
def exposed_time_integral(t: Trajectory) -> float:
    """Integral over time of 3 s minus the time to collision, while that is below 3 s (TIT; Minderhoud & Bovy 2001)."""
    return float(np.maximum(EXPOSED_TTC - _ttc(t)[1:], 0.0).sum() * t.dt)


@metric("m/s^2", "lower")
def max_drac(t: Trajectory) -> float:
    """Largest deceleration rate to avoid a crash, closing speed squared over twice the gap, before a collision."""
    closing = _closing(t)
    closing[-1] &= not t.crashed
    if not closing.any():
        return 0.0
    rate = (t.speed - t.lead_speed)[closing] ** 2 / (2.0 * np.maximum(t.gap[closing], 0.1))
    return float(rate.max())


def _detected(t: Trajectory) -> np.ndarray | None:
    """Whether the fault costs authority at each step from the onset on; None without an onset or a comparison."""
    if t.onset is None or np.isnan(t.sound_authority).all():
        return None
    return (t.sound_authority - t.authority)[t.onset :] > DETECTION_LOSS


@metric("s", "lower")
def time_to_detect(t: Trajectory) -> float:
    """Time from the onset until alpha_a first lies 0.2 below that of the same episode without a fault, if it does."""
    low = _detected(t)
    return float(np.argmax(low) * t.dt) if low is not None and low.any() else np.nan


@metric("-", "lower")
def missed_detection(t: Trajectory) -> float:
    """1 if alpha_a never lies 0.2 below that of the same episode without a fault, else 0; needs an onset."""
    low = _detected(t)
    return float(not low.any()) if low is not None else np.nan


@metric("-", "lower")
def false_authority_loss(t: Trajectory) -> float:
    """Mean of 1 - alpha_a before the onset, or over the whole episode without one."""
    healthy = t.authority[: t.onset]
    return float(np.mean(1.0 - healthy)) if len(healthy) else np.nan


@metric("-", "lower")
def false_alert(t: Trajectory) -> float:
    """Share of the time before the onset, or of the whole episode without one, with an alert to the driver."""
    healthy = t.alert[: t.onset]
    return float(np.mean(healthy)) if len(healthy) else np.nan


@metric("s", "lower")
def time_to_alert(t: Trajectory) -> float:
    """Time from the onset to the first alert to the driver; not defined without an onset or an alert."""
    if t.onset is None or not t.alert[t.onset :].any():
        return np.nan
    return float(np.argmax(t.alert[t.onset :]) * t.dt)


@metric("-", "neither")
def authority_min(t: Trajectory) -> float:
    """Smallest alpha_a."""
    return float(t.authority.min())


@metric("-", "lower")
def driver_effort(t: Trajectory) -> float:
    """Root mean square of the driver's actual command u_h,act, both channels over their limits."""
    return float(np.sqrt(np.mean(np.sum(t.driver**2, axis=1))))


@metric("-", "lower")
def driver_effort_peak(t: Trajectory) -> float:
    """Largest magnitude of the driver's actual command u_h,act, both channels over their limits."""
    return float(np.sqrt(np.sum(t.driver**2, axis=1).max()))


@metric("-", "lower")
def conflict(t: Trajectory) -> float:
    """Mean of max(0, -u_h,act u_a,act) over both channels, over their limits: driver against automation."""
    return float(np.mean(np.maximum(0.0, -t.driver * t.automation).sum(axis=1)))


@metric("1/min", "lower")
def steering_reversal_rate(t: Trajectory) -> float:
    """Rate of reversals of the front steering angle by more than 0.2 degrees (Markkula & Engstrom 2006, no filter)."""
    steering = t.command[:, 1] * t.delta_max
    reversals, direction, extreme = 0, 0, steering[0]
    for angle in steering.tolist():
        if direction >= 0 and angle < extreme - REVERSAL_GAP:
            reversals += direction > 0
            direction, extreme = -1, angle
        elif direction <= 0 and angle > extreme + REVERSAL_GAP:
            reversals += direction < 0
            direction, extreme = 1, angle
        elif direction * (angle - extreme) > 0.0:
            extreme = angle
    return 60.0 * reversals / (len(steering) * t.dt)


def _lateral_acceleration(t: Trajectory) -> np.ndarray:
    """Mean lateral acceleration of every time step, v_y' + v_x r, shape (T,) [m/s^2].

    v_x r alone is the lateral acceleration in steady cornering only; where the car yaws under steering that alternates,
    it is several times what the tyres can transmit.
    """
    turning = t.speed * t.yaw_rate
    return np.diff(t.lateral_speed) / t.dt + 0.5 * (turning[1:] + turning[:-1])


@metric("m/s^2", "lower")
def lateral_acceleration_max(t: Trajectory) -> float:
    """Largest |v_y' + v_x r|, averaged over a time step; ISO 11270 allows 3 m/s^2."""
    return float(np.abs(_lateral_acceleration(t)).max())


def _lateral_jerk(t: Trajectory) -> np.ndarray:
    """Magnitude of the change of the lateral acceleration over half a second, divided by that time [m/s^3]."""
    n = max(1, round(JERK_WINDOW / t.dt))
    lateral = _lateral_acceleration(t)
    return np.abs(lateral[n:] - lateral[:-n]) / (n * t.dt)


@metric("m/s^3", "lower")
def lateral_jerk_max(t: Trajectory) -> float:
    """Largest lateral jerk, averaged over 0.5 s; ISO 11270 allows 5 m/s^3; not defined for shorter episodes."""
    jerk = _lateral_jerk(t)
    return float(jerk.max()) if len(jerk) else np.nan


@metric("-", "lower")
def iso_11270_violation(t: Trajectory) -> float:
    """Share of the time with a lateral acceleration over 3 m/s^2 or a lateral jerk, over 0.5 s, over 5 m/s^3."""
    beyond = np.abs(_lateral_acceleration(t)) > LATERAL_ACCELERATION_LIMIT
    jerk = _lateral_jerk(t) > LATERAL_JERK_LIMIT
    beyond[len(beyond) - len(jerk) :] |= jerk
    return float(beyond.mean())


@metric("m/s^3", "lower")
def jerk_rms(t: Trajectory) -> float:
    """Root mean square of the change of the acceleration command over the time step."""
    if len(t.command) < 2:
        return np.nan
    return float(np.sqrt(np.mean((np.diff(t.command[:, 0]) * t.a_max / t.dt) ** 2)))


@metric("m/s", "lower")
def speed_rms(t: Trajectory) -> float:
    """Root mean square of v_x minus the target speed."""
    return float(np.sqrt(np.mean((t.speed - t.target_speed) ** 2)))


@metric("s", "lower")
def recovery_time(t: Trajectory) -> float:
    """Time from the onset until |y - y_target| stays within 0.5 m to the end; not defined where it does not."""
    if t.onset is None or t.crashed or t.left_road:
        return np.nan
    outside = np.flatnonzero(np.abs(t.lateral_error[t.onset :]) > RECOVERED)
    if len(outside) == 0:
        return 0.0
    recovered = outside[-1] + 1
    return float(recovered * t.dt) if t.onset + recovered < len(t.lateral_error) else np.nan


@metric("m", "neither")
def human_displacement(t: Trajectory) -> float:
    """Mean distance to the recorded vehicle whose place the ego has taken, along and across the road."""
    return np.nan if t.human is None else float(t.human[:, 0].mean())


@metric("m/s", "neither")
def human_speed_rms(t: Trajectory) -> float:
    """Root mean square of v_x minus the speed of the recorded vehicle whose place the ego has taken."""
    return np.nan if t.human is None else float(np.sqrt(np.mean(t.human[:, 1] ** 2)))


@metric("-", "lower")
def solver_failures(t: Trajectory) -> float:
    """Steps at which a solver failed and the last command was held, of automation and driver."""
    return float(t.solver_failures)


@metric("-", "higher")
def real_time_factor(t: Trajectory) -> float:
    """Simulated time over computing time, of the batch that the episode ran in; it differs from run to run."""
    return len(t.command) * t.dt / t.wall_time


STANDARD = tuple(METRICS)
"""Names of the metrics that the package defines; user-defined metrics come after them."""
