"""Wrapper base that binds one slot of the action and leaves the other slot open."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np

from shared_control_env.envs.shared_control import SharedControlEnv
from shared_control_env.envs.slots import SLOT_SPACES, space_of


class SlotWrapper(gym.ActionWrapper):
    """Base of the wrappers that decide one slot of the action at every step.

    The remaining action space is the Box of the slot that is still open. If no slot is open, it is ``Discrete(1)``,
    whose only action continues the episode.

    Args:
        env: an environment whose slot is open.
        slot: name of the slot.

    Attributes:
        slot: name of the bound slot.
        open_slots: names of the slots that are still open.

    Raises:
        ValueError: if the slot is already bound, or the environment has no slots.
    """

    def __init__(self, env: gym.Env, slot: str) -> None:
        super().__init__(env)
        if not isinstance(env.unwrapped, SharedControlEnv):
            raise ValueError(f"env = {env} has no slot {slot!r}; it must be a SharedControlEnv, possibly wrapped")
        self.slot = slot
        self._inner_slots = open_slots(env)
        if slot not in self._inner_slots:
            raise ValueError(f"slot {slot!r} of {env} is bound already; the open slots are {list(self._inner_slots)}")
        self.open_slots = tuple(name for name in self._inner_slots if name != slot)
        self.action_space = space_of(self.open_slots)

    @property
    def shared(self) -> SharedControlEnv:
        """The bare environment."""
        return self.unwrapped  # type: ignore[return-value]

    def decide(self) -> np.ndarray | None:
        """Value of the bound slot at this step; None where the environment itself decides."""
        raise NotImplementedError

    def action(self, action: Any) -> Any:
        """The inner environment's action: the bound slot as decided, and the other slot as given.

        Args:
            action: value of the slot that is still open.
        """
        value = self.decide()
        if len(self._inner_slots) == 1:
            return value
        (other,) = self.open_slots
        return {self.slot: value, other: action}


def open_slots(env: gym.Env) -> tuple[str, ...]:
    """Names of the slots that an environment's action leaves open.

    Args:
        env: the environment, possibly wrapped.
    """
    while isinstance(env, gym.Wrapper):
        if isinstance(env, SlotWrapper):
            return env.open_slots
        env = env.env
    return tuple(SLOT_SPACES)
