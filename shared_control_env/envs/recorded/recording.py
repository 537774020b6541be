"""A recording of traffic: lanes, and vehicles with their tracks, as read from a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

LONGEST_STEP = 1.0
"""Longest time between two samples of a track [s]."""

FASTEST = 80.0
"""Speed between two samples above which a unit must be wrong [m/s]."""

BODIES = (0.3, 30.0), (0.2, 5.0)
"""Smallest and largest length and width of a vehicle [m]."""


@dataclass(frozen=True)
class Lane:
    """A lane: its borders in driving direction, and its neighbours.

    Attributes:
        left, right: borders, shape (n, 2) and (m, 2) [m].
        lane_to_left, lane_to_right: ids of the neighbours in the same direction; None without one.
        successors, predecessors: ids of the lanes that it leads to and comes from.
    """

    left: np.ndarray
    right: np.ndarray
    lane_to_left: str | None = None
    lane_to_right: str | None = None
    successors: tuple[str, ...] = ()
    predecessors: tuple[str, ...] = ()


@dataclass(frozen=True)
class Track:
    """A recorded vehicle.

    Attributes:
        length, width: body [m].
        t: times, increasing, shape (n,) [s].
        x, y: positions of the centre, shape (n,) [m].
        heading: recorded headings, shape (n,) [rad].
    """

    length: float
    width: float
    t: np.ndarray
    x: np.ndarray
    y: np.ndarray
    heading: np.ndarray


@dataclass(frozen=True)
class Start:
    """Where the ego of a planning problem begins.

    Attributes:
        t: time [s].
        x, y, heading, speed: pose and speed [m, m, rad, m/s].
    """

    t: float
    x: float
    y: float
    heading: float
    speed: float


@dataclass(frozen=True)
class Recording:
    """A recording.

    Attributes:
        source: path of the file.
        lanes: lanes by id.
        tracks: vehicles by id.
        starts: planning problems by id.
    """

    source: str
    lanes: Mapping[str, Lane]
    tracks: Mapping[str, Track]
    starts: Mapping[str, Start] = field(default_factory=dict)


def check(recording: Recording) -> None:
    """Check what no reader may let pass: numbers, order, units, references, and vehicles inside one another.

    Args:
        recording: the recording.

    Raises:
        ValueError: naming file and element.
    """
    for name, lane in recording.lanes.items():
        _check_lane(recording, name, lane)
    for name, track in recording.tracks.items():
        _check_track(f"{recording.source}: vehicle {name}", track)
    for name, start in recording.starts.items():
        if not np.isfinite([start.t, start.x, start.y, start.heading, start.speed]).all():
            raise ValueError(f"{recording.source}: planning problem {name} has a value that is not finite")
    if not recording.lanes:
        raise ValueError(f"{recording.source} has no lane")
    if not recording.tracks:
        raise ValueError(f"{recording.source} has no vehicle")
    _check_overlaps(recording)


def _check_lane(recording: Recording, name: str, lane: Lane) -> None:
    label = f"{recording.source}: lane {name}"
    for side, border in (("left", lane.left), ("right", lane.right)):
        if len(border) < 2 or not np.isfinite(border).all():
            raise ValueError(f"{label}: its {side} border must have at least two finite points")
    others = (lane.lane_to_left, lane.lane_to_right, *lane.successors, *lane.predecessors)
    for other in others:
        if other is not None and other not in recording.lanes:
            raise ValueError(f"{label} refers to the lane {other}, which is not there")
    for side in ("lane_to_left", "lane_to_right"):
        seen, at = {name}, getattr(lane, side)
        while at is not None:
            if at in seen:
                raise ValueError(f"{label}: its neighbours ({side.replace('_', ' ')}) lead back to the lane {at}")
            seen.add(at)
            at = getattr(recording.lanes[at], side)


def _check_track(label: str, track: Track) -> None:
    for what, value, (low, high) in zip(("length", "width"), (track.length, track.width), BODIES, strict=True):
        if not low <= value <= high:
            raise ValueError(f"{label}: {what} = {value:g} m must lie in [{low:g}, {high:g}]; is the unit the metre?")
    if len(track.t) < 2:
        raise ValueError(f"{label} has {len(track.t)} states; at least two are needed")
    for what in ("t", "x", "y", "heading"):
        values = getattr(track, what)
        if not np.isfinite(values).all():
            raise ValueError(f"{label}: {what} is not finite in state {int(np.flatnonzero(~np.isfinite(values))[0])}")
    steps = np.diff(track.t)
    if (steps <= 0.0).any() or (steps > LONGEST_STEP).any():
        wrong = int(np.flatnonzero((steps <= 0.0) | (steps > LONGEST_STEP))[0])
        raise ValueError(
            f"{label}: from state {wrong} to the next t goes from {track.t[wrong]:g} to {track.t[wrong + 1]:g} s; it "
            f"must increase by at most {LONGEST_STEP:g} s"
        )
    speed = np.hypot(np.diff(track.x), np.diff(track.y)) / steps
    if speed.max() > FASTEST:
        wrong = int(np.argmax(speed))
        raise ValueError(
            f"{label} moves at {speed[wrong]:.0f} m/s after state {wrong}; at most {FASTEST:g} are taken: is the unit "
            "the metre, and the time in seconds?"
        )


def _check_overlaps(recording: Recording) -> None:
    """Raise ValueError if the centres of two vehicles lie within each other's bodies at one time."""
    tracks = list(recording.tracks.items())
    for i, (name, one) in enumerate(tracks):
        for other_name, two in tracks[i + 1 :]:
            begin, end = max(one.t[0], two.t[0]), min(one.t[-1], two.t[-1])
            if begin > end:
                continue
            t = np.linspace(begin, end, max(2, int((end - begin) / 0.1) + 1))
            dx = np.interp(t, one.t, one.x) - np.interp(t, two.t, two.x)
            dy = np.interp(t, one.t, one.y) - np.interp(t, two.t, two.y)
            near = np.hypot(dx, dy) < 0.5 * min(one.width, two.width)
            if near.any():
                raise ValueError(
                    f"{recording.source}: the vehicles {name} and {other_name} are inside each other at "
                    f"t = {t[np.argmax(near)]:.1f} s"
                )
