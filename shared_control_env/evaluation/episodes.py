"""Episodes of the benchmark: the plan of all episodes, and their run in one vectorised environment per batch."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from itertools import compress
from pathlib import Path
from platform import python_version
from time import perf_counter
from typing import Any, NamedTuple, TypeAlias

import numpy as np

import shared_control_env
from shared_control_env.controllers.allocators import Allocator, FuzzyAuthority, asks, decide, hide, in_kernel
from shared_control_env.controllers.automation import Planner
from shared_control_env.controllers.driver import Driver, checked_command
from shared_control_env.core.parameters import PERSONS, TRAFFIC_BODY
from shared_control_env.core.records import NEAR_S, NEAR_SPEED, PRECEDING, PRESENT, SPEED
from shared_control_env.core.world.road import locate
from shared_control_env.envs.degradations import DEGRADATIONS
from shared_control_env.envs.scenarios import SCENARIOS
from shared_control_env.envs.settings import Settings, change, combined, defaults, plain
from shared_control_env.envs.slots import AUTHORITY, DRIVER
from shared_control_env.envs.starts import recorded
from shared_control_env.evaluation.catalogue import AuthorityEntry, DriverEntry, Suite, choose_one
from shared_control_env.evaluation.metrics import Trajectory, measure_all
from shared_control_env.evaluation.severity import GradedFault, parse_fault
from shared_control_env.vector.environment import SharedControlVectorEnv

LARGEST_BATCH = 170
"""Largest number of episodes per batch: large enough for the kernel, small enough to lose little if interrupted."""

MOST_SEEDS = 1_000_000
"""Largest number of seeds of a run."""

NOT_IN_THE_NUMBERS = ("report.py", "replay.py", "statistics.py", "storage.py", "fingerprint.py", "viewer.py")
"""Source files that no result depends on."""

AS_GIVEN = "own"
"""Name in the table for the degradation that the scenario itself has."""


Fault: TypeAlias = "str | GradedFault | None"


class EpisodeBatch(NamedTuple):
    """Episodes that differ only in degradation and seed.

    Attributes:
        scenario: key of :data:`envs.scenarios.SCENARIOS`.
        driver: name and entry of the driver.
        authority: name and entry of the authority.
        episodes: fault and seed of each episode. The fault is the name of a degradation, a
            :class:`~shared_control_env.evaluation.severity.GradedFault`, or None for the scenario's own.
        config: changes to the scenario's settings.
        automation: makes a user-defined automation for each environment; None for the predictive controller.
        twins: whether the same episodes without a fault are run too, with which detection is measured.
    """

    scenario: str
    driver: tuple[str, DriverEntry]
    authority: tuple[str, AuthorityEntry]
    episodes: tuple[tuple[Fault, int], ...]
    config: Mapping[str, Any]
    automation: Callable[[], Planner] | None = None
    twins: bool = True

    @property
    def key(self) -> str:
        """Text that identifies the episodes, apart from driver and authority."""
        return json.dumps([self.scenario, self.episodes])


def plan(
    suite: Suite,
    drivers: Mapping[str, DriverEntry],
    authorities: Mapping[str, AuthorityEntry],
    seeds: Sequence[int],
    config: Mapping[str, Any],
    automation: Callable[[], Planner] | None = None,
) -> Iterator[EpisodeBatch]:
    """Divide all episodes of a suite into batches, in a fixed order.

    Args:
        suite: scenarios and degradations.
        drivers: driver entries by name.
        authorities: authority entries by name.
        seeds: seeds of the episodes of each scenario and degradation.
        config: changes to the settings of all scenarios.
        automation: makes a user-defined automation; None for the predictive controller.
    """
    episodes = [(degradation, seed) for degradation in suite.degradations for seed in seeds]
    for scenario in suite.scenarios:
        for driver in drivers.items():
            for authority in authorities.items():
                for i in range(0, len(episodes), LARGEST_BATCH):
                    part = tuple(episodes[i : i + LARGEST_BATCH])
                    yield EpisodeBatch(scenario, driver, authority, part, config, automation)


def settings_of(batch: EpisodeBatch, degradation: Fault) -> dict[str, Any]:
    """Changes to the scenario's settings for one episode of a batch.

    Args:
        batch: the batch.
        degradation: fault of the episode; None for the scenario's own.

    Raises:
        ValueError: if two of authority, suite, driver and the user's config disagree on one setting.
    """
    driver, entry = f"the driver {batch.driver[0]!r}", batch.driver[1]
    parts: list[tuple[str, Mapping[str, Any]]] = [
        (f"the authority {batch.authority[0]!r}", {"authority": {"law": batch.authority[1].law}}),
        (driver, entry.config),
        ("config", batch.config),
    ]
    if isinstance(degradation, GradedFault):
        parts.insert(1, (f"the fault {degradation.label!r}", degradation.settings()))
    elif degradation is not None:
        parts.insert(1, ("the suite", {"degradations": [degradation]}))
    config: dict[str, Any] = {}
    owners: dict[str, tuple[str, Any]] = {}
    for owner, changes in parts:
        for path, value in _leaves(changes):
            _refuse_clash(owners, owner, path, value)
            owners[path] = owner, value
        if owner == driver:
            owners.update({draw["setting"]: (driver, DRAWN) for draw in entry.draws})
        config = _joined(config, changes)
    given = batch.config.get("randomise")
    for draw in given if isinstance(given, list) else ():
        if isinstance(draw, Mapping) and isinstance(draw.get("setting"), str):
            _refuse_clash(owners, "config", draw["setting"], DRAWN)
    draws = (*entry.draws, *(degradation.draws() if isinstance(degradation, GradedFault) else ()))
    if draws:
        default = defaults(SCENARIOS[batch.scenario].settings)
        config["randomise"] = [*change(default, batch.config)["randomise"], *draws]
    return config


def without_fault(batch: EpisodeBatch, fault: Fault) -> dict[str, Any]:
    """Changes to the scenario's settings for the twin of an episode: the same but for the fault.

    Args:
        batch: the batch.
        fault: fault of the episode.
    """
    if isinstance(fault, str) or (fault is None and combined(SCENARIOS[batch.scenario].settings, {}).degradations):
        return settings_of(batch, "none")  # which draws as many random numbers as every other degradation
    config = settings_of(batch, None)
    return {**config, "faults": [], "degradations": []}


DRAWN = "a draw"
"""Placeholder for the value of a setting that is drawn."""


def _leaves(changes: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Paths of the settings in nested changes, such as ``driver_lag.K_h``, and their values."""
    for key, value in changes.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _refuse_clash(owners: Mapping[str, tuple[str, Any]], who: str, path: str, value: Any) -> None:
    """Raise ValueError if another owner gives a setting another value, or if a draw is involved."""
    owner, present = owners.get(path, (who, value))
    if owner != who and (present != value or value == DRAWN):
        what = "draws" if present == DRAWN else f"sets to {present!r}"
        raise ValueError(
            f"{who} changes {path!r}, which {owner} {what}; remove the change, or define an entry of your own"
        )


