"""The check of settings: the schema checks each setting alone; this module also checks combinations of settings."""

from __future__ import annotations

import math
import warnings
from collections import Counter
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from shared_control_env.core import parameters as core
from shared_control_env.core.faults.kinds import FACTOR, KINDS, LENGTH, RATE, SHARE, TIME, Kind
from shared_control_env.core.records import MAX_DELAY
from shared_control_env.envs.profiles import length_of
from shared_control_env.envs.recorded.replay import decided_by, files_in, read, replay_of, usable
from shared_control_env.envs.settings.changes import at, change, merge
from shared_control_env.envs.settings.schema import OWN_TRAFFIC, FaultSettings, RandomSettings, Settings, plain
from shared_control_env.nearest import hint, nearest

LEAD_IN = 50.0
"""Length of the straight road behind the ego's start [m]."""

LARGEST_OFFSET = 20.0
"""Largest offset of the perceived position [m]: several lanes."""

LARGEST_FACTOR = 100.0
"""Largest factor of a recorded fault [-]."""

CUT_OFF = 3.0
"""Number of standard deviations at which log-normal draws are cut off [-]."""

RESTING = ("lane_position", "heading", "headway", "felt_steering", "felt_acceleration", "display", "response")
"""Settings of a person that act only where the hands rest at the start."""

WAYS_TO_DRAW = ({"low", "high"}, {"median", "spread"}, {"choices"})
"""Keys that an entry of ``randomise`` has beside ``setting``: one of these sets."""

NOT_DRAWN = (
    *("simulation_frequency", "policy_frequency"),
    *("screen_width", "screen_height", "centering_position", "scaling"),
    *("offscreen_rendering", "real_time_rendering", "neighbour_vehicles_connected_lanes", "other_vehicles_type"),
    *("degradations", "randomise", "persons", "recording"),
)
"""Settings that must be the same in all episodes of an environment."""

DECIDED = ("road", "ego", "vehicles", "lane_change")
"""Settings that a recording decides, beside the length and the width of the car."""


def check(config: Mapping[str, Any]) -> Settings:
    """Check a merged config.

    Args:
        config: all settings as a plain dict.

    Returns:
        The checked settings.

    Raises:
        ValueError: for the first wrong setting, with its field, value and allowed range.
    """
    settings = _validated(config)
    _check_time(settings)
    _check_recording(settings)
    _check_faults(settings)
    _check_road(settings)
    _check_places(settings)
    _check_vehicle(settings)
    _check_idle(settings)
    _check_random(settings)  # last, so that what it finds is due to a draw
    return settings


def defaults(scenario: Mapping[str, Any]) -> dict[str, Any]:
    """All settings as a plain dict, with the values of a scenario.

    Args:
        scenario: settings of the scenario, a nested dict.
    """
    return merge(plain(Settings()), scenario)


def combined(scenario: Mapping[str, Any], config: Mapping[str, Any]) -> Settings:
    """Settings of a scenario with changes, after all checks.

    Args:
        scenario: settings of the scenario, a nested dict.
        config: changes to them, a nested dict.

    Raises:
        ValueError: for a wrong setting, as :func:`check`.
    """
    return check(change(defaults(scenario), config))


def _validated(config: Mapping[str, Any]) -> Settings:
    try:
        return Settings.model_validate(config)
    except ValidationError as error:
        raise ValueError(_explain(error)) from None


