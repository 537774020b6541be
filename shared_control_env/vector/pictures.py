"""Pictures of the environments in the kernel. A single environment takes over the situation of each and draws it."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.envs.registration import load_env_creator

from shared_control_env.core.batch import Batch
from shared_control_env.core.feedback.info import INFO
from shared_control_env.envs.settings import Settings, plain


class Pictures:
    """The drawing environment, and the data of a picture that the batch does not hold: paths and last infos.

    Args:
        render_mode: ``rgb_array``, ``human`` or None.
        num_envs: number of environments N.

    Attributes:
        drawn: number of environments that are drawn: all, one in a window, or none.
    """

    def __init__(self, render_mode: str | None, num_envs: int) -> None:
        self._mode = render_mode
        self.drawn = {"rgb_array": num_envs, "human": 1}.get(render_mode or "", 0)
        self._noted = np.zeros(num_envs, INFO)
        self._paths = np.zeros((0, 0, 2))
        self._viewer_env: Any = None
        self._shown: Settings | None = None

    def restart(self, steps: int) -> None:
        """Prepare for new settings.

        Args:
            steps: length of an episode as a number of decisions.
        """
        self.close()
        self._paths = np.zeros((self.drawn, steps + 1, 2))

    def note(self, infos: np.ndarray, active: np.ndarray, batch: Batch) -> None:
        """Store what a later picture needs from a step.

        Args:
            infos: infos of the step, records of :data:`info.INFO`, shape (N,).
            active: mask of the environments that took the step, shape (N,).
            batch: state of all environments after the step.
        """
        if self.drawn:
            self._noted = infos.copy() if active.all() else np.where(active, infos, self._noted)
            seen = np.arange(self.drawn)
            self._paths[seen, batch.scenes["k"][seen]] = batch.states[seen, :2]

    def draw(self, i: int, episode: Settings, batch: Batch) -> Any:
        """Draw one environment.

        Args:
            i: index of the environment.
            episode: settings of its episode.
            batch: state of all environments.

        Returns:
            A frame in ``rgb_array`` mode, None in ``human`` mode.
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
        """Close the drawing environment and its window."""
        if self._viewer_env is not None:
            self._viewer_env.close()
            self._viewer_env = None

    def __getstate__(self) -> dict[str, Any]:
        """State for pickling, without the drawing environment, which belongs to this process."""
        return {**self.__dict__, "_viewer_env": None}
