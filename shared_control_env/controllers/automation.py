"""The automation: nonlinear model predictive control with a warm start."""

from __future__ import annotations

from time import perf_counter
from typing import Protocol, runtime_checkable

import numpy as np

from shared_control_env.controllers.solution import Solution
from shared_control_env.core import entries
from shared_control_env.core.control.automation import AUTOMATE, AUTOMATIONS, FAILED, automate
from shared_control_env.core.records import AUTOMATION_MEMORY, SIGNALS


@runtime_checkable
class Planner(Protocol):
    """Anything that decides the automation's desired command.

    A planner may have an attribute ``failures``: the number of steps since the reset at which it held its last command.
    """

    def reset(self) -> None:
        """Begin an episode."""
        ...

    def act(self, scene: np.ndarray) -> Solution:
        """Decide on the command for one scene; ``command`` is u_a,des = [a, delta] [m/s^2, rad].

        Args:
            scene: the scene as the automation perceives it, a record of :data:`records.SCENE`, 0-d array.
        """
        ...


class Automation:
    """Desired commands u_a,des from the nonlinear predictive controller of Eq. 12-13.

    Args:
        parameters: :func:`records.pack` of :class:`Parameters`.
        memory: record of :data:`records.AUTOMATION_MEMORY`, a 0-d array; by default a record of its own.
    """

    def __init__(self, parameters: np.ndarray, memory: np.ndarray | None = None) -> None:
        self._parameters = parameters
        self._memory = np.zeros((), AUTOMATION_MEMORY) if memory is None else memory
        self._signals, self._work = np.zeros((), SIGNALS), np.zeros((), AUTOMATIONS)

    @property
    def failures(self) -> int:
        """Number of steps since the reset at which the solver failed and the last command was held."""
        return int(self._memory["failures"])

    def reset(self) -> None:
        """Forget the last commands."""
        entries.clear_automation(self._memory)

    def act(self, scene: np.ndarray) -> Solution:
        """Decide on the command for one scene.

        Args:
            scene: record of :data:`records.SCENE`, 0-d array, with its safe area already found.

        Returns:
            The solution. ``status`` is as in :mod:`core.control.automation`; ``dual_residual`` is that of the projected
            gradient.
        """
        begin = perf_counter()
        signals = self._signals
        entries.automate(
            AUTOMATE.address(automate), scene.reshape(1), self._parameters.reshape(1), self._memory, signals, self._work
        )
        status = int(signals["status"])
        return Solution(
            command=signals["u_a_des"].copy(),
            found=status != FAILED,
            status=status,
            iterations=int(signals["iterations"]),
            primal_residual=0.0,
            dual_residual=float(signals["residual"]),
            time=perf_counter() - begin,
        )
