"""Every parameter of the model with its unit, range, default and source.

The classes are named tuples: they are immutable and can be passed to the compiled functions directly.
Sources: *paper* is Huang et al., arXiv 2103.04563, with the table or equation; *ours* marks a choice
that the paper leaves open. All units are SI, and angles are in radians.
"""

from __future__ import annotations

import math
import statistics
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Interval

from shared_control_env.core.records import MAX_CONTROL, MAX_HORIZON, MAX_TERMS, Int32

FASTEST = 60.0
"""Highest speed that can be set [m/s]: 1.5 times the speed up to which the model is valid."""

LONGEST_ROAD = 1e5
"""Longest road that can be set [m]: the distance covered in an hour at 100 km/h."""

MOST_LANES = 30
"""Largest number of lanes that can be set [-]: the widest motorways have 26."""

LARGEST_ACCELERATION = 20.0
"""Largest acceleration limit that can be set [m/s^2]: twice what road tyres can transmit."""

LARGEST_STEERING = math.pi / 2
"""Upper bound of the steering limit, itself excluded [rad]: the wheels at a right angle to the car."""

# Bounds of the settings. In SI units, no quantity of a road vehicle except a weight exceeds one million. Squares and
# quotients of values within these bounds stay far from the limits of floating point.
Positive = Annotated[float, Interval(ge=1e-12, le=1e6)]
NonNegative = Annotated[float, Interval(ge=0.0, le=1e6)]
Fraction = Annotated[float, Interval(ge=0.0, le=1.0)]
Weight = Annotated[float, Interval(ge=0.0, le=1e12)]
PositiveWeight = Annotated[float, Interval(ge=1e-12, le=1e12)]
Speed = Annotated[float, Interval(ge=0.0, le=FASTEST)]  # [m/s]
TargetSpeed = Annotated[float, Interval(ge=0.1, le=FASTEST)]  # [m/s]
Mass = Annotated[float, Interval(ge=100.0, le=1e5)]  # [kg], from a light quadricycle to a road train
Inertia = Annotated[float, Interval(ge=10.0, le=1e6)]  # [kg m^2], for the same range of vehicles
BodyLength = Annotated[float, Interval(ge=0.1, le=30.0)]  # [m], for the same range of vehicles
BodyWidth = Annotated[float, Interval(ge=0.1, le=5.0)]  # [m]
Stiffness = Annotated[float, Interval(ge=1e3, le=1e7)]  # [N/rad]
Friction = Annotated[float, Interval(ge=0.05, le=2.0)]  # [-], from wet ice to racing tyres
ActuatorLag = Annotated[float, Interval(ge=0.0, le=10.0)]  # [s]


class VehicleParameters(NamedTuple):
    """Three-degree-of-freedom bicycle (Eq. 11), by default with linear tyres.

    Attributes:
        m: mass [kg]; paper, Table III.
        I_z: yaw moment of inertia [kg m^2]; paper, Table III.
        l_f: distance from the centre of mass to the front axle [m]; paper, Table III.
        l_r: distance from the centre of mass to the rear axle [m]; paper, Table III.
        C_f: cornering stiffness of one front tyre [N/rad]; ours (the paper prints none).
        C_r: cornering stiffness of one rear tyre [N/rad]; ours (the paper prints none).
        length: body length [m]; that of highway-env's vehicle.
        width: body width v_w [m]; paper, Table V.
        mu: friction coefficient of tyre and road [-]; ours: a dry road. The linear tyres of Eq. 11 do not use it.
        tyre: address of the compiled tyre force (:mod:`core.world.tyre`); 0 for the linear tyres of Eq. 11.
    """

    m: Mass = 2000.0
    I_z: Inertia = 1300.0
    l_f: BodyLength = 1.21
    l_r: BodyLength = 1.05
    C_f: Stiffness = 60_000.0
    C_r: Stiffness = 60_000.0
    length: BodyLength = 5.0
    width: BodyWidth = 2.0
    mu: Friction = 0.9
    tyre: int = 0


