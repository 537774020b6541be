"""Trained policies as small files, and as drivers and allocators that need neither torch nor Stable-Baselines3."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from agents.history import History
from shared_control_env.core.observation import FEATURES
from shared_control_env.core.parameters import Limits

ACTIVATIONS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "tanh": np.tanh,
    "relu": lambda x: np.maximum(x, 0.0),
}
"""Nonlinearities of the hidden layers."""


class Policy:
    """A multilayer perceptron from a history of observations to an action in [-1, 1] or [0, 1].

    Args:
        layers: weights (out, in) and biases (out,) of every layer.
        hidden: name in :data:`ACTIVATIONS`.
        squashed: whether the output goes through a tanh into the bounds; else it is clipped to them.
        low, high: bounds of the action.
        card: what it was trained as: algorithm, environment, task, config, seed, versions.
    """

    def __init__(
        self,
        layers: list[tuple[np.ndarray, np.ndarray]],
        hidden: str,
        squashed: bool,
        low: float,
        high: float,
        card: dict[str, Any],
    ) -> None:
        self.layers, self.hidden, self.squashed = layers, hidden, squashed
        self.low, self.high, self.card = low, high, card

    def act(self, stacked: np.ndarray) -> np.ndarray:
        """Action for a history of observations.

        Args:
            stacked: shape (..., HISTORY * 25).
        """
        x = stacked
        for weights, biases in self.layers[:-1]:
            x = ACTIVATIONS[self.hidden](x @ weights.T + biases)
        weights, biases = self.layers[-1]
        action = x @ weights.T + biases
        if self.squashed:
            return self.low + 0.5 * (np.tanh(action) + 1.0) * (self.high - self.low)
        return np.clip(action, self.low, self.high)

    def save(self, path: Path) -> None:
        """Write the policy as an ``.npz`` file with its card in it."""
        arrays: Any = {
            f"{kind}{i}": a for i, layer in enumerate(self.layers) for kind, a in zip("Wb", layer, strict=True)
        }
        shape = {"hidden": self.hidden, "squashed": self.squashed, "low": self.low, "high": self.high}
        np.savez_compressed(path, card=json.dumps({**self.card, "shape": shape}), **arrays)

    @classmethod
    def load(cls, path: Path) -> Policy:
        """Read a policy.

        Raises:
            ValueError: if it was made for another observation, naming what differs.
        """
        with np.load(path, allow_pickle=False) as stored:
            card = json.loads(str(stored["card"]))
            layers = [(stored[f"W{i}"], stored[f"b{i}"]) for i in range(sum(name.startswith("W") for name in stored))]
        features = [name for name, _ in FEATURES]
        if card["features"] != features:
            changed = sorted(set(card["features"]) ^ set(features)) or "their order"
            raise ValueError(f"{path} was trained on other observations; what differs: {changed}")
        shape = card.pop("shape")
        return cls(layers, shape["hidden"], shape["squashed"], shape["low"], shape["high"], card)


class LearnedDriver:
    """A trained policy as a :class:`~shared_control_env.controllers.driver.Driver`.

    Args:
        policy: of the task ``driver``.
        limits: of the commands.
    """

    def __init__(self, policy: Policy, limits: Limits | None = None) -> None:
        self._policy, self._history = policy, History(len(FEATURES))
        self._limits = np.array(limits or Limits())

    def reset(self, seed: int | None = None) -> None:
        """Begin an episode; the policy draws nothing."""
        self._history.reset()

    def act(self, observation: np.ndarray, scene: np.ndarray) -> np.ndarray:
        """Desired acceleration and steering, shape (2,)."""
        return self._policy.act(self._history.push(observation)) * self._limits
