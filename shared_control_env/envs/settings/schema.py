"""Settings of an environment: types, defaults, units and ranges.

The sections with model parameters are generated from the named tuples of :mod:`shared_control_env.core.parameters`,
which document each parameter and its source. The parameters are not listed a second time.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Annotated, Any, Literal, get_args, get_type_hints

from annotated_types import Interval, MaxLen, MinLen
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, create_model
from pydantic_core import PydanticCustomError

from shared_control_env.core import parameters as core
from shared_control_env.core.authority.fuzzy import OPERATORS
from shared_control_env.core.authority.laws import LAWS
from shared_control_env.core.faults.command import PLACES
from shared_control_env.core.faults.kinds import KINDS
from shared_control_env.core.feedback.observation import DRIVER_V0, OBSERVATIONS
from shared_control_env.core.feedback.reward import STANDARD, TERMS
from shared_control_env.core.parameters import Fraction, NonNegative, Positive, Speed, TargetSpeed, Weight
from shared_control_env.core.records import MAX_TERMS
from shared_control_env.core.world.tyre import TYRES
from shared_control_env.envs.degradations import DEGRADATIONS

OWN_TRAFFIC = "shared_control_env.envs.highway.vehicles.LaneFollower"
"""Path of the vehicle class that follows its plan and is driven by the core."""

LONGEST = 3600.0
"""Longest duration that can be set [s]: one hour."""

PANEL_HEIGHT = 192
"""Height of the panel of gauges in pictures [px]."""


def _whole(value: Any) -> Any:
    """Convert a float that is a whole number to an integer; return any other value unchanged."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


Lane = Annotated[int, Interval(ge=0, lt=core.MOST_LANES), BeforeValidator(_whole)]
"""Number of a lane; 0 is the rightmost."""

Onset = Annotated[float, Interval(ge=0.0, le=LONGEST)]
"""Time of the onset of an event [s]."""

Seed = Annotated[int, Interval(ge=0, lt=2**63), BeforeValidator(_whole)]
"""Seed of noise; the core keeps it in 64 bits."""


def _count(largest: int, smallest: int = 1) -> Any:
    return Annotated[int, Interval(ge=smallest, le=largest), BeforeValidator(_whole)]


def name_in(table: Mapping[str, Any], *but: str) -> Any:
    """Type of a setting that holds a name from a table. The table may grow after this type is made.

    Args:
        table: entries by name.
        but: names of the table that are not allowed here.
    """

    def check(name: str) -> str:
        names = [each for each in table if each not in but]
        if name not in names:
            expected = ", ".join(map(repr, names))
            text = "input should be one of {expected}" if names else "there is none to name; add one first"
            raise PydanticCustomError("literal_error", text, {"expected": expected})
        return name

    return Annotated[str, AfterValidator(check)]


class Section(BaseModel):
    """Base of all groups of settings. Unknown keys, values of another type and infinite values are refused."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


def _section(name: str, parameters: Any, *left_out: str, **more: Any) -> Any:
    """A settings class with the fields, types, ranges, defaults and documentation of a named-tuple class.

    ``name`` must be the name that the class is assigned to in this module, so that instances can be pickled.
    """
    hints = get_type_hints(parameters, include_extras=True)
    defaults = parameters._field_defaults
    for field, hint in hints.items():
        if (get_args(hint) or (hint,))[0] is int:
            hints[field] = Annotated[hint, BeforeValidator(_whole)]
    fields = {field: (hints[field], defaults[field]) for field in defaults if field not in left_out}
    return create_model(name, __base__=Section, __module__=__name__, __doc__=parameters.__doc__, **fields, **more)


class Segment(Section):
    """A piece of the road's reference line, which is the centre of lane 0."""

    length: Annotated[float, Interval(gt=0.0, le=core.LONGEST_ROAD)]  # [m]
    curvature: Annotated[float, Interval(ge=-1.0, le=1.0)] = 0.0  # [1/m], positive to the left


