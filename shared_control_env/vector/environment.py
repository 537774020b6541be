"""Many environments behind Gymnasium's vector interface, stepped by one compiled kernel."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from gymnasium import logger, spaces
from gymnasium.envs.registration import load_env_creator
from gymnasium.error import ClosedEnvironmentError
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from shared_control_env.controllers.arrays import as_array
from shared_control_env.core.delaunay import MAX_HOLES
from shared_control_env.core.info import INFO
from shared_control_env.core.jit import is_interpreted
from shared_control_env.core.observation import FEATURES
from shared_control_env.core.records import (
    AUTOMATION_MEMORY,
    FAULT_MEMORY,
    MEMORY,
    PERSON_MEMORY,
    SCENE,
    SIGNALS,
)
from shared_control_env.envs import settings as configuration
from shared_control_env.envs.cases import CASES, Case
from shared_control_env.envs.episode import draw_episode, is_random
from shared_control_env.envs.seeds import checked_seed
from shared_control_env.envs.settings import OWN_TRAFFIC, Settings, plain
from shared_control_env.envs.slots import AUTHORITY, DRIVER, SLACK, SLOT_SPACES, Clipping, space_of
from shared_control_env.vector import cold_start, kernel
from shared_control_env.vector.records import (
    NOT_LOADED,
    PROGRAM,
    SOLVER,
    WORKSPACE,
    Batch,
    Outputs,
    Setup,
)
from shared_control_env.vector.starts import empty_starts, grown, sizes_for, write_start
from shared_control_env.vector.threads import Threads, cores

ONE_FOR_ALL = ("simulation_frequency", "policy_frequency", "duration", "other_vehicles_type")
"""Settings that all environments share."""

AT_ONCE = 100_000
"""Environment steps of a rollout between two looks at whether it is interrupted: less than a second of one core."""

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
        render_mode: ``rgb_array`` for a picture of every environment, or ``human`` for a window with environment 0;
            drawn by the single environment's viewer, one after the other.
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
        if not _is_integer(num_envs) or num_envs < 1:
            raise ValueError(f"num_envs = {num_envs!r} must be an integer of at least 1")
        if threads is not None and (not _is_integer(threads) or threads < 1):
            raise ValueError(f"threads = {threads!r} must be an integer of at least 1, or None for one a core")
        for name, value in (("limiter", limiter), ("driver", driver)):
            if not isinstance(value, bool | np.bool_):
                raise ValueError(
                    f"{name} = {value!r} must be True or False; for a driver of your own use DriverModel on the single "
                    "environment, or its commands as actions"
                )
        if is_interpreted():
            raise ValueError(
                "NUMBA_DISABLE_JIT is set, and the vectorised environment is compiled alone: unset it, or use gym.make "
                "or gym.make_vec(..., vectorization_mode='sync')"
            )
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ValueError(f"render_mode = {render_mode!r} must be one of {self.metadata['render_modes']} or None")
        self._mode = _autoreset_mode(autoreset_mode)
        self.num_envs, self.render_mode = int(num_envs), render_mode
        self._limiter, self._driver = bool(limiter), bool(driver)
        self._case = case
        self._viewer_env: Any = None
        self._noted = np.zeros(self.num_envs, INFO)
        self._drawn = {"rgb_array": self.num_envs, "human": 1}.get(render_mode or "", 0)
        settings = settings_for_kernel(case, {} if config is None else config)
        if settings.has_person and not driver:
            raise ValueError("config['person']['active'] = True would not act: it needs driver=True")
        self.metadata = {**type(self).metadata, "autoreset_mode": self._mode}
        self._define_spaces()
        few = max(1, num_envs // FEWEST_PER_THREAD)
        self._threads = Threads(min(threads, num_envs) if threads is not None else min(len(cores()), few))
        self._works = np.zeros(self._threads.count, WORKSPACE)
        self._programs = np.zeros(self._threads.count, PROGRAM)
        self._no_actions = Actions(np.zeros((num_envs, 2)), np.zeros((num_envs, 1)))
        self._everyone = np.ones(num_envs, dtype=bool)
        self._clipping = Clipping(self.num_envs)
        self._seeds: list[int | None] = [None] * num_envs
        self._generators: list[np.random.Generator | None] = [None] * num_envs
        self._solvers = NOT_LOADED
        self._adopt(settings, [settings] * num_envs)

    def _define_spaces(self) -> None:
        """Spaces of the open slots, once."""
        bound = {DRIVER: self._driver, AUTHORITY: self._limiter}
        self._open = tuple(slot for slot in SLOT_SPACES if not bound[slot])
        self._open_bounds = {slot: (SLOT_SPACES[slot].low[0], SLOT_SPACES[slot].high[0]) for slot in self._open}
        single = space_of(self._open)
        self.single_action_space = single
        self.single_observation_space = spaces.Box(-1.0, 1.0, (len(FEATURES),), dtype=np.float32)
        self.action_space = batch_space(single, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)

    def _adopt(self, settings: Settings, templates: list[Settings]) -> None:
        """Take on settings, all and those of each environment; nothing has begun then."""
        n = self.num_envs
        self._settings, self._templates = settings, templates
        self._started = False
        self._close_viewer()
        self.metadata["render_fps"] = settings.policy_frequency
        self._paths = np.zeros((self._drawn, settings.steps + 1, 2))
        self._random = any(template is not settings or is_random(template) for template in templates)
        self._episodes = [settings] * n
        sizes = sizes_for(templates)
        starts = empty_starts(0 if self._random else 1, sizes)
        if not self._random:
            write_start(settings, starts, 0)
        self._setup = Setup(
            starts=starts,
            steps=settings.steps,
            frames=settings.simulation_frequency // settings.policy_frequency,
            dt=1.0 / settings.simulation_frequency,
            limiter=self._limiter,
            driver=self._driver,
            solvers=self._solvers,
        )
        self._batch = Batch(
            **empty_starts(n, sizes)._asdict(),
            scenes=np.zeros(n, SCENE),
            signals=np.zeros(n, SIGNALS),
            memories=np.zeros(n, MEMORY),
            automations=np.zeros(n, AUTOMATION_MEMORY),
            fault_memories=np.zeros((n, sizes.faults), FAULT_MEMORY),
            persons=np.zeros(n if self._driver else 0, PERSON_MEMORY),
            crashed=np.zeros(n, dtype=bool),
            ended=np.zeros(n, dtype=bool),
        )

    def __getstate__(self) -> dict[str, Any]:
        """All but what belongs to this process: the viewer, and where the solvers are in its memory."""
        setup = self._setup._replace(solvers=NOT_LOADED)
        return {**self.__dict__, "_viewer_env": None, "_solvers": NOT_LOADED, "_setup": setup}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Go on where the pickled or copied one was."""
        self.__dict__.update(state)
        if self._started:
            self._load_solvers()

    @property
    def threads(self) -> int:
        """How many threads there are."""
        return self._threads.count

    @property
    def config(self) -> dict[str, Any]:
        """The settings of all environments, without what a list of :meth:`reset` changed in some; read only."""
        return configuration.ReadOnly(configuration.plain(self._settings))

    @property
    def scenes(self) -> np.ndarray:
        """What the sensors of each environment give, records of :data:`records.SCENE`, shape (N,); read only."""
        return _read_only(self._batch.scenes)

    @property
    def signals(self) -> np.ndarray:
        """Signals planned for the present step of each environment, records of :data:`records.SIGNALS`, shape (N,)."""
        return _read_only(self._batch.signals)

    @property
    def episodes(self) -> tuple[Settings, ...]:
        """Settings of the present episode of each environment, with all that is random drawn."""
        return tuple(self._episodes)

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """Seed of each environment, a random one where none was given."""
        for i in range(self.num_envs):
            self._generator(i)
        return tuple(seed for seed in self._seeds if seed is not None)

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """Generator of each environment."""
        return tuple(self._generator(i) for i in range(self.num_envs))

    @property
    def bytes_per_environment(self) -> int:
        """Memory of one environment's state [B], without what a step returns."""
        return sum(array.nbytes for array in self._batch) // self.num_envs

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
            ValueError: for unknown options, a wrong mask, wrong seeds or settings, all of which change nothing. Also if
                an episode cannot be drawn: no environment is reset then, but changed settings stay, and need a reset.
            ClosedEnvironmentError: after :meth:`close`.
        """
        self._check_open()
        if options is not None and not isinstance(options, Mapping):
            raise ValueError(f"options = {options!r} must be a dict")
        options = dict(options or {})
        mask = self._checked_mask(options.pop("reset_mask", None))
        config = options.pop("config", None)
        if options:
            raise ValueError(
                f"options has the unknown key(s) {sorted(map(str, options))}; valid are 'config' and 'reset_mask'"
            )
        if config is not None and not mask.all():
            raise ValueError("options['config'] changes all environments; it does not go with a partial 'reset_mask'")
        changed = None if config is None else self._changed(config)
        generators = self._seeded(seed)
        if changed is not None:
            self._adopt(*changed)
        for i in np.flatnonzero(mask).tolist():
            seeded = generators[i]
            if seeded is not None:
                self._generators[i], self._seeds[i] = seeded
        out = self._outputs()
        if self._started:  # Environments that the mask leaves out keep their last observation.
            out.observations[:] = self._observations
        if self._solvers == NOT_LOADED:
            self._load_solvers()
        self._begin(mask, out)
        self._started = True
        self._show()
        return out.observations, self._infos(out.infos, out.solver, mask)

    def step(self, actions: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Drive one time step in every environment.

        Args:
            actions: batch of the action space.

        Returns:
            Observations, rewards, terminations, truncations and infos, all new arrays.

        Raises:
            ValueError: for a malformed action, naming the environment's index where one is to blame; nothing has
                moved then. Also before the first reset, for an ended environment where the mode does not reset it, and
                if an episode cannot be drawn: before anything moves, or in the mode ``same_step`` after that, when the
                ended environments await a reset.
            ClosedEnvironmentError: after :meth:`close`.
        """
        self._check_ready()
        checked = self._checked_actions(actions)
        out = self._outputs(np.empty)  # all environments move, and write all of it
        _, finals = self._drive(1, checked, out)
        self._show()
        infos = self._infos(out.infos, out.solver, self._everyone.copy())
        if finals is not None:
            ended = finals.terminations | finals.truncations
            infos["final_obs"], infos["_final_obs"] = finals.observations, ended
            infos["final_info"], infos["_final_info"] = self._infos(finals.infos, finals.solver, ended), ended
        return out.observations, out.rewards, out.terminations, out.truncations, infos

    def rollout(self, steps: int) -> Rollout:
        """Drive many time steps; both slots must be bound.

        Where no episode is drawn, nothing is to be seen and no episode begins in the step that another ends in, many
        of them are taken without returning to Python in between. Where autoreset is disabled, an environment whose
        episode ends stands still from then on.

        Args:
            steps: how many, in every environment.

        Raises:
            ValueError: if a slot of the action is open, steps is below 1, there was no reset, an environment has ended
                already and the mode does not reset it, or, as for :meth:`step`, an episode cannot be drawn.
            ClosedEnvironmentError: after :meth:`close`.
        """
        self._check_ready()
        if self._open:
            raise ValueError(f"rollout() needs limiter=True and driver=True; open are {list(self._open)}")
        if not _is_integer(steps) or steps < 1:
            raise ValueError(f"steps = {steps!r} must be an integer of at least 1")
        out = self._outputs()
        one_by_one = self._random or self.render_mode is not None or self._mode is AutoresetMode.SAME_STEP
        piece = 1 if one_by_one else max(1, AT_ONCE // self.num_envs)
        taken = []
        for first in range(0, steps, piece):
            taken.append(self._drive(min(piece, steps - first), self._no_actions, out)[0])
            self._show()
        return Rollout(*(np.concatenate(parts) for parts in zip(*taken, strict=True)))

    def render(self) -> tuple[np.ndarray, ...] | None:
        """Draw: every environment in ``rgb_array`` mode, as a tuple of frames; environment 0 in the window else.

        Raises:
            ValueError: before the first reset.
            ClosedEnvironmentError: after :meth:`close`.
        """
        self._check_open()
        if not self._started:
            raise ValueError("render() needs a reset() first")
        if self.render_mode is None:
            logger.warn("render() draws nothing without a render_mode; pass one to gym.make_vec, such as 'rgb_array'")
            return None
        frames = [self._draw_picture(i) for i in range(self._drawn)]
        return None if self.render_mode == "human" else tuple(frames)

    def _draw_picture(self, i: int) -> Any:
        """Draw environment i by a single environment that is put into its place."""
        episode, batch = self._episodes[i], self._batch
        if self._viewer_env is None:
            make: Any = load_env_creator("shared_control_env.envs.shared_control:SharedControlEnv")
            self._viewer_env, self._shown = make(plain(episode), render_mode=self.render_mode), episode
        if self._shown is not episode:
            self._viewer_env.reset(options={"config": plain(episode)})
            self._shown = episode
        path = self._paths[i, : int(batch.scenes[i]["k"]) + 1]
        self._viewer_env.show(
            batch.states[i], batch.traffic[i], batch.scenes[i], batch.signals[i], self._noted[i], path
        )
        return self._viewer_env.render()

    def _show(self) -> None:
        """Draw what people look at all the time."""
        if self.render_mode == "human":
            self.render()

    def close_extras(self, **kwargs: Any) -> None:
        """Close the viewer and end the threads."""
        self._close_viewer()
        self._threads.close()

    def _close_viewer(self) -> None:
        if self._viewer_env is not None:
            self._viewer_env.close()
            self._viewer_env = None

    def _check_open(self) -> None:
        if self.closed:
            raise ClosedEnvironmentError(
                "the environments are closed, by close() or with a wrapper around them that is gone; make new ones"
            )

    def _check_ready(self) -> None:
        """Raise what keeps the environments from being driven on."""
        self._check_open()
        if not self._started:
            raise ValueError("a reset() is needed first")
        if self._mode is not AutoresetMode.NEXT_STEP and self._batch.ended.any():
            index = int(np.flatnonzero(self._batch.ended)[0])
            raise ValueError(f"environment {index} has ended; reset it with options={{'reset_mask': ...}}")

    def _changed(self, config: dict[str, Any] | Sequence[dict[str, Any]]) -> tuple[Settings, list[Settings]]:
        """Settings of all environments and of each, changed by a dict, or those of each by one entry of a list."""
        if isinstance(config, Mapping):
            settings, entries = _merged(self._settings, config), [config] * self.num_envs
        elif isinstance(config, list | tuple) and len(config) == self.num_envs:
            settings, entries = self._settings, list(config)
        else:
            n = self.num_envs
            raise ValueError(
                f"options['config'] = {config!r} must be a dict, or a list of one for each of {n} environments"
            )
        _check_for_kernel(settings)
        merged = {(id(self._settings), id(config)): settings}
        templates = []
        for template, entry in zip(self._templates, entries, strict=True):
            key = id(template), id(entry)
            if key not in merged:
                merged[key] = _merged(template, entry)
            templates.append(merged[key])
        for i, template in enumerate(templates):
            for name in ONE_FOR_ALL:
                if getattr(template, name) != getattr(settings, name):
                    raise ValueError(f"options['config'][{i}][{name!r}] must be that of all environments")
            if len(template.vehicles) != len(settings.vehicles):
                raise ValueError(f"options['config'][{i}]['vehicles'] must have as many entries as in all")
        return settings, templates

    def set_config(self, config: dict[str, Any] | Sequence[dict[str, Any]]) -> None:
        """Change settings of the episodes that begin from now on, as a curriculum does; those under way go on.

        Args:
            config: changes to the settings of all environments, or a list of such for each.

        Raises:
            ValueError: for wrong settings, or those that all environments share and that need a :meth:`reset`.
        """
        settings, templates = self._changed(config)
        for name in ONE_FOR_ALL:
            if getattr(settings, name) != getattr(self._settings, name):
                raise ValueError(
                    f"config[{name!r}] = {getattr(settings, name)!r} is shared by all environments, some of which are "
                    "in the middle of an episode; change it by reset(options={'config': ...})"
                )
        if len(settings.vehicles) != len(self._settings.vehicles):
            raise ValueError(
                f"config['vehicles'] has {len(settings.vehicles)} entries, and {len(self._settings.vehicles)} now; "
                "their number is changed by reset(options={'config': ...})"
            )
        if not self._started:
            self._adopt(settings, templates)
            return
        self._settings, self._templates, self._random = settings, templates, True
        sizes = sizes_for(templates)
        self._batch = grown(self._batch, sizes)
        self._setup = self._setup._replace(starts=empty_starts(0, sizes))

    def _load_solvers(self) -> None:
        """Have all compiled that a step runs."""

        def compile_kernel() -> None:
            nobody = np.zeros(self.num_envs, dtype=bool)
            self._advance(1, nobody, False, self._no_actions, self._outputs())

        self._solvers = cold_start.compile_all(compile_kernel, self._driver)
        self._setup = self._setup._replace(solvers=self._solvers)

    def _generator(self, i: int) -> np.random.Generator:
        """Generator of environment i, seeded at random unless it was given a seed."""
        generator = self._generators[i]
        if generator is None:
            generator, self._seeds[i] = seeding.np_random(None)
            self._generators[i] = generator
        return generator

    def _begin(self, mask: np.ndarray, out: Outputs) -> None:
        """Begin an episode in each environment that the mask names."""
        self._draw(mask)
        self._move(1, mask, True, self._no_actions, out)

    def _draw(self, mask: np.ndarray) -> None:
        """Draw an episode for each environment that the mask names, if anything is random; all of them, or none."""
        drawn = {}
        if self._random:
            drawn = {i: draw_episode(self._templates[i], self._generator(i)) for i in np.flatnonzero(mask).tolist()}
        self._clipping.clear(mask)
        self._batch.ended[mask] = True  # so that the kernel begins them, even if an interrupt comes between
        for i, episode in drawn.items():
            self._episodes[i] = episode
            write_start(episode, self._batch, i)

    def _drive(self, steps: int, actions: Actions, out: Outputs) -> tuple[Rollout, Outputs | None]:
        """Steps of all environments, one where an episode is drawn or begins in the step that another ends in.

        Returns:
            Rewards and ends; what those episodes ended with that others followed in the same step, None without any.
        """
        next_step = self._mode is AutoresetMode.NEXT_STEP
        if next_step:
            self._draw(self._batch.ended)
        result = self._move(steps, self._everyone, next_step, actions, out)
        ended = result.ends[-1]
        if self._mode is not AutoresetMode.SAME_STEP or not ended.any():
            return result, None
        finals = self._outputs()
        for final, present in zip(finals, out, strict=True):
            final[ended] = present[ended]
        self._begin(ended, out)
        for name in ("rewards", "terminations", "truncations"):
            getattr(out, name)[ended] = getattr(finals, name)[ended]
        return result, finals

    def _move(self, steps: int, active: np.ndarray, anew: bool, actions: Actions, out: Outputs) -> Rollout:
        """Advance environments, and keep what a later reset or picture needs even if an interrupt comes then."""
        try:
            return self._advance(steps, active, anew, actions, out)
        finally:
            self._observations = out.observations.copy()
            if self._drawn:
                self._noted = out.infos.copy() if active.all() else np.where(active, out.infos, self._noted)
                seen = np.arange(self._drawn)
                self._paths[seen, self._batch.scenes["k"][seen]] = self._batch.states[seen, :2]

    def _advance(self, steps: int, active: np.ndarray, anew: bool, actions: Actions, out: Outputs) -> Rollout:
        """Run :func:`kernel.advance`, in all threads at once; it lets go of Python's lock."""
        rewards = np.zeros((steps, self.num_envs))
        ends = np.zeros((steps, self.num_envs), dtype=bool)
        taken = np.zeros(self._threads.count, dtype=np.int64)

        def work(thread: int) -> None:
            kernel.advance(
                taken,
                steps,
                active,
                anew,
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

        self._threads.run(work)
        return Rollout(rewards, ends)

    def _outputs(self, allocate: Callable[..., np.ndarray] = np.zeros) -> Outputs:
        """New arrays for one step."""
        n = self.num_envs
        return Outputs(
            observations=allocate((n, len(FEATURES)), np.float32),
            rewards=allocate(n),
            terminations=allocate(n, bool),
            truncations=allocate(n, bool),
            infos=allocate(n, INFO),
            solver=allocate(n, SOLVER),
        )

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
            size = SLOT_SPACES[slot].shape[0]
            array = _numbers(given[slot])
            if array is None or array.shape != (self.num_envs, size):
                what = f"shape {array.shape}" if array is not None else f"the value {given[slot]!r}"
                raise ValueError(f"actions[{slot!r}] has {what}; it must be numbers of shape ({self.num_envs}, {size})")
            finite = np.isfinite(array)
            if not finite.all():
                index = int(np.argwhere(~finite)[0, 0])
                low, high = self._open_bounds[slot]
                raise ValueError(
                    f"action of environment {index}, slot {slot!r}, is {array[index]}; "
                    f"it must be finite, in [{low:g}, {high:g}]"
                )
            low, high = self._open_bounds[slot]
            self._clipping.note(slot, array, bool(array.max() > high + SLACK or array.min() < low - SLACK))
            values[slot] = array
        return Actions(values[DRIVER], values[AUTHORITY])

    def _checked_mask(self, mask: Any) -> np.ndarray:
        if mask is None:
            return self._everyone.copy()
        given, mask = mask, np.asarray(mask)
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_:
            raise ValueError(f"options['reset_mask'] = {given!r} must be a bool array of shape ({self.num_envs},)")
        if not mask.any():
            raise ValueError("options['reset_mask'] names no environment; at least one entry must be True")
        if not self._started and not mask.all():
            raise ValueError("options['reset_mask'] must name every environment at the first reset")
        return mask.copy()

    def _seeded(self, seed: int | Sequence[int | None] | None) -> list[tuple[np.random.Generator, int] | None]:
        """Generator and seed of each environment, None where none is given."""
        if seed is None:
            return [None] * self.num_envs
        one = np.ndim(seed) == 0  # type: ignore[arg-type]
        seeds: Any = [checked_seed(seed) + i for i in range(self.num_envs)] if one else seed  # type: ignore[operator]
        if isinstance(seeds, str) or not hasattr(seeds, "__len__") or len(seeds) != self.num_envs:
            raise ValueError(
                f"seed = {seed!r} must be an integer, or have one for each of {self.num_envs} environments"
            )
        numbers = [checked_seed(value, f"seed of environment {i}") for i, value in enumerate(seeds)]
        return [None if number is None else seeding.np_random(number) for number in numbers]


def settings_for_kernel(case: Case, config: Mapping[str, Any]) -> Settings:
    """Settings of a scenario with changes, checked, those too that the kernel alone refuses.

    Raises:
        ValueError: for a wrong setting, or one that the single environment alone has.
    """
    default = configuration.merge(configuration.plain(Settings()), case.settings)
    settings = configuration.check(configuration.change(default, config))
    _check_for_kernel(settings)
    return settings


def _merged(settings: Settings, changes: Mapping[str, Any]) -> Settings:
    """Settings with some changes, checked."""
    return configuration.check(configuration.change(configuration.plain(settings), changes))


def _check_for_kernel(settings: Settings) -> None:
    """Raise ValueError for settings that the single environment alone has."""
    if settings.other_vehicles_type != OWN_TRAFFIC:
        raise ValueError(
            f"config['other_vehicles_type'] = {settings.other_vehicles_type!r} is not in the kernel; allowed is "
            f"{OWN_TRAFFIC!r}; for others use gym.make_vec(..., vectorization_mode='sync')"
        )
    for i, entry in enumerate(settings.randomise):
        if entry.setting in ONE_FOR_ALL:
            raise ValueError(
                f"config['randomise'][{i}]['setting'] = {entry.setting!r} is shared by all environments of the kernel, "
                "so that it cannot be drawn; use gym.make_vec(..., vectorization_mode='sync')"
            )
    if len(settings.vehicles) > MAX_HOLES:
        raise ValueError(f"config['vehicles'] has {len(settings.vehicles)} entries; the kernel takes 0 to {MAX_HOLES}")


def _autoreset_mode(mode: AutoresetMode | str) -> AutoresetMode:
    """Gymnasium's mode by itself, its name or its value, such as ``same_step`` or ``SameStep``."""
    if isinstance(mode, AutoresetMode):
        return mode
    spellings = {each.name.lower().replace("_", ""): each for each in AutoresetMode}
    text = str(mode).lower().replace("_", "").replace("-", "")
    if text not in spellings:
        names = [each.name.lower() for each in AutoresetMode]
        raise ValueError(f"autoreset_mode = {mode!r} must be an AutoresetMode or one of {sorted(names)}")
    return spellings[text]


def _read_only(array: np.ndarray) -> np.ndarray:
    """A view that cannot be written to."""
    view = array.view()
    view.flags.writeable = False
    return view


def _is_integer(value: Any) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def _numbers(value: Any) -> np.ndarray | None:
    """A new array of real numbers, None where the value is something else."""
    try:
        array = np.asarray(as_array(value))
    except ValueError:  # rows of different lengths
        return None
    return array.astype(np.float64) if array.dtype.kind in "fiub" else None


def _batched(records: np.ndarray, mask: np.ndarray) -> dict[str, Any]:
    """An array of records as a nested dict of arrays, each with the mask of the environments that have it."""
    values: dict[str, Any] = {}
    for name in records.dtype.names or ():
        field = records[name]
        values[name] = _batched(field, mask) if field.dtype.names else field
        values[f"_{name}"] = mask
    return values


class Vectorised:
    """What ``gym.make_vec`` calls for one scenario: N of its environments; see :class:`SharedControlVectorEnv`.

    Args:
        case: the scenario.
    """

    def __init__(self, case: Case) -> None:
        self.case = case

    def __call__(self, num_envs: int = 1, **options: Any) -> SharedControlVectorEnv:
        """N environments of the scenario.

        Raises:
            ValueError: for another automation, which the kernel does not know; or as :class:`SharedControlVectorEnv`.
        """
        if options.pop("automation", None) is not None:
            raise ValueError(
                "automation: another one is not in the kernel; use gym.make_vec(..., vectorization_mode='sync')"
            )
        return SharedControlVectorEnv(self.case, num_envs, **options)


def __getattr__(name: str) -> Vectorised:
    """The entry point of a scenario, by its key in :data:`cases.CASES`."""
    if name not in CASES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return Vectorised(CASES[name])