def _joined(first: Mapping[str, Any], second: Mapping[str, Any]) -> dict[str, Any]:
    """Merge two nested dicts of changes. The second has priority."""
    joined = dict(first)
    for key, value in second.items():
        both = isinstance(value, Mapping) and isinstance(joined.get(key), Mapping)
        joined[key] = _joined(joined[key], value) if both else value
    return joined


@cache
def source_digest() -> str:
    """Digest of the source files that results depend on, which distinguishes results of a changed checkout."""
    digest = sha256()
    for folder in ("core", "controllers", "envs", "wrappers", "vector", "learned", "evaluation"):
        for path in sorted((Path(shared_control_env.__file__).parent / folder).rglob("*.py")):
            if path.name not in NOT_IN_THE_NUMBERS:
                digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def versions() -> str:
    """Versions of Python, the packages and the sources that the results depend on."""
    packages = ("shared_control_env", "gymnasium", "highway-env", "numpy", "numba", "osqp")
    parts = [f"{name} {version(name)}" for name in packages]
    return ", ".join(["python " + python_version(), *parts, f"sources {source_digest()}"])


def bound_allocator(batch: EpisodeBatch, single: bool = False) -> bool | Allocator:
    """The allocator that the environments of a batch bind; False if it decides from outside.

    Args:
        batch: the batch.
        single: whether each episode has a single environment.
    """
    allocator = batch.authority[1].make()
    if not single and batch.automation is None:
        return allocator if in_kernel(allocator) else False
    return isinstance(allocator, FuzzyAuthority) and allocator.operators is None


