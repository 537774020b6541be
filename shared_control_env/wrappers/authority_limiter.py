"""The paper's limiter: risk assessment and fuzzy inference decide the automation's authority."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
from gymnasium.utils import RecordConstructorArgs

from shared_control_env.core import single
from shared_control_env.envs.slots import AUTHORITY
from shared_control_env.wrappers.slots import SlotWrapper


class AuthorityLimiter(SlotWrapper, RecordConstructorArgs):
    """Binds alpha_a: the risks r_x and r_y of letting u_a,f drive (Eq. 1-8), through the fuzzy inference (Eq. 9).

    What remains is the driver's command: the task that a learned or scripted driver solves. The risks are
    those that the environment assesses with its settings, so that every allocator sees the same ones.

    Args:
        env: an environment whose authority is open.
    """

    def __init__(self, env: gym.Env) -> None:
        RecordConstructorArgs.__init__(self)
        SlotWrapper.__init__(self, env, AUTHORITY)

    def decide(self) -> np.ndarray:
        """alpha_a of the planned step, shape (1,)."""
        return np.array([single.fuzzy_authority(self.shared.signals, self.shared.parameters)])
