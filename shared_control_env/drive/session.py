"""One episode with a person at the wheel: what was chosen, the steps, and the recording.

There is no clock here: a step is taken when it is asked for, with the input that it is given.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from shared_control_env.controllers.driver import PredictiveDriver
from shared_control_env.core.authority.laws import LAWS
from shared_control_env.drive.devices import Command
from shared_control_env.drive.latency import Timing, summary
from shared_control_env.envs.scenarios import SCENARIOS
from shared_control_env.envs.settings import combined, parameters_of
from shared_control_env.evaluation.catalogue import AUTHORITIES, DRIVERS, AuthorityEntry, DriverEntry, choose_one
from shared_control_env.evaluation.episodes import EpisodeBatch, RunningBatch, fault_named, settings_of, versions
from shared_control_env.evaluation.metrics import METRICS
from shared_control_env.nearest import hint
from shared_control_env.recordings.trial import FORMAT, Trial, flat

PERSON = "a person at the wheel"
"""Name of the driver in results."""

BESIDE = "internal_model"
"""Driver whose result on the same seed stands beside the person's."""

MOST_SEED = 2**63 - 1
"""Largest seed."""


class Choice(NamedTuple):
    """What a person drives: entries of the catalogue, as in the benchmark.

    Attributes:
        scenario: key of :data:`envs.scenarios.SCENARIOS`.
        degradation: key of the library of degradations, ``own`` for the scenario's, or ``kind:channel:size:duration``.
        authority: key of :data:`evaluation.catalogue.AUTHORITIES`.
        law: law that applies the authority; empty for the authority's own.
        seed: seed of the episode.
    """

    scenario: str = "lane_change"
    degradation: str = "bias_ramp"
    authority: str = "proportional"
    law: str = ""
    seed: int = 0

    def batch(self, driver: tuple[str, DriverEntry]) -> EpisodeBatch:
        """The episode as the benchmark runs it, with a driver.

        Args:
            driver: name and entry of the driver.

        Raises:
            ValueError: for a name that is not in the catalogue, with the nearest one.
        """
        choose_one("scenario", self.scenario, SCENARIOS)
        entry: AuthorityEntry = choose_one("authority", self.authority, AUTHORITIES)
        if self.law:
            if self.law not in LAWS:
                raise ValueError(f"law = {self.law!r}; {hint(self.law, LAWS)}")
            entry = entry._replace(law=self.law)
        if not isinstance(self.seed, int) or isinstance(self.seed, bool) or not 0 <= self.seed <= MOST_SEED:
            raise ValueError(f"seed = {self.seed!r} must be a whole number from 0 to {MOST_SEED}")
        fault = fault_named(self.degradation)
        batch = EpisodeBatch(self.scenario, driver, (self.authority, entry), ((fault, self.seed),), {}, twins=False)
        combined(SCENARIOS[self.scenario].settings, settings_of(batch, fault))  # raises for what cannot be
        return batch


class AtTheWheel:
    """The person as a driver: gives what the device commands, and keeps what the predictive driver would have wanted.

    Attributes:
        command: u_h,act of the next step [m/s^2, rad].
        model: the predictive driver of Eq. 15, which only looks on.
        wanted: its u_h,des on the same scene [m/s^2, rad], shape (2,).
    """

    def __init__(self) -> None:
        self.command = Command(0.0, 0.0)
        self.model: PredictiveDriver | None = None
        self.wanted = np.zeros(2)

    def reset(self, seed: int | None = None) -> None:
        """Begin an episode.

        Args:
            seed: not used.
        """
        self.command = Command(0.0, 0.0)

    def act(self, observation: np.ndarray, scene: np.ndarray) -> np.ndarray:
        """The device's command u_h,act [m/s^2, rad], shape (2,).

        Args:
            observation: the environment's observation.
            scene: record of :data:`core.records.SCENE`.
        """
        if self.model is not None:
            self.wanted = self.model.act(observation, scene)
        return np.array(self.command)


