"""Stable-Baselines3's vector interface to the vectorised environment; needs the extra ``train``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import VecEnv

from shared_control_env.vector.environment import SharedControlVectorEnv


class StableBaselinesVecEnv(VecEnv):
    """Adapter from :class:`SharedControlVectorEnv` to the vector interface of Stable-Baselines3.

    ``infos`` are filled only at the end of an episode. They contain ``terminal_observation`` and
    ``TimeLimit.truncated``, which the algorithms of Stable-Baselines3 read, and the signals of the last step. For all
    other steps, the attribute ``signals`` holds the signals as arrays. The options of :meth:`set_options` are those of
    the environment, ``{"config": {...}}``. They apply to every episode that begins afterwards, by :meth:`reset` or in a
    step, so that a callback can make the task harder.

    Args:
        env: environment from :func:`gymnasium.make_vec`, with ``autoreset_mode="same_step"``. It may be wrapped in
            Gymnasium's vector wrappers that support this mode, such as ``RecordEpisodeStatistics``. The statistics of
            that wrapper are in the ``infos`` of the last step as ``episode``.

    Raises:
        ValueError: for an environment of another class, or another autoreset mode.

    Attributes:
        env: the environment.
        signals: infos of the last step or reset as arrays.
    """

    def __init__(self, env: gym.vector.VectorEnv) -> None:
        if not isinstance(env.unwrapped, SharedControlVectorEnv):
            raise ValueError(f"env = {env} must be a SharedControlVectorEnv, possibly in Gymnasium's vector wrappers")
        if env.metadata["autoreset_mode"] is not AutoresetMode.SAME_STEP:
            raise ValueError("env must be made with autoreset_mode='same_step', which Stable-Baselines3 expects")
        self.env: Any = env
        self._kernel = env.unwrapped
        self.signals: dict[str, Any] = {}
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)
        self.metadata = {**self.metadata, "render_fps": env.metadata["render_fps"]}

    def reset(self) -> np.ndarray:
        """Begin new episodes with the seeds and options given to :meth:`seed` and :meth:`set_options`."""
        try:
            observations, self.signals = self.env.reset(seed=self._seeds, options=self._joint_options())
        finally:
            self._reset_seeds()
            self._reset_options()
        self.reset_infos = [{} for _ in range(self.num_envs)]
        return observations

    def _joint_options(self) -> dict[str, Any]:
        """Combine the options of all environments into options of the vectorised environment."""
        if not any(self._options):
            return {}
        unknown = {key for options in self._options for key in options} - {"config"}
        if unknown:
            raise ValueError(f"options has the unknown key(s) {sorted(unknown)}; valid is 'config'")
        configs = [options.get("config", {}) for options in self._options]
        alike = all(config == configs[0] for config in configs)
        return {"config": configs[0] if alike else configs}

    def step_async(self, actions: np.ndarray) -> None:
        """Store the actions for :meth:`step_wait`.

        Args:
            actions: batch of actions, an element of the action space of the environment.
        """
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Step all environments. Ended environments are reset in the same step, with the options given since.

        Returns:
            Observations, rewards, dones and infos.

        Raises:
            ValueError: for options that can only take effect at a :meth:`reset`, such as another duration.
        """
        if any(self._options):
            options = self._joint_options()
            self._reset_options()
            self._kernel.set_config(options["config"])
        observations, rewards, terminations, truncations, self.signals = self.env.step(self._actions)
        dones = terminations | truncations
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for i in np.flatnonzero(dones).tolist():
            infos[i] = _of_one(self.signals["final_info"], i)
            infos[i]["terminal_observation"] = self.signals["final_obs"][i]
            infos[i]["TimeLimit.truncated"] = bool(truncations[i] and not terminations[i])
            if "episode" in self.signals:
                infos[i]["episode"] = {name: values[i].item() for name, values in self.signals["episode"].items()}
        return observations, rewards.astype(np.float32), dones, infos

    def close(self) -> None:
        """Close the environments."""
        self.env.close()

    def render(self, mode: str | None = None) -> np.ndarray | None:
        """Show environment 0 in ``human`` mode; tile the pictures of all environments in ``rgb_array`` mode.

        Args:
            mode: render mode of the picture in ``rgb_array`` mode, passed to Stable-Baselines3; unused in ``human``
                mode.
        """
        if self.render_mode == "human":
            self.env.render()
            return None
        return super().render(mode)

    def get_images(self) -> Sequence[np.ndarray | None]:
        """A picture of every environment."""
        return self.env.render() or ()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """The value of an attribute, which is the same for every environment.

        Args:
            attr_name: name of the attribute.
            indices: indices of the environments; None for all.
        """
        return [getattr(self._kernel, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Always raises ValueError, because the environments share one kernel and its settings.

        Args:
            attr_name: name of the attribute.
            value: ignored.
            indices: ignored.

        Raises:
            ValueError: always.
        """
        raise ValueError(f"attribute {attr_name!r} cannot be set; pass settings to gym.make_vec(config=...)")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Always raises ValueError, because there are no single environments to call.

        Args:
            method_name: name of the method.
            args, kwargs: ignored.
            indices: ignored.

        Raises:
            ValueError: always.
        """
        raise ValueError(f"method {method_name!r} cannot be called: the environments share one kernel")

    def env_is_wrapped(self, wrapper_class: type[gym.Wrapper], indices: Any = None) -> list[bool]:
        """False for every environment; Gymnasium's vector wrappers around all of them are not searched.

        Args:
            wrapper_class: ignored.
            indices: indices of the environments; None for all.
        """
        return [False for _ in self._get_indices(indices)]


def _of_one(infos: dict[str, Any], i: int) -> dict[str, Any]:
    """Infos of environment i, without the masks."""
    return {
        name: _of_one(values, i) if isinstance(values, dict) else values[i]
        for name, values in infos.items()
        if not name.startswith("_")
    }