class RoadSettings(Section):
    """The road. Lanes are counted from the right; lane 0 is the rightmost."""

    segments: Annotated[list[Segment], MinLen(1), MaxLen(200)] = [Segment(length=1000.0)]
    lanes: _count(core.MOST_LANES) = 2
    lane_width: Annotated[float, Interval(gt=0.0, le=20.0)] = 4.0  # [m]


class EgoSettings(Section):
    """Start of the ego at s = 0, in the lane to keep."""

    lane: Lane = 0
    speed: Speed = 15.0  # [m/s]
    lateral_offset: Annotated[float, Interval(ge=-10.0, le=10.0)] = (
        0.0  # from the lane's centre, positive to the left [m]
    )


class RecordingSettings(Section):
    """Recorded traffic (envs.recorded); road, ego and vehicles are those of the recording.

    The environment fills in what it has drawn, and sets ``drawn``.
    """

    file: Annotated[str, MinLen(1), MaxLen(4096)]  # a recording, or a folder of them, of which one is drawn
    ego: Annotated[str, MinLen(1), MaxLen(200)] | None = None  # vehicle or planning problem; None to draw one
    drawn: bool = False


class BrakeSettings(Section):
    """Braking to a stop."""

    onset: Onset  # [s]
    deceleration: Annotated[float, Interval(gt=0.0, le=20.0)]  # [m/s^2]


class LaneChangeSettings(Section):
    """A change to another lane (core.world.lane_change)."""

    onset: Onset  # [s]
    duration: Annotated[float, Interval(ge=0.1, le=100.0)] = 4.0  # [s]
    lane: Lane


class VehicleSettings(Section):
    """Another vehicle at its start; positions are those of the centres, relative to the ego's (core.world.traffic)."""

    lane: Lane
    position: Annotated[float, Interval(ge=-core.LONGEST_ROAD, le=core.LONGEST_ROAD)]  # along the road [m]
    speed: Speed  # [m/s]
    behaviour: Literal["constant", "idm"] = "constant"
    desired_speed: TargetSpeed | None = None  # of idm [m/s]; None for the initial speed
    brake: BrakeSettings | None = None
    lane_change: LaneChangeSettings | None = None


class FaultSettings(Section):
    """A degradation of the automation (core.faults). The kind defines the meaning of the size."""

    kind: name_in(KINDS, "none") = "bias"
    channel: Literal["acceleration", "steering", "both"] = "steering"
    onset: Onset  # [s]
    ramp: NonNegative = 0.0  # [s]
    duration: Positive | None = None  # [s]; None for a permanent one
    period: NonNegative = 0.0  # of an intermittent degradation [s]; 0 if not intermittent
    duty: Annotated[float, Interval(gt=0.0, le=1.0)] = 0.5  # share of each period during which it acts
    size: float | None = None
    time_constant: Annotated[float, Interval(ge=1e-3, le=1e3)] = 0.5  # of coloured noise [s]
    frequency: Annotated[float, Interval(gt=0.0, le=1e3)] = 0.5  # of an oscillation [Hz]
    seed: Seed | None = None  # of noise; None for a random seed
    file: Annotated[str, MaxLen(4096)] | None = None  # of a recorded fault: CSV or Parquet (envs.profiles)


class RandomSettings(Section):
    """A setting drawn at the start of each episode: uniform within limits, log-normal, or one of several values."""

    setting: str  # its path, such as "ego.speed" or "vehicles.0.position"
    low: float | None = None
    high: float | None = None
    median: Positive | None = None  # of a log-normal distribution, cut off at 3 standard deviations
    spread: Annotated[float, Interval(ge=0.0, le=2.0)] | None = None  # standard deviation of its logarithm [-]
    choices: Annotated[list[float], MinLen(1), MaxLen(10_000)] | None = None


