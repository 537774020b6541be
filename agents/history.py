"""The last observations, which tell a policy of a fault by what it does."""

from __future__ import annotations

import numpy as np

HISTORY = 4
"""Observations that a policy sees."""


class History:
    """The last observations of one episode, laid out as Stable-Baselines3's VecFrameStack: newest last, zeros before.

    Args:
        size: of an observation.
    """

    def __init__(self, size: int) -> None:
        self._stack = np.zeros(HISTORY * size, dtype=np.float32)
        self._size = size

    def reset(self) -> None:
        """Forget everything."""
        self._stack[:] = 0.0

    def push(self, observation: np.ndarray) -> np.ndarray:
        """The stack with one more observation, shape (HISTORY * size,)."""
        self._stack[: -self._size] = self._stack[self._size :]
        self._stack[-self._size :] = observation
        return self._stack
