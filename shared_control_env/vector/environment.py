"""The vectorised environment: many environments behind Gymnasium's vector interface, stepped by one compiled kernel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from gymnasium import logger
from gymnasium.error import ClosedEnvironmentError
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from shared_control_env.controllers.allocators import Allocator, in_kernel
from shared_control_env.controllers.arrays import read_only
from shared_control_env.controllers.assessor import Assessor
from shared_control_env.core import kernel
from shared_control_env.core.authority.allocators import ALLOCATE, fuzzy_authority
from shared_control_env.core.batch import (
    NOT_LOADED,
    WORK,
    Outputs,
    Setup,
    empty_batch,
    empty_starts,
    new_outputs,
)
from shared_control_env.core.compile.calls import PACKAGE
from shared_control_env.core.compile.cold_start import cores
from shared_control_env.core.compile.jit import is_interpreted
from shared_control_env.core.control.predictive_driver import PROGRAM
from shared_control_env.core.feedback.info import as_batch
from shared_control_env.core.feedback.observation import OBSERVATIONS
from shared_control_env.core.loading import load
from shared_control_env.envs import settings as configuration
from shared_control_env.envs.episode import is_random
from shared_control_env.envs.scenarios import ENTRY, SCENARIOS, Scenario
from shared_control_env.envs.settings import Settings
from shared_control_env.envs.slots import AUTHORITY, DRIVER, NOT_DIRECT, SLOT_SPACES, observation_space, space_of
from shared_control_env.envs.starts import (
    enlarged,
    has_left,
    refresh_addresses,
    sizes_for,
    sizes_of,
    start_of,
    write_start,
)
from shared_control_env.vector.checks import (
    Actions,
    OpenSlots,
    changed_settings,
    check_shared_settings,
    checked_count,
    checked_generators,
    checked_mask,
    checked_mode,
    settings_for_kernel,
)
from shared_control_env.vector.episodes import Episodes
from shared_control_env.vector.pictures import Pictures
from shared_control_env.vector.threads import Threads

AT_ONCE = 100_000
"""Environment steps of a rollout between two checks for an interrupt; they take less than a second on one core."""

FEWEST_PER_THREAD = 32
"""Smallest number of environments per thread; with fewer, a further thread costs more time than it saves."""


class Rollout(NamedTuple):
    """Rewards and ends of episodes in a rollout.

    Attributes:
        rewards: reward of each step, shape (steps, N).
        ends: whether an episode ended in the step, shape (steps, N).
    """

    rewards: np.ndarray
    ends: np.ndarray


class SharedControlVectorEnv(VectorEnv):
    """N environments of one scenario in one kernel.

    For the same actions, environment i returns the same values as the single environment, because both call the same
    compiled functions. The action space is the Box of the open slot, a Dict of both slots if both are open, or
    ``Discrete(1)`` if both are bound.

    Args:
        scenario: the scenario.
        num_envs: number of environments N.
        config: changes to the settings of the scenario.
        render_mode: ``rgb_array`` for a picture of every environment, ``human`` for a window with environment 0, or
            None. The viewer of the single environment draws the pictures one after the other.
        limiter: True binds alpha_a to the fuzzy inference; an allocator with a ``compiled`` form binds it to that
            allocator; False leaves alpha_a open as the slot ``authority`` of the action.
        driver: True binds the driver's command to the paper's predictive driver, solved by an active-set method in
            the kernel; False leaves the command open as the slot ``driver`` of the action.
        autoreset_mode: Gymnasium's mode or its name, such as ``same_step``.
        threads: number of threads; None for one per core, or fewer for few environments.

    Raises:
        ValueError: for wrong settings, or settings that the kernel does not support.
    """

    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 20}

    def __init__(
        self,
        scenario: Scenario,
        num_envs: int = 1,
        config: dict[str, Any] | None = None,
        render_mode: str | None = None,
        limiter: bool | Allocator = True,
        driver: bool = False,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
    ) -> None:
        self.num_envs = n = checked_count("num_envs", num_envs)
        if threads is not None:
            threads = checked_count("threads", threads, ", or None for one a core")
        if not isinstance(driver, bool | np.bool_):
            raise ValueError(
                f"driver = {driver!r} must be True or False; for a driver of your own use DriverModel on the single "
                "environment, or its commands as actions"
            )
        self._allocate = _compiled(limiter)
        self._user_allocates = self._allocate is not None and self._allocate.__module__.partition(".")[0] != PACKAGE
        if is_interpreted():
            raise ValueError(
                "NUMBA_DISABLE_JIT is set, and the vectorised environment is compiled alone: unset it, or use gym.make "
                "or gym.make_vec(..., vectorization_mode='sync')"
            )
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ValueError(f"render_mode = {render_mode!r} must be one of {self.metadata['render_modes']} or None")
        self._mode, self.render_mode = checked_mode(autoreset_mode), render_mode
        self._driver = bool(driver)
        settings = settings_for_kernel(scenario, {} if config is None else config)
        self._check_driver([settings])
        self.metadata = {**type(self).metadata, "autoreset_mode": self._mode}
        self._observation = OBSERVATIONS[settings.observation.type]
        self._define_spaces()
        few = max(1, n // FEWEST_PER_THREAD)
        self._threads = Threads(min(threads, n) if threads is not None else min(len(cores()), few))
        self._works = np.zeros(self._threads.count, WORK)
        self._programs = np.zeros(self._threads.count, PROGRAM)
        self._pictures = Pictures(render_mode, n)
        self._everyone = np.ones(n, dtype=bool)
        self._episodes = Episodes(n)
        self._calls = NOT_LOADED
        self._adopt(settings, [settings] * n)

    def _define_spaces(self) -> None:
        """Define the spaces once, from the open slots and the observation type."""
        bound = {DRIVER: self._driver, AUTHORITY: self._allocate is not None}
        self._open = OpenSlots(self.num_envs, tuple(slot for slot in SLOT_SPACES if not bound[slot]))
        self.single_action_space = space_of(self._open.slots)
        self.single_observation_space = observation_space(self._observation)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)

    def _adopt(self, settings: Settings, templates: list[Settings]) -> None:
        """Adopt common settings and those of each environment. All environments need a reset afterwards."""
        n = self.num_envs
        self._settings = settings
        self._started = False
        self.metadata["render_fps"] = settings.policy_frequency
        self._pictures.restart(settings.steps)
        random = any(template is not settings or is_random(template) for template in templates)
        sizes = sizes_for(templates)
        self._episodes.adopt(templates, random, sizes, settings)
        starts = empty_starts(0 if random else 1, sizes)
        if not random:
            write_start(start_of(settings), starts, 0)
        self._setup = Setup(
            starts=starts,
            steps=settings.steps,
            frames=settings.simulation_frequency // settings.policy_frequency,
            dt=1.0 / settings.simulation_frequency,
            calls=self._calls,
            scales=self._observation.scales,
        )
        self._batch = empty_batch(n, sizes, self._driver)

    def __getstate__(self) -> dict[str, Any]:
        """State for pickling, without the function addresses, which are valid only in this process."""
        return {**self.__dict__, "_calls": NOT_LOADED, "_setup": self._setup._replace(calls=NOT_LOADED)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore pickled or copied environments, with the function addresses of this process."""
        self.__dict__.update(state)
        refresh_addresses(self._episodes, self._batch)
        self._episodes.tabulate(sizes_for(self._episodes.templates))
        refresh_addresses(self._episodes[: len(self._setup.starts.parameters)], self._setup.starts)
        if self._started:
            self._load()

    @property
    def threads(self) -> int:
        """Number of threads."""
        return self._threads.count

    @property
    def config(self) -> dict[str, Any]:
        """The common settings, without changes to single environments from a list in :meth:`reset`; read only."""
        return configuration.ReadOnly(configuration.plain(self._settings))

    @property
    def scenes(self) -> np.ndarray:
        """The perceived scene of each environment, records of :data:`records.SCENE`, shape (N,); read only."""
        return read_only(self._batch.scenes)

    @property
    def signals(self) -> np.ndarray:
        """Signals of the present step of each environment, records of :data:`records.SIGNALS`, (N,); read only."""
        return read_only(self._batch.signals)

    def views(self) -> list[np.ndarray]:
        """Scenes as read-only 0-d records, which always show the present step."""
        return [self.scenes[i : i + 1].reshape(()) for i in range(self.num_envs)]

    def signals_for_allocators(self) -> np.ndarray:
        """Copy of the signals with each driver's present u_h,act, records of :data:`records.SIGNALS`, shape (N,)."""
        signals = self._batch.signals.copy()
        signals["u_h_act"] = self._batch.memories["u_h_act"]
        return signals

    def assessors(self) -> list[Assessor]:
        """Answers to allocators' questions about the present step of each environment; valid until the next reset."""
        return [Assessor(i, self._batch, self._calls) for i in range(self.num_envs)]

    def show_alerts(self, alerts: np.ndarray) -> None:
        """Show each driver the alert of an allocator outside the kernel, from the next step on.

        Args:
            alerts: indices in :data:`core.authority.alerts.ALERTS`, shape (N,).
        """
        self._batch.signals["alert"] = alerts

    @property
    def episodes(self) -> tuple[Settings, ...]:
        """Settings of the present episode of each environment, with all random values drawn."""
        return tuple(self._episodes)

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """Seed of each environment; a random seed if none was given."""
        return self._episodes.known_seeds()

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """Generator of each environment."""
        return tuple(self._episodes.generator(i) for i in range(self.num_envs))

    @property
    def bytes_per_environment(self) -> int:
        """Memory of the state of one environment [B], without the arrays that a step returns."""
        return sum(array.nbytes for array in self._batch) // self.num_envs

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin episodes.

        Args:
            seed: an integer gives environment i the seed ``seed + i``; a sequence gives one seed to each environment.
            options: ``{"reset_mask": mask}`` resets only the environments in the mask, shape (N,).
                ``{"config": {...}}`` changes the settings of all environments; a list of N such dicts changes those
                of each environment.

        Returns:
            Observations, shape (N, n), and infos with masks as in Gymnasium.

        Raises:
            ValueError: for unknown options, a wrong mask, wrong seeds or wrong settings; nothing is changed then. Also
                if an episode cannot be drawn: no environment is reset then, but changed settings are kept and a reset
                is needed.
            ClosedEnvironmentError: after :meth:`close`.
        """
        self._check_open()
        if options is not None and not isinstance(options, Mapping):
            raise ValueError(f"options = {options!r} must be a dict")
        options = dict(options or {})
        mask = checked_mask(options.pop("reset_mask", None), self.num_envs, self._started)
        config = options.pop("config", None)
        if options:
            raise ValueError(
                f"options has the unknown key(s) {sorted(map(str, options))}; valid are 'config' and 'reset_mask'"
            )
        if config is not None and not mask.all():
            raise ValueError("options['config'] changes all environments; it does not go with a partial 'reset_mask'")
        changed = None if config is None else changed_settings(config, self._settings, self._episodes.templates)
        generators = checked_generators(seed, self.num_envs)
        if changed is not None:
            self._check_driver([changed[0], *changed[1]])
            self._adopt(*changed)
        for i in np.flatnonzero(mask).tolist():
            seeded = generators[i]
            if seeded is not None:
                self._episodes.seed(i, *seeded)
        out = self._outputs()
        if self._started:  # Environments outside the mask keep their last observation.
            out.observations[:] = self._observations
        if self._calls == NOT_LOADED:
            self._load()
        self._begin(mask, out)
        self._started = True
        self._show()
        return out.observations, self._infos(out.infos, out.drivers, mask)

    def step(self, actions: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Drive one time step in every environment.

        Args:
            actions: batch of actions, an element of ``action_space``.

        Returns:
            Observations, rewards, terminations, truncations and infos, all new arrays.

        Raises:
            ValueError: for a malformed action, with the index of the environment if there is one; nothing has moved
                then. Also before the first reset, and for an ended environment if the mode does not reset it. Also if
                an episode cannot be drawn: this is raised before anything moves, except in the mode ``same_step``,
                where the environments have moved and the ended ones need a reset. Also if a user-defined allocator
                gives an authority that is no number; the environments have moved then.
            ClosedEnvironmentError: after :meth:`close`.
        """
        self._check_ready()
        checked = self._open.checked(actions)
        out = self._outputs(np.empty)  # all environments move, and fill the arrays completely
        _, finals = self._drive(1, checked, out)
        self._show()
        infos = self._infos(out.infos, out.drivers, self._everyone.copy())
        if finals is not None:
            ended = finals.terminations | finals.truncations
            infos["final_obs"], infos["_final_obs"] = finals.observations, ended
            infos["final_info"] = self._infos(finals.infos, finals.drivers, ended, self._left)
            infos["_final_info"] = ended
        return out.observations, out.rewards, out.terminations, out.truncations, infos

    def rollout(self, steps: int) -> Rollout:
        """Drive many time steps; both slots must be bound.

        Many steps run without returning to Python, unless episodes are drawn at random, pictures are rendered, the
        autoreset mode is ``same_step``, or a user-defined allocator's authorities are checked. If autoreset is
        disabled, an environment stands still after the end of its episode.

        Args:
            steps: number of steps of every environment.

        Raises:
            ValueError: if a slot of the action is open, if ``steps`` is below 1, before the first reset, if an
                environment has ended and the mode does not reset it, or if an episode cannot be drawn, as in
                :meth:`step`.
            ClosedEnvironmentError: after :meth:`close`.
        """
        self._check_ready()
        if self._open.slots:
            raise ValueError(f"rollout() needs limiter=True and driver=True; open are {list(self._open.slots)}")
        steps = checked_count("steps", steps)
        out = self._outputs()
        same_step, drawn = self._mode is AutoresetMode.SAME_STEP, self.render_mode is not None
        one_by_one = self._episodes.random or self._user_allocates or drawn or same_step
        piece = 1 if one_by_one else max(1, AT_ONCE // self.num_envs)
        taken = []
        for first in range(0, steps, piece):
            taken.append(self._drive(min(piece, steps - first), self._open.no_actions, out)[0])
            self._show()
        return Rollout(*(np.concatenate(parts) for parts in zip(*taken, strict=True)))

    def render(self) -> tuple[np.ndarray, ...] | None:
        """Draw all environments as a tuple of frames in ``rgb_array`` mode, or environment 0 in the window.

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
        frames = [self._pictures.draw(i, self._episodes[i], self._batch) for i in range(self._pictures.drawn)]
        return None if self.render_mode == "human" else tuple(frames)

    def _check_driver(self, present: Sequence[Settings]) -> None:
        """Raise ValueError for a person beside an open driver's slot, or a direct slot that is bound."""
        if self._driver and any(settings.is_direct for settings in present):
            raise ValueError(NOT_DIRECT)
        if not self._driver and any(settings.has_person for settings in present):
            raise ValueError("the person in config['person'] or config['persons'] would not act: it needs driver=True")

    def _show(self) -> None:
        """Draw the window if there is one."""
        if self.render_mode == "human":
            self.render()

    def close_extras(self, **kwargs: Any) -> None:
        """Close the viewer and end the threads.

        Args:
            kwargs: ignored; part of Gymnasium's interface.
        """
        self._pictures.close()
        self._threads.close()

    def _check_open(self) -> None:
        if self.closed:
            raise ClosedEnvironmentError(
                "the environments are closed, by close() or with a wrapper around them that is gone; make new ones"
            )

    def _check_ready(self) -> None:
        """Raise an error if the environments cannot take a step."""
        self._check_open()
        if not self._started:
            raise ValueError("a reset() is needed first")
        if self._mode is not AutoresetMode.NEXT_STEP and self._batch.ended.any():
            index = int(np.flatnonzero(self._batch.ended)[0])
            raise ValueError(f"environment {index} has ended; reset it with options={{'reset_mask': ...}}")

    def set_config(self, config: dict[str, Any] | Sequence[dict[str, Any]]) -> None:
        """Change settings of future episodes, for example in a curriculum. Running episodes are not affected.

        Args:
            config: changes to the settings of all environments, or a list with one dict for each environment.

        Raises:
            ValueError: for wrong settings, or for shared settings that need a :meth:`reset`.
        """
        settings, templates = changed_settings(config, self._settings, self._episodes.templates)
        check_shared_settings(settings, self._settings)
        self._check_driver([settings, *templates])
        if not self._started:
            self._adopt(settings, templates)
            return
        self._settings, sizes = settings, sizes_for(templates)
        self._batch = enlarged(self._batch, sizes)
        self._episodes.adopt(templates, True, sizes_of(self._batch), None)
        self._setup = self._setup._replace(starts=empty_starts(0, sizes))

    def _load(self) -> None:
        """Compile everything that a step runs, or read it from numba's cache."""
        self._calls = load(self._driver, self._allocate, self._observation)
        self._setup = self._setup._replace(calls=self._calls)

    def _begin(self, mask: np.ndarray, out: Outputs) -> None:
        """Begin an episode in each environment of the mask."""
        self._draw(mask)
        self._move(1, mask, True, self._open.no_actions, out)

    def _draw(self, mask: np.ndarray) -> None:
        """Draw an episode for each environment of the mask if anything is random. A failed draw changes no episode."""
        if self._episodes.random:
            self._episodes.draw(mask, self._batch, self._threads)
        self._open.clipping.clear(mask)
        self._batch.ended[mask] = True

    def _drive(self, steps: int, actions: Actions, out: Outputs) -> tuple[Rollout, Outputs | None]:
        """Step all environments. ``steps`` must be 1 if episodes are drawn or the autoreset mode is ``same_step``.

        Returns:
            Rewards and ends; and the last outputs of episodes that ended and were reset in the same step, None if there
            are none.
        """
        next_step = self._mode is AutoresetMode.NEXT_STEP
        if next_step:
            self._draw(self._batch.ended)
        result = self._move(steps, self._everyone, next_step, actions, out)
        ended, self._left = result.ends[-1], has_left(self._batch.plans)
        if self._mode is not AutoresetMode.SAME_STEP or not ended.any():
            return result, None
        finals = self._outputs()
        for final, present in zip(finals, out, strict=True):
            final[ended] = present[ended]
        self._begin(ended, out)
        for name in ("rewards", "terminations", "truncations"):
            getattr(out, name)[ended] = getattr(finals, name)[ended]
        return result, finals

    def _move(self, steps: int, active: np.ndarray, autoreset: bool, actions: Actions, out: Outputs) -> Rollout:
        """Advance environments. What a later reset or picture needs is stored even if an interrupt occurs."""
        try:
            result = self._advance(steps, active, autoreset, actions, out)
        finally:
            self._observations = out.observations.copy()
            self._pictures.note(out.infos, active, self._batch)
        if self._user_allocates:
            wrong = np.flatnonzero(active & np.isnan(out.infos["alpha"]).any(axis=1))
            if len(wrong):
                raise ValueError(f"the allocator gave environment {wrong[0]} alpha_a = nan; it must be in [0, 1]")
        return result

    def _advance(self, steps: int, active: np.ndarray, autoreset: bool, actions: Actions, out: Outputs) -> Rollout:
        """Run :func:`kernel.advance` in all threads at once; it releases Python's global interpreter lock."""
        rewards = np.zeros((steps, self.num_envs))
        ends = np.zeros((steps, self.num_envs), dtype=bool)
        taken = np.zeros(self._threads.count, dtype=np.int64)

        def work(thread: int) -> None:
            kernel.advance(
                taken,
                steps,
                active,
                autoreset,
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

    def _outputs(self, allocate: Any = np.zeros) -> Outputs:
        """New arrays for one step."""
        return new_outputs(self.num_envs, self._observation.size, allocate)

    def _infos(
        self, infos: np.ndarray, drivers: np.ndarray, mask: np.ndarray, left: np.ndarray | None = None
    ) -> dict[str, Any]:
        """Convert records to nested dicts of arrays and masks; left: vehicles that have left their tracks."""
        values = as_batch(infos, mask, self._settings.terms)
        if self._settings.recording is not None:
            values["handed_over"] = has_left(self._batch.plans) if left is None else left
            values["_handed_over"] = mask
        if self._driver:
            values["driver"], values["_driver"] = as_batch(drivers, mask), mask
        return values


def _compiled(limiter: Any) -> Any:
    """The compiled function that allocates alpha_a in the kernel; None if alpha_a is an open slot of the action."""
    if isinstance(limiter, bool | np.bool_):
        return fuzzy_authority if limiter else None
    compiled = in_kernel(limiter)
    if compiled is None:
        raise ValueError(
            f"limiter = {limiter!r} must be True, False, or an allocator with a function ``compiled``, which the "
            "kernel can run; use an allocator in Python with AuthorityLimiter on the single environment, or pass its "
            "authorities as actions with limiter=False"
        )
    ALLOCATE.address(compiled)
    return compiled


class Vectorised:
    """Entry point of ``gym.make_vec`` for one scenario; see :class:`SharedControlVectorEnv`.

    Args:
        scenario: the scenario.

    Attributes:
        scenario: the scenario.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario

    def __call__(self, num_envs: int = 1, **options: Any) -> SharedControlVectorEnv:
        """Make N environments of the scenario.

        Args:
            num_envs: number of environments N.
            options: further arguments of :class:`SharedControlVectorEnv`.

        Raises:
            ValueError: for a user-defined automation, which the kernel cannot run; or as for
                :class:`SharedControlVectorEnv`.
        """
        if options.pop("automation", None) is not None:
            raise ValueError(
                "automation: another one is not in the kernel; use gym.make_vec(..., vectorization_mode='sync')"
            )
        return SharedControlVectorEnv(self.scenario, num_envs, **options)


def __getattr__(name: str) -> Vectorised:
    """The entry point of a scenario, found by its key in :data:`scenarios.SCENARIOS`."""
    key = name.removeprefix(ENTRY)
    if key not in SCENARIOS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return Vectorised(SCENARIOS[key])