def _explain(error: ValidationError) -> str:
    """Text for the first of pydantic's errors."""
    # An unknown key has priority: it may be the misspelt form of a key that is reported as missing.
    first = min(error.errors(), key=lambda e: e["type"] != "extra_forbidden")
    path = "config" + "".join(f"[{key!r}]" for key in first["loc"])
    if first["type"] == "extra_forbidden":
        section = _field(first["loc"][:-1])[0]
        return f"{path} is not a setting; {hint(first['loc'][-1], section.model_fields)}"
    if first["type"] == "missing":
        return f"{path} is missing"
    text = f"{path} = {first['input']!r}: {first['msg'][0].lower()}{first['msg'][1:]}"
    if first["type"] == "literal_error":
        names = [name for name in first["ctx"]["expected"].split("'") if name.strip(" ,or")]
        near = nearest(first["input"], names)
        return text + (f"; did you mean {near!r}?" if near else "")
    bounds = {name: value for each in _field(first["loc"])[1] for name, value in bounds_of(each)}
    ends = []
    for word, name, open_name in (("smallest", "ge", "gt"), ("largest", "le", "lt")):
        if name in bounds:
            ends.append(f"the {word} is {bounds[name]:g}")
        elif open_name in bounds:
            ends.append(f"{'larger' if open_name == 'gt' else 'smaller'} than {bounds[open_name]:g}")
    return text + (f" (allowed: {', '.join(ends)})" if ends else "")


def bounds_of(metadata: Any) -> list[tuple[str, Any]]:
    """Bounds that the metadata of a field set.

    Args:
        metadata: one metadata object of a field.

    Returns:
        Pairs of ``gt``, ``ge``, ``lt`` or ``le`` and the bound.
    """
    found = ((name, getattr(metadata, name, None)) for name in ("gt", "ge", "lt", "le"))
    return [(name, value) for name, value in found if value is not None]


def _field(location: tuple[int | str, ...]) -> tuple[Any, list[Any]]:
    """Type and constraints of the setting at a location; for a list, those of its entries."""
    kind: Any = Settings
    constraints: list[Any] = []
    for key in location:
        if isinstance(key, str) and isinstance(kind, type) and issubclass(kind, BaseModel):
            field = kind.model_fields[key]
            kind, constraints = field.annotation, list(field.metadata)
        while get_args(kind):  # unpack the first argument of Optional, Annotated or list
            constraints += [each for each in get_args(kind)[1:] if not isinstance(each, type)]
            kind = get_args(kind)[0]
    return kind, constraints


def _check_time(settings: Settings) -> None:
    simulation, policy = settings.simulation_frequency, settings.policy_frequency
    if simulation % policy:
        raise ValueError(
            f"config['simulation_frequency'] = {simulation} Hz must be a multiple of "
            f"config['policy_frequency'] = {policy} Hz"
        )
    if settings.steps < 1:
        raise ValueError(f"config['duration'] = {settings.duration} s must be at least one step of {1 / policy} s")


def _check_recording(settings: Settings) -> None:
    """Check that a recording can be read and has the ego, and that nothing is set that the recording decides."""
    recording = settings.recording
    if recording is None:
        return
    try:
        files = files_in(recording.file)
        for file in files:
            found = usable(file, settings.duration)
            if recording.ego is None and not found:
                raise ValueError(f"{file} has no vehicle that is recorded for {settings.duration:g} s")
            if recording.ego is not None and recording.ego not in (*read(file).tracks, *read(file).starts):
                raise ValueError(f"{file} has no vehicle and no planning problem {recording.ego!r}")
    except ValueError as error:
        raise ValueError(f"config['recording']: {error}") from None
    if recording.drawn:
        _check_drawn_recording(settings)
        return
    default = Settings()
    for field in DECIDED:
        if getattr(settings, field) != getattr(default, field):
            raise ValueError(f"config[{field!r}] would not act: the recording in config['recording'] decides it")
    for field in ("length", "width"):
        _refuse_idle("config['vehicle']", settings.vehicle, field, False, "the recording says how large the car is")
    if settings.other_vehicles_type != OWN_TRAFFIC:
        raise ValueError(
            f"config['other_vehicles_type'] = {settings.other_vehicles_type!r} would not act: recorded vehicles have "
            "tracks"
        )


@cache
def _defaults() -> dict[str, Any]:
    """All settings at their defaults; not to be changed."""
    return plain(Settings())


