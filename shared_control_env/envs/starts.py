"""The start of an episode as arrays: road, faults, parameters, ego and traffic, of one environment or of many."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from shared_control_env.core.batch import Batch, Starts
from shared_control_env.core.parameters import TRAFFIC_BODY, DegradationParameters, Parameters, TrafficParameters
from shared_control_env.core.records import (
    AUTOMATION_MEMORY,
    BODY_LENGTH,
    BODY_WIDTH,
    FAULT_MEMORY,
    MEMORY,
    PERSON_MEMORY,
    SCENE,
    SIGNALS,
    SPEED,
    TRANSITION,
    pack,
    record_dtype,
)
from shared_control_env.core.world.road import S0, curvature_at, point_at, reference_line
from shared_control_env.core.world.traffic import follow_lane
from shared_control_env.envs.settings import LEAD_IN, Settings, fault_records, parameters_of, plan_records


class Start(NamedTuple):
    """What an episode starts from.

    Attributes:
        line: reference line of the road, shape (n, 6).
        faults: degradations as records of :class:`core.parameters.DegradationParameters`, shape (m,).
        parameters: record of :class:`core.parameters.Parameters`.
        ego: state [x, y, psi, v_x, v_y, r], shape (6,).
        traffic: other vehicles as rows of :mod:`core.records`' traffic columns, shape (n_vehicles, 8).
        plans: what they are going to do, records of :class:`core.parameters.TrafficParameters`, shape (n_vehicles,).
    """

    line: np.ndarray
    faults: np.ndarray
    parameters: np.ndarray
    ego: np.ndarray
    traffic: np.ndarray
    plans: np.ndarray


def start_of(settings: Settings) -> Start:
    """The start that settings describe: the ego at s = 0, turning with the road.

    Args:
        settings: of an episode, with nothing left to draw.
    """
    line = reference_line([(s.length, s.curvature) for s in settings.road.segments], lead_in=LEAD_IN)
    d = settings.lane_centre(settings.ego.lane) + settings.ego.lateral_offset
    x, y, psi = point_at(line, 0.0, d)
    speed = settings.ego.speed
    ego = np.array([x, y, psi, speed, 0.0, speed * curvature_at(line, 0.0, d)])
    traffic = np.zeros((len(settings.vehicles), 8))
    for row, vehicle in zip(traffic, settings.vehicles, strict=True):
        row[:3] = point_at(line, vehicle.position, settings.lane_centre(vehicle.lane))
        row[SPEED], row[BODY_LENGTH], row[BODY_WIDTH] = vehicle.speed, *TRAFFIC_BODY
        follow_lane(row, line, 0.0, 0.0)
    return Start(line, fault_records(settings), pack(parameters_of(settings)), ego, traffic, plan_records(settings))


class Sizes(NamedTuple):
    """How much a start can hold.

    Attributes:
        faults: degradations.
        rows: of the reference line.
        vehicles: other vehicles.
    """

    faults: int
    rows: int
    vehicles: int


def sizes_for(templates: Sequence[Settings]) -> Sizes:
    """Room for whatever any of the settings draws.

    Args:
        templates: settings of every environment; all have as many vehicles.
    """
    different = list({id(template): template for template in templates}.values())
    faults = max(len(template.faults) + (1 if template.degradations else 0) for template in different)
    return Sizes(faults, max(_most_rows(template) for template in different), len(different[0].vehicles))


def _most_rows(settings: Settings) -> int:
    """Rows of the reference line: one for the lead-in and one for every segment, more where arcs are long.

    The whole road turns by at most 2 pi, in pieces of up to pi / 2.
    """
    if any(entry.setting.startswith("road") for entry in settings.randomise):
        return 1 + len(settings.road.segments) + 4
    return len(start_of(settings).line)


def empty_starts(n: int, sizes: Sizes) -> Starts:
    """Arrays for n starts.

    Args:
        n: how many.
        sizes: of each.
    """
    return Starts(
        parameters=np.zeros(n, record_dtype(Parameters)),
        states=np.zeros((n, 6)),
        lines=np.zeros((n, sizes.rows, 6)),
        faults=np.zeros((n, sizes.faults), record_dtype(DegradationParameters)),
        traffic=np.zeros((n, sizes.vehicles, 8)),
        plans=np.zeros((n, sizes.vehicles), record_dtype(TrafficParameters)),
    )


def grown(batch: Batch, sizes: Sizes) -> Batch:
    """A batch with room for larger starts too; what is under way in it stays as it is.

    Args:
        batch: of environments in the middle of episodes.
        sizes: of the starts to come.
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
    """Write an episode's start as entry i; what is left of a line begins at infinity, of the faults is none.

    Args:
        start: of the episode.
        starts: arrays with room for it, or the batch.
        i: which entry.
    """
    starts.parameters[i], starts.states[i] = start.parameters[()], start.ego
    starts.lines[i] = 0.0
    starts.lines[i, :, S0] = np.inf
    starts.lines[i, : len(start.line)] = start.line
    starts.faults[i] = np.zeros((), starts.faults.dtype)
    starts.faults[i, : len(start.faults)] = start.faults
    starts.traffic[i], starts.plans[i] = start.traffic, start.plans


def empty_batch(n: int, sizes: Sizes, driver: bool = False) -> Batch:
    """Arrays of n environments in which nothing has begun.

    Args:
        n: how many.
        sizes: of their starts.
        driver: whether the kernel drives them.
    """
    return Batch(
        **empty_starts(n, sizes)._asdict(),
        scenes=np.zeros(n, SCENE),
        signals=np.zeros(n, SIGNALS),
        memories=np.zeros(n, MEMORY),
        automations=np.zeros(n, AUTOMATION_MEMORY),
        persons=np.zeros(n if driver else 1, PERSON_MEMORY),
        transitions=np.zeros(n, TRANSITION),
        fault_memories=np.zeros((n, sizes.faults), FAULT_MEMORY),
        ended=np.zeros(n, dtype=bool),
    )


def refresh_addresses(episodes: Sequence[Settings], starts: Starts | Batch) -> None:
    """Write again where compiled functions are, which differs from process to process.

    Args:
        episodes: settings of each entry's episode.
        starts: arrays that came from another process.
    """
    for i, episode in enumerate(episodes):
        fresh = parameters_of(episode)
        starts.parameters["vehicle"]["tyre"][i] = fresh.vehicle.tyre
        starts.parameters["reward"]["addresses"][i] = fresh.reward.addresses
        faults = fault_records(episode)
        for name in ("act", "perceive", "advance"):
            starts.faults[name][i, : len(faults)] = faults[name]