class AuthoritySettings(Section):
    """Authority of the automation (core.authority)."""

    law: Literal[LAWS] = "paper"
    operators: Literal[OPERATORS] = "product-sum"
    strict: bool = False  # Eq. 10's second line as printed, only for alpha_a < 1


class InternalModelSettings(Section):
    """Whether the predictive driver knows its own response (core.control.driver), and the values that it assumes."""

    active: bool = False
    K_h: Annotated[float, Interval(ge=0.0, le=100.0)] | None = None  # [-]; None for that of driver_lag
    T_h: Positive | None = None  # [s]; None for that of driver_lag


class SolverSettings(Section):
    """Gauss-Newton iterations of the automation."""

    iterations: _count(100) = 3
    first_iterations: _count(100) = 5


class ModelSettings(Section):
    """The car as controllers, person and risk assessment take it to be; None for the true value.

    Tyre and friction concern the risk assessment; controllers and person assume linear tyres.
    """

    m: core.Mass | None = None  # [kg]
    I_z: core.Inertia | None = None  # [kg m^2]
    l_f: core.BodyLength | None = None  # [m]
    l_r: core.BodyLength | None = None  # [m]
    C_f: core.Stiffness | None = None  # [N/rad]
    C_r: core.Stiffness | None = None  # [N/rad]
    mu: core.Friction | None = None  # [-]
    tyre: name_in(TYRES) | None = None


class ActuatorSettings(Section):
    """Actuators of the car (core.world.actuator). The default is the paper's car, which has none."""

    acceleration_lag: core.ActuatorLag = 0.0  # [s]; 0 for none
    steering_lag: core.ActuatorLag = 0.0  # [s]; 0 for none
    acceleration_rate: Positive | None = None  # [m/s^3]; None for no limit
    steering_rate: Positive | None = None  # [rad/s]; None for no limit


class ObservationSettings(Section):
    """The observation that the environment returns (core.feedback.observation)."""

    type: name_in(OBSERVATIONS) = DRIVER_V0.name


class TermSettings(Section):
    """A term of the reward in addition to the standard ones (core.feedback.reward)."""

    term: name_in(TERMS, *STANDARD)
    weight: Weight


_TASK_FROM_ROAD = (
    *("dt", "road_end", "y_target", "y_goal"),
    *("change_onset", "change_duration"),
)
_Longitudinal = _section(
    "_Longitudinal",
    core.LongitudinalRiskParameters,
    *("graded", "alpha", "A_f"),  # the heights cancel in the ratio of Eq. 7
    preset=(Literal["paper", "graded"], "graded"),
)
_Task = _section("_Task", core.TaskParameters, *_TASK_FROM_ROAD)
_Vehicle = _section("_Vehicle", core.VehicleParameters, "tyre", tyre=(name_in(TYRES), "linear"))
_Limits = _section("_Limits", core.Limits)
_Automation = _section("_Automation", core.PredictiveParameters)
_Driver = _section("_Driver", core.PredictiveParameters, "R")  # the driver's cost has no potential field
_SafeArea = _section("_SafeArea", core.SafeAreaParameters)
_Lateral = _section("_Lateral", core.LateralRiskParameters)
_Law = _section("_Law", core.LawParameters)
_Lag = _section("_Lag", core.DriverLagParameters)
_Reward: Any = create_model(
    "_Reward",
    __base__=Section,
    __module__=__name__,
    __doc__="Weights of the standard terms of the reward (core.feedback.reward).",
    **{name: (Weight, TERMS[name].weight) for name in STANDARD},
)
_Person = _section("_Person", core.PersonParameters, "seed", seed=(Seed | None, None))  # None for a random seed


MOST_FAULTS = 20
"""Largest number of degradations of an episode."""