def _check_drawn_recording(settings: Settings) -> None:
    """Check that the settings of one episode are those that its recording decides."""
    recording = settings.recording
    assert recording is not None
    if recording.ego is None or not Path(recording.file).is_file():
        raise ValueError("config['recording']['drawn'] = True is set by the environment, with one file and its ego")
    dt = 1.0 / settings.simulation_frequency
    decided = decided_by(replay_of(Path(recording.file), recording.ego, dt, settings.simulation_steps))
    config, default = plain(settings), _defaults()
    wanted = {name: default[name] for name in DECIDED}
    wanted |= {name: {**config[name], **values} for name, values in decided.items()}
    for name, value in wanted.items():
        if config[name] != value:
            raise ValueError(f"config[{name!r}] would not act: the recording in config['recording'] decides it")


def _check_faults(settings: Settings) -> None:
    """Check that fault sizes are in the range of their kind, and that no field is set that the kind ignores."""
    for i, fault in enumerate(settings.faults):
        name, kind = f"config['faults'][{i}]", KINDS[fault.kind]
        _refuse_idle(name, fault, "size", kind.unit is not None, f"{fault.kind} has none")
        for field in ("time_constant", "frequency"):
            _refuse_idle(name, fault, field, field in kind.heeds, f"{fault.kind} has none")
        _refuse_idle(name, fault, "seed", kind.draws, f"{fault.kind} draws nothing")
        _refuse_idle(name, fault, "file", kind.recorded, f"{fault.kind} plays no recording")
        _refuse_idle(name, fault, "duty", fault.period > 0.0, "it needs a 'period'")
        if fault.channel not in kind.channels:
            why = (
                "acts on no channel; leave it out"
                if kind.act is None
                else f"does not act on it; {hint(fault.channel, kind.channels)}"
            )
            raise ValueError(f"{name}['channel'] = {fault.channel!r}: {fault.kind} {why}")
        if kind.unit is None:
            continue
        if fault.size is None:
            raise ValueError(f"{name}['size'] is missing; {fault.kind} needs one")
        if kind.recorded:
            _check_profile(name, fault, settings)
        low, high = _sizes(kind, fault, settings)
        if not low <= fault.size <= high:
            raise ValueError(f"{name}['size'] = {fault.size} must lie in [{low:g}, {high:g}] for {fault.kind}")


def _check_profile(name: str, fault: FaultSettings, settings: Settings) -> None:
    """Check that a recorded fault has a file, and that its profile lasts for as long as the fault acts."""
    if fault.file is None:
        raise ValueError(f"{name}['file'] is missing; {fault.kind} plays one")
    try:
        length = length_of(fault.file)
    except ValueError as error:
        raise ValueError(f"{name}['file'] = {fault.file!r}: {error}") from None
    left = max(settings.duration - fault.onset, 0.0)
    wanted = left if fault.duration is None else min(fault.duration, left)
    if length < wanted - 1.0 / settings.policy_frequency:
        raise ValueError(
            f"{name}['file'] = {fault.file!r} lasts {length:g} s, and the fault acts for {wanted:g} s; "
            f"give it a 'duration' of at most {length:g}, or a longer file"
        )


def _sizes(kind: Kind, fault: FaultSettings, settings: Settings) -> tuple[float, float]:
    """Range of a fault's size. Sizes beyond the ends would not degrade any command further, whatever its limits."""
    bound = core.LARGEST_ACCELERATION if fault.channel == "acceleration" else core.LARGEST_STEERING
    largest = {
        SHARE: 1.0,
        TIME: (MAX_DELAY - 1) / settings.policy_frequency,
        RATE: 2.0 * bound * settings.policy_frequency,
        LENGTH: LARGEST_OFFSET,
        FACTOR: LARGEST_FACTOR,
    }.get(kind.unit or "", 2.0 * bound)
    one_sided = kind.unit in (SHARE, TIME, RATE) or kind.draws  # a standard deviation has no sign
    return 0.0 if one_sided else -largest, largest


def _refuse_idle(name: str, section: BaseModel, field: str, heeded: bool, reason: str) -> None:
    """Raise ValueError if a field differs from its default although nothing uses it."""
    value = getattr(section, field)
    if not heeded and value != type(section).model_fields[field].default:
        raise ValueError(f"{name}[{field!r}] = {value!r} would not act: {reason}")


