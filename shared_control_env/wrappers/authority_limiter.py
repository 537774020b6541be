"""The limiter of the automation's authority: the paper's fuzzy inference, or another allocator."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import RecordConstructorArgs

from shared_control_env.controllers.allocators import Allocator, FuzzyAuthority, asks, decide, hide
from shared_control_env.controllers.driver import check_reset
from shared_control_env.envs.slots import AUTHORITY
from shared_control_env.wrappers.slot_wrapper import SlotWrapper


class AuthorityLimiter(SlotWrapper, RecordConstructorArgs):
    """Binds alpha_a: the fuzzy inference (Eq. 9) of the risks r_x and r_y of driving by u_a,f (Eq. 1-8).

    The open slot is the driver's command: the task that a learned or scripted driver solves. The environment assesses
    the risks with its own settings, so that every allocator sees the same risks.

    Args:
        env: an environment whose authority slot is open.
        allocator: the allocator; by default the fuzzy inference, with the operators of the settings.

    Raises:
        ValueError: if the allocator is not an object with ``reset`` and ``allocate``.
    """

    def __init__(self, env: gym.Env, allocator: Allocator | None = None) -> None:
        RecordConstructorArgs.__init__(self, allocator=allocator)
        SlotWrapper.__init__(self, env, AUTHORITY)
        if allocator is not None and (isinstance(allocator, type) or not isinstance(allocator, Allocator)):
            raise ValueError(
                f"allocator = {allocator!r} must be an object with reset(seed) and allocate(scene, signals) -> alpha_a"
            )
        if allocator is not None:
            check_reset(allocator, f"allocator = {allocator!r}")
        follows_settings = type(allocator) is FuzzyAuthority and allocator.operators is None
        self._given = None if follows_settings else allocator

    @property
    def allocator(self) -> Allocator:
        """The allocator in use."""
        return FuzzyAuthority(self.shared.episode.authority.operators) if self._given is None else self._given

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Reset the environment and the allocator.

        A given allocator's seed is drawn from the environment's random generator.

        Args:
            seed: seed of the environment's random generator, or None.
            options: options of Gymnasium's ``reset``.
        """
        result = self.env.reset(seed=seed, options=options)
        if self._given is not None:
            (own,) = self.shared.np_random.spawn(1)
            self._given.reset(seed=int(own.integers(2**31)))
        return result

    def decide(self) -> np.ndarray | None:
        """Authorities of the planned step over both channels, shape (2,); None if the environment's own decides."""
        if self._given is None:
            return None  # the same function in the environment's compiled step, which is faster
        shared = self.shared
        scene, signals = shared.scene.copy(), shared.signals_for_allocator()  # copies, which a user may change
        hide(signals, self._given)
        assess = shared.assessor if asks(self._given) else None
        alphas, alert = decide(self._given, scene, signals, assess, "allocator")
        shared.signals["alert"] = alert
        return alphas
