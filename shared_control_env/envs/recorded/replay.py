"""A recording as an episode: the road along the ego's lane, the tracks at the simulation steps, and the ego's start."""

from __future__ import annotations

from functools import cache, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from shared_control_env.core.parameters import TrafficParameters
from shared_control_env.core.records import BODY_LENGTH, BODY_WIDTH, HEADING, SPEED, YAW_RATE, X, Y, pack, record_dtype
from shared_control_env.core.world.replay import ADVANCE, AWAY, DECIDE, TRACK_COLUMNS, advance, decide
from shared_control_env.core.world.road import S0, WIDTH, locate
from shared_control_env.envs.recorded.commonroad import read_commonroad
from shared_control_env.envs.recorded.recording import Recording
from shared_control_env.envs.recorded.road import lane_at, road_along
from shared_control_env.envs.recorded.smoothing import motion
from shared_control_env.envs.recorded.tracks import TRACKS, read_tracks
from shared_control_env.envs.tables import version_of

SLOWEST = 2.0
"""Smallest speed that a vehicle wants that has left its track [m/s]."""

END = 10.0
"""Distance before the end of the recorded lanes at which an episode ends [m]."""


class Replay(NamedTuple):
    """A recording with one of its vehicles, or a planning problem, as the ego.

    Attributes:
        line: reference line through the ego's lane, s = 0 at the ego's start, shape (n, 12).
        ego: state of the ego at the start, shape (6,).
        body: length and width of the ego [m]; None for a planning problem.
        traffic: rows of the other V vehicles at the start, shape (V, 8).
        plans: their plans, records of :class:`core.parameters.TrafficParameters`, shape (V,).
        tracks: their tracks at the simulation steps, shape (V, T, 6).
        human: track of the vehicle whose place the ego has taken, shape (T, 6); None for a planning problem.
        human_steps: number of its rows that are recorded.
        road_end: path length at which the episode ends [m].
        lanes: number of lanes.
    """

    line: np.ndarray
    ego: np.ndarray
    body: tuple[float, float] | None
    traffic: np.ndarray
    plans: np.ndarray
    tracks: np.ndarray
    human: np.ndarray | None
    human_steps: int
    road_end: float
    lanes: int


EXAMPLE = "example"
"""Names the recording that comes with the package: generated, three lanes with a bend."""


def files_in(place: str) -> list[Path]:
    """Recordings in a folder, sorted; of a file, the file itself.

    Args:
        place: path of a recording, or of a folder with recordings; ``example`` for that of the package.

    Raises:
        ValueError: if there is none.
    """
    path = Path(__file__).parent / "example.tracks.csv" if place == EXAMPLE else Path(place).expanduser()
    if path.is_file():
        return [path]
    found = sorted(each for each in path.glob("*") if each.suffix == ".xml" or each.name.endswith(TRACKS))
    if not found:
        raise ValueError(f"{place} is no recording, and no folder with recordings (.xml, {', '.join(TRACKS)})")
    return found


def read(path: Path) -> Recording:
    """Read a recording; it is read once for as long as the file does not change.

    Args:
        path: CommonRoad scenario (``.xml``) or table of tracks (``.tracks.csv``, ``.tracks.parquet``).

    Raises:
        ValueError: for a file that is none, or wrong in itself.
    """
    return _read(*version_of(path))


@lru_cache(maxsize=64)
def _read(path: Path, changed: int, size: int) -> Recording:
    if path.suffix == ".xml":
        return read_commonroad(path)
    if path.name.endswith(TRACKS):
        return read_tracks(path)
    raise ValueError(f"{path} is no recording; its name must end with .xml, {' or '.join(TRACKS)}")


def usable(path: Path, duration: float) -> tuple[str, ...]:
    """Vehicles, and planning problems, that can be the ego: on a lane, and recorded for as long as an episode lasts.

    Args:
        path: the recording.
        duration: duration of an episode [s].
    """
    return _usable(*version_of(path), duration)


@lru_cache(maxsize=256)
def _usable(path: Path, changed: int, size: int, duration: float) -> tuple[str, ...]:
    recording = read(path)
    tracks = (
        name
        for name, track in recording.tracks.items()
        if track.t[-1] - track.t[0] >= duration and _is_on_a_lane(recording, track.x[0], track.y[0])
    )
    starts = (name for name, start in recording.starts.items() if _is_on_a_lane(recording, start.x, start.y))
    return (*tracks, *starts)


def _is_on_a_lane(recording: Recording, x: float, y: float) -> bool:
    try:
        lane_at(recording, float(x), float(y))
    except ValueError:
        return False
    return True


