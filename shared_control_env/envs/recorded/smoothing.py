"""Smooth motion from recorded positions: measured tracks are too noisy to differentiate twice.

Positions are smoothed by a Savitzky-Golay filter over one second (cubic) and joined by a cubic spline. Speed, heading
and yaw rate are derivatives of that spline, so that they belong to the motion that is seen. Recorded speeds are not
used, and recorded headings only for a vehicle that stands throughout.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import savgol_filter

from shared_control_env.core.records import ACCELERATION, HEADING, SPEED, YAW_RATE, X, Y
from shared_control_env.envs.recorded.recording import Track

WINDOW = 1.0
"""Length of the filter [s]."""

ORDER = 3
"""Order of its polynomials."""

STANDING = 0.5
"""Speed below which a vehicle keeps its heading [m/s]: the direction of its motion is noise then."""


def smoothed(track: Track) -> tuple[CubicSpline, CubicSpline]:
    """Smoothed positions x(t), y(t) of a track [m].

    Args:
        track: the track.
    """
    dt = float(np.median(np.diff(track.t)))
    grid = track.t[0] + dt * np.arange(round((track.t[-1] - track.t[0]) / dt) + 1)
    grid[-1] = track.t[-1]
    return tuple(CubicSpline(grid, _filtered(np.interp(grid, track.t, values), dt)) for values in (track.x, track.y))


def _filtered(values: np.ndarray, dt: float) -> np.ndarray:
    window = 2 * int(0.5 * WINDOW / dt) + 1
    window = min(window, len(values) - 1 + len(values) % 2)
    return savgol_filter(values, window, ORDER) if window > ORDER else values


def motion(track: Track, times: np.ndarray) -> np.ndarray:
    """Motion of a recorded vehicle at times within its record.

    Args:
        track: the track.
        times: times, shape (n,) [s].

    Returns:
        Rows of the traffic array without the body (X to YAW_RATE), shape (n, 6).
    """
    x, y = smoothed(track)
    dx, dy, ddx, ddy = x(times, 1), y(times, 1), x(times, 2), y(times, 2)
    rows = np.zeros((len(times), 6))
    rows[:, X], rows[:, Y], rows[:, SPEED] = x(times), y(times), np.hypot(dx, dy)
    moving = rows[:, SPEED] > STANDING
    recorded = np.interp(times, track.t, np.unwrap(track.heading))
    direction = np.where(moving, np.arctan2(dy, dx), np.nan)
    rows[:, HEADING] = _held(direction, recorded)
    speed = np.maximum(rows[:, SPEED], STANDING)
    rows[:, ACCELERATION] = (dx * ddx + dy * ddy) / speed
    rows[:, YAW_RATE] = np.where(moving, (dx * ddy - dy * ddx) / speed**2, 0.0)
    return rows


def _held(direction: np.ndarray, recorded: np.ndarray) -> np.ndarray:
    """Directions, each nan replaced by the last one before it, or the first after it; recorded ones without any."""
    known = np.flatnonzero(~np.isnan(direction))
    if len(known) == 0:
        return np.full(len(direction), recorded[0])
    last = np.maximum.accumulate(np.where(np.isnan(direction), -1, np.arange(len(direction))))
    return np.unwrap(direction[np.where(last < 0, known[0], last)])
