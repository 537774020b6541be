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
from shared_control_env.core import kernel
from shared_control_env.core.batch import NOT_LOADED, WORK, Setup
from shared_control_env.core.control.predictive_driver import PROGRAM
from shared_control_env.core.feedback.info import INFO, as_dict
from shared_control_env.core.feedback.observation import OBSERVATIONS
from shared_control_env.core.loading import load
from shared_control_env.core.records import HEADING, SPEED, X, Y
from shared_control_env.core.risk.corridor import new_scratch
from shared_control_env.core.risk.triangulation import MAX_HOLES, triangulate_any
from shared_control_env.envs import settings as configuration
from shared_control_env.envs.action import SlotAction
from shared_control_env.envs.episode import draw_episode
from shared_control_env.envs.highway.inherited import HighwayEnv
from shared_control_env.envs.highway.road import LineRoad
from shared_control_env.envs.highway.vehicles import EgoVehicle, LaneFollower, vehicle_class, write_row
from shared_control_env.envs.highway.viewer import SharedControlViewer
from shared_control_env.envs.observation import CoreObservation
from shared_control_env.envs.outputs import new_outputs
from shared_control_env.envs.seeds import checked_seed
from shared_control_env.envs.starts import Sizes, empty_batch, empty_starts, refresh_addresses, start_of, write_start


