"""Random starts in compiled code, from tables that :mod:`envs.drawing` makes once of the settings.

A draw uses the environment's generator as :func:`envs.episode.draw_episode` does, number by number, and writes the
start that :func:`envs.starts.start_of` gives of its result.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from shared_control_env.core.batch import Batch
from shared_control_env.core.compile.jit import jit
from shared_control_env.core.stream import integer, random
from shared_control_env.core.world.start import place

PARAMETERS, PLANS, NUMBERS = range(3)
"""Arrays that a drawn value is written to: parameters, plans of the traffic, numbers of the start."""

ONSET, RAMP, PERIOD, SIZE, DURATION = range(5)
"""Rows of the ranges of a degradation."""

SEED_RANGE = 2**31
"""Seeds of noise lie below."""

GIVEN, DISCARDED, TAKEN = range(3)
"""A fault's seed: given in the settings; drawn, since later draws must not depend on the kind, but not used; used."""


class Drawing(NamedTuple):
    """What is drawn for an episode, and the start apart from it. There are E settings, D degradations and C channels.

    Attributes:
        low, span: ends of the draws and high minus low, shape (E,); unused for a choice.
        choices: values of the choices, shape (E, n).
        counts: number of choices, shape (E,); 0 for a draw between ends.
        given: index of a setting's value among those drawn for the person in Python; -1 for the others, shape (E,).
        first: index of a setting's first target; its targets end before that of the next, shape (E + 1,).
        arrays, places: array and index in it of each target.
        parameters: parameters without the draws, as double words, of each person who may drive, shape (P, n).
        plans, numbers: plans, as double words, and numbers of the start without the draws.
        segments: number of segments of the road.
        faults: faults of the settings, records of :class:`core.parameters.DegradationParameters`, shape (m,).
        seeds: how each of these gets its seed, shape (m,).
        nothing: a fault that does not act, record, shape (1,).
        degradations: fault of each degradation and channel without the draws, records, shape (D, C).
        channels: number of channels of each degradation; 0 for no fault, shape (D,).
        ranges: ends of onset, ramp, period, size and duration of each degradation, shape (D, 5, 2).
        factors: unit of the size for each degradation and channel, shape (D, C).
        signed, lasting, seeded: whether each degradation's size can have either sign, whether its duration is drawn,
            and whether it takes a seed, shape (D,).
    """

    low: np.ndarray
    span: np.ndarray
    choices: np.ndarray
    counts: np.ndarray
    given: np.ndarray
    first: np.ndarray
    arrays: np.ndarray
    places: np.ndarray
    parameters: np.ndarray
    plans: np.ndarray
    numbers: np.ndarray
    segments: int
    faults: np.ndarray
    seeds: np.ndarray
    nothing: np.ndarray
    degradations: np.ndarray
    channels: np.ndarray
    ranges: np.ndarray
    factors: np.ndarray
    signed: np.ndarray
    lasting: np.ndarray
    seeded: np.ndarray


class Persons(NamedTuple):
    """What is drawn in Python for the persons of N environments; empty arrays where nobody is at the wheel.

    Attributes:
        which: index of the person in the tables, shape (N,).
        values: drawn settings, shape (N, n).
        seeds: seed of the person, shape (N,).
    """

    which: np.ndarray
    values: np.ndarray
    seeds: np.ndarray


@jit
def between(low: float, high: float, share: float) -> float:
    """The value at a share of the way between two ends.

    Args:
        low, high: the ends.
        share: the share [-].
    """
    return low + (high - low) * share


