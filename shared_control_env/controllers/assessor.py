"""What an allocator in Python may ask: the risks of any command, and what a compiled allocator would decide."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from shared_control_env.core import entries
from shared_control_env.core.authority.allocators import ALLOCATE
from shared_control_env.core.batch import Batch, Calls
from shared_control_env.core.records import SIGNALS, record_dtype
from shared_control_env.core.world.motion import Motion


class Assessor:
    """Answers for the present step of one environment.

    Args:
        i: index of the environment.
        batch: state of all environments.
        calls: addresses of the compiled functions.
    """

    def __init__(self, i: int, batch: Batch, calls: Calls) -> None:
        part = slice(i, i + 1)
        self._parameters = batch.parameters[part].reshape(())
        self._situation = (
            batch.scenes[part].reshape(()),
            batch.signals[part].reshape(()),
            batch.memories[part].reshape(()),
            self._parameters,
            batch.traffic[i],
            batch.lines[i],
            np.zeros((), SIGNALS),
            np.zeros((), record_dtype(Motion)),
            calls.assess,
        )

    def __call__(self, command: Any, horizon: float | None = None) -> tuple[float, float]:
        """Risks that arise if a command drives the car (Eq. 1-8).

        Args:
            command: ``[a, delta]`` [m/s^2, rad], shape (2,).
            horizon: prediction horizon [s]; the paper's tau_p of the settings by default.

        Returns:
            r_x and r_y [-].
        """
        tau = float(self._parameters["task"]["tau_p"]) if horizon is None else float(horizon)
        return entries.risks_of(float(command[0]), float(command[1]), tau, *self._situation)

    def decide(self, compiled: Callable[..., Any]) -> tuple[float, float, int]:
        """What a compiled allocator decides.

        Args:
            compiled: function with the signature :data:`core.authority.allocators.ALLOCATE`.

        Returns:
            Authorities over acceleration and over steering [-], not clipped; index of the alert.
        """
        return entries.allocate(ALLOCATE.address(compiled), *self._situation)