class ActuatorParameters(NamedTuple):
    """Actuators between the command u and the car (:mod:`core.world.actuator`); all ours. The paper has none.

    Attributes:
        acceleration_lag: time constant of drive and brake [s]; 0 for none.
        steering_lag: time constant of the steering [s]; 0 for none.
        acceleration_rate: largest rate of the acceleration [m/s^3]; infinite for none.
        steering_rate: largest rate of the steering angle [rad/s]; infinite for none.
    """

    acceleration_lag: ActuatorLag = 0.0
    steering_lag: ActuatorLag = 0.0
    acceleration_rate: Positive = math.inf
    steering_rate: Positive = math.inf


class Limits(NamedTuple):
    """Physical limits of every command (Eq. 14).

    Attributes:
        a_max: largest acceleration and deceleration [m/s^2]; paper, Section VI.
        delta_max: largest front steering angle [rad]; paper, Section VI (30 deg).
    """

    a_max: Annotated[float, Interval(ge=1e-9, le=LARGEST_ACCELERATION)] = 5.0
    delta_max: Annotated[float, Interval(ge=1e-9, lt=LARGEST_STEERING)] = math.radians(30.0)


class PredictiveParameters(NamedTuple):
    """Horizon and weights of both predictive controllers (Eq. 13, 15).

    The paper prints the horizons but no weights. With the default weights, the healthy automation reduces a lane error
    of 1 m to less than 5 cm in 1.75 s, with an overshoot of 0.23 m. In Case 1 the degraded automation alone leaves the
    lane (2.4 m), while the driver keeps the lane (0.6 m). The driver uses the same values, as the paper says.

    The paper's driver does not know the lag of Eq. 16. Without the automation (law ``driver_only``) this driver
    oscillates after a lane error of 1 m, at each of some twenty weightings tried. A driver whose model contains the lag
    (:class:`InternalModelParameters`) does not oscillate at the same weights and horizons.

    Attributes:
        H_p: prediction horizon [steps]; paper, Section VI.
        H_c: control horizon [steps]; the last command is held after it; paper, Section VI.
        W: weight of the lateral error squared [1/m^2]; ours.
        H: weight of the speed error squared [s^2/m^2]; ours.
        N: weight of the yaw acceleration squared [s^4/rad^2]; ours.
        Q_a: weight of the acceleration command squared [s^4/m^2]; ours.
        Q_delta: weight of the steering command squared [1/rad^2]; ours.
        R: weight of the potential-field value squared [-]; ours (automation only).
    """

    H_p: Annotated[int, Interval(ge=1, le=MAX_HORIZON)] = 10
    H_c: Annotated[int, Interval(ge=1, le=MAX_CONTROL)] = 3
    W: Weight = 1.0
    H: Weight = 0.1
    N: Weight = 0.01
    Q_a: PositiveWeight = 0.05
    Q_delta: PositiveWeight = 1.0
    R: Weight = 1e-4


class SafeAreaParameters(NamedTuple):
    """Extent of the driving region (Table I).

    Attributes:
        look_ahead: length of the region without a preceding vehicle [m]; ours.
        d_o: clearance kept behind the preceding vehicle [m]; paper, Table V.
    """

    look_ahead: Positive = 60.0
    d_o: NonNegative = 2.0


class LateralRiskParameters(NamedTuple):
    """Artificial potential field of the safe area's boundaries (Eq. 2, 3).

    Attributes:
        alpha_f: height of the field [-]; paper, Table V.
        sigma_y: width of the field [m]; paper, Table V.
        d_c: safety margin [m]; paper, Table V.
        v_w: vehicle width [m]; paper, Table V.
    """

    alpha_f: Positive = 30.0
    sigma_y: Positive = 1.0
    d_c: NonNegative = 0.8
    v_w: Positive = 2.0


