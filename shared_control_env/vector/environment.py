"""Many environments behind Gymnasium's vector interface, stepped by one compiled kernel."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from gymnasium.envs.registration import load_env_creator
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from shared_control_env.core.delaunay import MAX_HOLES
from shared_control_env.core.info import INFO
from shared_control_env.core.observation import FEATURES
from shared_control_env.core.parameters import DegradationParameters, Parameters, TrafficParameters
from shared_control_env.core.records import (
    AUTOMATION_MEMORY,
    FAULT_MEMORY,
    MEMORY,
    SCENE,
    SIGNALS,
    record_dtype,
)
from shared_control_env.core.road import S0
from shared_control_env.envs import config as configuration
from shared_control_env.envs.cases import CASES, Case
from shared_control_env.envs.config import Settings, plain
from shared_control_env.envs.episode import draw_episode, is_random
from shared_control_env.envs.situation import start_of
from shared_control_env.envs.slots import AUTHORITY, DRIVER, SLOT_SPACES, space_of
from shared_control_env.vector import cold_start, kernel
from shared_control_env.vector.records import (
    DISABLED,
    NEXT_STEP,
    NOT_LOADED,
    PROGRAM,
    SAME_STEP,
    SOLVER,
    WORKSPACE,
    Batch,
    Outputs,
    Setup,
    Starts,
)

AUTORESET = {
    AutoresetMode.NEXT_STEP: NEXT_STEP,
    AutoresetMode.SAME_STEP: SAME_STEP,
    AutoresetMode.DISABLED: DISABLED,
}
"""Gymnasium's autoreset modes and their codes in the kernel."""

KERNEL_TRAFFIC = "shared_control_env.envs.vehicles.LaneFollower"
"""Traffic that the kernel knows."""

ONE_FOR_ALL = ("simulation_frequency", "policy_frequency", "duration", "other_vehicles_type")
"""Settings that all environments share."""

FEWEST_PER_THREAD = 32
"""Environments under which another thread costs more than it saves."""


class Actions(NamedTuple):
    """Both slots of every environment's action; zeros for a bound one.

    Attributes:
        commands: driver's commands over their limits, (N, 2).
        alphas: authorities, (N, 1).
    """

    commands: np.ndarray
    alphas: np.ndarray


class Rollout(NamedTuple):
    """Rewards and ends of a rollout.

    Attributes:
        rewards: shape (steps, N).
        ends: whether an episode ended, shape (steps, N).
    """

    rewards: np.ndarray
    ends: np.ndarray


