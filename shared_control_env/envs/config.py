"""Settings of an environment: defaults, units, ranges, and their check.

The sections that hold the model's parameters are made from the named tuples of
:mod:`shared_control_env.core.parameters`, where each is documented with its source; there is no second
list of them. ``env.unwrapped.config`` is the checked settings as a plain dict.
"""

from __future__ import annotations

import difflib
import json
import math
import warnings
from collections.abc import Mapping
from typing import Annotated, Any, Literal, get_type_hints

import numpy as np
from annotated_types import Ge, MinLen
from pydantic import BaseModel, ConfigDict, ValidationError, create_model

from shared_control_env.core import parameters as core
from shared_control_env.core.authority import LAWS
from shared_control_env.core.degradation import KINDS
from shared_control_env.core.fuzzy import OPERATORS
from shared_control_env.core.records import MAX_DELAY, pack, record_dtype
from shared_control_env.envs.degradations import DEGRADATIONS

SHARES, TIMES, NOISES = ("loss_of_effectiveness", "saturation"), ("delay",), ("white_noise", "coloured_noise")
"""Kinds of degradation whose size is a share in [0, 1], a time, and a standard deviation."""

WITHOUT_SIZE = ("stuck", "drop_out", "sign_error", "missed_lead")
"""Kinds of degradation that have no size."""

LEAD_IN = 50.0
"""Straight road behind the ego's start [m]."""


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


def _section(name: str, parameters: type, *left_out: str, **more: Any) -> Any:
    """Settings with the fields, types, ranges, defaults and documentation of a named-tuple class.

    The class goes by the name that it is assigned to here, so that it can be pickled.
    """
    hints = get_type_hints(parameters, include_extras=True)
    defaults = parameters._field_defaults
    fields = {field: (hints[field], defaults[field]) for field in defaults if field not in left_out}
    return create_model(name, __base__=_Section, __module__=__name__, __doc__=parameters.__doc__, **fields, **more)


class Segment(_Section):
    """A piece of the road's reference line, which is the centre of lane 0."""

    length: core.Positive  # [m]
    curvature: float = 0.0  # [1/m], positive to the left


class RoadSettings(_Section):
    """The road. Lanes are counted from the right; lane 0 is the rightmost."""

    segments: Annotated[list[Segment], MinLen(1)] = [Segment(length=1000.0)]
    lanes: Annotated[int, Ge(1)] = 2
    lane_width: core.Positive = 4.0  # [m]


class EgoSettings(_Section):
    """Where the ego starts: at s = 0, in the lane that it is to keep."""

    lane: Annotated[int, Ge(0)] = 0
    speed: core.NonNegative = 15.0  # [m/s]
    lateral_offset: float = 0.0  # from the lane's centre, positive to the left [m]


class BrakeSettings(_Section):
    """Braking to a stop."""

    onset: core.NonNegative  # [s]
    deceleration: core.Positive  # [m/s^2]


class LaneChangeSettings(_Section):
    """A move over to another lane (core.lane_change)."""

    onset: core.NonNegative  # [s]
    duration: core.Positive = 4.0  # [s]
    lane: Annotated[int, Ge(0)]


class VehicleSettings(_Section):
    """Another vehicle at its start; positions are those of the centres, relative to the ego's (core.traffic)."""

    lane: Annotated[int, Ge(0)]
    position: float  # along the road [m]
    speed: core.NonNegative  # [m/s]
    behaviour: Literal["constant", "idm"] = "constant"
    desired_speed: core.Positive | None = None  # of idm [m/s]; None for its first speed
    brake: BrakeSettings | None = None
    lane_change: LaneChangeSettings | None = None


