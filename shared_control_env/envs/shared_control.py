"""The environment: a degraded automation and a driver share one car on a highway-env road."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from highway_env import utils
from highway_env.envs.common.abstract import AbstractEnv
from highway_env.vehicle.graphics import VehicleGraphics

from shared_control_env.controllers.automation import Automation
from shared_control_env.core import delaunay, single
from shared_control_env.core.info import INFO, as_dict
from shared_control_env.core.records import FAULT_MEMORY, HEADING, MEMORY, SCENE, SIGNALS, SPEED, X, Y
from shared_control_env.core.reward import TERMS
from shared_control_env.core.safe_area import triangulate
from shared_control_env.envs import config as configuration
from shared_control_env.envs.action import SlotAction
from shared_control_env.envs.episode import draw_episode
from shared_control_env.envs.graphics import SharedControlViewer
from shared_control_env.envs.observation import DriverObservation
from shared_control_env.envs.roads import LineRoad
from shared_control_env.envs.situation import Situation, start_of
from shared_control_env.envs.vehicles import EgoVehicle, LaneFollower


class SharedControlEnv(AbstractEnv):
    """Human-machine shared control of one car whose automation degrades.

    A step runs the signals of one time step k: the automation's desired command u_a,des and its degraded
    form u_a,f are known before it; the action brings the driver's u_h,des and the authority alpha_a; law, driver
    lag and sum follow; the vehicle moves to k + 1, where the next scene is perceived and planned for.

    The Cartesian frame is ISO 8855: x forward, y to the left, angles and steering positive to the left, as in
    the paper. highway-env's formulas hold in it unchanged; only its pictures, which draw y downwards, are
    flipped by the viewer.

    The bare environment's action has both slots open (:class:`SlotAction`); the wrappers ``AuthorityLimiter`` and
    ``DriverModel`` bind them.

    Attributes:
        settings: checked settings; ``config`` is the same as a plain dict.
        episode: settings of the present episode, with all that is random drawn.
        parameters: record of :class:`Parameters` that the core runs with.
        scene: record of :data:`records.SCENE`, the present scene with its safe area.
        signals: record of :data:`records.SIGNALS`: planned for the present scene after a reset or step.
        memory: record of :data:`records.MEMORY`.
        command_limits: largest acceleration and steering [m/s^2, rad], shape (2,).
        automation: any object with ``reset()`` and ``act(scene) -> Solution``.
        observation: the last observation.
        noted: record of :data:`info.INFO` of the last step, or reset.
    """

    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 20}

    def __init__(self, config: dict[str, Any] | None = None, render_mode: str | None = None) -> None:
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ValueError(f"render_mode = {render_mode!r} must be one of {self.metadata['render_modes']} or None")
        # highway-env updates metadata, which is the class's own dict, at every reset.
        self.metadata = dict(type(self).metadata)
        self.scene = np.zeros((), SCENE)
        self.signals = np.zeros((), SIGNALS)
        self.memory = np.zeros((), MEMORY)
        self.noted = np.zeros((), INFO)
        self._triangulation = np.zeros((), delaunay.WORKSPACE)
        super().__init__(config=config, render_mode=render_mode)

    @classmethod
    def default_config(cls) -> dict[str, Any]:
        """All settings with their defaults (:class:`configuration.Settings`)."""
        return configuration.plain(configuration.Settings())

    def configure(self, config: dict[str, Any] | None) -> None:
        """Merge changes into the config, nested dicts included, and check the whole.

        Raises:
            ValueError: naming the key and the nearest valid one, or the field, its value and its range.
        """
        merged = configuration.merge(self.config, config or {})
        if merged["offscreen_rendering"] is None:
            merged["offscreen_rendering"] = self.render_mode != "human"
        self.settings = configuration.check(merged)
        self._vehicle_class = self._checked_vehicle_class()
        self.config = configuration.plain(self.settings)

    def _checked_vehicle_class(self) -> Any:
        path = self.settings.other_vehicles_type
        try:
            return utils.class_from_path(path)
        except (ValueError, ImportError, AttributeError) as error:
            raise ValueError(
                f"config['other_vehicles_type'] = {path!r} is not the path of a class, such as "
                f"{configuration.Settings().other_vehicles_type!r} ({error})"
            ) from None

    def define_spaces(self) -> None:
        """Build action and observation types once: new spaces would forget the user's seed."""
        if self.action_space is None:
            self.observation_type = DriverObservation(self)
            self.action_type = SlotAction(self)
            self.observation_space = self.observation_type.space()
            self.action_space = self.action_type.space()

    def update_metadata(self, video_real_time_ratio: float = 1.0) -> None:
        """One frame a decision: videos run at the speed of the drive."""
        self.metadata["render_fps"] = round(video_real_time_ratio * self.settings.policy_frequency)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: of the environment's generator.
            options: ``{"config": {...}}`` changes settings from this episode on, as in highway-env.

        Returns:
            Observation and info. The signals in info are those planned for k = 0; nothing is applied yet.

        Raises:
            ValueError: for unknown options or wrong settings.
        """
        if options is not None and not isinstance(options, dict):
            raise ValueError(f"options = {options!r} must be a dict")
        unknown = set(options or {}) - {"config"}
        if unknown:
            raise ValueError(f"options has the unknown key(s) {sorted(unknown)}; valid is 'config'")
        if options and "config" in options:
            self.configure(options["config"])
        gym.Env.reset(self, seed=seed)
        self.update_metadata()
        self.steps, self.done = 0, False
        self._reset()
        self._perceive_and_plan()
        self.observation = self.observation_type.observe()
        info = self._info()
        if self.render_mode == "human":
            self.render()
        return self.observation.copy(), info

    def _reset(self) -> None:
        """Draw the episode; make road, vehicles and controllers from its settings."""
        settings = self.episode = draw_episode(self.settings, self.np_random)
        start = start_of(settings)
        self.line, self.faults, self.parameters = start.line, start.faults, start.parameters
        self._fault_memories = np.zeros(len(self.faults), FAULT_MEMORY)
        self.scene["felt"] = 0.0
        self.command_limits = np.array(list(self.parameters["limits"][()]))
        self.road = LineRoad(
            self.line,
            settings.road.lanes,
            settings.road.lane_width,
            np_random=self.np_random,
            neighbour_vehicles_connected_lanes=settings.neighbour_vehicles_connected_lanes,
        )
        self._place_vehicles(start)
        self.road.update_rows()
        self._corners = np.zeros((len(self.traffic), 4, 2))
        self._terms = np.zeros(len(TERMS))
        self._path = np.zeros((settings.steps + 1, 2))
        self.automation = Automation(self.parameters)
        self.automation.reset()
        single.clear_memory(self.memory)
        single.clear_signals(self.signals)

    def _place_vehicles(self, start: Situation) -> None:
        """Put the ego and the other vehicles on the road."""
        ego = EgoVehicle(self.road, start.ego, self.episode.task.target_speed, self.parameters)
        ego.color = VehicleGraphics.EGO_COLOR
        self.controlled_vehicles = [ego]
        self.road.vehicles = [ego]
        for (x, y, heading, speed), plan in zip(start.traffic[:, [X, Y, HEADING, SPEED]], start.plans, strict=True):
            vehicle = self._vehicle_class(self.road, (x, y), heading=float(heading), speed=float(speed))
            if isinstance(vehicle, LaneFollower):
                vehicle.plan[()] = plan
            self.road.vehicles.append(vehicle)

    def _perceive_and_plan(self) -> None:
        """Perceive the scene, find its safe area, let the automation decide, degrade it, assess the risk."""
        p, scene, signals, state = self.parameters, self.scene, self.signals, self.vehicle.array
        # An episode may be driven on past its end; the picture's path stays within the duration.
        self._path[min(self.steps, len(self._path) - 1)] = state[:2]
        count = single.sense(self.steps, state, self.traffic, self.line, p, scene, self._corners)
        if count <= delaunay.MAX_HOLES:
            single.find_area(self._corners, count, p, scene, self._triangulation)
        else:
            start, end, low, high = scene["region"].tolist()
            single.search(triangulate(start, end, low, high, self._corners[:count]), p, scene)
        y, v_target = single.misjudge(scene, self.faults, p, signals)
        self.solution = self.automation.act(scene)
        single.judge_rightly(scene, y, v_target)
        signals["u_a_des"] = self.solution.command
        signals["status"], signals["iterations"] = self.solution.status, self.solution.iterations
        signals["residual"] = self.solution.dual_residual
        single.monitor(scene, self.traffic, self.line, self.faults, self._fault_memories, p, signals)

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Drive one time step.

        Args:
            action: see :class:`SlotAction`.

        Returns:
            Observation, reward, terminated (collision or off the road), truncated (duration) and info.

        Raises:
            ValueError: if the action is malformed; nothing has moved then.
        """
        command, alpha_a = self.action_type.decode(action)
        last_a, previous_s = float(self.memory["u"][0]), float(self.scene["z"][0])
        single.blend(command, alpha_a, self.parameters, self.scene, self.memory, self.signals)
        info = self.noted = self._note_signals()
        self._simulate(self.signals["u"])
        self._perceive_and_plan()
        reward, terminated = single.conclude(
            previous_s,
            last_a,
            bool(self.vehicle.crashed),
            self.scene,
            self.signals,
            self.parameters,
            self.memory,
            self._terms,
            info,
        )
        self.observation = self.observation_type.observe()
        if self.render_mode == "human":
            self.render()
        return self.observation.copy(), reward, terminated, self._is_truncated(), as_dict(info)

    def _simulate(self, u: np.ndarray) -> None:
        """Move all vehicles through one decision's simulation steps under a constant command."""
        self.vehicle.act({"acceleration": float(u[0]), "steering": float(u[1])})
        frames = self.settings.simulation_frequency // self.settings.policy_frequency
        for _ in range(frames):
            self.road.act()
            self.road.step(1.0 / self.settings.simulation_frequency)
        self.steps += 1

    def _is_truncated(self) -> bool:
        """End of the duration, counted in whole steps."""
        return self.steps >= self.settings.steps

    def _note_signals(self) -> np.ndarray:
        """A new record of info that holds the signals of the present time step."""
        info = np.zeros((), INFO)
        single.note_signals(self.scene, self.signals, self.faults, self.automation.failures, info)
        return info

    def _info(self, obs: Any = None, action: Any = None) -> dict[str, Any]:
        """Info of a reset; highway-env's own also carries an unseeded sample of the action, which is left out."""
        info = self.noted = self._note_signals()
        single.note_start(self.scene, self.parameters, self.memory, info)
        return as_dict(info)

    @property
    def traffic(self) -> np.ndarray:
        """The other vehicles as rows of :mod:`records`' traffic columns, shape (n, 8)."""
        return self.road.rows[1:]

    def show(
        self,
        state: np.ndarray,
        traffic: np.ndarray,
        scene: np.ndarray,
        signals: np.ndarray,
        noted: np.ndarray,
        path: np.ndarray,
    ) -> None:
        """Take over another environment's situation of the same settings, to draw it.

        Args:
            state: of the ego, shape (6,).
            traffic: of the other vehicles, shape (n, 8).
            scene, signals, noted: records.
            path: positions of the ego so far, shape (k + 1, 2).
        """
        self.vehicle.array[:] = state
        for vehicle, row in zip(self.road.vehicles[1:], traffic, strict=True):
            vehicle.array[:] = row
        self.scene[()], self.signals[()], self.noted[()] = scene, signals, noted
        self.steps = len(path) - 1
        self._path[: len(path)] = path

    @property
    def path(self) -> np.ndarray:
        """Cartesian positions of the ego so far, shape (k + 1, 2) [m]."""
        return self._path[: self.steps + 1]

    def render(self) -> np.ndarray | None:
        """Draw the present scene: a frame in ``rgb_array`` mode, the window in ``human`` mode."""
        if self.render_mode is None:
            return super().render()
        if self.viewer is None:
            self.viewer = SharedControlViewer(self)
        self.viewer.display()
        if self.render_mode == "human":
            self.viewer.handle_events()
            return None
        return self.viewer.get_image()
