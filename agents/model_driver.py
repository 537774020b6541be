"""Models of Stable-Baselines3 as drivers, as they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.save_util import load_from_zip_file

from shared_control_env.core.feedback.observation import DRIVER_V0
from shared_control_env.core.parameters import Limits

ALGORITHMS: dict[str, type[BaseAlgorithm]] = {"ppo": PPO, "sac": SAC, "td3": TD3}
"""Algorithms by name."""


class ModelDriver:
    """A model that was trained on the environment's own observations, as the README shows.

    Args:
        model: of Stable-Baselines3; it acts deterministically.
        limits: of the commands.

    Raises:
        ValueError: if its spaces are others.
    """

    def __init__(self, model: BaseAlgorithm, limits: Limits | None = None) -> None:
        shapes = model.observation_space.shape, model.action_space.shape
        if shapes != ((DRIVER_V0.size,), (2,)):
            raise ValueError(
                f"the model maps observations of shape {shapes[0]} to actions of shape {shapes[1]}; a driver maps "
                f"{(DRIVER_V0.size,)} to (2,); policies of agents.train are read from their best.npz"
            )
        self._model, self._limits = model, np.array(limits or Limits())

    @staticmethod
    def read(path: Path | str) -> BaseAlgorithm:
        """The model in a file, of PPO, SAC or TD3. Pickled code in the file is run.

        Raises:
            ValueError: if it is no model, its policy is of none of these, or it was trained on normalised observations.
        """
        data, _, _ = load_from_zip_file(path, device="cpu")
        if not data or "policy_class" not in data:
            raise ValueError(f"{path} is no model of Stable-Baselines3")
        last = data.get("_last_obs")
        if last is not None and np.abs(np.asarray(last, dtype=float)).max() > 1.0:
            raise ValueError(
                f"{path} was trained on observations beyond the environment's bounds, so behind VecNormalize or the "
                "like, whose statistics it does not hold; train without, or with agents.train, which has its own"
            )
        made_by = data["policy_class"]
        for algorithm in ALGORITHMS.values():
            if made_by in algorithm.policy_aliases.values():
                return algorithm.load(path, device="cpu")
        raise ValueError(f"{path} holds a {made_by.__name__}; known are the policies of {', '.join(ALGORITHMS)}")

    def reset(self, seed: int | None = None) -> None:
        """Nothing is remembered and nothing drawn."""

    def act(self, observation: np.ndarray, scene: np.ndarray) -> np.ndarray:
        """Desired acceleration and steering, shape (2,)."""
        return self._model.predict(observation, deterministic=True)[0] * self._limits