class FaultSettings(_Section):
    """A degradation of the automation (core.degradation); what its size means depends on its kind."""

    kind: Literal[KINDS[1:]] = "bias"
    channel: Literal["acceleration", "steering", "both"] = "steering"
    onset: core.NonNegative  # [s]
    ramp: core.NonNegative = 0.0  # [s]
    duration: core.Positive | None = None  # [s]; None for a permanent one
    period: core.NonNegative = 0.0  # of one that comes and goes [s]; 0 for one that stays
    duty: core.Fraction = 0.5  # share of the period in which it is there
    size: float | None = None
    time_constant: core.Positive = 0.5  # of coloured noise [s]
    frequency: core.Positive = 0.5  # of an oscillation [Hz]
    seed: Annotated[int, Ge(0)] | None = None  # of noise; None to have it drawn


class RandomSettings(_Section):
    """A setting drawn at the start of each episode: uniform between two ends, or one of several values."""

    setting: str  # its path, such as "ego.speed" or "vehicles.0.position"
    low: float | None = None
    high: float | None = None
    choices: list[float] | None = None


class AuthoritySettings(_Section):
    """Authority of the automation (core.authority, core.fuzzy)."""

    law: Literal["paper", "proportional", "none", "driver_only"] = "paper"
    operators: Literal["product-sum", "min-max"] = "product-sum"


class SolverSettings(_Section):
    """Gauss-Newton iterations of the automation."""

    iterations: core.Count = 3
    first_iterations: core.Count = 5


_TASK_FROM_ROAD = ("dt", "lane_width", "road_low", "road_high", "y_target", "y_goal", "change_onset", "change_duration")
_Longitudinal = _section(
    "_Longitudinal", core.LongitudinalRiskParameters, "graded", preset=(Literal["paper", "graded"], "graded")
)
_Task = _section("_Task", core.TaskParameters, *_TASK_FROM_ROAD)
_Vehicle = _section("_Vehicle", core.VehicleParameters)
_Limits = _section("_Limits", core.Limits)
_Predictive = _section("_Predictive", core.PredictiveParameters)
_SafeArea = _section("_SafeArea", core.SafeAreaParameters)
_Lateral = _section("_Lateral", core.LateralRiskParameters)
_Law = _section("_Law", core.LawParameters)
_Lag = _section("_Lag", core.DriverLagParameters)
_Reward = _section("_Reward", core.RewardParameters)


class Settings(_Section):
    """All settings. The first group is highway-env's own, with its meaning there."""

    simulation_frequency: core.Count = 20  # [Hz]
    policy_frequency: core.Count = 20  # [Hz]
    other_vehicles_type: str = "shared_control_env.envs.vehicles.LaneFollower"
    screen_width: core.Count = 1000  # [px]
    screen_height: core.Count = 452  # [px]
    centering_position: Annotated[list[float], MinLen(2)] = [0.3, 0.5]
    scaling: core.Positive = 11.0  # [px/m]
    render_agent: bool = True
    offscreen_rendering: bool | None = None
    real_time_rendering: bool = False
    neighbour_vehicles_connected_lanes: bool = True

    duration: core.Positive = 10.0  # [s]
    road: RoadSettings = RoadSettings()
    ego: EgoSettings = EgoSettings()
    lane_change: LaneChangeSettings | None = None  # of the ego; None to keep the lane
    vehicles: list[VehicleSettings] = []
    faults: list[FaultSettings] = []
    degradations: list[Literal[tuple(DEGRADATIONS)]] = []  # one of these is drawn at the start of each episode
    randomise: list[RandomSettings] = []
    task: _Task = _Task()
    authority: AuthoritySettings = AuthoritySettings()
    law_tolerances: _Law = _Law()
    lateral_risk: _Lateral = _Lateral()
    longitudinal_risk: _Longitudinal = _Longitudinal()
    safe_area: _SafeArea = _SafeArea()
    automation: _Predictive = _Predictive()
    solver: SolverSettings = SolverSettings()
    driver: _Predictive = _Predictive()
    driver_lag: _Lag = _Lag()
    limits: _Limits = _Limits()
    vehicle: _Vehicle = _Vehicle()
    reward: _Reward = _Reward()

    @property
    def steps(self) -> int:
        """Length of an episode in decisions."""
        return round(self.duration * self.policy_frequency)

    def lane_centre(self, lane: int) -> float:
        """Lateral position of a lane's centre in the road frame [m]."""
        return lane * self.road.lane_width


