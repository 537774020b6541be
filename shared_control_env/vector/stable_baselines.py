"""Stable-Baselines3's vector interface over the kernel; needs the extra ``train``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import VecEnv

from shared_control_env.vector.environment import SharedControlVectorEnv


class StableBaselinesVecEnv(VecEnv):
    """A :class:`SharedControlVectorEnv` as Stable-Baselines3 takes it.

    Its ``infos`` hold what its algorithms read, at the end of an episode: ``terminal_observation`` and
    ``TimeLimit.truncated``. The signals of the loop stay arrays, in the attribute ``signals``.

    Args:
        env: of :func:`gymnasium.make_vec`, with ``autoreset_mode="same_step"``.

    Raises:
        ValueError: for another environment or autoreset mode.
    """

    def __init__(self, env: gym.vector.VectorEnv) -> None:
        bare = env.unwrapped
        if not isinstance(bare, SharedControlVectorEnv):
            raise ValueError(f"env = {env} must be a SharedControlVectorEnv")
        if bare.metadata["autoreset_mode"] is not AutoresetMode.SAME_STEP:
            raise ValueError("env must be made with autoreset_mode='same_step', which Stable-Baselines3 expects")
        self.env = bare
        self.signals: dict[str, Any] = {}
        self.render_mode = bare.render_mode
        super().__init__(bare.num_envs, bare.single_observation_space, bare.single_action_space)

    def reset(self) -> np.ndarray:
        """Observations of new episodes, with the seeds given by :meth:`seed`."""
        seeds = list(self._seeds) if any(seed is not None for seed in self._seeds) else None
        observations, self.signals = self.env.reset(seed=seeds)
        self.reset_infos = [{} for _ in range(self.num_envs)]
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions for :meth:`step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Step all environments; those that end are reset in the same step."""
        observations, rewards, terminations, truncations, self.signals = self.env.step(self._actions)
        dones = terminations | truncations
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for i in np.flatnonzero(dones):
            infos[i] = {
                "terminal_observation": self.signals["final_obs"][i],
                "TimeLimit.truncated": bool(truncations[i] and not terminations[i]),
            }
        return observations, rewards.astype(np.float32), dones, infos

    def close(self) -> None:
        """Close the environments."""
        self.env.close()

    def get_images(self) -> Sequence[np.ndarray | None]:
        """The picture of environment 0; the others have none."""
        frames = self.env.render() or (None,)
        return [*frames, *[None] * (self.num_envs - 1)]

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute, the same for every environment."""
        return [getattr(self.env, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refused: the environments share one kernel and its settings."""
        raise ValueError(f"attribute {attr_name!r} cannot be set; pass settings to gym.make_vec(config=...)")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Refused: there are no single environments to call."""
        raise ValueError(f"method {method_name!r} cannot be called: the environments share one kernel")

    def env_is_wrapped(self, wrapper_class: type[gym.Wrapper], indices: Any = None) -> list[bool]:
        """No environment is wrapped."""
        return [False for _ in self._get_indices(indices)]
