"""Tables for drawing episodes in compiled code, made once of the settings; see :mod:`core.drawing`."""

from __future__ import annotations

from itertools import combinations
from math import pi
from typing import Any

import numpy as np

from shared_control_env.core.batch import Sizes
from shared_control_env.core.drawing import DISCARDED, GIVEN, NUMBERS, PARAMETERS, PLANS, TAKEN, Drawing
from shared_control_env.core.faults.kinds import KINDS
from shared_control_env.core.parameters import PERSONS, DegradationParameters, Limits, TrafficParameters
from shared_control_env.core.records import pack, record_dtype
from shared_control_env.envs.degradations import DEGRADATIONS, Degradation, bound_of, fault_of
from shared_control_env.envs.episode import concerns_driver, of_person
from shared_control_env.envs.settings import (
    RandomSettings,
    Settings,
    check,
    fault_records,
    parameters_of,
    plain,
    plan_records,
)
from shared_control_env.envs.settings.changes import at
from shared_control_env.envs.settings.checks import RESTING, assigned, ends_of
from shared_control_env.envs.settings.schema import MOST_FAULTS
from shared_control_env.envs.starts import numbers_of

SECTIONS = ("ego", "vehicles", "lane_change", "task", "driver_lag")
"""Sections whose draws are looked at, beside the curvatures of the road; others are drawn in Python."""


def drawing_of(settings: Settings, sizes: Sizes) -> Drawing | None:
    """Tables for drawing the episodes of an environment; None where they are drawn in Python.

    In Python are drawn: a recording; values that do not simply appear in the start, such as the number of lanes; and
    everything where a combination of drawn values might be refused. The numbers of a person come from a generator that
    each episode makes anew; they are drawn in Python and given to the compiled code (:class:`core.drawing.Persons`).

    Args:
        settings: settings of the environment.
        sizes: capacity of the arrays for a start.
    """
    config = plain(settings)
    simple = all(_is_simple(entry, settings, config) for entry in settings.randomise)
    if settings.recording is not None or not simple:
        return None
    variants = _variants(settings)
    if variants is None or not all(map(_never_refused, variants)):
        return None
    targets = _targets(variants[0])
    if targets is None or any(_targets(variant) != targets for variant in variants[1:]):
        return None
    randomise, n = settings.randomise, max((len(entry.choices or ()) for entry in settings.randomise), default=0)
    choices = np.zeros((len(randomise), n))
    for row, entry in zip(choices, randomise, strict=True):
        row[: len(entry.choices or ())] = entry.choices or ()
    plans = np.zeros(sizes.vehicles, record_dtype(TrafficParameters))
    plans[: len(settings.vehicles)] = plan_records(settings)
    flat = [target for own in targets for target in own]
    mine = [settings.has_person and concerns_driver(entry) for entry in randomise]
    return Drawing(
        low=np.array([entry.low or 0.0 for entry in randomise]),
        span=np.array([(entry.high or 0.0) - (entry.low or 0.0) for entry in randomise]),
        choices=choices,
        counts=np.array([len(entry.choices or ()) for entry in randomise], dtype=np.int64),
        given=np.where(mine, np.cumsum(mine) - 1, -1).astype(np.int64),
        first=np.cumsum([0, *map(len, targets)]),
        arrays=np.array([array for array, _ in flat], dtype=np.int64),
        places=np.array([place for _, place in flat], dtype=np.int64),
        parameters=np.array([_words(pack(parameters_of(variant))) for variant in variants]),
        plans=_words(plans),
        numbers=numbers_of(settings),
        segments=1 + len(settings.road.segments),
        faults=fault_records(settings),
        seeds=np.array([_seed_of(fault) for fault in settings.faults], dtype=np.int64),
        nothing=np.zeros(1, record_dtype(DegradationParameters)),
        **_degradations(variants[0]),
    )


def _variants(settings: Settings) -> list[Settings] | None:
    """The settings with each person who may drive; None if one of them is refused."""
    if not settings.persons:
        return [settings]
    config = {**plain(settings), "persons": []}
    chosen = [of_person({**PERSONS[name]._asdict(), "seed": 0}) for name in settings.persons]
    try:
        return [check({**config, "person": person}) for person in chosen]
    except ValueError:
        return None


def _words(records: np.ndarray) -> np.ndarray:
    """Records as double words, shape (n,)."""
    return np.atleast_1d(records).view(np.float64).ravel()


def _seed_of(fault: Any) -> int:
    if fault.seed is not None:
        return GIVEN
    return TAKEN if KINDS[fault.kind].draws else DISCARDED


def _is_simple(entry: RandomSettings, settings: Settings, config: dict[str, Any]) -> bool:
    """Whether an entry draws a number that is no integer, in a section looked at; log-normal ones only of a person."""
    path = entry.setting.split(".")
    mine = settings.has_person and concerns_driver(entry) and path[-1] not in RESTING
    looked_at = mine or path[0] in SECTIONS or (path[0] == "road" and path[-1] == "curvature")
    return looked_at and (mine or entry.median is None) and not isinstance(at(config, tuple(path)), int)