class LongitudinalRiskParameters(NamedTuple):
    """Dynamic potential field of the neighbours (Eq. 5-8).

    Attributes:
        alpha: height of the relative-speed field [-]; paper, Table V.
        A_f: height of the distance field [-]; paper, Table V.
        sigma_x: width of the distance field [m], used where ``graded`` is False; paper, Table V.
        graded: whether sigma_x is 2 d^s instead (the text's "2 d_o", read as the distance of Eq. 8); ours.
        b: shape of the distance field [-]; paper, Table V.
        a_max: largest deceleration of all vehicles [m/s^2]; paper, Table V.
        t_r: reaction time [s]; paper, Table V.
        t_i: build-up time of the deceleration [s]; paper, Table V.
        d_o: clearance between stopped vehicles [m]; paper, Table V.
        w_f: weight of the follower [-]; paper, Table V (lane keeping).
        w_l: weight of the leader [-]; paper, Table V (lane keeping).
        w_p: weight of the preceding vehicle [-]; paper, Table V (lane keeping).
        w_f_change: weight of the follower during a lane change [-]; paper, Table V.
        w_l_change: weight of the leader during a lane change [-]; paper, Table V.
        w_p_change: weight of the preceding vehicle during a lane change [-]; paper, Table V.
        bumper_to_bumper: whether one vehicle length is subtracted from the distance between the centres; ours.
    """

    alpha: Positive = 10.0
    A_f: Positive = 2.0
    sigma_x: Positive = 4.0
    b: Positive = 2.0
    a_max: Positive = 7.0
    t_r: NonNegative = 0.1
    t_i: NonNegative = 0.1
    d_o: NonNegative = 2.0
    w_f: Fraction = 0.1
    w_l: Fraction = 0.2
    w_p: Fraction = 0.7
    w_f_change: Fraction = 0.8
    w_l_change: Fraction = 0.1
    w_p_change: Fraction = 0.1
    graded: bool = True
    bumper_to_bumper: bool = False


class LawParameters(NamedTuple):
    """Tolerances of the first line of Eq. 10, in physical units; both ours.

    Attributes:
        tolerance_a: largest ``|a_f - a_des|`` that counts as equal [m/s^2].
        tolerance_delta: largest ``|delta_f - delta_des|`` that counts as equal [rad].
    """

    tolerance_a: NonNegative = 0.01
    tolerance_delta: NonNegative = 0.001


class DriverLagParameters(NamedTuple):
    """Neuromuscular response of the driver (Eq. 16).

    Attributes:
        K_h: proportional gain [-]; paper, Section VI. With 0 the driver's hands are off the wheel.
        T_h: time constant [s]; paper, Section VI.
        direct: whether the driver's slot takes u_h,act itself, without Eq. 16: for a person at the controls, whose own
            arm has the lag already; ours.
    """

    K_h: Annotated[float, Interval(ge=0.0, le=100.0)] = 1.0
    T_h: Positive = 0.2
    direct: bool = False


class InternalModelParameters(NamedTuple):
    """What the predictive driver knows of its own arm (Eq. 16 within Eq. 15).

    All values are ours: the paper's driver does not know its arm.

    Attributes:
        active: whether the arm's response is part of the model that the driver predicts with.
        K_h: gain of the arm that the driver assumes [-].
        T_h: time constant of the arm that the driver assumes [s].
    """

    active: bool = False
    K_h: Annotated[float, Interval(ge=0.0, le=100.0)] = 1.0
    T_h: Positive = 0.2


class PersonParameters(NamedTuple):
    """Perception, attention and arm of a person at the wheel (:mod:`core.control.person`); all ours.

    Attributes:
        active: whether the predictive driver is a person; the other fields have an effect only then.
        engaged: whether the person drives from the start; if not, the hands rest until the person notices something.
        delay: delay of perception [s]; 0.15 to 0.25 s with visual and vestibular senses in steering (Nash & Cole,
            Vehicle System Dynamics 58(4), 2020).
        weber: standard deviation of the error of a perceived quantity, divided by that quantity [-]; a Weber fraction
            of about 0.1 (same source).
        noise_time: correlation time of the errors of perception and of the arm [s]; assumed.
        lane_position: smallest error of the lane position that is noticed [m]; assumed: the body is then 0.2 m from
            the line.
        heading: smallest heading relative to the road that is noticed [rad]; assumed.
        headway: time headway below which the vehicle ahead is noticed [s]; assumed. With 0 it is not noticed.
        felt_steering: smallest steering angle, felt at the wheel beyond what the road's curvature requires, that is
            noticed [rad]; assumed.
        felt_acceleration: smallest difference between the automation's acceleration and the person's own choice that
            is noticed [m/s^2]; assumed.
        display: displayed authority alpha_a below which the display is noticed [-]; assumed. With 0 there is none.
        response: median time from noticing to acting [s]; log-normal over persons, see :data:`PERSONS`.
        response_spread: standard deviation of the logarithm of that time [-].
        arm_noise: standard deviation of the error of a command, divided by the command: signal-dependent noise of the
            arm [-]; assumed.
        seed: seed of all random numbers of the person.
    """

    active: bool = False
    engaged: bool = True
    delay: Annotated[float, Interval(ge=0.0, le=1.0)] = 0.2
    weber: Annotated[float, Interval(ge=0.0, le=1.0)] = 0.1
    noise_time: Annotated[float, Interval(ge=0.01, le=10.0)] = 0.3
    lane_position: Annotated[float, Interval(ge=0.01, le=5.0)] = 0.8
    heading: Annotated[float, Interval(ge=0.001, le=0.5)] = 0.15
    headway: Annotated[float, Interval(ge=0.0, le=5.0)] = 0.6
    felt_steering: Annotated[float, Interval(ge=0.001, le=0.5)] = 0.08
    felt_acceleration: Annotated[float, Interval(ge=0.01, le=10.0)] = 3.0
    display: Fraction = 0.5
    response: Annotated[float, Interval(ge=0.0, le=30.0)] = 1.2
    response_spread: Annotated[float, Interval(ge=0.0, le=2.0)] = 0.5
    arm_noise: Annotated[float, Interval(ge=0.0, le=1.0)] = 0.05
    seed: int = 0


