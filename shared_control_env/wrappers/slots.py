"""Binding of one slot of the action, which leaves the others to whoever acts."""

from __future__ import annotations

import inspect
from typing import Any

import gymnasium as gym
import numpy as np

from shared_control_env.envs.shared_control import SharedControlEnv
from shared_control_env.envs.slots import SLOT_SPACES, space_of


class SlotWrapper(gym.ActionWrapper):
    """Base of the wrappers that decide one slot of the action at every step.

    The remaining action is the open slot's own Box, or ``Discrete(1)``, to go on, when none is open.

    Args:
        env: an environment whose slot is open.
        slot: name of the slot.

    Raises:
        ValueError: if the slot is bound already, or the environment has none.
    """

    def __init__(self, env: gym.Env, slot: str) -> None:
        super().__init__(env)
        if not isinstance(env.unwrapped, SharedControlEnv):
            raise ValueError(f"env = {env} must be a SharedControlEnv, possibly wrapped, to have the slot {slot!r}")
        self.slot = slot
        self._inner_slots = open_slots(env)
        if slot not in self._inner_slots:
            raise ValueError(f"slot {slot!r} of {env} is bound already; open are {list(self._inner_slots)}")
        self.open_slots = tuple(name for name in self._inner_slots if name != slot)
        self.action_space = space_of(self.open_slots)

    @property
    def shared(self) -> SharedControlEnv:
        """The bare environment."""
        return self.unwrapped  # type: ignore[return-value]

    def decide(self) -> np.ndarray:
        """Value of the bound slot at this step."""
        raise NotImplementedError

    def action(self, action: Any) -> Any:
        """The inner environment's action: the bound slot decided, the rest as given."""
        value = self.decide()
        if len(self._inner_slots) == 1:
            return value
        (other,) = self.open_slots
        return {self.slot: value, other: action}


def check_reset(player: Any, what: str) -> None:
    """Raise ValueError unless a driver's or an allocator's ``reset`` takes a seed."""
    try:
        inspect.signature(player.reset).bind(seed=0)
    except TypeError:
        raise ValueError(f"{what} = {player!r}: its reset must take a seed, as in reset(self, seed=None)") from None


def open_slots(env: gym.Env) -> tuple[str, ...]:
    """Names of the slots that an environment's action leaves open."""
    while isinstance(env, gym.Wrapper):
        if isinstance(env, SlotWrapper):
            return env.open_slots
        env = env.env
    return tuple(SLOT_SPACES)