def merge(config: dict[str, Any], changes: Mapping[str, Any], path: str = "config") -> dict[str, Any]:
    """Config with nested changes; lists are replaced whole.

    Raises:
        ValueError: for an unknown key, naming it and the nearest valid one.
    """
    if not isinstance(changes, Mapping):
        raise ValueError(f"{path} = {changes!r} must be a dict with keys among {sorted(config)}")
    merged = dict(config)
    for key, value in changes.items():
        if key not in config:
            raise ValueError(f"{path}[{key!r}] is not a setting; {_nearest(key, config)}")
        if isinstance(config[key], dict):
            if not isinstance(value, Mapping):
                raise ValueError(f"{path}[{key!r}] = {value!r} must be a dict with keys among {sorted(config[key])}")
            value = merge(config[key], value, f"{path}[{key!r}]")
        merged[key] = value
    return merged


def _nearest(key: object, valid: Any) -> str:
    """Sentence that names the nearest valid name, or all of them."""
    names = [str(name) for name in valid]
    near = difflib.get_close_matches(str(key), names, n=1, cutoff=0.5)
    return f"did you mean {near[0]!r}?" if near else f"valid are {', '.join(sorted(names))}"


def check(config: Mapping[str, Any]) -> Settings:
    """Check a merged config.

    Raises:
        ValueError: naming field, value and allowed range, for the first setting that is wrong.
    """
    try:
        settings = Settings.model_validate(config)
    except ValidationError as error:
        raise ValueError(_explain(error)) from None
    _check_time(settings)
    _check_faults(settings)
    _check_random(settings, config)
    _check_spawn(settings)
    _check_vehicle(settings)
    return settings


def _explain(error: ValidationError) -> str:
    """Pydantic's first error in the words of this module."""
    # An unknown key comes first: it may be the misspelt one that is missing.
    first = min(error.errors(), key=lambda e: e["type"] != "extra_forbidden")
    path = "config" + "".join(f"[{key!r}]" for key in first["loc"])
    if first["type"] == "extra_forbidden":
        valid: Any = Settings
        for key in first["loc"][:-1]:
            if isinstance(key, str):
                valid = valid.model_fields[key].annotation
                valid = getattr(valid, "__args__", (valid,))[0]
        return f"{path} is not a setting; {_nearest(first['loc'][-1], valid.model_fields)}"
    if first["type"] == "missing":
        return f"{path} is missing"
    text = f"{path} = {first['input']!r}: {first['msg'][0].lower()}{first['msg'][1:]}"
    if first["type"] == "literal_error":
        names = [name for name in first["ctx"]["expected"].split("'") if name.strip(" ,or")]
        near = difflib.get_close_matches(str(first["input"]), names, n=1, cutoff=0.5)
        text += f"; did you mean {near[0]!r}?" if near else ""
    return text


def _check_time(settings: Settings) -> None:
    simulation, policy = settings.simulation_frequency, settings.policy_frequency
    if simulation % policy:
        raise ValueError(
            f"config['simulation_frequency'] = {simulation} Hz must be a multiple of "
            f"config['policy_frequency'] = {policy} Hz"
        )
    if settings.steps < 1:
        raise ValueError(f"config['duration'] = {settings.duration} s must be at least one step of {1 / policy} s")


def _check_faults(settings: Settings) -> None:
    """Sizes that their kinds allow."""
    longest = (MAX_DELAY - 1) / settings.policy_frequency
    for i, fault in enumerate(settings.faults):
        name = f"config['faults'][{i}]['size']"
        if fault.kind in WITHOUT_SIZE:
            continue
        if fault.size is None:
            raise ValueError(f"{name} is missing; {fault.kind} needs one")
        low, high = -math.inf, math.inf
        if fault.kind in SHARES:
            low, high = 0.0, 1.0
        elif fault.kind in TIMES:
            low, high = 0.0, longest
        elif fault.kind in NOISES or fault.kind == "rate_limit":
            low = 0.0
        if not low <= fault.size <= high:
            raise ValueError(f"{name} = {fault.size} must lie in [{low:g}, {high:g}] for {fault.kind}")