def _check_random(settings: Settings) -> None:
    """Check that each entry of ``randomise`` names a number, names it once, and draws only allowed values."""
    config = plain(settings)
    seen: dict[str, int] = {}
    for i, entry in enumerate(settings.randomise):
        name = f"config['randomise'][{i}]"
        path = tuple(entry.setting.split("."))
        try:
            present = at(config, path)
        except ValueError as error:
            raise ValueError(f"{name}['setting'] = {entry.setting!r}: {error}") from None
        if entry.setting in seen:
            raise ValueError(f"{name} draws {entry.setting!r}, as entry {seen[entry.setting]} does; remove one of them")
        seen[entry.setting] = i
        if path[0] in NOT_DRAWN or path[-1] == "seed":
            raise ValueError(f"{name}['setting'] = {entry.setting!r} cannot be drawn")
        decided = path[0] in DECIDED or entry.setting in ("vehicle.length", "vehicle.width")
        if settings.recording is not None and decided:
            raise ValueError(f"{name} draws {entry.setting!r}, which the recording in config['recording'] decides")
        if isinstance(present, bool | str | list | Mapping):
            raise ValueError(f"{name}['setting'] = {entry.setting!r} is no number, so it cannot be drawn")
        given = entry.model_dump(exclude_none=True)
        del given["setting"]
        if set(given) not in WAYS_TO_DRAW or given.get("low", 0.0) > given.get("high", math.inf):
            raise ValueError(f"{name} = {given} must have either low <= high, or median and spread, or choices")
        for value in ends_of(entry):
            try:
                drawn = _validated(assigned(config, path, value))
            except ValueError as error:
                raise ValueError(f"{name} draws a value that is not allowed: {error}") from None
            _check_drawn(name, entry, drawn, settings)


def _check_drawn(name: str, entry: RandomSettings, drawn: Settings, settings: Settings) -> None:
    """Check that an end of a draw acts beside the other settings, unless another entry draws its own section too."""
    section = entry.setting.split(".")[0]
    if any(each.setting.split(".")[0] == section for each in settings.randomise if each is not entry):
        return
    if section == "person" and settings.persons:
        return
    try:
        _check_idle(drawn)
    except ValueError as error:
        raise ValueError(f"{name} draws {entry.setting!r}: {error}") from None


def ends_of(entry: RandomSettings) -> tuple[float, ...]:
    """The smallest and the largest value that can be drawn, or all choices.

    Args:
        entry: entry of ``randomise``.
    """
    if entry.choices is not None:
        return tuple(entry.choices)
    if entry.median is not None and entry.spread is not None:
        factor = math.exp(CUT_OFF * entry.spread)
        return entry.median / factor, entry.median * factor
    return tuple(end for end in (entry.low, entry.high) if end is not None)


def assigned(config: Any, path: tuple[str, ...], value: Any) -> Any:
    """A copy of a config with another value at an existing path.

    Args:
        config: settings as a plain dict, or a list of settings.
        path: keys, and indices of lists as text.
        value: the new value.
    """
    first, rest = path[0], path[1:]
    key: Any = int(first) if isinstance(config, list) else first
    copy = config.copy() if isinstance(config, list) else dict(config)
    copy[key] = assigned(config[key], rest, value) if rest else value
    return copy


def _check_road(settings: Settings) -> None:
    """Check that the road does not meet itself, and that no lane is on the wrong side of a curve's centre."""
    turned = sum(abs(segment.curvature) * segment.length for segment in settings.road.segments)
    if turned > 2.0 * math.pi:
        raise ValueError(
            f"config['road']['segments'] turn by {turned:.3g} rad in total; allowed are 0 to {2 * math.pi:.4g}, "
            "so that the road does not meet itself"
        )
    if settings.road_length > core.LONGEST_ROAD:
        raise ValueError(
            f"config['road']['segments'] are {settings.road_length} m long in total; at most {core.LONGEST_ROAD} m"
        )
    lanes, width = settings.road.lanes, settings.road.lane_width
    leftmost, edge = settings.lane_centre(lanes - 1), 0.5 * width
    for segment in settings.road.segments:
        if segment.curvature * (leftmost + edge) >= 1.0 or segment.curvature * -edge >= 1.0:
            raise ValueError(
                f"config['road']['segments']: curvature = {segment.curvature} 1/m is too sharp for {lanes} lanes of "
                f"{width} m; allowed are {-1 / edge:.4g} to {1 / (leftmost + edge):.4g}, both excluded"
            )