def _never_refused(settings: Settings) -> bool:
    """Whether no combination of drawn values can be refused.

    Most checks concern one drawn value each, so that it suffices to check the ends. Only the distances of vehicles in
    one lane, and the turn of the road, depend on several.
    """
    ranges = {entry.setting: (min(ends_of(entry)), max(ends_of(entry))) for entry in settings.randomise}
    places = [(settings.ego.lane, 0.0, 0.0)]
    for i, vehicle in enumerate(settings.vehicles):
        low, high = ranges.get(f"vehicles.{i}.position", (vehicle.position, vehicle.position))
        places.append((vehicle.lane, low, high))
    for (lane, low, high), (other_lane, other_low, other_high) in combinations(places, 2):
        if lane == other_lane and max(low - other_high, other_low - high) < settings.vehicle.length:
            return False
    turned = 0.0
    for i, segment in enumerate(settings.road.segments):
        low, high = ranges.get(f"road.segments.{i}.curvature", (segment.curvature, segment.curvature))
        turned += max(abs(low), abs(high)) * segment.length
    return turned <= 2.0 * pi and len(settings.faults) < MOST_FAULTS and _ends_are_accepted(settings)


def _ends_are_accepted(settings: Settings) -> bool:
    """Whether the ends of all draws and of all degradations are accepted."""
    limits, faults = _limits(settings), []
    for name in settings.degradations:
        entry = DEGRADATIONS[name]
        if entry is not None:
            for channel in entry.channels:
                faults += [fault_of(entry, channel, limits, np.full(7, share), 0) for share in (0.0, 1.0)]
    config: Any = {**plain(settings), "degradations": [], "randomise": []}
    ends = {tuple(entry.setting.split(".")): ends_of(entry) for entry in settings.randomise}
    try:
        for k in range(max(map(len, ends.values()), default=0)):
            drawn = config
            for path, values in ends.items():
                drawn = assigned(drawn, path, values[min(k, len(values) - 1)])
            check(drawn)
        for first in range(0, len(faults), MOST_FAULTS):
            check({**config, "faults": faults[first : first + MOST_FAULTS]})
    except ValueError:
        return False
    return True


def _limits(settings: Settings) -> Limits:
    return Limits(**settings.limits.model_dump())


def _targets(settings: Settings) -> list[list[tuple[int, int]]] | None:
    """Places at which each drawn value appears in the start; None if some value does not appear as it is."""
    config, base = plain(settings), _arrays(settings)
    found: list[list[tuple[int, int]]] = []
    taken: set[tuple[int, int]] = set()
    for entry in settings.randomise:
        probes = [*ends_of(entry), 0.5 * (min(ends_of(entry)) + max(ends_of(entry)))]
        changed = [
            (value, _arrays(Settings.model_validate(assigned(config, tuple(entry.setting.split(".")), value))))
            for value in probes
        ]
        own = {
            (which, int(place))
            for _, arrays in changed
            for which in range(len(base))
            for place in np.flatnonzero(arrays[which].view(np.int64) != base[which].view(np.int64))
        }
        if own & taken or any(arrays[which][place] != value for value, arrays in changed for which, place in own):
            return None
        taken |= own
        found.append(sorted(own))
    return found


def _arrays(settings: Settings) -> tuple[np.ndarray, ...]:
    """What a start consists of, in the order of the targets: parameters, plans and numbers."""
    assert (PARAMETERS, PLANS, NUMBERS) == (0, 1, 2)
    return _words(pack(parameters_of(settings))), _words(plan_records(settings)), numbers_of(settings)


def _degradations(settings: Settings) -> dict[str, np.ndarray]:
    """The part of the tables on degradations."""
    entries, limits = [DEGRADATIONS[name] for name in settings.degradations], _limits(settings)
    d, c = len(entries), max((len(entry.channels) for entry in entries if entry), default=0)
    records, factors = np.zeros((d, c), record_dtype(DegradationParameters)), np.ones((d, c))
    ranges, config = np.zeros((d, 5, 2)), {**plain(settings), "degradations": [], "randomise": []}
    present = [(i, entry) for i, entry in enumerate(entries) if entry is not None]
    for i, entry in present:
        ranges[i] = entry.onset, entry.ramp, entry.period, entry.size or (0.0, 0.0), entry.duration or (0.0, 0.0)
        for j, channel in enumerate(entry.channels):
            faults = [fault_of(entry, channel, limits, np.full(7, 0.5), 0)]
            records[i, j] = fault_records(check({**config, "faults": faults}))[0]
            factors[i, j] = bound_of(entry, channel, limits)
    return {
        "degradations": records,
        "channels": np.array([len(entry.channels) if entry else 0 for entry in entries], dtype=np.int64),
        "ranges": ranges,
        "factors": factors,
        "signed": _flags(entries, lambda entry: entry.signed),
        "lasting": _flags(entries, lambda entry: entry.duration is not None),
        "seeded": _flags(entries, lambda entry: KINDS[entry.kind].draws),
    }


def _flags(entries: list[Degradation | None], of: Any) -> np.ndarray:
    return np.array([entry is not None and of(entry) for entry in entries], dtype=bool)
