"""Pictures of environments in the kernel, drawn by a single environment that is put into the place of each."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.envs.registration import load_env_creator

from shared_control_env.core.batch import Batch
from shared_control_env.core.feedback.info import INFO
from shared_control_env.envs.settings import Settings, plain


class Pictures:
    """Who draws, and what a picture shows beside the batch: paths, and what was noted of the last step.

    Args:
        render_mode: ``rgb_array``, ``human`` or None.
        num_envs: of how many environments.

    Attributes:
        drawn: how many environments are drawn: all, the first one in a window, or none.
    """

    def __init__(self, render_mode: str | None, num_envs: int) -> None:
        self._mode = render_mode
        self.drawn = {"rgb_array": num_envs, "human": 1}.get(render_mode or "", 0)
        self._noted = np.zeros(num_envs, INFO)
        self._paths = np.zeros((0, 0, 2))
        self._viewer_env: Any = None
        self._shown: Settings | None = None

    def restart(self, steps: int) -> None:
        """Begin with other settings.

        Args:
            steps: length of an episode.
        """
        self.close()
        self._paths = np.zeros((self.drawn, steps + 1, 2))

    def note(self, infos: np.ndarray, active: np.ndarray, batch: Batch) -> None:
        """Keep what a later picture needs of a step.

        Args:
            infos: of the step, shape (N,).
            active: which environments took it, shape (N,).
            batch: after it.
        """
        if self.drawn:
            self._noted = infos.copy() if active.all() else np.where(active, infos, self._noted)
            seen = np.arange(self.drawn)
            self._paths[seen, batch.scenes["k"][seen]] = batch.states[seen, :2]

    def draw(self, i: int, episode: Settings, batch: Batch) -> Any:
        """A picture of one environment.

        Args:
            i: which.
            episode: its settings.
            batch: state of all.
        """
        if self._viewer_env is None:
            make: Any = load_env_creator("shared_control_env.envs.shared_control:SharedControlEnv")
            self._viewer_env, self._shown = make(plain(episode), render_mode=self._mode), episode
        if self._shown is not episode:
            self._viewer_env.reset(options={"config": plain(episode)})
            self._shown = episode
        path = self._paths[i, : int(batch.scenes[i]["k"]) + 1]
        self._viewer_env.show(
            batch.states[i], batch.traffic[i], batch.scenes[i], batch.signals[i], self._noted[i], path
        )
        return self._viewer_env.render()

    def close(self) -> None:
        """Close the window."""
        if self._viewer_env is not None:
            self._viewer_env.close()
            self._viewer_env = None

    def __getstate__(self) -> dict[str, Any]:
        """All but the viewer, which belongs to this process."""
        return {**self.__dict__, "_viewer_env": None}