def make_environment(batch: EpisodeBatch, n: int, render_mode: str | None = None, single: bool = False) -> Any:
    """Environments for n episodes of a batch. Slots are bound if their driver or allocator runs in the kernel.

    Args:
        batch: the batch.
        n: number of environments.
        render_mode: ``rgb_array`` or None.
        single: whether each episode has a single environment, as it has with a user-defined automation.
    """
    limiter, driver = bound_allocator(batch, single), batch.driver[1].make is None
    if single or batch.automation is not None:
        from shared_control_env.evaluation.one_by_one import SingleEnvironments  # needs highway-env

        automations = [None if batch.automation is None else batch.automation() for _ in range(n)]
        return SingleEnvironments(
            batch.scenario,
            automations,
            settings_of(batch, None),
            bool(limiter),
            driver,
            render_mode=render_mode,
        )
    return SharedControlVectorEnv(
        SCENARIOS[batch.scenario],
        n,
        config=settings_of(batch, None),
        limiter=limiter,
        driver=driver,
        render_mode=render_mode,
        threads=1,
    )


class Recorder:
    """Records the signals of all time steps of a batch.

    Args:
        steps: largest number of time steps T.
        n: number of episodes.

    Attributes:
        running: whether each episode is not over, shape (n,).
        lengths: number of time steps of each episode, shape (n,).
        crashed, left_road: whether each episode ended in a collision, or off the road, shape (n,).
        failures: number of solver failures of each episode, shape (n,).
        noticed: time at which a person at rest noticed something [s], nan if never, shape (n,).
        response: time from noticing to acting of a person at rest [s], 0 for other drivers, shape (n,).
    """

    STATES = ("z", "y_target", "v_target", "neighbours")
    """Signals whose last value is that of the state in which the episode ends."""

    SIGNALS = (*STATES, "u", "u_h_act", "u_a_act", "alpha_a", "alert", "fault_active")

    def __init__(self, steps: int, n: int) -> None:
        self._values: dict[str, np.ndarray] = {}
        self._shape = (steps + 1, n)
        self.lengths = np.full(n, steps)
        self.crashed, self.left_road = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
        self.failures, self.noticed, self.response = np.zeros(n, dtype=int), np.full(n, np.nan), np.zeros(n)
        self.running = np.ones(n, dtype=bool)

    def note(self, k: int, infos: Mapping[str, Any], ended: np.ndarray, scenes: np.ndarray) -> bool:
        """Record the signals of one step, and the ends of episodes.

        Args:
            k: index of the time step.
            infos: infos of all environments.
            ended: whether the episode of each environment has ended, shape (n,).
            scenes: scenes after the step, records of :data:`core.records.SCENE`, shape (n,).

        Returns:
            Whether any episode is still running.
        """
        for name in self.SIGNALS:
            value = np.asarray(infos[name])
            if name not in self._values:
                self._values[name] = np.zeros((*self._shape, *value.shape[1:]), value.dtype)
            self._values[name][k, self.running] = value[self.running]
        failures = infos["automation"]["failures"] + (infos["driver"]["failures"] if "driver" in infos else 0)
        self.failures[self.running] = failures[self.running]
        if "driver" in infos:
            self.response[self.running] = infos["driver"]["response"][self.running]
            noticed = infos["driver"]["noticed"]
            seen = self.running & np.isfinite(noticed)
            self.noticed[seen] = noticed[seen]
        over = self.running & ended
        self.lengths[over] = k + 1
        for name in self.STATES:
            self._values[name][k + 1, over] = scenes[name][over]
        self.crashed[over], self.left_road[over] = infos["crashed"][over], ~infos["on_road"][over]
        self.running &= ~ended
        return bool(self.running.any())

    def trajectory(self, i: int, settings: Any, wall_time: float, twin: int | None = None) -> Trajectory:
        """The trajectory of one episode.

        Args:
            i: index of the episode.
            settings: settings of the episode.
            wall_time: computing time of the episode [s].
            twin: index of the same episode without a fault; None if it was not run.
        """
        T = self.lengths[i]
        value = {name: array[: T + (name in self.STATES), i] for name, array in self._values.items()}
        sound = np.full(T, np.nan)
        if twin is not None:
            both = min(T, self.lengths[twin])
            sound[:both] = self._values["alpha_a"][:both, twin]
        limits = np.array([settings.limits.a_max, settings.limits.delta_max])
        ahead = value["neighbours"][:, PRECEDING]
        gap = ahead[:, NEAR_S] - value["z"][:, 0] - 0.5 * (settings.vehicle.length + TRAFFIC_BODY[0])
        present = ahead[:, PRESENT] > 0.0
        gap = np.where(present, gap, np.inf)
        if self.crashed[i]:
            gap[-1] = 0.0
        return Trajectory(
            dt=1.0 / settings.policy_frequency,
            lateral_error=value["z"][:, 1] - value["y_target"],
            lane_width=settings.road.lane_width,
            body_width=settings.vehicle.width,
            speed=value["z"][:, 3],
            target_speed=value["v_target"],
            lateral_speed=value["z"][:, 4],
            yaw_rate=value["z"][:, 5],
            command=value["u"] / limits,
            delta_max=settings.limits.delta_max,
            a_max=settings.limits.a_max,
            gap=gap,
            lead_speed=np.where(present, ahead[:, NEAR_SPEED], 0.0),
            driver=value["u_h_act"] / limits,
            automation=value["u_a_act"] / limits,
            authority=value["alpha_a"],
            sound_authority=sound,
            alert=value["alert"] > 0,
            degraded=value["fault_active"],
            crashed=bool(self.crashed[i]),
            left_road=bool(self.left_road[i]),
            solver_failures=int(self.failures[i]),
            wall_time=wall_time,
            human=human_of(settings, value["z"]),
        )