def _check_random(settings: Settings, config: Mapping[str, Any]) -> None:
    """Paths that name a setting, and something to draw from."""
    for i, entry in enumerate(settings.randomise):
        name = f"config['randomise'][{i}]"
        valid: Any = config
        for key in entry.setting.split("."):
            if isinstance(valid, list) and key.isdigit() and int(key) < len(valid):
                valid = valid[int(key)]
            elif isinstance(valid, Mapping) and key in valid:
                valid = valid[key]
            else:
                keys = range(len(valid)) if isinstance(valid, list) else valid if isinstance(valid, Mapping) else ()
                raise ValueError(f"{name}['setting'] = {entry.setting!r}: no setting {key!r}; {_nearest(key, keys)}")
        uniform = entry.low is not None and entry.high is not None and entry.low <= entry.high
        if uniform == bool(entry.choices):
            raise ValueError(f"{name} = {entry.model_dump()} must have either low <= high or choices")


def _check_spawn(settings: Settings) -> None:
    """Lanes that exist, a road that does not meet itself, and no two vehicles in one place."""
    turned = sum(abs(segment.curvature) * segment.length for segment in settings.road.segments)
    if turned > 2.0 * math.pi:
        raise ValueError(
            f"config['road']['segments'] turn by {turned:.3g} rad in all; allowed are 0 to {2 * math.pi:.4g}, "
            "so that the road does not meet itself"
        )
    lanes, width = settings.road.lanes, settings.road.lane_width
    leftmost, edge = settings.lane_centre(lanes - 1), 0.5 * width
    for segment in settings.road.segments:
        if segment.curvature * (leftmost + edge) >= 1.0 or segment.curvature * -edge >= 1.0:
            raise ValueError(
                f"config['road']['segments']: curvature = {segment.curvature} 1/m is too sharp for {lanes} lanes of "
                f"{width} m; allowed are {-1 / edge:.4g} to {1 / (leftmost + edge):.4g}, both excluded"
            )
    if abs(settings.ego.lateral_offset) > edge:
        raise ValueError(
            f"config['ego']['lateral_offset'] = {settings.ego.lateral_offset} m must lie in "
            f"[{-edge}, {edge}], within the lane"
        )
    length = settings.vehicle.length
    road_length = sum(segment.length for segment in settings.road.segments)
    placed = [("config['ego']", settings.ego.lane, 0.0)]
    for i, vehicle in enumerate(settings.vehicles):
        name = f"config['vehicles'][{i}]"
        if not -LEAD_IN <= vehicle.position <= road_length:
            raise ValueError(
                f"{name}['position'] = {vehicle.position} m is not on the road, [{-LEAD_IN}, {road_length}] m"
            )
        placed.append((name, vehicle.lane, vehicle.position))
    changes = [("config", settings.lane_change)]
    changes += [(f"config['vehicles'][{i}]", vehicle.lane_change) for i, vehicle in enumerate(settings.vehicles)]
    for name, change in changes:
        if change is not None and change.lane >= lanes:
            raise ValueError(f"{name}['lane_change']['lane'] = {change.lane} must lie in [0, {lanes - 1}]")
    for i, (name, lane, position) in enumerate(placed):
        if lane >= lanes:
            raise ValueError(f"{name}['lane'] = {lane} must lie in [0, {lanes - 1}]")
        for other, other_lane, other_position in placed[:i]:
            if lane == other_lane and abs(position - other_position) < length:
                raise ValueError(
                    f"{name}['position'] = {position} m overlaps {other} at {other_position} m: "
                    f"in one lane the distance must be at least the vehicle length, {length} m"
                )