@jit
def draw_starts(
    mask: np.ndarray,
    streams: np.ndarray,
    batch: Batch,
    parameters: np.ndarray,
    plans: np.ndarray,
    drawing: Drawing,
    persons: Persons,
    numbers: np.ndarray,
    thread: int,
    threads: int,
) -> None:
    """Draw a start for every environment of a mask; each of several threads draws for its share of them.

    Args:
        mask: whether an environment begins an episode, shape (N,).
        streams: states of the generators, advanced, see :mod:`core.stream`, shape (N, 6).
        batch: the starts are written, except for parameters and plans.
        parameters, plans: the batch's parameters and plans as double words, written, shapes (N, n) and (N, m).
        drawing: the tables.
        persons: what is drawn for the persons.
        numbers: scratch of each thread, shape (threads, n).
        thread, threads: index of this thread, and number of threads.
    """
    own = numbers[thread]
    for i in range(thread, mask.shape[0], threads):
        if mask[i]:
            _draw_settings(i, streams[i], parameters[i], plans[i], own, drawing, persons)
            if persons.which.shape[0] > 0:
                batch.parameters[i].person.seed = persons.seeds[i]
            _draw_faults(streams[i], batch.faults[i], drawing)
            place(own, drawing.segments, batch.lines[i], batch.states[i], batch.traffic[i])


@jit
def _draw_settings(
    i: int,
    stream: np.ndarray,
    parameters: np.ndarray,
    plans: np.ndarray,
    numbers: np.ndarray,
    drawing: Drawing,
    persons: Persons,
) -> None:
    """Copy the start, and write the drawn settings to their places."""
    _copy(drawing.parameters[persons.which[i] if persons.which.shape[0] > 0 else 0], parameters)
    _copy(drawing.plans, plans)
    _copy(drawing.numbers, numbers)
    for e in range(drawing.low.shape[0]):
        if drawing.given[e] >= 0:
            value = persons.values[i, drawing.given[e]]
        elif drawing.counts[e] > 0:
            value = drawing.choices[e, integer(stream, drawing.counts[e])]
        else:
            value = drawing.low[e] + drawing.span[e] * random(stream)
        for t in range(drawing.first[e], drawing.first[e + 1]):
            where = drawing.places[t]
            if drawing.arrays[t] == PARAMETERS:
                parameters[where] = value
            elif drawing.arrays[t] == PLANS:
                plans[where] = value
            else:
                numbers[where] = value


@jit
def _copy(source: np.ndarray, target: np.ndarray) -> None:
    for i in range(source.shape[0]):
        target[i] = source[i]


@jit
def _draw_faults(stream: np.ndarray, faults: np.ndarray, drawing: Drawing) -> None:
    """Draw one of the degradations and the seeds of noise; the drawn fault comes after those of the settings."""
    own = drawing.faults.shape[0]
    for i in range(own):
        faults[i] = drawing.faults[i]
    for i in range(own, faults.shape[0]):
        faults[i] = drawing.nothing[0]
    if drawing.channels.shape[0] > 0:
        d = integer(stream, drawing.channels.shape[0])
        which, size, sign = random(stream), random(stream), random(stream)
        onset, ramp, duration, period = random(stream), random(stream), random(stream), random(stream)
        seed = integer(stream, SEED_RANGE)
        if drawing.channels[d] > 0:
            channel = int(which * drawing.channels[d])
            faults[own] = drawing.degradations[d, channel]
            fault: Any = faults[own]
            ends = drawing.ranges[d]
            fault.onset = between(ends[ONSET, 0], ends[ONSET, 1], onset)
            fault.ramp = between(ends[RAMP, 0], ends[RAMP, 1], ramp)
            fault.period = between(ends[PERIOD, 0], ends[PERIOD, 1], period)
            fault.size = between(ends[SIZE, 0], ends[SIZE, 1], size) * drawing.factors[d, channel]
            if drawing.signed[d] and sign < 0.5:
                fault.size = -fault.size
            if drawing.lasting[d]:
                fault.duration = between(ends[DURATION, 0], ends[DURATION, 1], duration)
            if drawing.seeded[d]:
                fault.seed = seed
    for i in range(own):
        if drawing.seeds[i] != GIVEN:
            seed = integer(stream, SEED_RANGE)
            if drawing.seeds[i] == TAKEN:
                faults[i].seed = seed
