"""Methods of highway-env's environments other than reset, step and render: some apply here, others raise an error."""

from __future__ import annotations

from typing import Any

from highway_env.envs.common.abstract import AbstractEnv
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.kinematics import Vehicle

from shared_control_env.envs.highway.vehicles import EgoVehicle, LaneFollower


class HighwayEnv(AbstractEnv):
    """highway-env's base class. Each inherited method either works or raises an error that states the reason.

    ``simplify``, ``set_vehicle_field`` and ``call_vehicle_method`` return changed copies for planning, as in
    highway-env.
    """

    @property
    def vehicle(self) -> Any:
        """The ego vehicle; None while there is none."""
        return self.controlled_vehicles[0] if self.controlled_vehicles else None

    @vehicle.setter
    def vehicle(self, vehicle: Vehicle) -> None:
        if not isinstance(vehicle, EgoVehicle):
            raise ValueError(f"vehicle = {vehicle!r} must be an EgoVehicle, which has the core's dynamics")
        self.controlled_vehicles = [vehicle]

    def set_record_video_wrapper(self, wrapper: Any) -> None:
        """Let a ``RecordVideo`` record every simulation step instead of every decision.

        Args:
            wrapper: gymnasium's ``RecordVideo`` around this environment; its frame rate is set.

        Raises:
            ValueError: if the wrapper is not a ``RecordVideo``.
        """
        if not hasattr(wrapper, "frames_per_sec") or not hasattr(wrapper, "_capture_frame"):
            raise ValueError(f"wrapper = {wrapper!r} must be a gymnasium.wrappers.RecordVideo")
        self._record_video_wrapper = wrapper
        self.update_metadata()

    def get_available_actions(self) -> list[int]:
        """Always raises ValueError, because there are no discrete actions to list."""
        raise ValueError(
            "get_available_actions(): the action is continuous, see action_space; there is no list of actions"
        )

    def to_finite_mdp(self) -> Any:
        """Always raises ValueError, because the task is continuous and has no finite form."""
        raise ValueError("to_finite_mdp(): state and action are continuous; there is no finite Markov decision process")

    def change_vehicles(self, vehicle_class_path: str) -> AbstractEnv:
        """Always raises ValueError, because the class of the other vehicles is a setting.

        Args:
            vehicle_class_path: path of a vehicle class.

        Raises:
            ValueError: always.
        """
        raise ValueError(
            f"change_vehicles({vehicle_class_path!r}): pass config={{'other_vehicles_type': ...}} to gym.make or reset"
        )

    def set_preferred_lane(self, preferred_lane: int | None = None) -> AbstractEnv:
        """A copy of the environment in which vehicles of highway-env's class IDMVehicle prefer a lane.

        Args:
            preferred_lane: index of the lane; None to change nothing.

        Raises:
            ValueError: if there is no such vehicle.
        """
        self._require_idm("set_preferred_lane")
        return super().set_preferred_lane(preferred_lane)

    def set_route_at_intersection(self, _to: str) -> AbstractEnv:
        """A copy of the environment in which vehicles of highway-env's class IDMVehicle have a route.

        Args:
            _to: destination, as in highway-env.

        Raises:
            ValueError: if there is no such vehicle.
        """
        self._require_idm("set_route_at_intersection")
        return super().set_route_at_intersection(_to)

    def randomize_behavior(self) -> AbstractEnv:
        """A copy of the environment in which the behaviour of vehicles of highway-env's class IDMVehicle is randomised.

        Raises:
            ValueError: if there is no such vehicle.
        """
        self._require_idm("randomize_behavior")
        return super().randomize_behavior()

    def set_vehicle_field(self, args: tuple[str, object]) -> AbstractEnv:
        """A copy of the environment in which a field of the other vehicles is set.

        Args:
            args: name of the field, and its value.

        Raises:
            ValueError: if the other vehicles have no such field, or the field would have no effect.
        """
        self._require_attribute("set_vehicle_field", args[0])
        own = any(isinstance(vehicle, LaneFollower) for vehicle in self.road.vehicles)
        if own and args[0] not in ("position", "heading", "speed"):
            raise ValueError(
                f"set_vehicle_field(): {args[0]!r} of this traffic would not act; position, heading and speed do"
            )
        return super().set_vehicle_field(args)

    def call_vehicle_method(self, args: tuple[str, tuple[object]]) -> AbstractEnv:
        """A copy of the environment in which each vehicle with a method is replaced by the result of that method.

        Args:
            args: name of the method, and its arguments.

        Raises:
            ValueError: if the other vehicles have no such method.
        """
        self._require_attribute("call_vehicle_method", args[0])
        return super().call_vehicle_method(args)

    def _require_idm(self, method: str) -> None:
        if not any(isinstance(vehicle, IDMVehicle) for vehicle in self.road.vehicles):
            raise ValueError(
                f"{method}() changes vehicles of highway-env's IDMVehicle, but there is none: set "
                "config['other_vehicles_type'], or the vehicles' plans in config['vehicles']"
            )

    def _require_attribute(self, method: str, name: str) -> None:
        others = [vehicle for vehicle in self.road.vehicles if vehicle is not self.vehicle]
        if not others or not all(hasattr(vehicle, name) for vehicle in others):
            raise ValueError(
                f"{method}(): {name!r} is no attribute of all the other vehicles, of which there are {len(others)}"
            )
