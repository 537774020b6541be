"""The start of an episode as arrays: road, faults, parameters, ego and traffic."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shared_control_env.core.parameters import TRAFFIC_BODY
from shared_control_env.core.records import BODY_LENGTH, BODY_WIDTH, SPEED, pack
from shared_control_env.core.road import curvature_at, point_at, reference_line
from shared_control_env.core.traffic import follow_lane
from shared_control_env.envs.settings import LEAD_IN, Settings, fault_records, parameters_of, plan_records


class Situation(NamedTuple):
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


def start_of(settings: Settings) -> Situation:
    """The situation that settings describe. The ego starts at s = 0, turning with the road."""
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
    return Situation(line, fault_records(settings), pack(parameters_of(settings)), ego, traffic, plan_records(settings))