def _check_places(settings: Settings) -> None:
    """Check that all lanes exist, that all vehicles are on the road, and that no two of them overlap."""
    lanes, edge = settings.road.lanes, 0.5 * settings.road.lane_width
    if abs(settings.ego.lateral_offset) > edge:
        raise ValueError(
            f"config['ego']['lateral_offset'] = {settings.ego.lateral_offset} m must lie in "
            f"[{-edge}, {edge}], within the lane"
        )
    placed = [("config['ego']", settings.ego.lane, 0.0)]
    changes = [("config", settings.lane_change)]
    for i, vehicle in enumerate(settings.vehicles):
        name = f"config['vehicles'][{i}]"
        if not -LEAD_IN <= vehicle.position <= settings.road_length:
            raise ValueError(
                f"{name}['position'] = {vehicle.position} m is not on the road, [{-LEAD_IN}, {settings.road_length}] m"
            )
        placed.append((name, vehicle.lane, vehicle.position))
        changes.append((name, vehicle.lane_change))
    for name, lane_change in changes:
        if lane_change is not None and lane_change.lane >= lanes:
            raise ValueError(f"{name}['lane_change']['lane'] = {lane_change.lane} must lie in [0, {lanes - 1}]")
    for i, (name, lane, position) in enumerate(placed):
        if lane >= lanes:
            raise ValueError(f"{name}['lane'] = {lane} must lie in [0, {lanes - 1}]")
        for other, other_lane, other_position in placed[:i]:
            if lane == other_lane and abs(position - other_position) < settings.vehicle.length:
                raise ValueError(
                    f"{name}['position'] = {position} m overlaps {other} at {other_position} m: "
                    f"in one lane the distance must be at least the vehicle length, {settings.vehicle.length} m"
                )


def _check_vehicle(settings: Settings) -> None:
    """Check that the car is stable at the speeds of the task, and warn if it is unstable at motorway speed."""
    vehicle = core.VehicleParameters(**settings.vehicle.model_dump(exclude={"tyre"}))
    critical = core.critical_speed(vehicle)
    fastest = max(settings.ego.speed, settings.task.target_speed)
    what = (
        f"config['vehicle'] = {vehicle} oversteers with a critical speed of {critical:.1f} m/s "
        "(l_f C_f must not exceed l_r C_r by too much)"
    )
    if critical <= fastest:
        raise ValueError(f"{what}; it must lie above the task's highest speed, {fastest} m/s")
    if critical <= 40.0:
        warnings.warn(f"{what}: the car is unstable above it, within the model's range of 40 m/s", stacklevel=2)


def _check_thresholds(settings: Settings) -> None:
    """Check that what a person with resting hands waits for can happen."""
    road, centre = settings.road, settings.lane_centre(settings.ego.lane)
    right, left = -0.5 * road.lane_width, settings.lane_centre(road.lanes) - 0.5 * road.lane_width
    for field, largest, unit, why in (
        ("lane_position", max(left - centre, centre - right), "m", "beyond it the car is off the road"),
        ("felt_steering", settings.limits.delta_max, "rad", "the steering angle is never larger"),
        ("felt_acceleration", 2.0 * settings.limits.a_max, "m/s^2", "two accelerations never differ by more"),
    ):
        value = getattr(settings.person, field)
        preset = any(value == getattr(each, field) for each in core.PERSONS.values())
        if value >= largest and not preset:  # a preset may have a threshold that these limits never reach
            raise ValueError(
                f"config['person'][{field!r}] = {value} {unit} would never be noticed: it must be less than "
                f"{largest:g} {unit}, since {why}"
            )


