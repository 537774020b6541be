"""Adapter from an observation of the core to a highway-env observation type."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from highway_env.envs.common.observation import ObservationType

from shared_control_env.core.feedback.observation import Observation
from shared_control_env.envs.slots import observation_space


class CoreObservation(ObservationType):
    """The observation that the core wrote for the present scene.

    Args:
        env: the environment; its attribute ``observation`` holds the last observation.
        observation: the observation type of the core.
    """

    def __init__(self, env: Any, observation: Observation) -> None:
        super().__init__(env)
        self.observation = observation

    def space(self) -> spaces.Box:
        """Box of shape (n,) in [-1, 1]."""
        return observation_space(self.observation)

    def observe(self) -> np.ndarray:
        """Observation of the present scene as a new array."""
        return self.env.observation.copy()