class SharedControlEnv(HighwayEnv):
    """Human-machine shared control of one car whose automation degrades.

    A step runs the signals of one time step k (:mod:`core.loop`): the automation's desired command u_a,des and its
    degraded form u_a,f are known before it; the action brings the driver's u_h,des and the authority alpha_a; law,
    driver lag and sum follow; the vehicle moves to k + 1, where the next scene is perceived and planned for.

    The environment is a batch of one in the kernel that steps many: one compiled call a step. highway-env's vehicles
    are views of its arrays. Where Python has to come in between (an automation of one's own, vehicles of another class,
    more than eight of them in the driving region, a recorder of every simulation step), the same calls of the loop are
    made one after the other.

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
        self.noted = np.zeros((), INFO)
        self.viewer: SharedControlViewer | None = None
        self._given_automation: Planner | None = None
        self._adopted: dict[str, Any] | None = None
        self._spec: Any = None
        self._works, self._programs = np.zeros(1, WORK), np.zeros(1, PROGRAM)
        self._commands, self._alphas = np.zeros((1, 2)), np.zeros((1, 1))
        self._taken, self._everyone = np.zeros(1, dtype=np.int64), np.ones(1, dtype=bool)
        self._rewarded, self._ends = np.zeros((1, 1)), np.zeros((1, 1), dtype=bool)
        self._calls = NOT_LOADED
        self._bound: list[Any] | None = None
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
        self._check_observation(settings)
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

    def _check_observation(self, settings: configuration.Settings) -> None:
        """Refuse another observation than the spaces were made for."""
        if self._adopted is not None and settings.observation != self.settings.observation:
            raise ValueError(
                f"config['observation']['type'] = {settings.observation.type!r}: the spaces of this environment are "
                f"made for {self.settings.observation.type!r}; make a new one"
            )

    def define_spaces(self) -> None:
        """Build action and observation types once: new spaces would forget the user's seed."""
        if self.action_space is None:
            self._observation = OBSERVATIONS[self.settings.observation.type]
            self.observation_type = CoreObservation(self, self._observation)
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
        self._advance(resetting=True)
        info = self._info(self.observation)
        if self.render_mode == "human":
            self.render()
        return self.observation.copy(), info

    def _reset(self) -> None:
        """Draw the episode; make road, vehicles and controllers from its settings."""
        settings = self.episode = draw_episode(self.settings, self.np_random)
        start = start_of(settings)
        self._batch = empty_batch(1, Sizes(len(start.faults), len(start.line), len(start.traffic)))
        write_start(start, self._batch, 0)
        self.episode_steps, self._terms = settings.steps, settings.terms
        self.command_limits = np.array(list(self.parameters["limits"][()]))
        self.road = LineRoad(
            self.line,
            settings.road.lanes,
            settings.road.lane_width,
            np_random=self.np_random,
            neighbour_vehicles_connected_lanes=settings.neighbour_vehicles_connected_lanes,
        )
        self._place_vehicles()
        self._bind()
        self._path = np.zeros((settings.steps + 1, 2))
        given = self._given_automation
        self._automation = Automation(self.parameters) if given is None else given
        self._automation.reset()

    def _place_vehicles(self) -> None:
        """Put the ego and the other vehicles on the road."""
        batch = self._batch
        ego = EgoVehicle(self.road, batch.states[0], self.episode.task.target_speed, self.parameters)
        ego.color = VehicleGraphics.EGO_COLOR
        self.controlled_vehicles = [ego]
        self.road.vehicles = [ego]
        for (x, y, heading, speed), plan in zip(
            batch.traffic[0][:, [X, Y, HEADING, SPEED]], batch.plans[0], strict=True
        ):
            vehicle = self._vehicle_class(self.road, (x, y), heading=float(heading), speed=float(speed))
            if isinstance(vehicle, LaneFollower):
                vehicle.plan[()] = plan
            self.road.vehicles.append(vehicle)

    def _bind(self) -> None:
        """Have the vehicles' arrays be those of the batch: after a reset, a copy, or when there are others."""
        ego, others = self.vehicle, self.road.vehicles[1:]
        batch = self._batch
        states, traffic = np.zeros((1, 6)), np.zeros((1, len(others), 8))
        plans = np.zeros((1, len(others)), batch.plans.dtype)
        states[0], ego.array, ego.parameters = ego.array, states[0], self.parameters
        for j, vehicle in enumerate(others):
            if isinstance(vehicle, LaneFollower):
                plan = plans[0, j : j + 1].reshape(())
                traffic[0, j], plan[()] = vehicle.array, vehicle.plan
                vehicle.array, vehicle.plan = traffic[0, j], plan
            else:
                write_row(vehicle, traffic[0, j])
        self._batch = batch._replace(states=states, traffic=traffic, plans=plans)
        self._foreign = [
            (vehicle, row) for vehicle, row in zip(others, traffic[0], strict=True) if type(vehicle) is not LaneFollower
        ]
        self._corners = np.zeros((len(others), 4, 2))
        self.road.rows = np.zeros((0, 8))
        self._bound = [ego, *self.road.vehicles]
        self._load()

    def _load(self) -> None:
        """Have all compiled that a step runs, and say how it runs."""
        settings = self.episode
        self._setup = Setup(
            starts=empty_starts(0, Sizes(0, 0, 0)),  # the start is in the batch
            steps=settings.steps,
            frames=settings.simulation_frequency // settings.policy_frequency,
            dt=1.0 / settings.simulation_frequency,
            calls=self._calls,
            scales=self._observation.scales,
        )
        self._outputs = new_outputs(1, self._observation.size)
        if self._calls == NOT_LOADED:
            self._calls = load(lambda: self._run_kernel(~self._everyone), False, None, self._observation)
            self._setup = self._setup._replace(calls=self._calls)

    def _run_kernel(self, active: np.ndarray) -> None:
        """One step of the batch of one."""
        self._taken[0] = 0
        kernel.advance(
            self._taken,
            1,
            active,
            True,
            self._commands,
            self._alphas,
            self._batch,
            self._setup,
            self._outputs,
            self._rewarded,
            self._ends,
            self._works,
            self._programs,
            0,
        )

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Drive one time step.

        Args:
            action: see :class:`SlotAction`.

        Returns:
            Observation, reward, terminated (collision or off the road), truncated (duration) and info.

        Raises:
            ValueError: if the action is malformed; nothing has moved then.
        """
        self._commands[0], self._alphas[0, 0] = self.action_type.decode(action)
        if self._bound != [self.vehicle, *self.road.vehicles]:
            self._bind()
        self._advance(resetting=False)
        reward, terminated, truncated = self._reward(action), self._is_terminated(), self._is_truncated()
        info = self._info(self.observation, action)
        if self.render_mode == "human":
            self.render()
        return self.observation.copy(), reward, terminated, truncated, info

    def _advance(self, resetting: bool) -> None:
        """A step, or the begin of an episode: in one compiled call, or in several with Python in between."""
        frames = self._setup.frames
        recorder = self._record_video_wrapper
        every_frame = recorder is not None and recorder.recording and frames > 1
        # Observation and info are the caller's, so they are new every time.
        self._outputs = self._outputs._replace(
            observations=np.zeros((1, self._observation.size), np.float32), infos=np.zeros(1, INFO)
        )
        self._batch.ended[0] = resetting
        if self._given_automation is None and not self._foreign and not every_frame and len(self._corners) <= MAX_HOLES:
            self._run_kernel(self._everyone)
            if not resetting:
                self.road.pass_frames(frames, self._setup.dt)
                self.vehicle.crashed |= bool(self._batch.transitions["crashed"][0])
        else:
            self._advance_with_python(resetting)
        if not resetting:
            self.steps += 1
            self.time = self.steps / self.episode.policy_frequency
        # An episode may be driven on past its end; the picture's path stays within the duration.
        self._path[min(self.steps, len(self._path) - 1)] = self._batch.states[0, :2]
        self.noted, self.observation = self._outputs.infos.reshape(()), self._outputs.observations[0]

    def _advance_with_python(self, resetting: bool) -> None:
        """The calls of :func:`kernel.advance` one after the other, with Python's vehicles and automation in between."""
        batch, setup, out, works = self._batch, self._setup, self._outputs, self._works
        given, signals = self._given_automation, self.signals
        if not resetting:
            kernel.respond(self._commands, self._alphas, batch, setup, out, works, self._programs)
            self._simulate(signals["u"])
            batch.transitions["crashed"][0] = self.vehicle.crashed
        for vehicle, row in self._foreign:
            write_row(vehicle, row)
        k = 0 if resetting else self.steps + 1
        count = kernel.look(k, resetting, batch, setup, out, works, self._corners)
        if count > MAX_HOLES:
            triangles = triangulate_any(self.scene["region"], self._corners[:count])
            kernel.search_among(triangles, batch, works, new_scratch(len(triangles)))
        if given is not None:
            kernel.show_automation(batch, works)
            solution = self._decided(given.act(works["automation_view"][:1].reshape(())))
            signals["u_a_des"], signals["residual"] = solution.command, solution.dual_residual
            signals["status"], signals["iterations"] = solution.status, solution.iterations
            batch.automations["failures"][0] = int(getattr(given, "failures", 0))
        kernel.judge(given is not None, batch, setup, works)
        kernel.finish(resetting, batch, setup, out)

    def _decided(self, solution: Any) -> Solution:
        """What another automation decided, checked, its command kept within the limits."""
        if not isinstance(solution, Solution):
            raise ValueError(f"automation.act() gave {solution!r}, which is no controllers.solution.Solution")
        command = np.clip(checked_command(solution.command, "automation"), -self.command_limits, self.command_limits)
        return solution._replace(command=command)

    def _simulate(self, u: np.ndarray) -> None:
        """Move all vehicles through one decision's simulation steps under a constant command, by highway-env."""
        self.vehicle.act({"acceleration": float(u[0]), "steering": float(u[1])})
        self.road.update_rows()
        for frame in range(self._setup.frames):
            self.road.act()
            self.road.step(self._setup.dt)
            recorder = self._record_video_wrapper
            if recorder is not None and recorder.recording and frame + 1 < self._setup.frames:
                recorder._capture_frame()

    @property
    def parameters(self) -> np.ndarray:
        """Record of :class:`core.parameters.Parameters` that the core runs with."""
        return self._batch.parameters.reshape(())

    @property
    def scene(self) -> np.ndarray:
        """Record of :data:`records.SCENE`, the present scene with its safe area."""
        return self._batch.scenes.reshape(())

    @property
    def signals(self) -> np.ndarray:
        """Record of :data:`records.SIGNALS`: planned for the present scene after a reset or step."""
        return self._batch.signals.reshape(())

    @property
    def memory(self) -> np.ndarray:
        """Record of :data:`records.MEMORY`."""
        return self._batch.memories.reshape(())

    @property
    def line(self) -> np.ndarray:
        """Reference line of the road, shape (n, 6)."""
        return self._batch.lines[0]

    @property
    def faults(self) -> np.ndarray:
        """Degradations of the episode, records of :class:`core.parameters.DegradationParameters`, shape (m,)."""
        return self._batch.faults[0]

    @property
    def traffic(self) -> np.ndarray:
        """The other vehicles as rows of :mod:`records`' traffic columns, shape (n, 8)."""
        return self._batch.traffic[0]

    def _reward(self, action: Any) -> float:
        """Reward of the step just taken: the weighted terms of :mod:`core.feedback.reward`."""
        return float(self._outputs.rewards[0])

    def _rewards(self, action: Any) -> dict[str, float]:
        """The unweighted terms of the step just taken, by name."""
        return dict(zip(self._terms, self.noted["rewards"].tolist(), strict=False))

    def _is_terminated(self) -> bool:
        """Whether the step just taken ended in a collision or off the road."""
        return bool(self._outputs.terminations[0])

    def _is_truncated(self) -> bool:
        """End of the duration, counted in whole steps, or of the road."""
        return bool(self._outputs.truncations[0])

    def _info(self, obs: np.ndarray, action: Any = None) -> dict[str, Any]:
        """Every signal of the step just taken, or of the reset (:data:`core.feedback.info.INFO`).

        highway-env's own also carries the action, which is an unseeded sample at a reset; it is left out.
        """
        info = as_dict(self.noted, self._terms)
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
        process = {"viewer": None, "_record_video_wrapper": None, "_calls": NOT_LOADED, "_bound": None}
        return {**self.__dict__, **process}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Go on where the pickled or copied one was."""
        self.__dict__.update(state)
        refresh_addresses([self.episode], self._batch)
