"""Conversion of checked settings to the parameters of the compiled core."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pydantic import BaseModel

from shared_control_env.core import parameters as core
from shared_control_env.core.authority.fuzzy import OPERATORS
from shared_control_env.core.authority.laws import LAWS
from shared_control_env.core.faults import kinds
from shared_control_env.core.faults.command import PLACES
from shared_control_env.core.faults.kinds import CHANNEL, KINDS, RATE
from shared_control_env.core.feedback.reward import TERMS, VALUE
from shared_control_env.core.records import MAX_TERMS, pack, record_dtype
from shared_control_env.core.world import tyre
from shared_control_env.envs.profiles import resampled
from shared_control_env.envs.settings.schema import Settings


def parameters_of(settings: Settings) -> core.Parameters:
    """Parameters of the core for checked settings.

    Args:
        settings: checked settings.
    """

    def values(section: BaseModel, **more: Any) -> dict[str, Any]:
        return {**section.model_dump(), **more}

    longitudinal = values(settings.longitudinal_risk)
    longitudinal["graded"] = longitudinal.pop("preset") == "graded"
    change = settings.lane_change
    return core.Parameters(
        vehicle=core.VehicleParameters(**values(settings.vehicle, tyre=tyre.address_of(settings.vehicle.tyre))),
        model=model_of(settings),
        actuator=core.ActuatorParameters(
            settings.actuator.acceleration_lag,
            settings.actuator.steering_lag,
            settings.actuator.acceleration_rate or math.inf,
            settings.actuator.steering_rate or math.inf,
        ),
        limits=core.Limits(**values(settings.limits)),
        automation=core.PredictiveParameters(**values(settings.automation)),
        driver=core.PredictiveParameters(**values(settings.driver)),
        safe_area=core.SafeAreaParameters(**values(settings.safe_area)),
        lateral=core.LateralRiskParameters(**values(settings.lateral_risk)),
        longitudinal=core.LongitudinalRiskParameters(**longitudinal),
        law=core.LawParameters(**values(settings.law_tolerances)),
        lag=core.DriverLagParameters(**values(settings.driver_lag)),
        internal_model=core.InternalModelParameters(
            active=settings.internal_model.active,
            K_h=settings.driver_lag.K_h if settings.internal_model.K_h is None else settings.internal_model.K_h,
            T_h=settings.driver_lag.T_h if settings.internal_model.T_h is None else settings.internal_model.T_h,
        ),
        person=core.PersonParameters(**values(settings.person, seed=settings.person.seed or 0)),
        reward=reward_of(settings),
        task=core.TaskParameters(
            **values(settings.task),
            dt=1.0 / settings.policy_frequency,
            road_end=settings.road_length,
            y_target=settings.lane_centre(settings.ego.lane),
            y_goal=settings.lane_centre(settings.ego.lane if change is None else change.lane),
            change_onset=math.inf if change is None else change.onset,
            change_duration=4.0 if change is None else change.duration,
        ),
        authority=core.AuthorityParameters(
            law=LAWS.index(settings.authority.law),
            operators=OPERATORS.index(settings.authority.operators),
            fault_at=PLACES.index(settings.fault_at),
            strict=settings.authority.strict,
            shared=settings.misperception == "shared",
        ),
        solver=core.SolverParameters(**values(settings.solver)),
    )


def model_of(settings: Settings) -> core.VehicleParameters:
    """The vehicle parameters that controllers, person and risk assessment assume.

    Args:
        settings: checked settings.
    """
    believed = {**settings.vehicle.model_dump(), **settings.model.model_dump(exclude_none=True)}
    return core.VehicleParameters(**{**believed, "tyre": tyre.address_of(believed["tyre"])})


def reward_of(settings: Settings) -> core.RewardParameters:
    """Number, function addresses and weights of the reward terms.

    Args:
        settings: checked settings.
    """
    given = {entry.term: entry.weight for entry in settings.reward_terms}
    weights = {**settings.reward.model_dump(), **given}
    addresses, values = np.zeros(MAX_TERMS, dtype=np.int64), np.zeros(MAX_TERMS)
    for i, (name, weight) in enumerate(weights.items()):
        addresses[i], values[i] = VALUE.address(TERMS[name].value), weight
    return core.RewardParameters(len(weights), addresses, values)


def fault_records(settings: Settings) -> np.ndarray:
    """Faults as records of :class:`core.parameters.DegradationParameters`, shape (n,).

    Args:
        settings: checked settings.
    """
    records = np.zeros(len(settings.faults), record_dtype(core.DegradationParameters))
    for i, fault in enumerate(settings.faults):
        kind = KINDS[fault.kind]
        act, perceive, advance = kinds.addresses(kind)
        profile = None if fault.file is None else resampled(fault.file, 1.0 / settings.policy_frequency)
        records[i] = pack(
            core.DegradationParameters(
                kind=list(KINDS).index(fault.kind),
                act=act,
                perceive=perceive,
                advance=advance,
                in_unit_of_channel=kind.unit in (CHANNEL, RATE),
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
                profile=0 if profile is None else profile.ctypes.data,
                profile_steps=0 if profile is None else len(profile),
            )
        )
    return records


def plan_records(settings: Settings) -> np.ndarray:
    """Plans of the other vehicles as records of :class:`core.parameters.TrafficParameters`, shape (n,).

    Args:
        settings: checked settings.
    """
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