def human_of(settings: Settings, z: np.ndarray) -> np.ndarray | None:
    """Distance and difference of speed to the recorded vehicle whose place the ego has taken.

    Args:
        settings: settings of the episode.
        z: states of the ego in the road frame, shape (T + 1, 6).

    Returns:
        Distance [m] and speed minus that of the vehicle [m/s] while it is recorded, shape (n, 2); None without one.
    """
    replay = None if settings.recording is None else recorded(settings)
    if replay is None or replay.human is None:
        return None
    frames = settings.simulation_frequency // settings.policy_frequency
    track = replay.human[: replay.human_steps : frames][: len(z)]
    placed = np.array([locate(replay.line, x, y)[:2] for x, y in track[:, :2]])
    distance = np.hypot(*(z[: len(track), :2] - placed).T)
    return np.column_stack([distance, z[: len(track), 3] - track[:, SPEED]])


class Policies:
    """Drivers and allocators of a batch that run in Python, one instance per environment.

    Args:
        batch: the batch.
        seeds: seed of each environment.
        env: environments of the batch, after their reset.
        single: whether each episode has a single environment.
    """

    def __init__(self, batch: EpisodeBatch, seeds: Sequence[int], env: Any, single: bool = False) -> None:
        self._env, self._scenes = env, env.views()
        self._limits = np.array([[each.limits.a_max, each.limits.delta_max] for each in env.episodes])
        make_driver, make_allocator = batch.driver[1].make, batch.authority[1].make
        bound = bool(bound_allocator(batch, single))
        self._names = f"driver {batch.driver[0]!r}", f"authority {batch.authority[0]!r}"
        self._drivers: list[Driver] = [make_driver() for _ in seeds] if make_driver else []
        self._allocators: list[Allocator] = [] if bound else [make_allocator() for _ in seeds]
        asked = bool(self._allocators) and asks(self._allocators[0])
        self._assessors = env.assessors() if asked else [None] * len(seeds)
        for seed, *policies in zip(seeds, *(each for each in (self._drivers, self._allocators) if each), strict=True):
            for policy in policies:
                policy.reset(seed=seed)

    def decide(self, observations: np.ndarray) -> Any:
        """Actions of all environments for the open slots.

        Args:
            observations: observations of all environments, shape (N, n).

        Returns:
            Values of the open slot, or a dict of both slots; an empty dict if both are bound.
        """
        action = {}
        if self._drivers:
            commands = [
                checked_command(driver.act(observation, scene), self._names[0])
                for driver, observation, scene in zip(self._drivers, observations, self._scenes, strict=True)
            ]
            action[DRIVER] = np.clip(np.array(commands) / self._limits, -1.0, 1.0)
        if self._allocators:
            shown = self._env.signals_for_allocators()
            hide(shown, self._allocators[0])
            alphas, alerts = zip(
                *(
                    decide(*each, self._names[1])
                    for each in zip(self._allocators, self._scenes, _records(shown), self._assessors, strict=True)
                ),
                strict=True,
            )
            self._env.show_alerts(np.array(alerts))
            action[AUTHORITY] = np.array(alphas)
        return action if len(action) != 1 else next(iter(action.values()))


