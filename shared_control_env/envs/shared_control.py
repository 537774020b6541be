"""The environment: a degraded automation and a driver share one car on a highway-env road."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import deepcopy
from typing import Any

import gymnasium as gym
import numpy as np

from shared_control_env.controllers.assessor import Assessor
from shared_control_env.controllers.automation import Automation, Planner
from shared_control_env.controllers.driver import checked_command
from shared_control_env.controllers.solution import Solution
from shared_control_env.core import kernel
from shared_control_env.core.authority.allocators import fuzzy_authority
from shared_control_env.core.batch import (
    NOT_LOADED,
    WORK,
    Outputs,
    Setup,
    Sizes,
    empty_batch,
    empty_starts,
    new_outputs,
)
from shared_control_env.core.compile.jit import compiled_form
from shared_control_env.core.control.predictive_driver import PROGRAM
from shared_control_env.core.feedback.info import INFO, as_dict
from shared_control_env.core.feedback.observation import OBSERVATIONS
from shared_control_env.core.loading import load
from shared_control_env.core.records import HEADING, SPEED, X, Y
from shared_control_env.core.risk.corridor import new_scratch
from shared_control_env.core.risk.triangulation import MAX_HOLES, triangulate_any
from shared_control_env.envs import settings as configuration
from shared_control_env.envs.episode import draw_episode
from shared_control_env.envs.highway.action import SlotAction
from shared_control_env.envs.highway.inherited import HighwayEnv
from shared_control_env.envs.highway.observation import CoreObservation
from shared_control_env.envs.highway.road import LineRoad
from shared_control_env.envs.highway.vehicles import EgoVehicle, LaneFollower, vehicle_class, write_row
from shared_control_env.envs.highway.viewer import SharedControlViewer
from shared_control_env.envs.seeds import checked_seed
from shared_control_env.envs.starts import count_vehicles, has_left, refresh_addresses, start_of, write_start

INFOS = 16
"""Number of steps for whose infos memory is allocated at once, since one allocation takes half a kernel's step."""


