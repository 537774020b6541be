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

    Its ``infos`` are filled at the end of an episode: ``terminal_observation`` and ``TimeLimit.truncated``, which its
    algorithms read, and the signals of the last step. Of all other steps the signals stay arrays, in the attribute
    ``signals``. Options of :meth:`set_options` are those of the environment, ``{"config": {...}}``; they act on every
    episode that begins after them, by :meth:`reset` or in a step, so that a callback can make the task harder.

    Args:
        env: of :func:`gymnasium.make_vec`, with ``autoreset_mode="same_step"``.

    Raises:
        ValueError: for another environment, a wrapped one (wrap this one, by ``VecNormalize`` and the like), or another
            autoreset mode.
    """

    def __init__(self, env: gym.vector.VectorEnv) -> None:
        if not isinstance(env, SharedControlVectorEnv):
            raise ValueError(f"env = {env} must be a SharedControlVectorEnv that nothing is wrapped around")
        if env.metadata["autoreset_mode"] is not AutoresetMode.SAME_STEP:
            raise ValueError("env must be made with autoreset_mode='same_step', which Stable-Baselines3 expects")
        self.env = env
        self.signals: dict[str, Any] = {}
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)
        self.metadata = {**self.metadata, "render_fps": env.metadata["render_fps"]}

    def reset(self) -> np.ndarray:
        """Observations of new episodes, with the seeds and options given by :meth:`seed` and :meth:`set_options`."""
        try:
            observations, self.signals = self.env.reset(seed=self._seeds, options=self._joint_options())
        finally:
            self._reset_seeds()
            self._reset_options()
        self.reset_infos = [{} for _ in range(self.num_envs)]
        return observations

    def _joint_options(self) -> dict[str, Any]:
        """Options of all environments as those of the one that holds them."""
        if not any(self._options):
            return {}
        unknown = {key for options in self._options for key in options} - {"config"}
        if unknown:
            raise ValueError(f"options has the unknown key(s) {sorted(unknown)}; valid is 'config'")
        configs = [options.get("config", {}) for options in self._options]
        alike = all(config == configs[0] for config in configs)
        return {"config": configs[0] if alike else configs}

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions for :meth:`step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Step all environments; those that end are reset in the same step, with the options given meanwhile.

        Raises:
            ValueError: for options that cannot act before the next :meth:`reset`, such as another duration.
        """
        if any(self._options):
            options = self._joint_options()
            self._reset_options()
            self.env.set_config(options["config"])
        observations, rewards, terminations, truncations, self.signals = self.env.step(self._actions)
        dones = terminations | truncations
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for i in np.flatnonzero(dones).tolist():
            infos[i] = _of_one(self.signals["final_info"], i)
            infos[i]["terminal_observation"] = self.signals["final_obs"][i]
            infos[i]["TimeLimit.truncated"] = bool(truncations[i] and not terminations[i])
        return observations, rewards.astype(np.float32), dones, infos

    def close(self) -> None:
        """Close the environments."""
        self.env.close()

    def render(self, mode: str | None = None) -> np.ndarray | None:
        """Show environment 0 in ``human`` mode; the pictures of all, as tiles, in ``rgb_array`` mode."""
        if self.render_mode == "human":
            self.env.render()
            return None
        return super().render(mode)

    def get_images(self) -> Sequence[np.ndarray | None]:
        """A picture of every environment."""
        return self.env.render() or ()

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


def _of_one(infos: dict[str, Any], i: int) -> dict[str, Any]:
    """What infos say of environment i, without their masks."""
    return {
        name: _of_one(values, i) if isinstance(values, dict) else values[i]
        for name, values in infos.items()
        if not name.startswith("_")
    }
