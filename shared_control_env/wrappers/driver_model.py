"""A driver in the loop."""

from __future__ import annotations

from math import inf
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import RecordConstructorArgs

from shared_control_env.controllers.driver import Driver, PersonDriver, check_reset, checked_command, driver_of
from shared_control_env.envs.settings import parameters_of
from shared_control_env.envs.slots import DRIVER, NOT_DIRECT
from shared_control_env.wrappers.slot_wrapper import SlotWrapper


class DriverModel(SlotWrapper, RecordConstructorArgs):
    """Binds the driver's command with any :class:`Driver`.

    The open slot is alpha_a: the task that a learned allocator solves. With the limiter applied too, no slot is open.
    ``info["driver"]`` holds the status, iterations, residuals and failures of a driver that has a ``solution``. For a
    person it also holds whether the person drives, and what the person noticed and when.

    Args:
        env: an environment whose driver slot is open.
        driver: the driver; by default the one of the settings: the paper's predictive driver, or a person.

    Attributes:
        driver: the driver in use.

    Raises:
        ValueError: if the driver is not an object with ``reset`` and ``act``; at a step, if the driver does not return
            two finite numbers.
    """

    def __init__(self, env: gym.Env, driver: Driver | None = None) -> None:
        RecordConstructorArgs.__init__(self, driver=driver)
        SlotWrapper.__init__(self, env, DRIVER)
        if driver is not None and (isinstance(driver, type) or not isinstance(driver, Driver)):
            raise ValueError(
                f"driver = {driver!r} must be an object with reset(seed) and act(observation, scene) -> [a, delta]"
            )
        if driver is not None:
            check_reset(driver, f"driver = {driver!r}")
        self._given = driver
        self._check_driver()
        self.driver: Driver = driver_of(parameters_of(self.shared.episode)) if driver is None else driver

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Reset the environment and the driver; the driver's seed is drawn from the environment's random generator.

        Args:
            seed: seed of the environment's random generator, or None.
            options: options of Gymnasium's ``reset``.

        Raises:
            ValueError: as for the environment; or for a person in the settings if a driver was given.
        """
        observation, info = self.env.reset(seed=seed, options=options)
        self._check_driver()
        if self._given is None:
            self.driver = driver_of(parameters_of(self.shared.episode))
        (own,) = self.shared.np_random.spawn(1)  # spawning leaves the environment's own draws unchanged
        self.driver.reset(seed=int(own.integers(2**31)))
        return observation, {**info, **self._report()}

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Step with the driver's command; see :class:`SharedControlEnv`.

        Args:
            action: the value of the slot that is still open.
        """
        observation, reward, terminated, truncated, info = self.env.step(self.action(action))
        return observation, reward, terminated, truncated, {**info, **self._report()}

    def _check_driver(self) -> None:
        """Raise ValueError if the settings have a person but a driver was given, or are direct but none was."""
        if self._given is None and self.shared.settings.is_direct:
            raise ValueError(NOT_DIRECT)
        if self._given is not None and self.shared.settings.has_person:
            raise ValueError(
                "the person in config['person'] or config['persons'] would not act: another driver is given"
            )

    def decide(self) -> np.ndarray:
        """The driver's command divided by its limits, shape (2,)."""
        shared = self.shared
        if self._given is None:
            command = checked_command(self.driver.act(shared.observation, shared.scene))
            if isinstance(self.driver, PersonDriver):
                shared.memory["resting"] = self.driver.resting
            return command / shared.command_limits
        # Copies, so that a user's driver cannot change the simulation.
        command = checked_command(self.driver.act(shared.observation.copy(), shared.scene.copy()))
        return np.clip(command / shared.command_limits, -1.0, 1.0)

    def _report(self) -> dict[str, Any]:
        """The solver's report; it has the same keys at the reset and at every step."""
        if not hasattr(self.driver, "solution"):
            return {}
        solution = self.driver.solution
        return {
            "driver": {
                "status": 0 if solution is None else solution.status,
                "iterations": 0 if solution is None else solution.iterations,
                "primal_residual": 0.0 if solution is None else solution.primal_residual,
                "dual_residual": 0.0 if solution is None else solution.dual_residual,
                "failures": int(getattr(self.driver, "failures", 0)),
                **self._person(),
                **{name: float(self.shared.parameters["lag"][name]) for name in ("K_h", "T_h")},
            }
        }

    def _person(self) -> dict[str, Any]:
        """Whether a person drives, what was noticed and when, and the response; any other driver counts as driving."""
        if not isinstance(self.driver, PersonDriver):
            return {"engaged": True, "noticed": inf, "reason": 0, "response": 0.0}
        return {name: self.driver.person[name].item() for name in ("engaged", "noticed", "reason", "response")}
