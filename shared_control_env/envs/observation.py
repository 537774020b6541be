"""The driver's view as a highway-env observation type."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from gymnasium import spaces
from highway_env.envs.common.observation import ObservationType

from shared_control_env.core import single
from shared_control_env.core.observation import FEATURES

if TYPE_CHECKING:
    from shared_control_env.envs.shared_control import SharedControlEnv


class DriverObservation(ObservationType):
    """What a driver can perceive (:data:`core.observation.FEATURES`); the fault is not in it."""

    env: SharedControlEnv

    def space(self) -> spaces.Box:
        """Box of shape (25,) in [-1, 1]."""
        return spaces.Box(-1.0, 1.0, shape=(len(FEATURES),), dtype=np.float32)

    def observe(self) -> np.ndarray:
        """Observation of the present scene, a new array."""
        env = self.env
        observation = np.empty(len(FEATURES), dtype=np.float32)
        single.observe(env.scene, env.memory, env.line, env.parameters, observation)
        return observation
