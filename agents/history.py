"""The last observations, which tell a policy of a fault by what it does."""

from __future__ import annotations

import numpy as np

HISTORY = 4
"""Observations that a policy sees."""


class History:
    """The last observations of N episodes: the newest, and the changes that led to it.

    A policy sees ``[o(k), o(k) - o(k-1), ..., o(k-HISTORY+2) - o(k-HISTORY+1)]``, with ``o(0)`` in the place of what
    was before an episode. Changes say what the car does that nobody at the wheel asked for; as differences of entries
    that hardly differ a network would be long in finding them.

    Args:
        n: episodes.
        size: of an observation.
    """

    def __init__(self, n: int, size: int) -> None:
        self._last = np.zeros((n, HISTORY, size), dtype=np.float32)
        self._empty = np.ones(n, dtype=bool)

    def forget(self, ended: np.ndarray | slice = slice(None)) -> None:
        """Begin episodes: those that the mask of shape (N,) names, or all."""
        self._empty[ended] = True

    def push(self, observations: np.ndarray) -> np.ndarray:
        """Take one more observation of every episode.

        Args:
            observations: shape (N, size).

        Returns:
            What a policy sees, float32, shape (N, HISTORY * size).
        """
        self._last[:, 1:] = self._last[:, :-1]
        self._last[:, 0] = observations
        self._last[self._empty] = observations[self._empty, None]
        self._empty[:] = False
        return _seen(self._last)

    def would_see(self, observation: np.ndarray, i: int) -> np.ndarray:
        """What a policy would see in episode i with one more observation, which is not taken."""
        return _seen(np.concatenate([observation[None], self._last[i, :-1]])[None])[0]


def _seen(last: np.ndarray) -> np.ndarray:
    """The newest observation and the changes, the newest first, flat."""
    return np.concatenate([last[:, :1], last[:, :-1] - last[:, 1:]], axis=1).reshape(len(last), -1)
