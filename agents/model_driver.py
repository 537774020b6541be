"""Models of Stable-Baselines3 as drivers, without conversion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.save_util import load_from_zip_file

from shared_control_env.controllers.stateless import Stateless
from shared_control_env.core.feedback.observation import DRIVER_V0
from shared_control_env.core.parameters import Limits

ALGORITHMS: dict[str, type[BaseAlgorithm]] = {"ppo": PPO, "sac": SAC, "td3": TD3}
"""Supported algorithms by name."""


class ModelDriver(Stateless):
    """A model that was trained on the environment's own observations, as the README shows.

    Args:
        model: model of Stable-Baselines3; it acts deterministically.
        limits: limits of the commands; by default the environment's.

    Raises:
        ValueError: if its observation or action space has another shape.
    """

    def __init__(self, model: BaseAlgorithm, limits: Limits | None = None) -> None:
        shapes = model.observation_space.shape, model.action_space.shape
        if shapes != ((DRIVER_V0.size,), (2,)):
            raise ValueError(
                f"the model maps observations of shape {shapes[0]} to actions of shape {shapes[1]}; a driver maps "
                f"{(DRIVER_V0.size,)} to (2,); a policy of agents.train is read from its best.npz"
            )
        self._model, self._limits = model, np.array(limits or Limits())

    @staticmethod
    def read(path: Path | str) -> BaseAlgorithm:
        """Read a model of PPO, SAC or TD3 from a file. Pickled code in the file is run.

        Args:
            path: the file.

        Raises:
            ValueError: if the file is not a model, if its policy belongs to none of these algorithms, or if it was
                trained on normalised observations.
        """
        data, _, _ = load_from_zip_file(path, device="cpu")
        if not data or "policy_class" not in data:
            raise ValueError(f"{path} is no model of Stable-Baselines3")
        last = data.get("_last_obs")
        if last is not None and np.abs(np.asarray(last, dtype=float)).max() > 1.0:
            raise ValueError(
                f"{path} was trained on observations beyond the environment's bounds, so with VecNormalize or the "
                "like, whose statistics the file does not hold; train without it, or use agents.train"
            )
        made_by = data["policy_class"]
        for algorithm in ALGORITHMS.values():
            if made_by in algorithm.policy_aliases.values():
                return algorithm.load(path, device="cpu")
        raise ValueError(f"{path} holds a {made_by.__name__}; the known policies are those of {', '.join(ALGORITHMS)}")

    def act(self, observation: np.ndarray, scene: np.ndarray) -> np.ndarray:
        """Desired acceleration and steering [m/s^2, rad], shape (2,).

        Args:
            observation: the environment's observation, shape (n,).
            scene: record of :data:`core.records.SCENE`; not used.
        """
        return self._model.predict(observation, deterministic=True)[0] * self._limits
