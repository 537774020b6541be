"""Binding of one slot of the action, which leaves the others to whoever acts."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from shared_control_env.envs.action import SLOT_SPACES
from shared_control_env.envs.shared_control import SharedControlEnv


class SlotWrapper(gym.ActionWrapper):
    """Base of the wrappers that decide one slot of the action at every step.

    The remaining action is a dict while two slots or more are open, that slot's own Box when one is, and
    ``Discrete(1)``, to go on, when none is.

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
        rest = {name: SLOT_SPACES[name] for name in self._inner_slots if name != slot}
        self.open_slots = tuple(rest)
        self.action_space: spaces.Space = spaces.Discrete(1)
        if rest:
            (space,) = rest.values()
            self.action_space = spaces.Box(space.low, space.high, dtype=np.float32)

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


def open_slots(env: gym.Env) -> tuple[str, ...]:
    """Names of the slots that an environment's action leaves open."""
    while isinstance(env, gym.Wrapper):
        if isinstance(env, SlotWrapper):
            return env.open_slots
        env = env.env
    return tuple(SLOT_SPACES)
