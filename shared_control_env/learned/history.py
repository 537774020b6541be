"""The last observations, from which a policy can infer a fault by its effects."""

from __future__ import annotations

import numpy as np

HISTORY = 4
"""Number of observations that a policy sees."""


class History:
    """The last observations of N episodes: the newest observation, and the changes that led to it.

    A policy sees ``[o(k), o(k) - o(k-1), ..., o(k-HISTORY+2) - o(k-HISTORY+1)]``. Before the start of an episode,
    ``o(0)`` takes the place of the missing observations. The changes show motion of the car that the driver did not
    ask for. They are given as differences because a network would learn them slowly from entries that hardly differ.

    Args:
        n: number of episodes, N.
        size: number of entries of an observation.
    """

    def __init__(self, n: int, size: int) -> None:
        self._last = np.zeros((n, HISTORY, size), dtype=np.float32)
        self._empty = np.ones(n, dtype=bool)

    def forget(self, ended: np.ndarray | slice = slice(None)) -> None:
        """Begin new episodes.

        Args:
            ended: mask of the episodes that begin again, shape (N,); by default all.
        """
        self._empty[ended] = True

    def push(self, observations: np.ndarray) -> np.ndarray:
        """Add one observation of every episode.

        Args:
            observations: the newest observations, shape (N, size).

        Returns:
            What a policy sees, float32, shape (N, HISTORY * size).
        """
        self._last[:, 1:] = self._last[:, :-1]
        self._last[:, 0] = observations
        self._last[self._empty] = observations[self._empty, None]
        self._empty[:] = False
        return _seen(self._last)

    def would_see(self, observation: np.ndarray, i: int) -> np.ndarray:
        """What a policy would see in one episode after one more observation, without adding it.

        Args:
            observation: the observation, shape (size,).
            i: index of the episode.

        Returns:
            Array of shape (HISTORY * size,).
        """
        return _seen(np.concatenate([observation[None], self._last[i, :-1]])[None])[0]


def of_episode(observations: np.ndarray) -> np.ndarray:
    """What a policy sees in each step of one episode.

    Args:
        observations: observations of the episode, shape (T, size).

    Returns:
        Array of shape (T, HISTORY * size), as :meth:`History.push` returns it step by step.
    """
    steps = np.arange(len(observations))[:, None] - np.arange(HISTORY)
    return _seen(observations[np.maximum(steps, 0)])


def _seen(last: np.ndarray) -> np.ndarray:
    """The newest observation and the changes, the newest first, flattened."""
    return np.concatenate([last[:, :1], last[:, :-1] - last[:, 1:]], axis=1).reshape(len(last), -1)