def replay_of(path: Path, ego: str, dt: float, steps: int) -> Replay:
    """The replay of a recording; made once for as long as the file does not change.

    The arrays are kept for as long as the program runs, since compiled code knows their addresses.

    Args:
        path: the recording.
        ego: id of a vehicle or of a planning problem.
        dt: simulation step [s].
        steps: number of simulation steps of an episode.

    Raises:
        ValueError: for an id that is not there, or an ego on no lane.
    """
    return _made(*version_of(path), ego, dt, steps)


@cache
def _made(path: Path, changed: int, size: int, ego: str, dt: float, steps: int) -> Replay:
    recording = read(path)
    if ego in recording.tracks:
        track = recording.tracks[ego]
        begin = float(track.t[0])
        first = motion(track, np.array([begin]))[0]
        body: tuple[float, float] | None = (track.length, track.width)
    elif ego in recording.starts:
        start = recording.starts[ego]
        begin, body = start.t, None
        first = np.zeros(TRACK_COLUMNS)
        first[[X, Y, HEADING, SPEED]] = start.x, start.y, start.heading, start.speed
    else:
        known = ", ".join([*recording.tracks, *recording.starts])
        raise ValueError(f"{path} has no vehicle and no planning problem {ego!r}; it has {known}")
    road = road_along(recording, float(first[X]), float(first[Y]))
    pose = road.into(first[None])[0]
    s_ego = locate(road.line, pose[X], pose[Y])[0]
    line = road.line.copy()
    line[:, S0] -= s_ego
    times = begin + dt * np.arange(steps + 1)
    ids = tuple(name for name in recording.tracks if name != ego)
    tracks, plans = np.zeros((len(ids), steps + 1, TRACK_COLUMNS)), np.zeros(len(ids), record_dtype(TrafficParameters))
    traffic = np.zeros((len(ids), 8))
    human, human_steps = None, 0
    if ego in recording.tracks:
        human_steps = int((times <= recording.tracks[ego].t[-1] + 1e-9).sum())
        human = np.ascontiguousarray(road.into(_within(recording, ego, times)))
    for i, name in enumerate(ids):
        track = recording.tracks[name]
        tracks[i] = road.into(_within(recording, name, times))
        there = np.flatnonzero((times >= track.t[0] - 1e-9) & (times <= track.t[-1] + 1e-9))
        ends = (int(there[0]), int(there[-1])) if len(there) else (steps + 1, -1)
        plans[i] = pack(
            TrafficParameters(
                desired_speed=max(SLOWEST, float(tracks[i, :, SPEED].max())),
                track=tracks[i].ctypes.data,
                decide=DECIDE.address(decide),
                advance=ADVANCE.address(advance),
                ego_track=0 if human is None else human.ctypes.data,
                steps=steps + 1,
                first=ends[0],
                last=ends[1],
            )
        )
        traffic[i, :TRACK_COLUMNS] = tracks[i, 0]
        if ends[0] > 0 or ends[1] < 0:
            traffic[i, :TRACK_COLUMNS] = 0.0
            traffic[i, [X, Y]] = AWAY
        traffic[i, [BODY_LENGTH, BODY_WIDTH]] = track.length, track.width
    state = np.array([pose[X], pose[Y], pose[HEADING], pose[SPEED], 0.0, pose[YAW_RATE]])
    return Replay(line, state, body, traffic, plans, tracks, human, human_steps, road.end - s_ego - END, road.lanes)


def decided_by(replay: Replay) -> dict[str, dict[str, Any]]:
    """Settings of an episode that a recording decides, by section.

    Args:
        replay: the recording with its ego.
    """
    width = float(np.median(replay.line[:, WIDTH]))
    segments = [{"length": replay.road_end, "curvature": 0.0}]
    decided: dict[str, dict[str, Any]] = {
        "road": {"segments": segments, "lanes": replay.lanes, "lane_width": width},
        "ego": {"lane": 0, "speed": float(replay.ego[SPEED]), "lateral_offset": 0.0},
    }
    if replay.body is not None:
        decided["vehicle"] = dict(zip(("length", "width"), replay.body, strict=True))
    return decided


def _within(recording: Recording, name: str, times: np.ndarray) -> np.ndarray:
    """Motion of a vehicle; at rest at its ends before and after its record."""
    track = recording.tracks[name]
    rows = motion(track, times.clip(track.t[0], track.t[-1]))
    outside = (times < track.t[0]) | (times > track.t[-1])
    rows[outside, SPEED:] = 0.0
    return rows
