"""Vehicles on highway-env's road: the ego with the dynamics of the core, and traffic that follows its lane."""

from __future__ import annotations

import sys
from importlib import import_module
from typing import Any

import numpy as np
from highway_env.road.lane import AbstractLane
from highway_env.road.road import LaneIndex, Road
from highway_env.vehicle.graphics import VehicleGraphics
from highway_env.vehicle.kinematics import Vehicle

from shared_control_env.core import entries
from shared_control_env.core.parameters import TrafficParameters
from shared_control_env.core.records import (
    ACCELERATION,
    BODY_LENGTH,
    BODY_WIDTH,
    HEADING,
    SPEED,
    YAW_RATE,
    X,
    Y,
    pack,
)
from shared_control_env.envs.settings import OWN_TRAFFIC


class ArrayVehicle(Vehicle):
    """A highway-env vehicle whose pose and speed are stored in one array that compiled functions advance.

    highway-env reads and assigns ``position``, ``heading`` and ``speed``; they are views of the array. The
    lane is looked up when it is read, not at every step.

    Args:
        road: road of the vehicle.
        position: position [x, y], shape (2,) [m].
        heading: heading [rad].
        speed: speed [m/s].

    Attributes:
        array: state of the vehicle; the subclass defines its entries.
    """

    _POSE: tuple[int, int, int, int]  # indices of x, y, heading and speed in the array
    _SIZE: int

    def __init__(self, road: Road, position: Any, heading: float = 0.0, speed: float = 0.0) -> None:
        self.array = np.zeros(self._SIZE)
        super().__init__(road, position, heading, speed)

    @property
    def position(self) -> np.ndarray:
        return self.array[self._POSE[0] : self._POSE[1] + 1]

    @position.setter
    def position(self, value: Any) -> None:
        self.array[self._POSE[0] : self._POSE[1] + 1] = value

    @property
    def heading(self) -> float:
        return float(self.array[self._POSE[2]])

    @heading.setter
    def heading(self, value: float) -> None:
        self.array[self._POSE[2]] = value

    @property
    def speed(self) -> float:
        return float(self.array[self._POSE[3]])

    @speed.setter
    def speed(self, value: float) -> None:
        self.array[self._POSE[3]] = value

    @property
    def lane_index(self) -> LaneIndex:
        return self.road.network.get_closest_lane_index(self.position, self.heading)

    @lane_index.setter
    def lane_index(self, value: LaneIndex) -> None:
        """Nothing: the lane follows from the position."""

    @property
    def lane(self) -> AbstractLane:
        return self.road.network.get_lane(self.lane_index)

    @lane.setter
    def lane(self, value: AbstractLane) -> None:
        """Nothing: the lane follows from the position."""


class EgoVehicle(ArrayVehicle):
    """The ego. ``array`` is the state [x, y, psi, v_x, v_y, r] of the dynamic bicycle model (Eq. 11).

    Args:
        road: road of the vehicle.
        state: initial state [x, y, psi, v_x, v_y, r], shape (6,) [m, rad, m/s, rad/s].
        target_speed: target speed [m/s].
        parameters: record of :class:`core.parameters.Parameters`.

    Attributes:
        realised: output of the actuators [m/s^2, rad], shape (2,).
        target_speed: target speed [m/s]; highway-env's MOBIL expects this attribute of every vehicle.
        parameters: record of :class:`core.parameters.Parameters`.
    """

    _POSE = (0, 1, 2, 3)
    _SIZE = 6

    def __init__(self, road: Road, state: np.ndarray, target_speed: float, parameters: np.ndarray) -> None:
        self.parameters = parameters
        self.LENGTH, self.WIDTH = (float(parameters["vehicle"][name]) for name in ("length", "width"))
        super().__init__(road, state[:2], float(state[2]), float(state[3]))
        self.array[:] = state
        self.action = {"acceleration": 0.0, "steering": 0.0}
        self.target_speed = target_speed
        self.color = VehicleGraphics.EGO_COLOR
        self.realised, self._command = np.zeros(2), np.zeros(2)

    @property
    def velocity(self) -> np.ndarray:
        """Velocity of the centre of mass in the Cartesian frame, slip included, shape (2,) [m/s]."""
        _, _, psi, v_x, v_y, _ = self.array
        return np.array([v_x * np.cos(psi) - v_y * np.sin(psi), v_x * np.sin(psi) + v_y * np.cos(psi)])

    def step(self, dt: float) -> None:
        """Advance actuators and dynamics by one simulation step under the stored action.

        Args:
            dt: simulation step [s].
        """
        u = self._command
        u[0], u[1] = self.action["acceleration"], self.action["steering"]
        entries.step_plant(self.array, u, self.realised, dt, self.parameters)