def _records(array: np.ndarray) -> list[np.ndarray]:
    """The records of an array, each as a 0-d array."""
    return [array[i : i + 1].reshape(()) for i in range(len(array))]


class RunningBatch:
    """The episodes of a batch, driven step by step.

    Args:
        batch: the batch.
        render_mode: ``rgb_array`` or None.
        single: whether each episode has a single environment; the others share a vectorised one.

    Attributes:
        batch: the batch.
        env: the environments.
        configs: changes to the scenario's settings, by environment.
        drawn: settings of each episode, with all random values drawn.
        recorder: what the metrics need.
        observations, rewards, terminations, truncations, infos: what the environments gave last.
    """

    def __init__(self, batch: EpisodeBatch, render_mode: str | None = None, single: bool = False) -> None:
        changes = {fault: settings_of(batch, fault) for fault, _ in batch.episodes}
        configs, seeds = [changes[fault] for fault, _ in batch.episodes], [seed for _, seed in batch.episodes]
        self._twins, added = _twins(batch)
        for fault, seed in added:
            configs.append(without_fault(batch, fault))
            seeds.append(seed)
        self.batch, self.configs = batch, configs
        self.env = make_environment(batch, len(seeds), render_mode, single)
        self.observations, self.infos = self.env.reset(seed=seeds, options={"config": configs})
        self.drawn = self.env.episodes
        self._steps = max(episode.steps for episode in self.drawn)  # they are equal in the kernel
        self.recorder, self._policies = Recorder(self._steps, len(seeds)), Policies(batch, seeds, self.env, single)
        self.rewards, self._k = np.zeros(len(seeds)), 0
        self.terminations, self.truncations = np.zeros((2, len(seeds)), dtype=bool)

    def step(self) -> bool:
        """Drive one time step in every episode that is not over.

        Returns:
            Whether any episode goes on.
        """
        action = self._policies.decide(self.observations)
        outcome = self.env.step(action)
        self.observations, self.rewards, self.terminations, self.truncations, self.infos = outcome
        ended = self.terminations | self.truncations
        going = self.recorder.note(self._k, self.infos, ended, self.env.scenes)
        self._k += 1
        return going and self._k < self._steps

    def rows(self, wall_time: float) -> list[dict[str, Any]]:
        """One row per episode of the batch, see :func:`run`.

        Args:
            wall_time: computing time of each episode [s].
        """
        made_with, recorder, drawn = versions(), self.recorder, self.drawn
        return [
            {
                "scenario": self.batch.scenario,
                "degradation": name_of(fault),
                "driver": self.batch.driver[0],
                "authority": self.batch.authority[0],
                "seed": seed,
                "terminated": bool(recorder.crashed[i] or recorder.left_road[i]),
                "duration": recorder.lengths[i] / drawn[i].policy_frequency,
                "K_h": np.nan if drawn[i].is_direct else drawn[i].driver_lag.K_h,
                "T_h": np.nan if drawn[i].is_direct else drawn[i].driver_lag.T_h,
                "person": person_of(drawn[i]),
                "response": recorder.response[i],
                "noticed": recorder.noticed[i],
                **fault_of(drawn[i]),
                **measure_all(recorder.trajectory(i, drawn[i], wall_time, self._twins.get((fault, seed)))),
                "config_hash": config_hash(self.batch.scenario, self.configs[i]),
                "version": version("shared_control_env"),
                "versions": made_with,
            }
            for i, (fault, seed) in enumerate(self.batch.episodes)
        ]