def _check_idle(settings: Settings) -> None:
    """Check that no setting is changed that would have no effect beside the other settings."""
    reason = "the tyres are linear, and know no friction"
    _refuse_idle("config['vehicle']", settings.vehicle, "mu", settings.vehicle.tyre != "linear", reason)
    true, believed = settings.vehicle.tyre, settings.model.tyre
    _refuse_idle("config['model']", settings.model, "mu", (believed or true) != "linear", reason)
    repeated = [name for name, count in Counter(settings.terms).items() if count > 1]
    if repeated:
        raise ValueError(f"config['reward_terms'] names {repeated[0]!r} more than once")
    own = settings.other_vehicles_type == OWN_TRAFFIC
    for i, vehicle in enumerate(settings.vehicles):
        name = f"config['vehicles'][{i}]"
        for field in ("behaviour", "brake", "lane_change", "desired_speed"):
            reason = f"config['other_vehicles_type'] = {settings.other_vehicles_type!r} knows no plans"
            _refuse_idle(name, vehicle, field, own, reason)
        _refuse_idle(name, vehicle, "desired_speed", vehicle.behaviour == "idm", "it is of the behaviour 'idm'")
        if vehicle.lane_change is not None and vehicle.lane_change.lane == vehicle.lane:
            raise ValueError(
                f"{name}['lane_change']['lane'] = {vehicle.lane} would not act: the vehicle is in that lane"
            )
    reason = "the traffic of this package looks for no neighbours by itself"
    _refuse_idle("config", settings, "neighbour_vehicles_connected_lanes", not own, reason)
    risk, name = settings.longitudinal_risk, "config['longitudinal_risk']"
    _refuse_idle(name, risk, "sigma_x", risk.preset == "paper", "it is of the preset 'paper'")
    for field in ("w_f_change", "w_l_change", "w_p_change"):
        _refuse_idle(name, risk, field, settings.lane_change is not None, "there is no config['lane_change']")
    if settings.lane_change is not None and settings.lane_change.lane == settings.ego.lane:
        lane = settings.ego.lane
        raise ValueError(f"config['lane_change']['lane'] = {lane} would not act: the ego is in that lane")
    for field in ("K_h", "T_h"):
        arm, model = settings.driver_lag, settings.internal_model
        _refuse_idle("config['driver_lag']", arm, field, not arm.direct, "a direct driver has an arm of its own")
        _refuse_idle(
            "config['internal_model']", model, field, model.active, "the driver has no internal model (active)"
        )
    for field in type(settings.person).model_fields:
        reason = "config['persons'] says who drives"
        _refuse_idle("config['person']", settings.person, field, field == "seed" or not settings.persons, reason)
    if settings.driver_lag.direct and settings.has_person:
        raise ValueError("config['driver_lag']['direct'] = True: the person in the settings has an arm with a lag")
    person, longest = settings.person, (MAX_DELAY - 1) / settings.policy_frequency
    if person.delay > longest:
        raise ValueError(f"config['person']['delay'] = {person.delay} s must lie in [0, {longest:g}] at this frequency")
    for field in type(person).model_fields:
        _refuse_idle("config['person']", person, field, field == "active" or settings.has_person, "there is no person")
    for field in RESTING:
        resting = not person.engaged or bool(settings.persons)
        _refuse_idle("config['person']", person, field, resting, "this person drives from the start (engaged)")
    if person.active and not person.engaged:
        _check_thresholds(settings)
    law = settings.authority.law
    if settings.fault_at == "planner" and law == "paper":
        raise ValueError(
            "config['fault_at'] = 'planner' does not go with config['authority']['law'] = 'paper': Eq. 10 falls back "
            "on the command without the fault, which is unknown in this case; the other laws do not need it"
        )
    _refuse_idle("config['authority']", settings.authority, "strict", law == "paper", f"the law is {law!r}")
    for field in ("standstill_gap", "closing_time"):
        keeps = settings.task.time_headway > 0.0
        _refuse_idle("config['task']", settings.task, field, keeps, "no gap is kept without a time_headway")
    for field in ("tolerance_a", "tolerance_delta"):
        _refuse_idle("config['law_tolerances']", settings.law_tolerances, field, law == "paper", f"the law is {law!r}")
