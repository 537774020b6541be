"""Where everything stands at the start of an episode: road, ego and traffic from a few numbers.

The numbers are one array: lane width [m], number of lanes, offset of the ego's lane from the reference line [m], the
ego's offset from its lane [m] and its speed [m/s]; then length [m] and curvature [1/m] of each segment of the road, the
straight lead-in first; then offset from the reference line [m], path length [m] and speed [m/s] of each other vehicle.
"""

from __future__ import annotations

import numpy as np

from shared_control_env.core.compile.jit import jit
from shared_control_env.core.parameters import TRAFFIC_BODY
from shared_control_env.core.records import BODY_LENGTH, BODY_WIDTH, HEADING, SPEED, X, Y
from shared_control_env.core.world.replay import AWAY
from shared_control_env.core.world.road import chain, curvature_at, point_at
from shared_control_env.core.world.traffic import follow_lane

LANE_WIDTH, LANES, EGO_LANE, EGO_OFFSET, EGO_SPEED, SEGMENTS = range(6)
"""Indices in the numbers of a start; the last is that of the first segment."""


@jit
def place(numbers: np.ndarray, segments: int, line: np.ndarray, ego: np.ndarray, traffic: np.ndarray) -> None:
    """Place road, ego and traffic. The ego is at s = 0 and turns with the road; vehicles that are left over are away.

    Args:
        numbers: numbers of the start, see the module.
        segments: number of segments.
        line: reference line, written, shape (n, 12).
        ego: state ``[x, y, psi, v_x, v_y, r]`` [m, rad, m/s, rad/s], written, shape (6,).
        traffic: other vehicles, written, columns as in :mod:`core.records`, shape (M, 8).
    """
    after = SEGMENTS + 2 * segments
    road = numbers[SEGMENTS:after].reshape((segments, 2))
    chain(road, -road[0, 0], numbers[LANE_WIDTH], int(numbers[LANES]), line)
    d, speed = numbers[EGO_LANE] + numbers[EGO_OFFSET], numbers[EGO_SPEED]
    ego[0], ego[1], ego[2] = point_at(line, 0.0, d)
    ego[3], ego[4], ego[5] = speed, 0.0, speed * curvature_at(line, 0.0, d)
    vehicles = (numbers.shape[0] - after) // 3
    for i in range(traffic.shape[0]):
        row = traffic[i]
        for j in range(row.shape[0]):
            row[j] = 0.0
        row[X] = row[Y] = AWAY
        if i < vehicles:
            first = after + 3 * i
            row[X], row[Y], row[HEADING] = point_at(line, numbers[first + 1], numbers[first])
            row[SPEED], row[BODY_LENGTH], row[BODY_WIDTH] = numbers[first + 2], TRAFFIC_BODY[0], TRAFFIC_BODY[1]
            follow_lane(row, line, 0.0, 0.0)
