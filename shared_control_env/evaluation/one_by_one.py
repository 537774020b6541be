"""Episodes in single environments, one after the other: for an automation in Python, or for a person at the wheel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from shared_control_env.controllers.arrays import read_only
from shared_control_env.controllers.assessor import Assessor
from shared_control_env.controllers.automation import Planner
from shared_control_env.envs.settings import Settings
from shared_control_env.wrappers import DriverModel
from shared_control_env.wrappers.limited import Limited


class SingleEnvironments:
    """Single environments of one scenario, with those methods of the vectorised one that :func:`episodes.run` uses.

    Args:
        scenario: key of :data:`envs.scenarios.SCENARIOS`.
        automations: one automation for each environment, with ``reset()`` and ``act(scene)``; None for the predictive
            controller.
        config: changes to the scenario's settings.
        limiter: whether the fuzzy inference decides alpha_a.
        driver: whether the predictive driver of the settings drives, solved by OSQP.
        render_mode: ``rgb_array`` or None.

    Attributes:
        environments: the environments.
    """

    def __init__(
        self,
        scenario: str,
        automations: Sequence[Planner | None],
        config: Mapping[str, Any],
        limiter: bool,
        driver: bool,
        render_mode: str | None = None,
    ) -> None:
        self.environments: list[Any] = []
        for automation in automations:
            env = Limited(scenario)(dict(config), render_mode, limiter, automation)
            self.environments.append(DriverModel(env) if driver else env)
        self._ended = np.zeros(len(self.environments), dtype=bool)
        self._results: list[Any] = [None] * len(self.environments)

    @property
    def config(self) -> dict[str, Any]:
        """Settings of the first environment."""
        return self.environments[0].unwrapped.config

    @property
    def episodes(self) -> tuple[Settings, ...]:
        """Settings of each episode, with all random values drawn."""
        return tuple(env.unwrapped.episode for env in self.environments)

    def views(self) -> list[np.ndarray]:
        """Scenes as read-only 0-d records, which always show the present step."""
        return [read_only(env.unwrapped.scene) for env in self.environments]

    @property
    def scenes(self) -> np.ndarray:
        """The perceived scene of each environment, records of :data:`core.records.SCENE`, shape (N,)."""
        return np.array([env.unwrapped.scene for env in self.environments])

    def signals_for_allocators(self) -> np.ndarray:
        """Signals with each driver's present u_h,act, records of :data:`core.records.SIGNALS`, shape (N,)."""
        return np.array([env.unwrapped.signals_for_allocator() for env in self.environments])

    def assessors(self) -> list[Assessor]:
        """Answers to allocators' questions about the present step of each environment."""
        return [env.unwrapped.assessor for env in self.environments]

    def show_alerts(self, alerts: np.ndarray) -> None:
        """Show each driver the alert of an allocator.

        Args:
            alerts: indices in :data:`core.authority.alerts.ALERTS`, shape (N,).
        """
        for env, alert in zip(self.environments, alerts, strict=True):
            env.unwrapped.signals["alert"] = alert

    def reset(self, *, seed: Sequence[int], options: Mapping[str, Any]) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode in each environment.

        Args:
            seed: one seed for each environment.
            options: ``{"config": [...]}``, changes to the settings of each environment.

        Returns:
            Observations and infos, one row per environment.
        """
        for i, (env, own, config) in enumerate(zip(self.environments, seed, options["config"], strict=True)):
            observation, info = env.reset(seed=own, options={"config": config})
            self._results[i] = observation, 0.0, False, False, info
        self._ended[:] = False
        observations, _, _, _, infos = self._stacked()
        return observations, infos

    def step(self, actions: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Drive one time step in every environment whose episode is running. The others keep their last results.

        Args:
            actions: values of the open slot, or a dict of both slots, one row per environment.

        Returns:
            Observations, rewards, terminations, truncations and infos, one row per environment.
        """
        for i in np.flatnonzero(~self._ended):
            action = {slot: rows[i] for slot, rows in actions.items()} if isinstance(actions, dict) else actions[i]
            self._results[i] = self.environments[i].step(action)
            self._ended[i] = self._results[i][2] or self._results[i][3]
        return self._stacked()

    def _stacked(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        observations, rewards, terminations, truncations, infos = zip(*self._results, strict=True)
        ends = np.array(terminations), np.array(truncations)
        return np.stack(observations), np.array(rewards), *ends, _stacked_infos(infos)

    def render(self) -> tuple[np.ndarray, ...]:
        """A picture of each environment."""
        return tuple(env.render() for env in self.environments)

    def close(self) -> None:
        """Close all environments."""
        for env in self.environments:
            env.close()


def _stacked_infos(infos: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Stack nested dicts of numbers into one nested dict of arrays."""
    return {
        name: _stacked_infos([info[name] for info in infos])
        if isinstance(value, Mapping)
        else np.array([info[name] for info in infos])
        for name, value in infos[0].items()
    }