def run(batch: EpisodeBatch, frames: list[np.ndarray] | None = None) -> list[dict[str, Any]]:
    """Run a batch.

    Args:
        batch: the batch.
        frames: list to which pictures are appended, of the start and of the end of each step of the episodes that are
            not over; None for no pictures.

    Returns:
        One row per episode: identity, end, the driver's K_h [-] and T_h [s], the person at the wheel, with the response
        time and the time at which a person at rest noticed something [s], all metrics, and the versions.
    """
    begin = perf_counter()
    running = RunningBatch(batch, None if frames is None else "rgb_array")
    going, shown = True, np.ones(len(batch.episodes), dtype=bool)
    while going:
        _append_pictures(frames, running, shown)
        shown = running.recorder.running[: len(batch.episodes)].copy()
        going = running.step()
    _append_pictures(frames, running, shown)
    running.env.close()
    return running.rows((perf_counter() - begin) / len(running.configs))


def _append_pictures(frames: list[np.ndarray] | None, running: RunningBatch, shown: np.ndarray) -> None:
    """Append the pictures of some episodes of a batch, unless no pictures are wanted."""
    if frames is not None:
        frames.extend(compress(running.env.render() or (), shown))


def fault_named(name: str) -> Fault:
    """The fault of a name, as :func:`name_of` gives it.

    Args:
        name: key of :data:`envs.degradations.DEGRADATIONS`, ``own`` or ``kind:channel:size:duration``.

    Raises:
        ValueError: for an unknown name, with the nearest one, or for a size that its kind does not allow.
    """
    if isinstance(name, str) and ":" in name:
        return parse_fault(name)
    choose_one("degradation", name, {AS_GIVEN: None, **DEGRADATIONS})
    return None if name == AS_GIVEN else name


def name_of(fault: Fault) -> str:
    """Name of a fault in the tables.

    Args:
        fault: fault of an episode.
    """
    return fault.label if isinstance(fault, GradedFault) else fault or AS_GIVEN


def _twins(batch: EpisodeBatch) -> tuple[dict[tuple[Fault, int], int], list[tuple[Fault, int]]]:
    """Index of the environment that runs the twin of each episode with a fault, and the episodes to run a twin of.

    Episodes of the batch without a fault are twins themselves; the others come after the episodes of the batch.
    """
    twins: dict[tuple[Fault, int], int] = {}
    added: list[tuple[Fault, int]] = []
    if not batch.twins:
        return twins, added
    sound = {seed: i for i, (fault, seed) in enumerate(batch.episodes) if fault == "none"}
    for fault, seed in batch.episodes:
        if fault == "none":
            continue
        if seed not in sound:
            sound[seed] = len(batch.episodes) + len(added)
            added.append((fault, seed))
        twins[fault, seed] = sound[seed]
    return twins, added


def fault_of(settings: Settings) -> dict[str, Any]:
    """Kind, channel, size, onset [s] and duration [s] of an episode's first fault; empty or NaN without one.

    Args:
        settings: settings of one episode.
    """
    if not settings.faults:
        return {"fault_kind": "", "fault_channel": "", **dict.fromkeys(_OF_A_FAULT, np.nan)}
    first = settings.faults[0]
    numbers = (first.size, first.onset, first.duration)
    return {
        "fault_kind": first.kind,
        "fault_channel": first.channel,
        **dict(zip(_OF_A_FAULT, (np.nan if each is None else each for each in numbers), strict=True)),
    }


_OF_A_FAULT = ("fault_size", "fault_onset", "fault_duration")


def person_of(settings: Settings) -> str:
    """Name of the person at the wheel: a key of :data:`core.parameters.PERSONS`, ``own``, or empty without a person.

    The delay of perception, which differs between the persons of a population, does not count.

    Args:
        settings: settings of one episode.
    """
    if not settings.has_person:
        return ""
    fields = {key: value for key, value in plain(settings)["person"].items() if key not in ("seed", "delay")}
    return next((name for name, each in PERSONS.items() if fields.items() <= each._asdict().items()), "own")


def config_hash(scenario: str, changes: Mapping[str, Any]) -> str:
    """Digest of the settings of a scenario and of the changes to them.

    Args:
        scenario: key of :data:`envs.scenarios.SCENARIOS`.
        changes: changes to the settings of the scenario.
    """
    return sha256(json.dumps([SCENARIOS[scenario].settings, changes], sort_keys=True).encode()).hexdigest()[:12]
