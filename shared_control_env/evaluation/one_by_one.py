"""Episodes in single environments, one after the other, for an automation that the kernel does not run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from shared_control_env.controllers.automation import Planner
from shared_control_env.envs.environments import environment_class
from shared_control_env.envs.settings import Settings
from shared_control_env.wrappers import AuthorityLimiter, DriverModel


class SingleEnvironments:
    """Single environments of one scenario behind what :func:`episodes.run` uses of the vectorised one.

    Args:
        scenario: key of :data:`envs.scenarios.SCENARIOS`.
        automations: one for each environment, with ``reset()`` and ``act(scene)``.
        config: changes to the scenario's settings.
        limiter: whether the fuzzy inference decides alpha_a.
        driver: whether the predictive driver of the settings drives, by OSQP.
        render_mode: ``rgb_array`` or None.
    """

    def __init__(
        self,
        scenario: str,
        automations: Sequence[Planner],
        config: Mapping[str, Any],
        limiter: bool,
        driver: bool,
        render_mode: str | None = None,
    ) -> None:
        self._envs: list[Any] = []
        for automation in automations:
            env: Any = environment_class(scenario)(dict(config), render_mode=render_mode)
            env.automation = automation
            env = AuthorityLimiter(env) if limiter else env
            self._envs.append(DriverModel(env) if driver else env)
        self._ended = np.zeros(len(self._envs), dtype=bool)
        self._results: list[Any] = [None] * len(self._envs)

    @property
    def config(self) -> dict[str, Any]:
        """Settings of the first environment."""
        return self._envs[0].unwrapped.config

    @property
    def episodes(self) -> tuple[Settings, ...]:
        """Settings of each episode, with all that is random drawn."""
        return tuple(env.unwrapped.episode for env in self._envs)

    def views(self) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Scene and signals of each environment, 0-d records, which stay those of the present step."""
        return [env.unwrapped.scene for env in self._envs], [env.unwrapped.signals for env in self._envs]

    def reset(self, *, seed: Sequence[int], options: Mapping[str, Any]) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode in each environment.

        Args:
            seed: one for each.
            options: ``{"config": [...]}``, changes to the settings of each.

        Returns:
            Observations and infos, a row for each.
        """
        for i, (env, own, config) in enumerate(zip(self._envs, seed, options["config"], strict=True)):
            observation, info = env.reset(seed=own, options={"config": config})
            self._results[i] = observation, 0.0, False, False, info
        self._ended[:] = False
        observations, _, _, _, infos = self._stacked()
        return observations, infos

    def step(self, actions: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Drive one time step in every environment whose episode goes on; the others keep their last results.

        Args:
            actions: of the open slot, or a dict of both, a row for each environment.

        Returns:
            Observations, rewards, terminations, truncations and infos, a row for each.
        """
        for i in np.flatnonzero(~self._ended):
            action = {slot: rows[i] for slot, rows in actions.items()} if isinstance(actions, dict) else actions[i]
            self._results[i] = self._envs[i].step(action)
            self._ended[i] = self._results[i][2] or self._results[i][3]
        return self._stacked()

    def _stacked(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        observations, rewards, terminations, truncations, infos = zip(*self._results, strict=True)
        ends = np.array(terminations), np.array(truncations)
        return np.stack(observations), np.array(rewards), *ends, _stacked_infos(infos)

    def render(self) -> tuple[np.ndarray, ...]:
        """A picture of each environment."""
        return tuple(env.render() for env in self._envs)

    def close(self) -> None:
        """Close all."""
        for env in self._envs:
            env.close()


def _stacked_infos(infos: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Nested dicts of numbers as one of arrays."""
    return {
        name: _stacked_infos([info[name] for info in infos])
        if isinstance(value, Mapping)
        else np.array([info[name] for info in infos])
        for name, value in infos[0].items()
    }