class LaneFollower(ArrayVehicle):
    """A vehicle that follows its lane and its plan (:mod:`core.world.traffic`). ``array`` is its row of the traffic.

    Args:
        road: road of the vehicle.
        position: position [x, y], shape (2,) [m].
        heading: heading [rad].
        speed: speed [m/s].

    Attributes:
        plan: record of :class:`core.parameters.TrafficParameters`; constant speed by default, as in the paper's cases.
    """

    _POSE = (X, Y, HEADING, SPEED)
    _SIZE = 8

    def __init__(self, road: Road, position: Any, heading: float = 0.0, speed: float = 0.0) -> None:
        super().__init__(road, position, heading, speed)
        self.array[BODY_LENGTH], self.array[BODY_WIDTH] = self.LENGTH, self.WIDTH
        self.plan, self._work = pack(TrafficParameters()), np.zeros((3, 8))
        self.step(0.0)

    def take(self, row: np.ndarray) -> None:
        """Take over a state with its body.

        Args:
            row: row of the traffic array, shape (8,).
        """
        self.array[:] = row
        self.LENGTH, self.WIDTH = float(row[BODY_LENGTH]), float(row[BODY_WIDTH])

    def act(self, action: dict | str | None = None) -> None:
        """Decide on the acceleration according to the plan.

        Args:
            action: ignored; an argument of highway-env's interface.
        """
        road = self.road
        if self.plan["track"]:
            me, traffic = road.vehicles.index(self) - 1, road.rows[1:]
            entries.decide(me, road.plans, traffic, road.rows[0], road.frames, road.dt, road.line, self._work)
            self.array[ACCELERATION] = traffic[me, ACCELERATION]
            return
        entries.decide_acceleration(self.array, self.plan, road.time, road.rows[0], road.rows[1:], road.line)

    def step(self, dt: float) -> None:
        """Advance along the lane by one simulation step.

        Args:
            dt: simulation step [s].
        """
        if self.plan["track"]:
            road = self.road
            me, traffic = road.vehicles.index(self) - 1, road.rows[1:]
            entries.advance(me, road.plans, traffic, road.rows[0], road.frames, dt, road.line)
            self.array[:] = traffic[me]
            return
        entries.move_along(self.array, self.plan, self.road.line, self.road.time, dt)


def vehicle_class(path: str) -> type[Vehicle]:
    """Find the class of the other vehicles by its path, such as ``highway_env.vehicle.behavior.IDMVehicle``.

    Settings may come from an untrusted file, so a path must not import arbitrary modules. The class must be in
    highway-env, in this package, or in a module that the program has already imported.

    Args:
        path: path of the class, ``module.name``.

    Raises:
        ValueError: if there is no such class, or the class is not a vehicle class of highway-env.
    """
    module, _, name = path.rpartition(".")
    what = f"config['other_vehicles_type'] = {path!r}"
    if module.split(".")[0] in ("highway_env", "shared_control_env"):
        try:
            found = getattr(import_module(module), name, None)
        except ImportError as error:
            raise ValueError(f"{what} is not the path of a class: {error}") from None
    elif module in sys.modules:
        found = getattr(sys.modules[module], name, None)
    else:
        raise ValueError(
            f"{what} must be the path of a class, such as {OWN_TRAFFIC!r}; its module {module!r} is neither "
            "highway-env's nor imported already"
        )
    unfit = found in (ArrayVehicle, EgoVehicle)
    if not isinstance(found, type) or not issubclass(found, Vehicle) or unfit:
        raise ValueError(f"{what} must be the path of a class of vehicles, such as {OWN_TRAFFIC!r}; it is {found!r}")
    return found


def write_row(vehicle: Vehicle, row: np.ndarray) -> None:
    """Write a highway-env vehicle of any class into a row of the traffic array.

    For a kinematic vehicle, acceleration and yaw rate follow from its present action.

    Args:
        vehicle: the vehicle.
        row: row to write, columns as in :mod:`core.records`, shape (8,).
    """
    if isinstance(vehicle, LaneFollower):
        row[:] = vehicle.array
        return
    if isinstance(vehicle, EgoVehicle):
        row[X], row[Y], row[HEADING], row[SPEED], _, row[YAW_RATE] = vehicle.array.tolist()
        row[ACCELERATION] = vehicle.action["acceleration"]
        row[BODY_LENGTH], row[BODY_WIDTH] = vehicle.LENGTH, vehicle.WIDTH
        return
    row[X], row[Y] = vehicle.position
    row[HEADING], row[SPEED] = vehicle.heading, vehicle.speed
    row[ACCELERATION] = vehicle.action["acceleration"]
    slip = np.arctan(0.5 * np.tan(vehicle.action["steering"]))
    row[YAW_RATE] = vehicle.speed * np.sin(slip) / (0.5 * vehicle.LENGTH)
    row[BODY_LENGTH], row[BODY_WIDTH] = vehicle.LENGTH, vehicle.WIDTH