def _check_vehicle(settings: Settings) -> None:
    """Stable at the speeds of the task; a warning where it would not be at motorway speed."""
    vehicle = core.VehicleParameters(**settings.vehicle.model_dump())
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


def parameters_of(settings: Settings) -> core.Parameters:
    """The core's parameters of checked settings."""

    def values(section: BaseModel, **more: Any) -> dict[str, Any]:
        return {**section.model_dump(), **more}

    longitudinal = values(settings.longitudinal_risk)
    longitudinal["graded"] = longitudinal.pop("preset") == "graded"
    width, change = settings.road.lane_width, settings.lane_change
    return core.Parameters(
        vehicle=core.VehicleParameters(**values(settings.vehicle)),
        limits=core.Limits(**values(settings.limits)),
        automation=core.PredictiveParameters(**values(settings.automation)),
        driver=core.PredictiveParameters(**values(settings.driver)),
        safe_area=core.SafeAreaParameters(**values(settings.safe_area)),
        lateral=core.LateralRiskParameters(**values(settings.lateral_risk)),
        longitudinal=core.LongitudinalRiskParameters(**longitudinal),
        law=core.LawParameters(**values(settings.law_tolerances)),
        lag=core.DriverLagParameters(**values(settings.driver_lag)),
        reward=core.RewardParameters(**values(settings.reward)),
        task=core.TaskParameters(
            **values(settings.task),
            dt=1.0 / settings.policy_frequency,
            lane_width=width,
            road_low=-0.5 * width,
            road_high=settings.lane_centre(settings.road.lanes) - 0.5 * width,
            y_target=settings.lane_centre(settings.ego.lane),
            y_goal=settings.lane_centre(settings.ego.lane if change is None else change.lane),
            change_onset=math.inf if change is None else change.onset,
            change_duration=4.0 if change is None else change.duration,
        ),
        authority=core.AuthorityParameters(
            law=LAWS.index(settings.authority.law),
            operators=OPERATORS.index(settings.authority.operators),
            **values(settings.solver),
        ),
    )


def fault_records(settings: Settings) -> np.ndarray:
    """Faults as records of :class:`core.DegradationParameters`, shape (n,)."""
    records = np.zeros(len(settings.faults), record_dtype(core.DegradationParameters))
    for i, fault in enumerate(settings.faults):
        records[i] = pack(
            core.DegradationParameters(
                kind=KINDS.index(fault.kind),
                acceleration=fault.channel != "steering",
                steering=fault.channel != "acceleration",
                onset=fault.onset,
                ramp=fault.ramp,
                duration=math.inf if fault.duration is None else fault.duration,
                period=fault.period,
                duty=fault.duty,
                size=fault.size or 0.0,
                time_constant=fault.time_constant,
                frequency=fault.frequency,
                seed=fault.seed or 0,
            )
        )
    return records


def plan_records(settings: Settings) -> np.ndarray:
    """The other vehicles' plans as records of :class:`core.TrafficParameters`, shape (n,)."""
    records = np.zeros(len(settings.vehicles), record_dtype(core.TrafficParameters))
    for i, vehicle in enumerate(settings.vehicles):
        plan = core.TrafficParameters(
            follows=vehicle.behaviour == "idm", desired_speed=vehicle.desired_speed or max(vehicle.speed, 1.0)
        )
        if vehicle.brake is not None:
            plan = plan._replace(brake_onset=vehicle.brake.onset, deceleration=vehicle.brake.deceleration)
        change = vehicle.lane_change
        if change is not None:
            shift = settings.lane_centre(change.lane) - settings.lane_centre(vehicle.lane)
            plan = plan._replace(change_onset=change.onset, change_duration=change.duration, shift=shift)
        records[i] = pack(plan)
    return records


def plain(settings: Settings) -> dict[str, Any]:
    """Settings as a dict of JSON's own types, which an environment's spec can store."""
    return json.loads(settings.model_dump_json())
