"""Trained policies as small files, and as drivers and allocators that need neither torch nor Stable-Baselines3."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from shared_control_env.controllers.arrays import as_array
from shared_control_env.core.parameters import Limits
from shared_control_env.learned.card import check_card
from shared_control_env.learned.history import HISTORY, History
from shared_control_env.learned.views import (
    ALLOCATOR_FEATURES,
    DRIVER_FEATURES,
    FEATURES_OF,
    allocator_view,
    authority,
    command,
    driver_view,
)

ACTIVATIONS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "tanh": np.tanh,
    "relu": lambda x: np.maximum(x, 0.0),
}
"""Activation functions of the hidden layers."""


ACTIONS = {"driver": 2, "allocator": 1}
"""Number of entries in the action of each task."""

Layer: TypeAlias = tuple[np.ndarray, np.ndarray]
"""Weights, shape (out, in), and biases, shape (out,)."""


class Policy:
    """A multilayer perceptron from a history of observations to an action in [-1, 1].

    Args:
        layers: all layers, the input layer first.
        hidden: activation function of the hidden layers, a name in :data:`ACTIVATIONS`.
        squashed: whether a tanh maps the output to the bounds; otherwise the output is clipped to the bounds.
        card: card of the training; see :mod:`agents.card`.

    Attributes:
        layers, hidden, squashed, card: as the arguments.
    """

    def __init__(
        self,
        layers: list[Layer],
        hidden: str,
        squashed: bool,
        card: dict[str, Any],
    ) -> None:
        self.layers, self.hidden, self.squashed, self.card = layers, hidden, squashed, card

    def act(self, stacked: np.ndarray) -> np.ndarray:
        """Action for a history of observations.

        Args:
            stacked: history of observations, shape (..., HISTORY * size).
        """
        x = stacked
        for weights, biases in self.layers[:-1]:
            x = ACTIVATIONS[self.hidden](x @ weights.T + biases)
        weights, biases = self.layers[-1]
        action = x @ weights.T + biases
        return np.tanh(action) if self.squashed else np.clip(action, -1.0, 1.0)

    def save(self, path: Path) -> None:
        """Write the policy with its card to an ``.npz`` file.

        Args:
            path: the file.
        """
        arrays: Any = {
            f"{kind}{i}": a for i, layer in enumerate(self.layers) for kind, a in zip("Wb", layer, strict=True)
        }
        shape = {"hidden": self.hidden, "squashed": self.squashed}
        np.savez_compressed(path, card=json.dumps({**self.card, "shape": shape}), **arrays)

    @classmethod
    def load(cls, path: Path) -> Policy:
        """Read a policy.

        Args:
            path: the file.

        Raises:
            ValueError: if the file is not a policy, or if the policy was trained for spaces or environments that do not
                exist any more; the message names the difference.
        """
        try:
            with np.load(path, allow_pickle=False) as stored:
                card = json.loads(str(stored["card"]))
                count = sum(name.startswith("W") for name in stored)
                layers = [(stored[f"W{i}"], stored[f"b{i}"]) for i in range(count)]
            shape = card.pop("shape")
            policy = cls(layers, shape["hidden"], shape["squashed"], card)
        except (KeyError, ValueError, TypeError, AttributeError, EOFError, OSError, zipfile.BadZipFile) as error:
            raise ValueError(f"{path} is no policy of agents.train: {error!r}") from None
        check_card(path, card)
        policy._check(path)
        return policy

    def _check(self, path: Path) -> None:
        """Raise ValueError unless the layers are finite and map the task's observation to the task's action."""
        if not isinstance(self.hidden, str) or self.hidden not in ACTIVATIONS or not isinstance(self.squashed, bool):
            raise ValueError(
                f"{path} has the shape hidden = {self.hidden!r}, squashed = {self.squashed!r}; hidden must "
                f"be one of {', '.join(ACTIVATIONS)}, and squashed true or false"
            )
        task = self.card["task"]
        sizes = [HISTORY * len(FEATURES_OF[task]), *(len(biases) for _, biases in self.layers)]
        if len(sizes) < 2 or sizes[-1] != ACTIONS[task]:
            raise ValueError(
                f"{path} has {len(self.layers)} layer(s) and {sizes[-1]} outputs; it must have {ACTIONS[task]} outputs"
            )
        for i, (weights, biases) in enumerate(self.layers):
            if weights.shape != (sizes[i + 1], sizes[i]) or biases.shape != (sizes[i + 1],):
                raise ValueError(
                    f"{path}: layer {i} has weights of shape {weights.shape} and biases of shape {biases.shape}; they "
                    f"must be ({sizes[i + 1]}, {sizes[i]}) and ({sizes[i + 1]},)"
                )
            if weights.dtype.kind != "f" or biases.dtype.kind != "f" or not np.isfinite(weights.sum() + biases.sum()):
                raise ValueError(f"{path}: layer {i} has weights or biases that are not finite numbers")


def as_array64(tensor: Any) -> np.ndarray:
    """A tensor of PyTorch as an array of double precision.

    Args:
        tensor: on any device, with or without a gradient.
    """
    return np.asarray(as_array(tensor), dtype=np.float64)


def fold(layers: list[Layer], mean: np.ndarray, std: np.ndarray) -> list[Layer]:
    """Fold a normalisation of the input into the first layer.

    The result acts on the raw input as the given layers act on the normalised input:
    ``W (x - mean) / std + b = (W / std) x + b - (W / std) mean``.

    Args:
        layers: layers for normalised input, the input layer first.
        mean, std: mean and standard deviation of the input, shape (in,).
    """
    weights = layers[0][0] / std
    return [(weights, layers[0][1] - weights @ mean), *layers[1:]]


class LearnedDriver:
    """A trained policy as a :class:`~shared_control_env.controllers.driver.Driver`.

    Args:
        policy: policy of the task ``driver``.
        limits: limits of the commands; by default the environment's.

    Raises:
        ValueError: if the policy was trained for another task.
    """

    def __init__(self, policy: Policy, limits: Limits | None = None) -> None:
        _require(policy, "driver")
        self._policy, self._history = policy, History(1, len(DRIVER_FEATURES))
        self._limits = np.array(limits or Limits())

    def reset(self, seed: int | None = None) -> None:
        """Begin an episode.

        Args:
            seed: not used, since the policy draws no random numbers.
        """
        self._history.forget()

    def act(self, observation: np.ndarray, scene: np.ndarray) -> np.ndarray:
        """Desired acceleration and steering [m/s^2, rad], shape (2,).

        Args:
            observation: the environment's observation, shape (n,).
            scene: record of :data:`core.records.SCENE`; the felt command is used.
        """
        seen = self._history.push(driver_view(observation, scene["felt"])[None])
        return command(self._policy.act(seen), self._policy.card["dead_zone"])[0] * self._limits


class LearnedAllocator:
    """A trained policy as an :class:`~shared_control_env.controllers.allocators.Allocator`.

    Args:
        policy: policy of the task ``allocator``.

    Raises:
        ValueError: if the policy was trained for another task.
    """

    def __init__(self, policy: Policy) -> None:
        _require(policy, "allocator")
        self._policy, self._history = policy, History(1, len(ALLOCATOR_FEATURES))

    def reset(self, seed: int | None = None) -> None:
        """Begin an episode.

        Args:
            seed: not used, since the policy draws no random numbers.
        """
        self._history.forget()

    def allocate(self, scene: np.ndarray, signals: np.ndarray) -> float:
        """alpha_a of one step.

        Args:
            scene: record of :data:`core.records.SCENE`.
            signals: record of :data:`core.records.SIGNALS`.
        """
        return float(authority(self._policy.act(self._history.push(allocator_view(scene, signals)[None])))[0, 0])


def _require(policy: Policy, task: str) -> None:
    if policy.card["task"] != task:
        raise ValueError(f"the policy was trained for the task {policy.card['task']!r}, not {task!r}")
