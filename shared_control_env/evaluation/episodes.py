"""Episodes of the benchmark: which there are, and their run in one vectorised environment a batch."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from platform import python_version
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

import shared_control_env
from shared_control_env.controllers.allocators import Allocator, checked_authority
from shared_control_env.controllers.automation import Planner
from shared_control_env.controllers.driver import Driver, checked_command
from shared_control_env.core.parameters import TRAFFIC_BODY
from shared_control_env.core.records import NEAR_S, NEAR_SPEED, PRECEDING, PRESENT
from shared_control_env.envs.scenarios import SCENARIOS
from shared_control_env.envs.settings import Settings, change, merge, plain
from shared_control_env.envs.slots import AUTHORITY, DRIVER
from shared_control_env.evaluation.catalogue import AuthorityEntry, DriverEntry, Suite
from shared_control_env.evaluation.metrics import Trajectory, measure_all
from shared_control_env.vector.environment import SharedControlVectorEnv

LARGEST_BATCH = 170
"""Episodes that run together at most: large enough for the kernel, small enough to lose little when stopped."""

MOST_SEEDS = 1_000_000
"""Largest number of seeds of a run."""

NOT_IN_THE_NUMBERS = ("report.py", "replay.py", "statistics.py", "storage.py", "fingerprint.py", "graphics.py")
"""Sources that no result depends on."""

AS_GIVEN = "own"
"""Name of the degradation that a scenario has by itself."""


class Batch(NamedTuple):
    """Episodes that differ in degradation and seed alone.

    Attributes:
        scenario: key of :data:`envs.scenarios.SCENARIOS`.
        driver: name, and entry.
        authority: name, and entry.
        episodes: degradation (None for the scenario's own) and seed of each.
        config: changes to the scenario's settings.
        automation: makes another automation for each environment; None for the predictive controller.
    """

    scenario: str
    driver: tuple[str, DriverEntry]
    authority: tuple[str, AuthorityEntry]
    episodes: tuple[tuple[str | None, int], ...]
    config: Mapping[str, Any]
    automation: Callable[[], Planner] | None = None

    @property
    def key(self) -> str:
        """Text that says which episodes these are, beside driver and authority."""
        return json.dumps([self.scenario, self.episodes])


def plan(
    suite: Suite,
    drivers: Mapping[str, DriverEntry],
    authorities: Mapping[str, AuthorityEntry],
    seeds: Sequence[int],
    config: Mapping[str, Any],
    automation: Callable[[], Planner] | None = None,
) -> Iterator[Batch]:
    """All episodes of a suite in batches, in a fixed order.

    Args:
        suite: scenarios and degradations.
        drivers: by name.
        authorities: by name.
        seeds: of the episodes of each scenario and degradation.
        config: changes to the settings of all scenarios.
        automation: makes another automation; None for the predictive controller.
    """
    episodes = [(degradation, seed) for degradation in suite.degradations for seed in seeds]
    for scenario in suite.scenarios:
        for driver in drivers.items():
            for authority in authorities.items():
                for i in range(0, len(episodes), LARGEST_BATCH):
                    part = tuple(episodes[i : i + LARGEST_BATCH])
                    yield Batch(scenario, driver, authority, part, config, automation)


def settings_of(batch: Batch, degradation: str | None) -> dict[str, Any]:
    """Changes to the scenario's settings for one episode of a batch.

    Raises:
        ValueError: if two of authority, suite, driver and the user's config say different things of one setting.
    """
    driver, entry = f"the driver {batch.driver[0]!r}", batch.driver[1]
    parts: list[tuple[str, Mapping[str, Any]]] = [
        (f"the authority {batch.authority[0]!r}", {"authority": {"law": batch.authority[1].law}}),
        (driver, entry.config),
        ("config", batch.config),
    ]
    if degradation is not None:
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
            _refuse_clash({k: v for k, v in owners.items() if v[0] != "config"}, "config", draw["setting"], DRAWN)
    if entry.draws:
        default = merge(plain(Settings()), SCENARIOS[batch.scenario].settings)
        config["randomise"] = [*change(default, batch.config)["randomise"], *entry.draws]
    return config


DRAWN = "a draw"
"""Stands for the value of a setting that is drawn."""


def _leaves(changes: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Paths of the settings that nested changes name, such as ``driver_lag.K_h``, and their values."""
    for key, value in changes.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _refuse_clash(owners: Mapping[str, tuple[str, Any]], who: str, path: str, value: Any) -> None:
    """Raise ValueError where a setting is another's, and has another value there."""
    owner, present = owners.get(path, (who, value))
    if owner != who and (present != value or value == DRAWN):
        what = "draws" if present == DRAWN else f"sets to {present!r}"
        raise ValueError(
            f"{who} changes {path!r}, which {owner} {what}; leave it out, or give an entry of your own for it"
        )


def _joined(first: Mapping[str, Any], second: Mapping[str, Any]) -> dict[str, Any]:
    """Two nested dicts of changes as one; the second counts where both say something."""
    joined = dict(first)
    for key, value in second.items():
        both = isinstance(value, Mapping) and isinstance(joined.get(key), Mapping)
        joined[key] = _joined(joined[key], value) if both else value
    return joined


@cache
def source_digest() -> str:
    """Digest of the sources that the numbers come from, so that those of a changed checkout are told apart."""
    digest = sha256()
    for folder in ("core", "controllers", "envs", "vector", "learned", "evaluation"):
        for path in sorted((Path(shared_control_env.__file__).parent / folder).rglob("*.py")):
            if path.name not in NOT_IN_THE_NUMBERS:
                digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def versions() -> str:
    """Versions that enter the results."""
    packages = ("shared_control_env", "gymnasium", "highway-env", "numpy", "numba", "osqp")
    parts = [f"{name} {version(name)}" for name in packages]
    return ", ".join(["python " + python_version(), *parts, f"sources {source_digest()}"])


def make_environment(batch: Batch, render_mode: str | None = None) -> Any:
    """Environment of a batch's episodes, with the slots bound that need no Python.

    Args:
        batch: the episodes.
        render_mode: ``rgb_array`` or None.
    """
    limiter, driver = batch.authority[1].make is None, batch.driver[1].make is None
    if batch.automation is not None:
        from shared_control_env.evaluation.one_by_one import SingleEnvironments  # which needs highway-env

        automations = [batch.automation() for _ in batch.episodes]
        return SingleEnvironments(
            batch.scenario, automations, settings_of(batch, None), limiter, driver, render_mode=render_mode
        )
    return SharedControlVectorEnv(
        SCENARIOS[batch.scenario],
        len(batch.episodes),
        config=settings_of(batch, None),
        limiter=limiter,
        driver=driver,
        render_mode=render_mode,
        threads=1,
    )


class Recorder:
    """Signals of all time steps of a batch.

    Args:
        steps: T.
        n: episodes.
    """

    SIGNALS = ("z", "y_target", "v_target", "u", "u_h_act", "u_a_act", "alpha_a", "neighbours", "fault_active")

    def __init__(self, steps: int, n: int) -> None:
        self._values: dict[str, np.ndarray] = {}
        self._shape = (steps, n)
        self.lengths = np.full(n, steps)
        self.crashed, self.left_road = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
        self.failures, self.noticed = np.zeros(n, dtype=int), np.full(n, np.nan)
        self._running = np.ones(n, dtype=bool)

    def note(self, k: int, infos: Mapping[str, Any], ended: np.ndarray) -> bool:
        """Keep the signals of step k, and how episodes end with it; whether any goes on."""
        for name in self.SIGNALS:
            value = np.asarray(infos[name])
            if name not in self._values:
                self._values[name] = np.zeros((*self._shape, *value.shape[1:]), value.dtype)
            self._values[name][k] = value
        failures = infos["automation"]["failures"] + (infos["driver"]["failures"] if "driver" in infos else 0)
        self.failures[self._running] = failures[self._running]
        if "driver" in infos:
            noticed = infos["driver"]["noticed"]
            seen = self._running & np.isfinite(noticed)
            self.noticed[seen] = noticed[seen]
        over = self._running & ended
        self.lengths[over] = k + 1
        self.crashed[over], self.left_road[over] = infos["crashed"][over], ~infos["on_road"][over]
        self._running &= ~ended
        return bool(self._running.any())

    def trajectory(self, i: int, settings: Any, wall_time: float) -> Trajectory:
        """Episode i."""
        value = {name: array[: self.lengths[i], i] for name, array in self._values.items()}
        limits = np.array([settings.limits.a_max, settings.limits.delta_max])
        ahead = value["neighbours"][:, PRECEDING]
        gap = ahead[:, NEAR_S] - value["z"][:, 0] - 0.5 * (settings.vehicle.length + TRAFFIC_BODY[0])
        present = ahead[:, PRESENT] > 0.0
        return Trajectory(
            dt=1.0 / settings.policy_frequency,
            lateral_error=value["z"][:, 1] - value["y_target"],
            lane_width=settings.road.lane_width,
            speed=value["z"][:, 3],
            target_speed=value["v_target"],
            yaw_rate=value["z"][:, 5],
            command=value["u"] / limits,
            delta_max=settings.limits.delta_max,
            a_max=settings.limits.a_max,
            gap=np.where(present, gap, np.inf),
            lead_speed=np.where(present, ahead[:, NEAR_SPEED], 0.0),
            driver=value["u_h_act"] / limits,
            automation=value["u_a_act"] / limits,
            authority=value["alpha_a"],
            degraded=value["fault_active"],
            crashed=bool(self.crashed[i]),
            left_road=bool(self.left_road[i]),
            solver_failures=int(self.failures[i]),
            wall_time=wall_time,
        )


class Policies:
    """Drivers and allocators of a batch that Python runs, one of each an environment.

    Args:
        batch: the episodes.
        env: their environment, reset.
    """

    def __init__(self, batch: Batch, env: Any) -> None:
        self._scenes, self._signals = env.views()
        limits = env.config["limits"]
        self._limits = np.array([limits["a_max"], limits["delta_max"]])
        make_driver, make_allocator = batch.driver[1].make, batch.authority[1].make
        self._names = f"driver {batch.driver[0]!r}", f"authority {batch.authority[0]!r}"
        self._drivers: list[Driver] = [make_driver() for _ in batch.episodes] if make_driver else []
        self._allocators: list[Allocator] = [make_allocator() for _ in batch.episodes] if make_allocator else []
        for (_, seed), *policies in zip(
            batch.episodes, *(each for each in (self._drivers, self._allocators) if each), strict=True
        ):
            for policy in policies:
                policy.reset(seed=seed)

    def decide(self, observations: np.ndarray) -> Any:
        """Action of all environments: of the slots that the kernel leaves open."""
        action = {}
        if self._drivers:
            commands = [
                checked_command(driver.act(observation, scene), self._names[0])
                for driver, observation, scene in zip(self._drivers, observations, self._scenes, strict=True)
            ]
            action[DRIVER] = np.clip(np.array(commands) / self._limits, -1.0, 1.0)
        if self._allocators:
            alphas = [
                checked_authority(a.allocate(scene, signals), self._names[1])
                for a, scene, signals in zip(self._allocators, self._scenes, self._signals, strict=True)
            ]
            action[AUTHORITY] = np.array(alphas, dtype=float)[:, None]
        return action if len(action) != 1 else next(iter(action.values()))


def run(batch: Batch, frames: list[np.ndarray] | None = None) -> list[dict[str, Any]]:
    """Run a batch.

    Args:
        batch: the episodes.
        frames: pictures of the first episode before every step are appended, where a list is given.

    Returns:
        One row an episode: what it is, how it ended, the driver's K_h and T_h [s], when a person at rest noticed
        something [s], every metric, and what it was made with.
    """
    begin = perf_counter()
    env = make_environment(batch, None if frames is None else "rgb_array")
    seeds = [seed for _, seed in batch.episodes]
    changes = {degradation: settings_of(batch, degradation) for degradation, _ in batch.episodes}
    configs = [changes[degradation] for degradation, _ in batch.episodes]
    observations, _ = env.reset(seed=seeds, options={"config": configs})
    settings, drawn = env.episodes[0], env.episodes
    recorder, policies = Recorder(settings.steps, len(batch.episodes)), Policies(batch, env)
    for k in range(settings.steps):
        if frames is not None:
            frames.extend(env.render() or ())
        action = policies.decide(observations)
        observations, _, terminations, truncations, infos = env.step(action)
        if not recorder.note(k, infos, terminations | truncations):
            break
    env.close()
    wall_time = (perf_counter() - begin) / len(batch.episodes)
    made_with = versions()
    return [
        {
            "scenario": batch.scenario,
            "degradation": degradation or AS_GIVEN,
            "driver": batch.driver[0],
            "authority": batch.authority[0],
            "seed": seed,
            "terminated": bool(recorder.crashed[i] or recorder.left_road[i]),
            "duration": recorder.lengths[i] / settings.policy_frequency,
            **plain(drawn[i])["driver_lag"],
            "noticed": recorder.noticed[i],
            **measure_all(recorder.trajectory(i, drawn[i], wall_time)),
            "config_hash": config_hash(batch.scenario, configs[i]),
            "version": version("shared_control_env"),
            "versions": made_with,
        }
        for i, (degradation, seed) in enumerate(batch.episodes)
    ]


def config_hash(scenario: str, changes: Mapping[str, Any]) -> str:
    """Digest of all that a scenario's settings and the changes to them say."""
    return sha256(json.dumps([SCENARIOS[scenario].settings, changes], sort_keys=True).encode()).hexdigest()[:12]
