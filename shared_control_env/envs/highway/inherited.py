"""What highway-env's environments offer beside reset, step and render, and what of it makes sense here."""

from __future__ import annotations

from typing import Any

from highway_env.envs.common.abstract import AbstractEnv
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.kinematics import Vehicle

from shared_control_env.envs.highway.vehicles import EgoVehicle, LaneFollower


class HighwayEnv(AbstractEnv):
    """highway-env's base, whose methods either act or say why they cannot.

    ``simplify``, ``set_vehicle_field`` and ``call_vehicle_method`` return changed copies, for planning, as there.
    """

    @property
    def vehicle(self) -> Any:
        """The ego."""
        return self.controlled_vehicles[0] if self.controlled_vehicles else None

    @vehicle.setter
    def vehicle(self, vehicle: Vehicle) -> None:
        if not isinstance(vehicle, EgoVehicle):
            raise ValueError(f"vehicle = {vehicle!r} must be an EgoVehicle, which has the core's dynamics")
        self.controlled_vehicles = [vehicle]

    def set_record_video_wrapper(self, wrapper: Any) -> None:
        """Have a ``RecordVideo`` record every simulation step instead of every decision.

        Args:
            wrapper: gymnasium's ``RecordVideo`` around this environment; its frame rate is set.
        """
        if not hasattr(wrapper, "frames_per_sec") or not hasattr(wrapper, "_capture_frame"):
            raise ValueError(f"wrapper = {wrapper!r} must be a gymnasium.wrappers.RecordVideo")
        self._record_video_wrapper = wrapper
        self.update_metadata()

    def get_available_actions(self) -> list[int]:
        """Refused: there are no discrete actions to list."""
        raise ValueError(
            "get_available_actions(): the action is continuous, see action_space; there is no list of actions"
        )

    def to_finite_mdp(self) -> Any:
        """Refused: there is no finite form of a continuous task."""
        raise ValueError("to_finite_mdp(): state and action are continuous; there is no finite Markov decision process")

    def change_vehicles(self, vehicle_class_path: str) -> AbstractEnv:
        """Refused: the class of the other vehicles is a setting."""
        raise ValueError(
            f"change_vehicles({vehicle_class_path!r}): pass config={{'other_vehicles_type': ...}} to gym.make or reset"
        )

    def set_preferred_lane(self, preferred_lane: int | None = None) -> AbstractEnv:
        """A copy in which highway-env's own vehicles prefer a lane; refused where there is none of them."""
        self._require_idm("set_preferred_lane")
        return super().set_preferred_lane(preferred_lane)

    def set_route_at_intersection(self, _to: str) -> AbstractEnv:
        """A copy in which highway-env's own vehicles have a route; refused where there is none of them."""
        self._require_idm("set_route_at_intersection")
        return super().set_route_at_intersection(_to)

    def randomize_behavior(self) -> AbstractEnv:
        """A copy in which highway-env's own vehicles behave differently; refused where there is none of them."""
        self._require_idm("randomize_behavior")
        return super().randomize_behavior()

    def set_vehicle_field(self, args: tuple[str, object]) -> AbstractEnv:
        """A copy in which a field of the other vehicles is set; refused where they have no such field."""
        self._require_attribute("set_vehicle_field", args[0])
        own = any(isinstance(vehicle, LaneFollower) for vehicle in self.road.vehicles)
        if own and args[0] not in ("position", "heading", "speed"):
            raise ValueError(
                f"set_vehicle_field(): {args[0]!r} of this traffic would not act; position, heading and speed do"
            )
        return super().set_vehicle_field(args)

    def call_vehicle_method(self, args: tuple[str, tuple[object]]) -> AbstractEnv:
        """A copy in which the vehicles are what a method of theirs returns; refused where none has it."""
        self._require_attribute("call_vehicle_method", args[0])
        return super().call_vehicle_method(args)

    def _require_idm(self, method: str) -> None:
        if not any(isinstance(vehicle, IDMVehicle) for vehicle in self.road.vehicles):
            raise ValueError(
                f"{method}() changes vehicles of highway-env's IDMVehicle, and there is none: set "
                "config['other_vehicles_type'], or the vehicles' plans in config['vehicles']"
            )

    def _require_attribute(self, method: str, name: str) -> None:
        others = [vehicle for vehicle in self.road.vehicles if vehicle is not self.vehicle]
        if not others or not all(hasattr(vehicle, name) for vehicle in others):
            raise ValueError(
                f"{method}(): {name!r} is no attribute of all the other vehicles, of which there are {len(others)}"
            )