class SharedControlVectorEnv(VectorEnv):
    """N environments of one scenario and configuration in one kernel.

    Environment i gives what the single environment gives for the same actions; the functions are the same.

    Args:
        case: the scenario.
        num_envs: N.
        config: changes to the scenario's settings.
        render_mode: ``rgb_array`` or ``human``; environment 0 is drawn, by the single environment's viewer.
        limiter: bind alpha_a with the fuzzy inference; else it is the action's slot ``authority``.
        driver: bind the driver's command with the paper's predictive driver, solved by an active-set method in
            the kernel; else it is the action's slot ``driver``.
        autoreset_mode: Gymnasium's mode or its name, such as ``same_step``.
        threads: how many; by default one a core, and fewer for few environments.

    Raises:
        ValueError: for wrong settings, or traffic that the kernel does not know.

    The action is the open slot's Box, a dict of both, or ``Discrete(1)`` where both are bound.
    """

    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 20}

    def __init__(
        self,
        case: Case,
        num_envs: int = 1,
        config: dict[str, Any] | None = None,
        render_mode: str | None = None,
        limiter: bool = True,
        driver: bool = False,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
    ) -> None:
        if num_envs < 1:
            raise ValueError(f"num_envs = {num_envs} must be at least 1")
        if threads is not None and threads < 1:
            raise ValueError(f"threads = {threads} must be at least 1, or None for one a core")
        for name, value in (("limiter", limiter), ("driver", driver)):
            if not isinstance(value, bool):
                raise ValueError(
                    f"{name} = {value!r} must be True or False; for a driver of your own use DriverModel on the single "
                    "environment, or its commands as actions"
                )
        names = {mode.name.lower(): mode for mode in AutoresetMode}
        if not isinstance(autoreset_mode, AutoresetMode) and autoreset_mode not in names:
            raise ValueError(f"autoreset_mode = {autoreset_mode!r} must be an AutoresetMode or one of {sorted(names)}")
        self._mode = autoreset_mode if isinstance(autoreset_mode, AutoresetMode) else names[autoreset_mode]
        self.num_envs, self.render_mode = num_envs, render_mode
        self._limiter, self._driver = limiter, driver
        self._case = case
        self._viewer_env: Any = None
        default = configuration.merge(configuration.plain(configuration.Settings()), case.settings)
        self._settings = configuration.check(configuration.merge(default, config or {}))
        self._templates = [self._settings] * num_envs
        self.metadata = {**type(self).metadata, "autoreset_mode": self._mode}
        self._define_spaces()
        wanted = threads or os.cpu_count() or 1
        self.threads = max(1, min(wanted, num_envs // FEWEST_PER_THREAD)) if threads is None else min(wanted, num_envs)
        self._pool = ThreadPoolExecutor(self.threads - 1) if self.threads > 1 else None
        self._works = np.zeros(self.threads, WORKSPACE)
        self._programs = np.zeros(self.threads, PROGRAM)
        self._no_actions = Actions(np.zeros((num_envs, 2)), np.zeros((num_envs, 1)))
        self._nobody, self._everyone = np.zeros(num_envs, dtype=bool), np.ones(num_envs, dtype=bool)
        self._seeds: tuple[int | None, ...] = (None,) * num_envs
        self._generators: list[np.random.Generator | None] = [None] * num_envs
        self._started = False
        self._set_up()

    def _define_spaces(self) -> None:
        """Spaces of the open slots, once."""
        bound = {DRIVER: self._driver, AUTHORITY: self._limiter}
        self._open = tuple(slot for slot in SLOT_SPACES if not bound[slot])
        single = space_of(self._open)
        self.single_action_space = single
        self.single_observation_space = spaces.Box(-1.0, 1.0, (len(FEATURES),), dtype=np.float32)
        self.action_space = batch_space(single, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)

    def _set_up(self) -> None:
        """Arrays and shared data from the settings."""
        settings, n = self._settings, self.num_envs
        if settings.other_vehicles_type != KERNEL_TRAFFIC:
            raise ValueError(
                f"config['other_vehicles_type'] = {settings.other_vehicles_type!r} is not in the kernel; allowed is "
                f"{KERNEL_TRAFFIC!r}; for others use gym.make_vec(..., vectorization_mode='sync')"
            )
        if len(settings.vehicles) > MAX_HOLES:
            raise ValueError(
                f"config['vehicles'] has {len(settings.vehicles)} entries; the kernel takes 0 to {MAX_HOLES}"
            )
        self.metadata["render_fps"] = settings.policy_frequency
        self._path = np.zeros((settings.steps + 1, 2))
        self._random = any(template is not settings or is_random(template) for template in self._templates)
        self._episodes, self._prepared = [settings] * n, [settings] * n
        starts = _no_starts(n if self._random else 1, self._templates)
        if not self._random:
            _write_start(settings, starts, 0)
        self._setup = Setup(
            starts=starts,
            steps=settings.steps,
            frames=settings.simulation_frequency // settings.policy_frequency,
            dt=1.0 / settings.simulation_frequency,
            limiter=self._limiter,
            driver=self._driver,
            autoreset=AUTORESET[self._mode],
            solvers=NOT_LOADED,
        )
        self._batch = Batch(
            parameters=np.zeros(n, starts.parameters.dtype),
            scenes=np.zeros(n, SCENE),
            signals=np.zeros(n, SIGNALS),
            memories=np.zeros(n, MEMORY),
            automations=np.zeros(n, AUTOMATION_MEMORY),
            states=np.zeros((n, 6)),
            lines=np.zeros((n, *starts.lines.shape[1:])),
            faults=np.zeros((n, *starts.faults.shape[1:]), starts.faults.dtype),
            fault_memories=np.zeros((n, *starts.faults.shape[1:]), FAULT_MEMORY),
            traffic=np.zeros((n, *starts.traffic.shape[1:])),
            plans=np.zeros((n, *starts.plans.shape[1:]), starts.plans.dtype),
            crashed=np.zeros(n, dtype=bool),
            ended=np.zeros(n, dtype=bool),
        )

    @property
    def config(self) -> dict[str, Any]:
        """The settings of every environment."""
        return configuration.plain(self._settings)

    @property
    def scenes(self) -> np.ndarray:
        """What the sensors of each environment give, records of :data:`records.SCENE`, shape (N,)."""
        return self._batch.scenes

    @property
    def signals(self) -> np.ndarray:
        """Signals planned for the present step of each environment, records of :data:`records.SIGNALS`, shape (N,)."""
        return self._batch.signals

    @property
    def episodes(self) -> tuple[Settings, ...]:
        """Settings of the present episode of each environment, with all that is random drawn."""
        return tuple(self._episodes)

    @property
    def np_random_seed(self) -> tuple[int | None, ...]:  # type: ignore[override]
        """Seed of each environment, None where it was not given one."""
        return self._seeds

    @property
    def bytes_per_environment(self) -> int:
        """Memory of one environment's state [B]."""
        starts = self._setup.starts if self._random else ()
        return sum(array.nbytes for array in (*self._batch, *starts)) // self.num_envs

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin episodes.

        Args:
            seed: of all environments: an int for seed, seed + 1, ..., or one for each.
            options: ``{"reset_mask": mask}`` resets the environments it names alone; ``{"config": {...}}`` changes
                the settings of all, and a list of N such dicts those of each.

        Returns:
            Observations, and infos with masks as Gymnasium's.

        Raises:
            ValueError: for unknown options, a wrong mask, seeds of another number, or wrong settings.
        """
        options = dict(options or {})
        mask = self._checked_mask(options.pop("reset_mask", None))
        config = options.pop("config", None)
        if options:
            raise ValueError(f"options has the unknown key(s) {sorted(options)}; valid are 'config' and 'reset_mask'")
        if config is not None:
            if not mask.all():
                raise ValueError(
                    "options['config'] changes all environments; it does not go with a partial 'reset_mask'"
                )
            self._configure(config)
        self._take_seeds(seed, mask)
        out = self._outputs()
        if self._started:  # Environments that the mask leaves out keep their last observation.
            out.observations[:] = self._observations
        if self._random and not self._started:  # those without a seed
            self._prepare(np.array([generator is None for generator in self._generators]))
        if self._setup.solvers is NOT_LOADED:
            self._load_solvers()
        self._advance(1, mask, mask, self._no_actions, out)
        self._started = True
        self._begin_next(mask)
        self._finish(out)
        return out.observations, self._infos(out.infos, out.solver, mask)

    def step(self, actions: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Drive one time step in every environment.

        Args:
            actions: batch of the action space.

        Returns:
            Observations, rewards, terminations, truncations and infos, all new arrays.

        Raises:
            ValueError: for a malformed action, naming the environment's index; nothing has moved then. Also
                before the first reset, and for an ended environment where autoreset is disabled.
        """
        checked = self._checked_actions(actions)
        if not self._started:
            raise ValueError("step() needs a reset() first")
        if self._mode is AutoresetMode.DISABLED and self._batch.ended.any():
            index = int(np.flatnonzero(self._batch.ended)[0])
            raise ValueError(f"environment {index} has ended; reset it with options={{'reset_mask': ...}}")
        out = self._outputs()
        self._drive(checked, out)
        self._finish(out)
        infos = self._infos(out.infos, out.solver, np.ones(self.num_envs, dtype=bool))
        ended = out.terminations | out.truncations
        if self._mode is AutoresetMode.SAME_STEP and ended.any():
            infos["final_obs"], infos["_final_obs"] = out.final_observations, ended
            infos["final_info"] = self._infos(out.final_infos, out.final_solver, ended)
            infos["_final_info"] = ended
        return out.observations, out.rewards, out.terminations, out.truncations, infos

    def rollout(self, steps: int) -> Rollout:
        """Drive many time steps without returning to Python between them; both slots must be bound.

        Args:
            steps: how many, in every environment.

        Raises:
            ValueError: if a slot of the action is open, steps is below 1, or there was no reset.
        """
        if self._open:
            raise ValueError(f"rollout() needs limiter=True and driver=True; open are {list(self._open)}")
        if steps < 1:
            raise ValueError(f"steps = {steps} must be at least 1")
        if not self._started:
            raise ValueError("rollout() needs a reset() first")
        out = self._outputs()
        if self._random:  # every episode begins with a draw
            taken = [self._drive(self._no_actions, out) for _ in range(steps)]
            result = Rollout(*(np.concatenate(parts) for parts in zip(*taken, strict=True)))
        else:
            result = self._advance(steps, self._everyone, self._nobody, self._no_actions, out)
        self._finish(out)
        return result

    def render(self) -> tuple[np.ndarray, ...] | None:
        """Draw environment 0; in ``rgb_array`` mode a tuple of its frame."""
        if self._viewer_env is None:
            make: Any = load_env_creator("shared_control_env.envs.shared_control:SharedControlEnv")
            self._viewer_env = make(plain(self._episodes[0]), render_mode=self.render_mode)
            self._shown = self._episodes[0]
        if self._shown is not self._episodes[0]:
            self._shown = self._episodes[0]
            self._viewer_env.reset(options={"config": plain(self._shown)})
        batch = self._batch
        k = int(batch.scenes[0]["k"])
        self._viewer_env.show(batch.states[0], batch.traffic[0], batch.scenes[0], batch.signals[0], self._path[: k + 1])
        frame = self._viewer_env.render()
        return None if frame is None else (frame,)

    def close_extras(self, **kwargs: Any) -> None:
        """Close the viewer and end the threads."""
        if self._viewer_env is not None:
            self._viewer_env.close()
        if self._pool is not None:
            self._pool.shutdown()

    def _configure(self, config: dict[str, Any] | Sequence[dict[str, Any]]) -> None:
        """Change the settings of all environments, or those of each by one entry of a list."""
        base = configuration.plain(self._settings)
        if isinstance(config, Mapping):
            self._settings = configuration.check(configuration.merge(base, config))
            self._templates = [self._settings] * self.num_envs
        elif len(config) != self.num_envs:
            raise ValueError(
                f"options['config'] has {len(config)} entries; it must be a dict or have one for each of "
                f"{self.num_envs} environments"
            )
        else:
            different = {id(entry): entry for entry in config}
            checked = {key: configuration.check(configuration.merge(base, entry)) for key, entry in different.items()}
            templates = [checked[id(entry)] for entry in config]
            for i, template in enumerate(templates):
                for name in ONE_FOR_ALL:
                    if getattr(template, name) != getattr(self._settings, name):
                        raise ValueError(f"options['config'][{i}][{name!r}] must be that of all environments")
                if len(template.vehicles) != len(self._settings.vehicles):
                    raise ValueError(f"options['config'][{i}]['vehicles'] must have as many entries as in all")
            self._templates = templates
        self._viewer_env = None
        self._set_up()

    def _load_solvers(self) -> None:
        """Have all compiled that a step runs."""

        def compile_kernel() -> None:
            self._advance(1, self._nobody, self._nobody, self._no_actions, self._outputs())

        self._setup = self._setup._replace(solvers=cold_start.compile_all(compile_kernel, self._driver))

    def _prepare(self, mask: np.ndarray) -> None:
        """Draw the next episode of the environments that the mask names."""
        for i in np.flatnonzero(mask).tolist():
            generator = self._generators[i]
            if generator is None:
                generator = self._generators[i] = seeding.np_random(None)[0]
            self._prepared[i] = draw_episode(self._templates[i], generator)
            _write_start(self._prepared[i], self._setup.starts, i)

    def _begin_next(self, mask: np.ndarray) -> None:
        """Note that the environments that the mask names have begun what was prepared, and prepare the next."""
        if self._random and mask.any():
            for i in np.flatnonzero(mask).tolist():
                self._episodes[i] = self._prepared[i]
            self._prepare(mask)

    def _drive(self, actions: Actions, out: Outputs) -> Rollout:
        """One step of all environments."""
        resetting = self._batch.ended.copy()
        result = self._advance(1, self._everyone, self._nobody, actions, out)
        self._begin_next(result.ends[0] if self._mode is AutoresetMode.SAME_STEP else resetting)
        return result

    def _advance(self, steps: int, active: np.ndarray, resets: np.ndarray, actions: Actions, out: Outputs) -> Rollout:
        """Run :func:`kernel.advance`, in all threads at once; it lets go of Python's lock."""
        rewards = np.zeros((steps, self.num_envs))
        ends = np.zeros((steps, self.num_envs), dtype=bool)
        taken = np.zeros(self.threads, dtype=np.int64)

        def work(thread: int) -> None:
            kernel.advance(
                taken,
                steps,
                active,
                resets,
                actions.commands,
                actions.alphas,
                self._batch,
                self._setup,
                out,
                rewards,
                ends,
                self._works,
                self._programs,
                thread,
            )

        others = [self._pool.submit(work, thread) for thread in range(1, self.threads)] if self._pool else []
        work(0)
        for other in others:
            other.result()  # raises what it raised
        return Rollout(rewards, ends)

    def _outputs(self) -> Outputs:
        """New arrays for one step; the final ones are large and made only where they are used."""
        n = self.num_envs
        finals = n if self._mode is AutoresetMode.SAME_STEP else 0
        return Outputs(
            observations=np.zeros((n, len(FEATURES)), dtype=np.float32),
            rewards=np.zeros(n),
            terminations=np.zeros(n, dtype=bool),
            truncations=np.zeros(n, dtype=bool),
            infos=np.zeros(n, INFO),
            solver=np.zeros(n, SOLVER),
            final_observations=np.zeros((finals, len(FEATURES)), dtype=np.float32),
            final_infos=np.zeros(finals, INFO),
            final_solver=np.zeros(finals, SOLVER),
        )

    def _finish(self, out: Outputs) -> None:
        """Keep what a later reset or picture needs."""
        self._observations = out.observations.copy()
        if self.render_mode is not None:
            self._path[self._batch.scenes[0]["k"]] = self._batch.states[0, :2]
            if self.render_mode == "human":
                self.render()

    def _infos(self, infos: np.ndarray, solver: np.ndarray, mask: np.ndarray) -> dict[str, Any]:
        """Records as Gymnasium's nested dict of arrays with their masks."""
        values = _batched(infos, mask)
        if self._driver:
            values["driver"], values["_driver"] = _batched(solver, mask), mask
        return values

    def _checked_actions(self, actions: Any) -> Actions:
        """Commands and authorities, with zeros for what is bound."""
        given = actions if len(self._open) == 2 else dict.fromkeys(self._open, actions)
        if len(self._open) == 2 and (not isinstance(actions, dict) or set(actions) != set(self._open)):
            raise ValueError(
                f"actions must be a dict with the keys {sorted(self._open)}, each of shape ({self.num_envs}, n)"
            )
        values = {DRIVER: self._no_actions.commands, AUTHORITY: self._no_actions.alphas}
        for slot in self._open:
            array = np.array(given[slot], dtype=np.float64)
            size = SLOT_SPACES[slot].shape[0]
            if array.shape != (self.num_envs, size):
                raise ValueError(f"actions[{slot!r}] has shape {array.shape}; it must be ({self.num_envs}, {size})")
            finite = np.isfinite(array)
            if not finite.all():
                index = int(np.argwhere(~finite)[0, 0])
                low, high = SLOT_SPACES[slot].low[0], SLOT_SPACES[slot].high[0]
                raise ValueError(
                    f"action of environment {index}, slot {slot!r}, is {array[index]}; "
                    f"it must be finite, in [{low:g}, {high:g}]"
                )
            values[slot] = array
        return Actions(values[DRIVER], values[AUTHORITY])

    def _checked_mask(self, mask: Any) -> np.ndarray:
        if mask is None:
            return np.ones(self.num_envs, dtype=bool)
        if not isinstance(mask, np.ndarray) or mask.shape != (self.num_envs,) or mask.dtype != np.bool_:
            raise ValueError(f"options['reset_mask'] = {mask!r} must be a bool array of shape ({self.num_envs},)")
        if not mask.any():
            raise ValueError("options['reset_mask'] names no environment; at least one entry must be True")
        if not self._started and not mask.all():
            raise ValueError("options['reset_mask'] must name every environment at the first reset")
        return mask

    def _take_seeds(self, seed: int | Sequence[int | None] | None, mask: np.ndarray) -> None:
        """Seed the generators of the environments that the mask names, and draw their next episodes anew."""
        if seed is None:
            return
        seeds = [seed + i for i in range(self.num_envs)] if isinstance(seed, int | np.integer) else list(seed)
        if len(seeds) != self.num_envs:
            raise ValueError(
                f"seed has {len(seeds)} entries; it must be an int or have one for each of {self.num_envs}"
            )
        generators = [None if value is None else seeding.np_random(int(value))[0] for value in seeds]
        seeded = np.array([generator is not None for generator in generators]) & mask
        for i in np.flatnonzero(seeded).tolist():
            self._generators[i] = generators[i]
        if self._random:
            self._prepare(seeded)
        self._seeds = tuple(new if chosen else old for new, old, chosen in zip(seeds, self._seeds, mask, strict=True))


def _batched(records: np.ndarray, mask: np.ndarray) -> dict[str, Any]:
    """An array of records as a nested dict of arrays, each with the mask of the environments that have it."""
    values: dict[str, Any] = {}
    for name in records.dtype.names or ():
        field = records[name]
        values[name] = _batched(field, mask) if field.dtype.names else field
        values[f"_{name}"] = mask
    return values


def _no_starts(n: int, templates: Sequence[Settings]) -> Starts:
    """Arrays for n starts, large enough for whatever any of the settings draws."""
    different = list({id(template): template for template in templates}.values())
    faults = max(len(template.faults) + (1 if template.degradations else 0) for template in different)
    rows = max(_most_rows(template) for template in different)
    vehicles = len(different[0].vehicles)
    return Starts(
        parameters=np.zeros(n, record_dtype(Parameters)),
        states=np.zeros((n, 6)),
        lines=np.zeros((n, rows, 6)),
        faults=np.zeros((n, faults), record_dtype(DegradationParameters)),
        traffic=np.zeros((n, vehicles, 8)),
        plans=np.zeros((n, vehicles), record_dtype(TrafficParameters)),
    )


def _most_rows(settings: Settings) -> int:
    """Rows of the reference line: one for the lead-in and one for every segment, more where arcs are long.

    The whole road turns by at most 2 pi, in pieces of up to pi / 2.
    """
    if any(entry.setting.startswith("road") for entry in settings.randomise):
        return 1 + len(settings.road.segments) + 4
    return len(start_of(settings).line)


def _write_start(settings: Settings, starts: Starts, i: int) -> None:
    """Write an episode's start as entry i; what is left of a line begins at infinity, of the faults is none."""
    start = start_of(settings)
    starts.parameters[i], starts.states[i] = start.parameters[()], start.ego
    starts.lines[i] = 0.0
    starts.lines[i, :, S0] = np.inf
    starts.lines[i, : len(start.line)] = start.line
    starts.faults[i] = np.zeros((), starts.faults.dtype)
    starts.faults[i, : len(start.faults)] = start.faults
    starts.traffic[i], starts.plans[i] = start.traffic, start.plans


class Vectorised:
    """What ``gym.make_vec`` calls for one scenario: N of its environments; see :class:`SharedControlVectorEnv`.

    Args:
        case: the scenario.
    """

    def __init__(self, case: Case) -> None:
        self.case = case

    def __call__(self, num_envs: int = 1, **options: Any) -> SharedControlVectorEnv:
        """N environments of the scenario."""
        return SharedControlVectorEnv(self.case, num_envs, **options)


def __getattr__(name: str) -> Vectorised:
    """The entry point of a scenario, by its key in :data:`cases.CASES`."""
    if name not in CASES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return Vectorised(CASES[name])