class Settings(Section):
    """All settings. The first group consists of highway-env's own settings, with the same meaning as there."""

    simulation_frequency: _count(1000) = 20  # [Hz]
    policy_frequency: _count(100) = 20  # [Hz]
    other_vehicles_type: str = OWN_TRAFFIC
    screen_width: _count(4096, smallest=160) = 1000  # [px]
    screen_height: _count(4096, smallest=PANEL_HEIGHT + 8) = 452  # [px]
    centering_position: Annotated[list[Fraction], MinLen(2), MaxLen(2)] = [0.3, 0.5]
    scaling: Annotated[float, Interval(ge=0.1, le=1000.0)] = 11.0  # [px/m]
    offscreen_rendering: bool | None = None
    real_time_rendering: bool = False
    neighbour_vehicles_connected_lanes: bool = True

    duration: Annotated[float, Interval(gt=0.0, le=LONGEST)] = 10.0  # [s]
    road: RoadSettings = RoadSettings()
    ego: EgoSettings = EgoSettings()
    lane_change: LaneChangeSettings | None = None  # of the ego; None to keep the lane
    recording: RecordingSettings | None = None  # recorded traffic; None for the vehicles below
    vehicles: Annotated[list[VehicleSettings], MaxLen(100)] = []
    faults: Annotated[list[FaultSettings], MaxLen(MOST_FAULTS)] = []
    fault_at: Literal[PLACES] = "command"  # where degradations of the command act (core.faults)
    misperception: Literal["automation", "shared"] = "automation"  # shared: also in the risk assessment
    degradations: list[name_in(DEGRADATIONS)] = []  # one of these is drawn at the start of each episode
    randomise: Annotated[list[RandomSettings], MaxLen(1000)] = []
    task: _Task = _Task()
    authority: AuthoritySettings = AuthoritySettings()
    law_tolerances: _Law = _Law()
    lateral_risk: _Lateral = _Lateral()
    longitudinal_risk: _Longitudinal = _Longitudinal()
    safe_area: _SafeArea = _SafeArea()
    automation: _Automation = _Automation()
    solver: SolverSettings = SolverSettings()
    driver: _Driver = _Driver()
    driver_lag: _Lag = _Lag()
    internal_model: InternalModelSettings = InternalModelSettings()
    person: _Person = _Person()
    persons: list[name_in(core.PERSONS)] = []  # one of these drives in each episode, instead of the settings of person
    limits: _Limits = _Limits()
    vehicle: _Vehicle = _Vehicle()
    model: ModelSettings = ModelSettings()
    actuator: ActuatorSettings = ActuatorSettings()
    observation: ObservationSettings = ObservationSettings()
    reward: _Reward = _Reward()
    reward_terms: Annotated[list[TermSettings], MaxLen(MAX_TERMS - len(STANDARD))] = []

    @property
    def terms(self) -> tuple[str, ...]:
        """Names of the reward terms, in order."""
        return (*STANDARD, *(entry.term for entry in self.reward_terms))

    @property
    def steps(self) -> int:
        """Length of an episode as a number of decisions."""
        return round(self.duration * self.policy_frequency)

    @property
    def simulation_steps(self) -> int:
        """Length of an episode as a number of simulation steps."""
        return self.steps * (self.simulation_frequency // self.policy_frequency)

    @property
    def is_direct(self) -> bool:
        """Whether the driver's slot takes u_h,act itself."""
        return bool(self.driver_lag.direct)

    @property
    def has_person(self) -> bool:
        """Whether the predictive driver is the model of a person."""
        return self.person.active or bool(self.persons)

    @property
    def road_length(self) -> float:
        """Length of the road ahead of the start [m]."""
        return sum(segment.length for segment in self.road.segments)

    def lane_centre(self, lane: int) -> float:
        """Lateral position of a lane's centre in the road frame [m].

        Args:
            lane: number of the lane; 0 is the rightmost.
        """
        return lane * self.road.lane_width


def plain(settings: Settings) -> dict[str, Any]:
    """Settings as a dict of JSON types, which the spec of an environment can store.

    Args:
        settings: checked settings.
    """
    return json.loads(settings.model_dump_json())