TRAFFIC_BODY = (5.0, 2.0)
"""Length and width of the bodies of highway-env's vehicles [m]."""

PERSONS: dict[str, PersonParameters] = {
    "attentive": PersonParameters(active=True),
    "hands_on": PersonParameters(active=True, engaged=False, response=1.2, response_spread=0.5),
    "hands_off": PersonParameters(active=True, engaged=False, felt_steering=0.5, response=2.7, response_spread=0.6),
}
"""Persons by name.

``attentive``: expects the fault and drives all the time.

``hands_on``: rests the hands on the wheel. The median response, 1.2 s, and its spread are assumed. The median lies at
the lower end of the 1.18 to 1.74 s that steering reactions took at a system limit in a curve, where the hands were
first put on the wheel (Paula et al., Sensors 23(24):9785, 2023): the time here starts when a threshold is passed.

``hands_off``: feels hardly anything at the wheel and takes 2.7 s, about the mean of 129 studies of take-over times
(Zhang et al., 2019; the number is yet to be verified). The spread is assumed.
"""


IDENTIFIED_DRIVERS: dict[str, DriverLagParameters] = {
    "driver_1": DriverLagParameters(0.95, 0.15),
    "driver_2": DriverLagParameters(1.15, 0.21),
    "driver_3": DriverLagParameters(1.10, 0.14),
    "driver_4": DriverLagParameters(1.20, 0.18),
    "driver_5": DriverLagParameters(0.98, 0.19),
    "average": DriverLagParameters(1.08, 0.17),
}
"""The five drivers identified in the paper's Table IV, and their average."""


class RewardParameters(NamedTuple):
    """Terms of the reward (:mod:`core.feedback.reward`) and their weights; all ours.

    Attributes:
        n_terms: number of terms.
        addresses: addresses of the terms' compiled functions, shape (MAX_TERMS,).
        weights: weights of the terms [-], shape (MAX_TERMS,).
    """

    n_terms: int = 0
    addresses: Annotated[np.ndarray, (MAX_TERMS,), np.int64] = np.zeros(MAX_TERMS, dtype=np.int64)
    weights: Annotated[np.ndarray, (MAX_TERMS,)] = np.zeros(MAX_TERMS)


def fitted_arms() -> tuple[tuple[float, float], tuple[float, float]]:
    """Log-normal fit of K_h and T_h over the five drivers of Table IV.

    Returns:
        Median and standard deviation of the logarithm, first of K_h and then of T_h.
    """
    five = [lag for name, lag in IDENTIFIED_DRIVERS.items() if name != "average"]
    fits = []
    for field in ("K_h", "T_h"):
        logarithms = [math.log(getattr(lag, field)) for lag in five]
        fits.append((math.exp(statistics.mean(logarithms)), statistics.stdev(logarithms)))
    return fits[0], fits[1]


