"""Outputs of a step of the kernel: the arrays that it writes, and the observation space."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from gymnasium import spaces

from shared_control_env.core.batch import Outputs
from shared_control_env.core.control.predictive_driver import DRIVER_REPORT
from shared_control_env.core.feedback.info import INFO
from shared_control_env.core.feedback.observation import Observation


def observation_space(observation: Observation) -> spaces.Box:
    """Space of an observation: a Box of shape (n,) in [-1, 1].

    Args:
        observation: the observation type.
    """
    return spaces.Box(-1.0, 1.0, shape=(observation.size,), dtype=np.float32)


def new_outputs(n: int, features: int, allocate: Callable[..., np.ndarray] = np.zeros) -> Outputs:
    """New arrays for one step of n environments.

    Args:
        n: number of environments.
        features: number of features of an observation.
        allocate: ``numpy.zeros``, or ``numpy.empty`` if every environment writes its entries.
    """
    return Outputs(
        observations=allocate((n, features), np.float32),
        rewards=allocate(n),
        terminations=allocate(n, bool),
        truncations=allocate(n, bool),
        infos=allocate(n, INFO),
        drivers=allocate(n, DRIVER_REPORT),
    )