class Drive:
    """An episode with a person at the wheel.

    Args:
        choice: what is driven.

    Attributes:
        choice: what is driven.
        settings: settings of the episode, with all random values drawn.
        going: whether the episode goes on.
        pauses: why the drive was paused or is invalid, in the order of the events.
    """

    def __init__(self, choice: Choice) -> None:
        self.choice, self.person = choice, AtTheWheel()
        entry = DriverEntry(PERSON, lambda: self.person, {"driver_lag": {"direct": True}})
        self._running = RunningBatch(choice.batch((PERSON, entry)), single=True)
        self.settings = self._running.drawn[0]
        self._parameters = parameters_of(self.settings)
        self.person.model = PredictiveDriver(self._parameters)
        self.going, self.pauses = True, list[str]()
        self._rows: dict[str, list[Any]] = defaultdict(list)

    def __len__(self) -> int:
        """Number of time steps so far."""
        return len(self._rows["reward"])

    @property
    def env(self) -> Any:
        """The bare environment."""
        return self._running.env.environments[0].unwrapped

    @property
    def dt(self) -> float:
        """Time step [s]."""
        return self._parameters.task.dt

    @property
    def limits(self) -> Any:
        """Limits of the command."""
        return self._parameters.limits

    @property
    def info(self) -> Mapping[str, Any]:
        """All signals of the last step."""
        return self._running.infos

    @property
    def observation(self) -> np.ndarray:
        """The present observation, shape (n,)."""
        return self._running.observations[0]

    def step(self, command: Command, raw: np.ndarray, timing: Timing) -> bool:
        """Drive one time step.

        Args:
            command: the person's u_h,act.
            raw: readings of the device, shape (n,).
            timing: lateness of the tick, age of the input, round trip [s].

        Returns:
            Whether the episode goes on.
        """
        rows, running = self._rows, self._running
        rows["observation"].append(self.observation.copy())
        self.person.command = command
        self.going = running.step()
        for name, values in flat(running.infos):
            rows[name].append(np.array(values[0]))
        rows["command"].append(np.array(command))
        rows["wanted"].append(self.person.wanted.copy())
        rows["raw"].append(np.array(raw, dtype=float))
        rows["reward"].append(running.rewards[0])
        rows["terminated"].append(running.terminations[0])
        rows["truncated"].append(running.truncations[0])
        for name, value in timing._asdict().items():
            rows[name].append(value)
        return self.going

    def invalidate(self, reason: str) -> None:
        """Note why the drive is no valid trial.

        Args:
            reason: the reason.
        """
        self.pauses.append(reason)

    def trial(self, about: Mapping[str, Any]) -> Trial:
        """The recording of the steps so far.

        Args:
            about: further entries of the header, such as the device and its calibration.
        """
        columns = {name: np.array(values) for name, values in self._rows.items()}
        batch = self._running.batch
        scenario = SCENARIOS[self.choice.scenario]
        header = {
            "format": FORMAT,
            "versions": versions(),
            "choice": self.choice._asdict(),
            "environment": {
                "id": scenario.id,
                "config": settings_of(batch, batch.episodes[0][0]),
                "policy_frequency": self.settings.policy_frequency,
                "a_max": self.limits.a_max,
                "delta_max": self.limits.delta_max,
            },
            "seed": self.choice.seed,
            "steps": len(columns["reward"]),
            "finished": not self.going,
            "valid": not self.pauses,
            "pauses": self.pauses,
            "last_observation": self.observation.tolist(),
            "latency": summary(columns),
            **about,
        }
        return Trial(header, columns)

    def result(self) -> dict[str, Any]:
        """The metrics of the finished episode."""
        (row,) = self._running.rows(np.nan)
        return {"terminated": row["terminated"], **{name: row[name] for name in METRICS}}

    def close(self) -> None:
        """Close the environment."""
        self._running.env.close()


def result_of_model(choice: Choice) -> dict[str, Any]:
    """Metrics of :data:`BESIDE` on the same seed.

    Args:
        choice: what is driven.
    """
    running = RunningBatch(choice.batch((BESIDE, DRIVERS[BESIDE])), single=True)
    while running.step():
        pass
    running.env.close()
    (row,) = running.rows(np.nan)
    return {"terminated": row["terminated"], **{name: row[name] for name in METRICS}}