class SharedControlEnv(HighwayEnv):
    """Human-machine shared control of one car whose automation degrades.

    A step covers one time step k (:mod:`core.loop`). The automation's desired command u_a,des and its degraded form
    u_a,f are known before the step. The action provides the driver's desired command u_h,des and the authority
    alpha_a. The authority law, the driver lag and the sum of the commands follow. The vehicle then moves to time step
    k + 1, where the automation perceives the next scene and plans for it.

    The environment is a batch of size one in the kernel of the vectorised environment. A step is one compiled call,
    and highway-env's vehicles are views of the kernel's arrays. In some cases Python code has to run within a step: a
    user-defined automation, vehicles of another class, more than eight vehicles in the driving region, or a recorder
    of every simulation step. In these cases the parts of the loop are called one after the other from Python.

    The Cartesian frame is ISO 8855: x forward, y to the left, angles and steering positive to the left, as in
    the paper. highway-env's formulas hold unchanged in this frame. highway-env draws y downwards, so the viewer flips
    its pictures.

    The action of the bare environment has both slots open (:class:`SlotAction`). The wrappers ``AuthorityLimiter`` and
    ``DriverModel`` bind them.

    A subclass may override ``_reward(action)``, ``_rewards(action)``, ``_is_terminated()``, ``_is_truncated()`` and
    ``_info(observation, action)``, as in highway-env.

    Args:
        config: changes to the default settings; None for no changes.
        render_mode: ``human``, ``rgb_array`` or None.

    Raises:
        ValueError: for wrong settings or an unknown render mode.

    Attributes:
        config: settings of the next episode as a plain dict. Assigned values are checked at the next reset and take
            effect from there, as in highway-env.
        settings: the same settings, checked.
        episode: settings of the present episode, with all random values drawn.
        command_limits: largest acceleration and steering [m/s^2, rad], shape (2,).
        observation: the last observation.
        noted: record of :data:`info.INFO` of the last step or reset.
        viewer: the viewer; None before the first picture.
    """

    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 20}

    def __init__(self, config: dict[str, Any] | None = None, render_mode: str | None = None) -> None:
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ValueError(f"render_mode = {render_mode!r} must be one of {self.metadata['render_modes']} or None")
        # highway-env updates metadata at every reset. The copy keeps the dict of the class unchanged.
        self.metadata = dict(type(self).metadata)
        self.noted = np.zeros((), INFO)
        self.viewer: SharedControlViewer | None = None
        self._given_automation: Planner | None = None
        self._adopted: dict[str, Any] | None = None
        self._spec: Any = None
        self._works, self._programs = np.zeros(1, WORK), np.zeros(1, PROGRAM)
        self._commands, self._alphas, self._infos = np.zeros((1, 2)), np.zeros((1, 2)), np.empty(0, INFO)
        self._kernel: Callable[..., None] | None = None
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
        """Merge changes into the config and check the result. The changes take effect at the next reset.

        Nested dicts are merged. Settings that the changes name are removed from ``config["randomise"]``.

        Args:
            config: changes to the settings; None for no changes.

        Raises:
            ValueError: for an unknown key, with the nearest valid key; or for a wrong value, with its range.
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
        """Raise ValueError if the frame rate changes although a video recorder may already use the old one."""
        told = self._adopted is not None and self.render_mode == "rgb_array" and self._record_video_wrapper is None
        if told and settings.policy_frequency != self.settings.policy_frequency:
            raise ValueError(
                f"config['policy_frequency'] = {settings.policy_frequency} Hz: pictures of this environment are taken "
                f"at {self.settings.policy_frequency} Hz, and a video recorder does not notice a change; make a "
                "new environment, or pass the recorder to set_record_video_wrapper()"
            )

    def _check_observation(self, settings: configuration.Settings) -> None:
        """Raise ValueError if the observation type differs from the one that the spaces were made for."""
        if self._adopted is not None and settings.observation != self.settings.observation:
            raise ValueError(
                f"config['observation']['type'] = {settings.observation.type!r}: the spaces of this environment are "
                f"made for {self.settings.observation.type!r}; make a new one"
            )

    def define_spaces(self) -> None:
        """Build action and observation types once, because new spaces would lose the seed that a user gave them."""
        if self.action_space is None:
            self._observation = OBSERVATIONS[self.settings.observation.type]
            self.observation_type = CoreObservation(self, self._observation)
            self.action_type = SlotAction(self)
            self.observation_space = self.observation_type.space()
            self.action_space = self.action_type.space()

    def update_metadata(self, video_real_time_ratio: float = 1.0) -> None:
        """Set the frame rate of videos to one frame per decision, or per simulation step with a recorder set.

        Args:
            video_real_time_ratio: playback speed relative to real time [-].
        """
        frequency = self.settings.policy_frequency
        if self._record_video_wrapper is not None:
            frequency = self.settings.simulation_frequency
            self._record_video_wrapper.frames_per_sec = round(video_real_time_ratio * frequency)
        self.metadata["render_fps"] = round(video_real_time_ratio * frequency)

    @property
    def automation(self) -> Planner:
        """The automation that decides u_a,des: the predictive controller of Eq. 12-13, or an assigned :class:`Planner`.

        An assigned automation is kept across resets; each reset calls its ``reset()``.
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
            seed: seed of the environment's generator; None to let the generator continue.
            options: ``{"config": {...}}`` changes settings from this episode on, as in highway-env.

        Returns:
            Observation and info. The signals in info are those planned for k = 0; no command has been applied yet.

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
        """Draw the settings of the episode, and create road, vehicles and controllers from them."""
        self._load()  # first, since it waits for a process that compiles what is needed below
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
        self._outputs = new_outputs(1, self._observation.size)
        self._bind()
        self._path = np.zeros((settings.steps + 1, 2))
        self._automation.reset()

    def _place_vehicles(self) -> None:
        """Put the ego and the other vehicles on the road."""
        batch = self._batch
        ego = EgoVehicle(self.road, batch.states[0], self.episode.task.target_speed, self.parameters)
        self.controlled_vehicles = [ego]
        self.road.vehicles = [ego]
        for row, plan in zip(batch.traffic[0], batch.plans[0], strict=True):
            x, y, heading, speed = row[[X, Y, HEADING, SPEED]].tolist()
            vehicle = self._vehicle_class(self.road, (x, y), heading=heading, speed=speed)
            if isinstance(vehicle, LaneFollower):
                vehicle.plan[()] = plan
                if plan["track"]:
                    vehicle.take(row)
            self.road.vehicles.append(vehicle)

    def _bind(self) -> None:
        """Make vehicles and automation views of the batch, and set up the step.

        Needed after a reset, a copy, or a change of vehicles.
        """
        ego = self.vehicle
        others = [vehicle for vehicle in self.road.vehicles if vehicle is not ego]
        batch = self._batch
        states, traffic = np.zeros((1, 6)), np.zeros((1, len(others), 8))
        plans = np.zeros((1, len(others)), batch.plans.dtype)
        states[0], ego.array, ego.parameters = ego.array, states[0], self.parameters
        ego.realised = self.memory["realised"]
        for j, vehicle in enumerate(others):
            if isinstance(vehicle, LaneFollower):
                plan = plans[0, j : j + 1].reshape(())
                traffic[0, j], plan[()] = vehicle.array, vehicle.plan
                vehicle.array, vehicle.plan = traffic[0, j], plan
            else:
                write_row(vehicle, traffic[0, j])
        self._batch = batch._replace(states=states, traffic=traffic, plans=plans)
        self._crashed, self._k, self._position = batch.transitions["crashed"], batch.scenes["k"], states[0, :2]
        self._foreign = [
            (vehicle, row) for vehicle, row in zip(others, traffic[0], strict=True) if type(vehicle) is not LaneFollower
        ]
        self.road.plans, self.road.dt = plans[0], 1.0 / self.episode.simulation_frequency
        self._corners = np.zeros((len(others), 4, 2))
        self.road.rows = np.zeros((0, 8))
        self._bound = [ego, *self.road.vehicles]
        given = self._given_automation
        self._automation = Automation(self.parameters, batch.automations.reshape(())) if given is None else given
        self._load()
        settings = self.episode
        self._setup = Setup(
            starts=empty_starts(0, Sizes(0, 0, 0)),  # the batch already holds the start
            steps=settings.steps,
            frames=settings.simulation_frequency // settings.policy_frequency,
            dt=1.0 / settings.simulation_frequency,
            calls=self._calls,
            scales=self._observation.scales,
        )

    def _load(self) -> None:
        """Load or compile all functions that a step calls, unless this was done before."""
        if self._calls == NOT_LOADED:
            self._calls = load(False, fuzzy_authority, self._observation)

    def _run_kernel(self) -> None:
        """Run one step of the kernel on the batch of size one."""
        self._taken[0] = 0
        run = self._kernel or kernel.advance
        run(
            self._taken,
            1,
            self._everyone,
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
        if self._kernel is None:
            self._kernel = compiled_form(kernel.advance)

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Drive one time step.

        Args:
            action: dict of both slots, see :class:`SlotAction`.

        Returns:
            Observation, reward, terminated (collision or off the road), truncated (end of the duration or of the
            road) and info.

        Raises:
            ValueError: if the action is malformed; the state is unchanged then.
        """
        self._commands[0], self._alphas[0] = self.action_type.decode(action)
        if self._bound != [self.vehicle, *self.road.vehicles]:
            self._bind()
        self._advance(resetting=False)
        reward, terminated, truncated = self._reward(action), self._is_terminated(), self._is_truncated()
        info = self._info(self.observation, action)
        if self.render_mode == "human":
            self.render()
        return self.observation.copy(), reward, terminated, truncated, info

    def _advance(self, resetting: bool) -> None:
        """Run a step, or begin an episode: in one compiled call, or in several calls with Python code in between."""
        frames = self._setup.frames
        recorder = self._record_video_wrapper
        every_frame = recorder is not None and recorder.recording and frames > 1
        # The caller may keep observation and info, so new arrays are used in each step.
        kept, new = self._outputs, np.empty((1, self._observation.size), np.float32)
        if len(self._infos) == 0:
            self._infos = np.empty(INFOS, INFO)
        infos, self._infos = self._infos[:1], self._infos[1:]
        self._outputs = Outputs(new, kept.rewards, kept.terminations, kept.truncations, infos, kept.drivers)
        self._batch.ended[0] = resetting
        if self._given_automation is None and not self._foreign and not every_frame and len(self._corners) <= MAX_HOLES:
            ego = self.vehicle
            if ego.crashed and not resetting:
                self._crashed[0] = True
            self._run_kernel()
            if not resetting:
                self.road.pass_frames(frames, self._setup.dt)
                if self._crashed[0]:
                    ego.crashed = True
        else:
            self._advance_with_python(resetting)
        if not resetting:
            self.steps = int(self._k[0])
            self.time = self.steps / self.episode.policy_frequency
        # An episode may be continued past its end; the drawn path ends with the duration.
        self._path[min(self.steps, len(self._path) - 1)] = self._position
        self.noted, self.observation = self._outputs.infos.reshape(()), self._outputs.observations[0]

    def _advance_with_python(self, resetting: bool) -> None:
        """Make the calls of :func:`kernel.advance` one by one, with vehicles and automation in Python in between."""
        batch, setup, out, works = self._batch, self._setup, self._outputs, self._works
        given, signals = self._given_automation, self.signals
        if not resetting:
            kernel.respond(self._commands, self._alphas, batch, setup, out, works, self._programs)
            self._simulate(signals["u"])
            batch.transitions["crashed"][0] = self.vehicle.crashed
        for vehicle, row in self._foreign:
            write_row(vehicle, row)
        k = 0 if resetting else int(self.scene["k"]) + 1
        count = kernel.show(k, resetting, batch, setup, out, works, self._corners)
        if count > MAX_HOLES:
            triangles = triangulate_any(self.scene["region"], self._corners[:count])
            kernel.search_among(triangles, batch, new_scratch(len(triangles)))
        if given is not None:
            kernel.show_automation(batch, works)
            solution = self._decided(given.act(works["automation_view"][:1].reshape(())))
            signals["u_a_des"], signals["residual"] = solution.command, solution.dual_residual
            signals["status"], signals["iterations"] = solution.status, solution.iterations
            batch.automations["failures"][0] = int(getattr(given, "failures", 0))
        kernel.decide(given is not None, batch, setup, works)
        kernel.finish(resetting, batch, setup, out)

    def _decided(self, solution: Any) -> Solution:
        """Check the solution of a user-defined automation, and clip its command to the limits."""
        if not isinstance(solution, Solution):
            raise ValueError(f"automation.act() gave {solution!r}, which is no controllers.solution.Solution")
        for name in ("status", "iterations", "dual_residual"):
            value = getattr(solution, name)
            if not isinstance(value, int | float | np.number):
                raise ValueError(f"automation.act() gave a Solution with {name} = {value!r}, which is no number")
        command = np.clip(checked_command(solution.command, "automation"), -self.command_limits, self.command_limits)
        return solution._replace(command=command)

    def _simulate(self, u: np.ndarray) -> None:
        """Move all vehicles through the simulation steps of one decision with highway-env, under a constant command."""
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
        """Parameters of the core, a record of :class:`core.parameters.Parameters`."""
        return self._batch.parameters.reshape(())

    @property
    def scene(self) -> np.ndarray:
        """The present scene with its safe area, a record of :data:`records.SCENE`."""
        return self._batch.scenes.reshape(())

    @property
    def signals(self) -> np.ndarray:
        """Signals planned for the present scene after a reset or step, a record of :data:`records.SIGNALS`."""
        return self._batch.signals.reshape(())

    def signals_for_allocator(self) -> np.ndarray:
        """Copy of the signals with the driver's present u_h,act, a record of :data:`records.SIGNALS`."""
        signals = self.signals.copy()
        signals["u_h_act"] = self.memory["u_h_act"]
        return signals

    @property
    def assessor(self) -> Assessor:
        """Answers to an allocator's questions about the present step."""
        return Assessor(0, self._batch, self._calls)

    @property
    def memory(self) -> np.ndarray:
        """What the loop carries from step to step, a record of :data:`records.MEMORY`."""
        return self._batch.memories.reshape(())

    @property
    def line(self) -> np.ndarray:
        """Reference line of the road, shape (n, 12)."""
        return self._batch.lines[0]

    @property
    def faults(self) -> np.ndarray:
        """Degradations of the episode, records of :class:`core.parameters.DegradationParameters`, shape (m,)."""
        return self._batch.faults[0]

    @property
    def traffic(self) -> np.ndarray:
        """The other vehicles, one per row, columns as in :mod:`core.records`, shape (n, 8)."""
        return self._batch.traffic[0]

    @property
    def handed_over(self) -> np.ndarray:
        """Whether each recorded vehicle has left its track because of the ego, in the order of the recording.

        The ego is left out. The array is as long as for the recording with the most vehicles, shape (n,).
        """
        left = np.zeros(count_vehicles(self.settings), dtype=bool)
        left[: len(self._batch.plans[0])] = has_left(self._batch.plans[0])
        return left

    def _reward(self, action: Any) -> float:
        """Reward of the last step: the sum of the weighted terms of :mod:`core.feedback.reward`."""
        return float(self._outputs.rewards[0])

    def _rewards(self, action: Any) -> dict[str, float]:
        """The unweighted reward terms of the last step, by name."""
        return dict(zip(self._terms, self.noted["rewards"].tolist(), strict=False))

    def _is_terminated(self) -> bool:
        """Whether the last step ended in a collision or off the road."""
        return bool(self._outputs.terminations[0])

    def _is_truncated(self) -> bool:
        """Whether the last step reached the end of the duration, counted in whole steps, or the end of the road."""
        return bool(self._outputs.truncations[0])

    def _info(self, obs: np.ndarray, action: Any = None) -> dict[str, Any]:
        """All signals of the last step or reset (:data:`core.feedback.info.INFO`).

        highway-env's info also contains the action, which is an unseeded sample at a reset. It is left out here.
        """
        info = as_dict(self.noted, self._terms)
        if self.episode.recording is not None:
            info["handed_over"] = self.handed_over
        if type(self)._rewards is not SharedControlEnv._rewards:
            info["rewards"] = self._rewards(action)
        return info

    def action_of(self, command: Any) -> np.ndarray:
        """Convert a driver's command to an action, whose entries are shares of the limits.

        Args:
            command: ``[a, delta]`` [m/s^2, rad], shape (2,).

        Returns:
            Array of float32, shape (2,) [-]; outside [-1, 1] if the command exceeds the limits.
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
        """Copy the present situation of another environment with the same settings, in order to draw it.

        Args:
            state: state of the ego, shape (6,) [m, rad, m/s, rad/s].
            traffic: other vehicles, one per row, and perhaps rows that are left over, shape (n, 8).
            scene: record of :data:`records.SCENE`.
            signals: record of :data:`records.SIGNALS`.
            noted: record of :data:`info.INFO`.
            path: positions of the ego so far, shape (k + 1, 2) [m].
        """
        self.vehicle.array[:] = state
        for vehicle, row in zip(self.road.vehicles[1:], traffic, strict=False):  # rows that are left over are away
            vehicle.array[:] = row
        for vehicle in self.road.vehicles:  # the viewer marks those that overlap now
            vehicle.crashed = False
        self.scene[()], self.signals[()], self.noted[()] = scene, signals, noted
        self.steps = len(path) - 1
        self._path[: len(path)] = path

    @property
    def path(self) -> np.ndarray:
        """Cartesian positions of the ego so far, shape (k + 1, 2) [m]."""
        return self._path[: self.steps + 1]

    def render(self) -> np.ndarray | None:
        """Draw the present scene: returns a frame in ``rgb_array`` mode, updates the window in ``human`` mode."""
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
        """Gymnasium's specification, with the settings in plain types so that it can be written as JSON."""
        return self._spec

    @spec.setter
    def spec(self, spec: Any) -> None:
        if spec is not None and isinstance(spec.kwargs.get("config"), Mapping):
            spec.kwargs = {**spec.kwargs, "config": configuration.as_plain(spec.kwargs["config"])}
        self._spec = spec

    def __getstate__(self) -> dict[str, Any]:
        """State for pickling, without what belongs to this process: viewer, recorder and function addresses."""
        return {**self.__dict__, "viewer": None, "_record_video_wrapper": None, "_calls": NOT_LOADED, "_kernel": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Continue from the state of the pickled or copied environment.

        Args:
            state: state of :meth:`__getstate__`.
        """
        self.__dict__.update(state)
        refresh_addresses([self.episode], self._batch)
        self._bind()

    def __deepcopy__(self, memo: dict[int, Any]) -> SharedControlEnv:
        """Copy as pickles do; highway-env's own copy would part the vehicles from the batch.

        Args:
            memo: objects that are copied already, of :mod:`copy`.
        """
        new = type(self).__new__(type(self))
        memo[id(self)] = new
        new.__setstate__(deepcopy(self.__getstate__(), memo))
        return new
