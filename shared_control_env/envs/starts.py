"""The start of an episode as arrays (road, faults, parameters, ego, traffic), for one environment or for many."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from shared_control_env.core.batch import Batch, Sizes, Starts, empty_starts
from shared_control_env.core.records import X, Y, pack
from shared_control_env.core.world.replay import AWAY
from shared_control_env.core.world.road import COLUMNS, S0, pieces_of
from shared_control_env.core.world.start import place
from shared_control_env.envs.recorded.replay import Replay, files_in, read, replay_of
from shared_control_env.envs.recorded.road import most_rows
from shared_control_env.envs.settings import LEAD_IN, Settings, fault_records, parameters_of, plan_records


class Start(NamedTuple):
    """The start of one episode.

    Attributes:
        line: reference line of the road, shape (n, 12).
        faults: degradations as records of :class:`core.parameters.DegradationParameters`, shape (m,).
        parameters: record of :class:`core.parameters.Parameters`.
        ego: state of the ego, [x, y, psi, v_x, v_y, r] [m, rad, m/s, rad/s], shape (6,).
        traffic: other vehicles, one per row; columns as in :mod:`core.records`, shape (n_vehicles, 8).
        plans: plans of the other vehicles, records of :class:`core.parameters.TrafficParameters`, shape (n_vehicles,).
    """

    line: np.ndarray
    faults: np.ndarray
    parameters: np.ndarray
    ego: np.ndarray
    traffic: np.ndarray
    plans: np.ndarray


def start_of(settings: Settings) -> Start:
    """The start that the settings describe.

    Args:
        settings: settings of one episode, after all random draws.
    """
    if settings.recording is not None:
        replay = recorded(settings)
        return Start(
            replay.line,
            fault_records(settings),
            pack(parameters_of(settings)),
            replay.ego,
            replay.traffic,
            replay.plans,
        )
    numbers = numbers_of(settings)
    segments = 1 + len(settings.road.segments)
    line = np.empty((sum(pieces_of(s.length, s.curvature) for s in settings.road.segments) + 1, COLUMNS))
    ego, traffic = np.empty(6), np.empty((len(settings.vehicles), 8))
    place(numbers, segments, line, ego, traffic)
    return Start(line, fault_records(settings), pack(parameters_of(settings)), ego, traffic, plan_records(settings))


def numbers_of(settings: Settings) -> np.ndarray:
    """The numbers of a start, from which :func:`core.world.start.place` places everything.

    Args:
        settings: settings of one episode, after all random draws.
    """
    road, ego = settings.road, settings.ego
    values = [road.lane_width, road.lanes, settings.lane_centre(ego.lane), ego.lateral_offset, ego.speed, LEAD_IN, 0.0]
    values += [value for segment in road.segments for value in (segment.length, segment.curvature)]
    for vehicle in settings.vehicles:
        values += [settings.lane_centre(vehicle.lane), vehicle.position, vehicle.speed]
    return np.array(values, dtype=float)


def recorded(settings: Settings) -> Replay:
    """The replay of an episode with recorded traffic.

    Args:
        settings: settings of one episode, after all random draws.
    """
    assert settings.recording is not None
    assert settings.recording.ego is not None
    dt = 1.0 / settings.simulation_frequency
    return replay_of(Path(settings.recording.file), settings.recording.ego, dt, settings.simulation_steps)


def count_vehicles(settings: Settings) -> int:
    """Largest number of other vehicles of an episode.

    Args:
        settings: settings of the environment.
    """
    if settings.recording is None:
        return len(settings.vehicles)
    return max(len(read(file).tracks) for file in files_in(settings.recording.file))


def has_left(plans: np.ndarray) -> np.ndarray:
    """Whether vehicles with a recorded track have left it.

    Args:
        plans: records of :class:`core.parameters.TrafficParameters`.
    """
    return plans["follows"] & (plans["track"] != 0)


def sizes_for(templates: Sequence[Settings]) -> Sizes:
    """Sizes that suffice for every episode that can be drawn from the settings.

    Args:
        templates: settings of each environment; all have the same number of vehicles.
    """
    different = list({id(template): template for template in templates}.values())
    faults = max(len(template.faults) + (1 if template.degradations else 0) for template in different)
    return Sizes(faults, max(map(_most_rows, different)), max(map(count_vehicles, different)))


def _most_rows(settings: Settings) -> int:
    """Largest number of rows of the reference line: the lead-in, every segment, and the pieces of long arcs.

    The whole road turns by at most 2 pi, and an arc is split into pieces of at most pi / 2.
    """
    if settings.recording is not None:
        return max(most_rows(read(file)) for file in files_in(settings.recording.file))
    if any(entry.setting.startswith("road") for entry in settings.randomise):
        return 1 + len(settings.road.segments) + 4
    return len(start_of(settings).line)


def sizes_of(batch: Batch) -> Sizes:
    """Sizes that a batch has room for.

    Args:
        batch: state of the environments.
    """
    return Sizes(batch.faults.shape[1], batch.lines.shape[1], batch.traffic.shape[1])


def enlarged(batch: Batch, sizes: Sizes) -> Batch:
    """A batch with room for larger starts. The episodes that are running in it are kept.

    Args:
        batch: state of environments that may be in the middle of an episode.
        sizes: capacity that the next starts need.

    Returns:
        The batch itself if it is large enough, else a batch with larger arrays.
    """
    n, rows, faults = *batch.lines.shape[:2], batch.faults.shape[1]
    if sizes.rows <= rows and sizes.faults <= faults:
        return batch
    larger = empty_starts(n, Sizes(max(sizes.faults, faults), max(sizes.rows, rows), sizes.vehicles))
    larger.lines[:, :, S0] = np.inf
    larger.lines[:, :rows], larger.faults[:, :faults] = batch.lines, batch.faults
    memories = np.zeros(larger.faults.shape, batch.fault_memories.dtype)
    memories[:, :faults] = batch.fault_memories
    return batch._replace(lines=larger.lines, faults=larger.faults, fault_memories=memories)


def write_start(start: Start, starts: Starts | Batch, i: int) -> None:
    """Write the start of an episode as entry i.

    Unused rows of the line get an infinite start position, and unused fault records are zero.

    Args:
        start: start of the episode.
        starts: arrays that are large enough for the start, or the batch.
        i: index of the entry.
    """
    starts.parameters[i], starts.states[i] = start.parameters[()], start.ego
    starts.lines[i] = 0.0
    starts.lines[i, :, S0] = np.inf
    starts.lines[i, : len(start.line)] = start.line
    starts.faults[i] = np.zeros((), starts.faults.dtype)
    starts.faults[i, : len(start.faults)] = start.faults
    n = len(start.traffic)  # the rows that are left over are away
    starts.traffic[i, n:], starts.plans[i, n:] = 0.0, np.zeros((), starts.plans.dtype)
    starts.traffic[i, n:, [X, Y]] = AWAY
    starts.traffic[i, :n], starts.plans[i, :n] = start.traffic, start.plans


def refresh_addresses(episodes: Sequence[Settings], starts: Starts | Batch) -> None:
    """Write the addresses of compiled functions again, because they differ between processes.

    Args:
        episodes: settings of the episode of each entry.
        starts: arrays that were pickled or copied, possibly in another process.
    """
    for i, episode in enumerate(episodes):
        try:
            fresh, faults = parameters_of(episode), fault_records(episode)
        except KeyError as error:
            raise ValueError(
                f"{error.args[0]!r}, which this environment uses, is not known in this program; add it before, as the "
                "program did that made the environment"
            ) from None
        starts.parameters["vehicle"]["tyre"][i] = fresh.vehicle.tyre
        starts.parameters["reward"]["addresses"][i] = fresh.reward.addresses
        for name in ("act", "perceive", "advance", "profile", "profile_steps"):
            starts.faults[name][i, : len(faults)] = faults[name]
        if episode.recording is not None and episode.recording.drawn:
            plans = recorded(episode).plans
            for name in ("track", "decide", "advance", "ego_track"):
                starts.plans[name][i, : len(plans)] = plans[name]