def critical_speed(vehicle: VehicleParameters) -> float:
    """Speed above which an oversteering car is unstable [m/s]; infinite for a car that does not oversteer.

    ``v_crit = L sqrt(2 C_f C_r / (m (l_f C_f - l_r C_r)))`` with ``L = l_f + l_r``, the stiffness per tyre, and two
    tyres per axle (Rajamani, Vehicle Dynamics and Control, Section 3.3).

    Args:
        vehicle: parameters of the car.
    """
    oversteer = vehicle.l_f * vehicle.C_f - vehicle.l_r * vehicle.C_r
    if oversteer <= 0.0:
        return math.inf
    wheelbase = vehicle.l_f + vehicle.l_r
    return wheelbase * math.sqrt(2.0 * vehicle.C_f * vehicle.C_r / (vehicle.m * oversteer))


class TaskParameters(NamedTuple):
    """The driving task: time step, lanes, target speed and lane change.

    Attributes:
        dt: time step of all controllers [s]; paper, Section VI (0.05 s).
        tau_p: horizon of the CTRA prediction [s]; paper, Section III-A.
        road_end: path length at which the road and the episode end [m].
        y_target: lateral position of the lane to keep [m].
        target_speed: desired speed where no slower vehicle precedes [m/s]; Case 1 (15 m/s).
        time_headway: desired time headway [s]. With 0 there is none: the target speed is then that of the preceding
            vehicle at any distance, as in the paper. 1.2 s is usual (ISO 15622 requires at least 0.8 s).
        standstill_gap: desired gap at rest, bumper to bumper [m]; ours.
        closing_time: time constant with which an error of the gap is corrected [s]; ours.
        y_goal: lateral position of the lane to change to [m].
        change_onset: time at which the lane change begins [s]; infinite for none.
        change_duration: duration of the lane change [s]; ours.
    """

    dt: Positive = 0.05
    tau_p: Annotated[float, Interval(ge=1e-3, le=10.0)] = 0.5
    road_end: Positive = math.inf
    y_target: float = 0.0
    target_speed: TargetSpeed = 15.0
    time_headway: Annotated[float, Interval(ge=0.0, le=10.0)] = 0.0
    standstill_gap: NonNegative = 4.0
    closing_time: Annotated[float, Interval(ge=0.1, le=100.0)] = 1.5
    y_goal: float = 0.0
    change_onset: NonNegative = math.inf
    change_duration: Positive = 4.0


class DegradationParameters(NamedTuple):
    """One degradation of the automation (:mod:`core.faults`); all ours except the two biases of the paper.

    Attributes:
        kind: index in :data:`core.faults.kinds.KINDS`; 0 for no degradation.
        act: address of the kind's compiled function that changes the command; 0 for none.
        perceive: address of the kind's compiled function that changes the perception; 0 for none.
        advance: address of the kind's compiled function that advances its memory; 0 for none.
        in_unit_of_channel: whether the size is in the unit of its channel, or in that unit per second.
        acceleration: whether the degradation acts on the acceleration command.
        steering: whether the degradation acts on the steering command.
        onset: time at which the degradation begins [s]; paper, Eq. 17, 18.
        ramp: time over which the degradation grows to its full size [s]; paper, Eq. 17, 18.
        duration: time from the onset to the end of the degradation [s]; infinite for a permanent one.
        period: period of an intermittent degradation [s]; 0 for one that is not intermittent.
        duty: share of each period during which an intermittent degradation acts [-].
        size: size of the degradation; the kind defines its meaning and unit; paper, Eq. 17, 18.
        time_constant: correlation time of coloured noise [s].
        frequency: frequency of an oscillation [Hz].
        seed: seed of the noise.
        profile: address of a recorded profile at the time steps since the onset; 0 for none.
        profile_steps: number of its entries.
    """

    kind: int = 0
    act: int = 0
    perceive: int = 0
    advance: int = 0
    in_unit_of_channel: bool = True
    acceleration: bool = False
    steering: bool = False
    onset: NonNegative = 0.0
    ramp: NonNegative = 0.0
    duration: Positive = math.inf
    period: NonNegative = 0.0
    duty: Fraction = 0.5
    size: float = 0.0
    time_constant: Positive = 0.5
    frequency: Positive = 0.5
    seed: int = 0
    profile: int = 0
    profile_steps: Int32 = 0


