"""highway-env's road and road network along a reference line."""

from __future__ import annotations

from typing import Any

import numpy as np
from highway_env.road.lane import AbstractLane, CircularLane, LineType, StraightLane
from highway_env.road.road import Road, RoadNetwork

from shared_control_env.core.world.collision import find_collisions
from shared_control_env.core.world.road import KAPPA, LENGTH, PSI0, RIGHT, S0, point_at
from shared_control_env.envs.highway.vehicles import write_row


class LineRoad(Road):
    """A road along a reference line. Its collisions are checked in the core.

    highway-env checks every pair of vehicles in Python at every step. As in highway-env, a collision is a present
    overlap. Unlike highway-env, vehicles that are about to collide are not displaced.

    Args:
        line: reference line, shape (n, 12).
        lanes: number of lanes.
        lane_width: width of a lane [m].
        options: further arguments of highway-env's ``Road``.

    Attributes:
        line: reference line, shape (n, 12).
        rows: all vehicles as rows of the traffic array, the ego first, shape (n_vehicles, 8).
        lane_width: width of a lane [m].
        time: time since the start of the episode [s].
        frames: number of simulation steps so far.
        dt: simulation step [s].
        plans: plans of the vehicles but the ego, records of :class:`core.parameters.TrafficParameters`, shape (n,).
    """

    def __init__(self, line: np.ndarray, lanes: int, lane_width: float, **options: Any) -> None:
        super().__init__(network=road_network(line, lanes, lane_width), **options)
        self.line, self.lane_width = line, lane_width
        self.time, self.frames, self.dt = 0.0, 0, 0.0
        self.plans: np.ndarray | None = None
        self.rows = np.zeros((0, 8))

    def update_rows(self) -> np.ndarray:
        """Write the present state of the vehicles into ``rows``, and return the array."""
        if len(self.rows) != len(self.vehicles):
            self.rows = np.zeros((len(self.vehicles), 8))
            self._crashed = np.zeros(len(self.vehicles), dtype=bool)
        for row, vehicle in zip(self.rows, self.vehicles, strict=True):
            write_row(vehicle, row)
        return self.rows

    def pass_frames(self, frames: int, dt: float) -> None:
        """Advance the time of the road.

        Args:
            frames: number of simulation steps.
            dt: simulation step [s].
        """
        self.frames += frames
        self.time = self.frames * dt  # a product, because a running sum would drift

    def step(self, dt: float) -> None:
        """Move every vehicle by one simulation step, then mark vehicles that overlap as crashed.

        Args:
            dt: simulation step [s].
        """
        for vehicle in self.vehicles:
            vehicle.step(dt)
        self.pass_frames(1, dt)
        self.mark_collisions()

    def mark_collisions(self) -> None:
        """Mark vehicles that overlap as crashed."""
        rows = self.update_rows()
        self._crashed[:] = False
        if find_collisions(rows, self._crashed):
            for index in np.flatnonzero(self._crashed):
                self.vehicles[index].crashed = True


def road_network(line: np.ndarray, lanes: int, lane_width: float) -> RoadNetwork:
    """Network of parallel lanes along a reference line. The reference line is the centre of lane 0.

    highway-env's ``lateral`` equals d of the road frame minus the lateral position of the lane's centre, because
    highway-env's formulas do not depend on whether y points up or down.

    Args:
        line: reference line, shape (n, 12).
        lanes: number of lanes, counted from the right.
        lane_width: width of a lane [m].

    Returns:
        Network with the nodes "0", "1", ... at the ends of the segments.
    """
    network = RoadNetwork()
    first = round((line[0, RIGHT] + 0.5 * lane_width) / lane_width)  # not 0 where the line is not the rightmost lane
    for i, row in enumerate(line):
        for lane in range(lanes):
            right = LineType.CONTINUOUS_LINE if lane == 0 else LineType.NONE
            left = LineType.CONTINUOUS_LINE if lane == lanes - 1 else LineType.STRIPED
            if row[KAPPA] and right == LineType.CONTINUOUS_LINE:
                right = LineType.CONTINUOUS
            if row[KAPPA] and left == LineType.CONTINUOUS_LINE:
                left = LineType.CONTINUOUS
            d = (first + lane) * lane_width
            network.add_lane(str(i), str(i + 1), _lane(line, row, d, lane_width, (right, left)))
    return network


def _lane(line: np.ndarray, row: np.ndarray, d: float, width: float, line_types: tuple[int, int]) -> AbstractLane:
    """One lane of one segment, at lateral offset d [m] from the reference line."""
    common = {"width": width, "line_types": line_types, "speed_limit": None}
    begin, kappa = np.array(point_at(line, row[S0], d)[:2]), row[KAPPA]
    psi0, length = row[PSI0], row[LENGTH]
    if kappa == 0.0:
        end = begin + length * np.array([np.cos(psi0), np.sin(psi0)])
        return StraightLane(begin, end, **common)
    # "clockwise" refers to a screen with y downwards. It means growing angles, which are left turns in this frame.
    turn = 1.0 if kappa > 0.0 else -1.0
    radius = turn / kappa - turn * d
    centre = begin + turn * radius * np.array([-np.sin(psi0), np.cos(psi0)])
    start_phase = psi0 - turn * np.pi / 2
    end_phase = start_phase + kappa * length
    return CircularLane(centre, radius, start_phase, end_phase, clockwise=turn > 0.0, **common)
