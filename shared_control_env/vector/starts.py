"""Starts of episodes in the arrays of many environments."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from shared_control_env.core.parameters import DegradationParameters, Parameters, TrafficParameters
from shared_control_env.core.records import record_dtype
from shared_control_env.core.road import S0
from shared_control_env.envs.settings import Settings
from shared_control_env.envs.situation import start_of
from shared_control_env.vector.records import Batch, Starts


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
    """Room for whatever any of the settings draws; all have as many vehicles."""
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
    """Arrays for n starts."""
    return Starts(
        parameters=np.zeros(n, record_dtype(Parameters)),
        states=np.zeros((n, 6)),
        lines=np.zeros((n, sizes.rows, 6)),
        faults=np.zeros((n, sizes.faults), record_dtype(DegradationParameters)),
        traffic=np.zeros((n, sizes.vehicles, 8)),
        plans=np.zeros((n, sizes.vehicles), record_dtype(TrafficParameters)),
    )


def grown(batch: Batch, sizes: Sizes) -> Batch:
    """A batch with room for larger starts too; what is under way in it stays as it is."""
    n, rows, faults = *batch.lines.shape[:2], batch.faults.shape[1]
    if sizes.rows <= rows and sizes.faults <= faults:
        return batch
    larger = empty_starts(n, Sizes(max(sizes.faults, faults), max(sizes.rows, rows), sizes.vehicles))
    larger.lines[:, :, S0] = np.inf
    larger.lines[:, :rows], larger.faults[:, :faults] = batch.lines, batch.faults
    memories = np.zeros(larger.faults.shape, batch.fault_memories.dtype)
    memories[:, :faults] = batch.fault_memories
    return batch._replace(lines=larger.lines, faults=larger.faults, fault_memories=memories)


def write_start(settings: Settings, starts: Starts | Batch, i: int) -> None:
    """Write an episode's start as entry i; what is left of a line begins at infinity, of the faults is none."""
    start = start_of(settings)
    starts.parameters[i], starts.states[i] = start.parameters[()], start.ego
    starts.lines[i] = 0.0
    starts.lines[i, :, S0] = np.inf
    starts.lines[i, : len(start.line)] = start.line
    starts.faults[i] = np.zeros((), starts.faults.dtype)
    starts.faults[i, : len(start.faults)] = start.faults
    starts.traffic[i], starts.plans[i] = start.traffic, start.plans