class TrafficParameters(NamedTuple):
    """Plan of another vehicle (:mod:`core.world.traffic`); all ours.

    Attributes:
        follows: whether the vehicle follows by the Intelligent Driver Model; if not, it holds its speed.
        desired_speed: v_0 of the Intelligent Driver Model [m/s].
        brake_onset: time at which the vehicle begins to brake [s]; infinite for never.
        deceleration: deceleration with which the vehicle then brakes to a stop [m/s^2].
        change_onset: time at which the vehicle begins a lane change [s]; infinite for never.
        change_duration: duration of the lane change [s].
        shift: lateral displacement of the lane change, positive to the left [m].
        track: address of a recorded track, rows X to YAW_RATE at the simulation steps; 0 for none. A vehicle with a
            track replays it until ``follows`` is set, which the core does once the ego makes the record impossible.
        decide: address of the function that decides how a vehicle with a track moves, see :mod:`world.replay`.
        advance: address of the function that moves it.
        ego_track: address of the track of the vehicle whose place the ego has taken; 0 for none.
        steps: number of rows of the track.
        first: first simulation step at which the vehicle is there.
        last: last simulation step at which it is there.
    """

    follows: bool = False
    desired_speed: Positive = 15.0
    brake_onset: NonNegative = math.inf
    deceleration: NonNegative = 0.0
    change_onset: NonNegative = math.inf
    change_duration: Positive = 3.0
    shift: float = 0.0
    track: int = 0
    decide: int = 0
    advance: int = 0
    ego_track: int = 0
    steps: Int32 = 0
    first: Int32 = 0
    last: Int32 = 0


class AuthorityParameters(NamedTuple):
    """Choice of the fuzzy operators and of the authority law, and where degradations of the command act.

    Attributes:
        law: index in :data:`core.authority.laws.LAWS`; paper, Eq. 10.
        operators: index in :data:`core.authority.fuzzy.OPERATORS`; ours.
        fault_at: index in :data:`core.faults.command.PLACES`, where degradations of the command act; paper: command.
        shared: whether the risk assessment shares the automation's errors of perception; ours.
        strict: whether the second line of Eq. 10 applies only for alpha_a < 1, as printed.
    """

    law: int = 0
    operators: int = 0
    fault_at: int = 1
    shared: bool = False
    strict: bool = False


class SolverParameters(NamedTuple):
    """Iteration limits of the automation's solver.

    Attributes:
        iterations: largest number of Gauss-Newton iterations per step; ours.
        first_iterations: largest number of Gauss-Newton iterations at the first step, a cold start; ours.
    """

    iterations: int = 3
    first_iterations: int = 5


class Parameters(NamedTuple):
    """All parameters of one environment; the groups are documented in their classes.

    Attributes:
        vehicle: the ego vehicle as it drives.
        model: the ego vehicle as controllers, person and risk assessment model it. Controllers and person use it with
            linear tyres, the risk assessment with the tyre that it names.
        actuator: lag and rate limit of the car's actuators.
        limits: limits of the commands.
        automation: horizon and weights of the automation's predictive controller.
        driver: horizon and weights of the driver's predictive controller; the paper uses those of the automation.
        safe_area: extent of the driving region.
        lateral: parameters of the lateral risk.
        longitudinal: parameters of the longitudinal risk.
        law: tolerances of the authority law.
        lag: neuromuscular lag of the driver.
        internal_model: what the driver knows of this lag.
        person: perception, attention and arm of a person at the wheel.
        reward: terms and weights of the reward.
        task: the driving task.
        authority: fuzzy operators, authority law and place of the fault.
        solver: iteration limits of the automation's solver.
    """

    vehicle: VehicleParameters = VehicleParameters()
    model: VehicleParameters = VehicleParameters()
    actuator: ActuatorParameters = ActuatorParameters()
    limits: Limits = Limits()
    automation: PredictiveParameters = PredictiveParameters()
    driver: PredictiveParameters = PredictiveParameters()
    safe_area: SafeAreaParameters = SafeAreaParameters()
    lateral: LateralRiskParameters = LateralRiskParameters()
    longitudinal: LongitudinalRiskParameters = LongitudinalRiskParameters()
    law: LawParameters = LawParameters()
    lag: DriverLagParameters = DriverLagParameters()
    internal_model: InternalModelParameters = InternalModelParameters()
    person: PersonParameters = PersonParameters()
    reward: RewardParameters = RewardParameters()
    task: TaskParameters = TaskParameters()
    authority: AuthorityParameters = AuthorityParameters()
    solver: SolverParameters = SolverParameters()
