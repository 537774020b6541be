"""The environment: a degraded automation and a driver share one car on a highway-env road."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from highway_env.vehicle.graphics import VehicleGraphics

from shared_control_env.controllers.automation import Automation, Planner
from shared_control_env.controllers.driver import checked_command
from shared_control_env.controllers.solution import Solution
from shared_control_env.core import delaunay, single
from shared_control_env.core.info import INFO, as_dict
from shared_control_env.core.records import FAULT_MEMORY, HEADING, MEMORY, SCENE, SIGNALS, SPEED, X, Y
from shared_control_env.core.reward import TERMS
from shared_control_env.core.safe_area import triangulate
from shared_control_env.envs import settings as configuration
from shared_control_env.envs.action import SlotAction
from shared_control_env.envs.episode import draw_episode
from shared_control_env.envs.graphics import SharedControlViewer
from shared_control_env.envs.inherited import HighwayEnv
from shared_control_env.envs.observation import DriverObservation
from shared_control_env.envs.roads import LineRoad
from shared_control_env.envs.seeds import checked_seed
from shared_control_env.envs.situation import Situation, start_of
from shared_control_env.envs.vehicles import EgoVehicle, LaneFollower, vehicle_class


class SharedControlEnv(HighwayEnv):
    """Human-machine shared control of one car whose automation degrades.

    A step runs the signals of one time step k: the automation's desired command u_a,des and its degraded
    form u_a,f are known before it; the action brings the driver's u_h,des and the authority alpha_a; law, driver
    lag and sum follow; the vehicle moves to k + 1, where the next scene is perceived and planned for.

    The Cartesian frame is ISO 8855: x forward, y to the left, angles and steering positive to the left, as in
    the paper. highway-env's formulas hold in it unchanged; only its pictures, which draw y downwards, are
    flipped by the viewer.

    The bare environment's action has both slots open (:class:`SlotAction`); the wrappers ``AuthorityLimiter`` and
    ``DriverModel`` bind them.

    A subclass may override ``_reward(action)``, ``_rewards(action)``, ``_is_terminated()``, ``_is_truncated()`` and
    ``_info(observation, action)``, as those of highway-env.

    Attributes:
        config: settings of the next episode as a plain dict. What is assigned to it counts from the next reset on, as
            with highway-env, and is checked there.
        settings: the same, checked.
        episode: settings of the present episode, with all that is random drawn.
        parameters: record of :class:`Parameters` that the core runs with.
        scene: record of :data:`records.SCENE`, the present scene with its safe area.
        signals: record of :data:`records.SIGNALS`: planned for the present scene after a reset or step.
        memory: record of :data:`records.MEMORY`.
        command_limits: largest acceleration and steering [m/s^2, rad], shape (2,).
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
        self.viewer: SharedControlViewer | None = None
        self._triangulation = np.zeros((), delaunay.WORKSPACE)
        self._given_automation: Planner | None = None
        self._adopted: dict[str, Any] | None = None
        self._spec: Any = None
        super().__init__(config=config, render_mode=render_mode)

    @classmethod
    def default_config(cls) -> dict[str, Any]:
        """All settings with their defaults (:class:`configuration.Settings`)."""
        return configuration.plain(configuration.Settings())

    def configure(self, config: dict[str, Any] | None) -> None:
        """Merge changes into the config, nested dicts included, and check the whole; they act from the next reset on.

        What the changes name is no longer drawn (``config["randomise"]``).

        Raises:
            ValueError: naming the key and the nearest valid one, or the field, its value and its range.
        """
        adopted = self.config if self._adopted is None else self._adopted
        assigned = configuration.difference(adopted, self.config)
        merged = configuration.change(adopted, assigned) if assigned else adopted
        merged = configuration.change(merged, {} if config is None else config)
        if merged["offscreen_rendering"] is None:
            merged["offscreen_rendering"] = self.render_mode != "human"
        settings = configuration.check(merged)
        self._check_video_speed(settings)
        self._vehicle_class = vehicle_class(settings.other_vehicles_type)
        self.settings = settings
        self.config, self._adopted = configuration.plain(settings), configuration.plain(settings)

    def _check_video_speed(self, settings: configuration.Settings) -> None:
        """Refuse another frame rate where whoever records pictures was told one and cannot be told another."""
        told = self._adopted is not None and self.render_mode == "rgb_array" and self._record_video_wrapper is None
        if told and settings.policy_frequency != self.settings.policy_frequency:
            raise ValueError(
                f"config['policy_frequency'] = {settings.policy_frequency} Hz: pictures of this environment are taken "
                f"at {self.settings.policy_frequency} Hz, which a video's recorder cannot be told to change; make a "
                "new environment, or hand the recorder to set_record_video_wrapper()"
            )

    def define_spaces(self) -> None:
        """Build action and observation types once: new spaces would forget the user's seed."""
        if self.action_space is None:
            self.observation_type = DriverObservation(self)
            self.action_type = SlotAction(self)
            self.observation_space = self.observation_type.space()
            self.action_space = self.action_type.space()

    def update_metadata(self, video_real_time_ratio: float = 1.0) -> None:
        """Frame rate at which videos run at the speed of the drive: one frame a decision, or a simulation step."""
        frequency = self.settings.policy_frequency
        if self._record_video_wrapper is not None:
            frequency = self.settings.simulation_frequency
            self._record_video_wrapper.frames_per_sec = round(video_real_time_ratio * frequency)
        self.metadata["render_fps"] = round(video_real_time_ratio * frequency)

    @property
    def automation(self) -> Planner:
        """Who decides u_a,des: the predictive controller of Eq. 12-13, or another :class:`Planner` put here.

        One that is put here stays over resets, which call its ``reset()``.
        """
        return self._automation

    @automation.setter
    def automation(self, automation: Planner) -> None:
        if isinstance(automation, type) or not isinstance(automation, Planner):
            raise ValueError(f"automation = {automation!r} must be an object with reset() and act(scene) -> Solution")
        self._automation = self._given_automation = automation

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
        if options is not None and not isinstance(options, Mapping):
            raise ValueError(f"options = {options!r} must be a dict")
        unknown = set(options or {}) - {"config"}
        if unknown:
            raise ValueError(f"options has the unknown key(s) {sorted(map(str, unknown))}; valid is 'config'")
        changes = (options or {}).get("config")
        if changes is not None or self.config != self._adopted:
            self.configure(changes)
        gym.Env.reset(self, seed=checked_seed(seed))
        self.action_type.clipping.clear()
        self.update_metadata()
        self.steps, self.time, self.done = 0, 0.0, False
        self._reset()
        if self.viewer is not None and not self.viewer.shows(self.config):
            self.viewer.close()
            self.viewer = None
        self._perceive_and_plan()
        self.observation = self.observation_type.observe()
        self.noted = self._note_signals()
        single.note_start(self.scene, self.parameters, self.memory, self.noted)
        info = self._info(self.observation)
        if self.render_mode == "human":
            self.render()
        return self.observation.copy(), info

    def _reset(self) -> None:
        """Draw the episode; make road, vehicles and controllers from its settings."""
        settings = self.episode = draw_episode(self.settings, self.np_random)
        start = start_of(settings)
        self.line, self.faults, self.parameters = start.line, start.faults, start.parameters
        self._fault_at_actuator = settings.fault_at == "actuator"
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
        self.episode_steps = settings.steps
        self._path = np.zeros((settings.steps + 1, 2))
        given = self._given_automation
        self._automation = Automation(self.parameters) if given is None else given
        self._automation.reset()
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
        try:
            self.solution = self._automation.act(scene)
        finally:
            single.judge_rightly(scene, y, v_target)
        signals["u_a_des"] = self._desired()
        signals["status"], signals["iterations"] = self.solution.status, self.solution.iterations
        signals["residual"] = self.solution.dual_residual
        single.monitor(scene, self.traffic, self.line, self.faults, self._fault_memories, p, signals)

    def _desired(self) -> np.ndarray:
        """The automation's command; one of another automation is checked, and kept within the limits."""
        if self._given_automation is None:
            return self.solution.command
        if not isinstance(self.solution, Solution):
            raise ValueError(f"automation.act() gave {self.solution!r}, which is no controllers.solution.Solution")
        return np.clip(checked_command(self.solution.command, "automation"), -self.command_limits, self.command_limits)

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
        p, scene, memory, signals = self.parameters, self.scene, self.memory, self.signals
        if self._fault_at_actuator:
            single.blend_degraded(command, alpha_a, p, self.faults, self._fault_memories, scene, memory, signals)
        else:
            single.blend(command, alpha_a, p, scene, memory, signals)
        self.noted = self._note_signals()
        self._simulate(self.signals["u"])
        self._perceive_and_plan()
        self._outcome = single.conclude(
            previous_s,
            last_a,
            bool(self.vehicle.crashed),
            self.scene,
            self.signals,
            self.parameters,
            self.memory,
            self._terms,
            self.noted,
            self.episode_steps,
        )
        self.observation = self.observation_type.observe()
        reward, terminated, truncated = self._reward(action), self._is_terminated(), self._is_truncated()
        info = self._info(self.observation, action)
        if self.render_mode == "human":
            self.render()
        return self.observation.copy(), reward, terminated, truncated, info

    def _simulate(self, u: np.ndarray) -> None:
        """Move all vehicles through one decision's simulation steps under a constant command."""
        self.vehicle.act({"acceleration": float(u[0]), "steering": float(u[1])})
        frames = self.episode.simulation_frequency // self.episode.policy_frequency
        for frame in range(frames):
            self.road.act()
            self.road.step(1.0 / self.episode.simulation_frequency)
            if self._record_video_wrapper is not None and self._record_video_wrapper.recording and frame + 1 < frames:
                self._record_video_wrapper._capture_frame()
        self.steps += 1
        self.time = self.steps / self.episode.policy_frequency

    def _reward(self, action: Any) -> float:
        """Reward of the step just taken: the weighted terms of :mod:`core.reward`."""
        return self._outcome[0]

    def _rewards(self, action: Any) -> dict[str, float]:
        """The unweighted terms of the step just taken, by name."""
        return as_dict(self.noted["rewards"])

    def _is_terminated(self) -> bool:
        """Whether the step just taken ended in a collision or off the road."""
        return self._outcome[1]

    def _is_truncated(self) -> bool:
        """End of the duration, counted in whole steps, or of the road."""
        return self._outcome[2]

    def _note_signals(self) -> np.ndarray:
        """A new record of info that holds the signals of the present time step."""
        info = np.zeros((), INFO)
        failures = int(getattr(self._automation, "failures", 0))
        single.note_signals(self.scene, self.signals, self.faults, failures, info)
        return info

    def _info(self, obs: np.ndarray, action: Any = None) -> dict[str, Any]:
        """Every signal of the step just taken, or of the reset (:data:`core.info.INFO`).

        highway-env's own also carries the action, which is an unseeded sample at a reset; it is left out.
        """
        info = as_dict(self.noted)
        if type(self)._rewards is not SharedControlEnv._rewards:
            info["rewards"] = self._rewards(action)
        return info

    def action_of(self, command: Any) -> np.ndarray:
        """The action for a driver's command, which ``step`` takes in shares of the limits.

        Args:
            command: ``[a, delta]`` [m/s^2, rad], shape (2,).

        Returns:
            float32, shape (2,); beyond [-1, 1] where the command is beyond the limits.
        """
        return (np.asarray(command, dtype=float) / self.command_limits).astype(np.float32)

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
            if not self.viewer.offscreen:
                self.viewer.handle_events()
            return None
        return self.viewer.get_image()

    @property
    def spec(self) -> Any:
        """Gymnasium's specification, with the settings in plain types, so that it can be written as JSON."""
        return self._spec

    @spec.setter
    def spec(self, spec: Any) -> None:
        if spec is not None and isinstance(spec.kwargs.get("config"), Mapping):
            spec.kwargs = {**spec.kwargs, "config": configuration.as_plain(spec.kwargs["config"])}
        self._spec = spec

    def __getstate__(self) -> dict[str, Any]:
        """State for pickles: all but windows and recorders, which belong to this process."""
        return {**self.__dict__, "viewer": None, "_record_video_wrapper": None}
