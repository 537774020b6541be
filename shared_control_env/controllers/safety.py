"""Allocators that limit the automation by what its command leads to; the kernel runs them too."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from shared_control_env.controllers.allocators import Allocation
from shared_control_env.controllers.assessor import Assessor
from shared_control_env.controllers.stateless import Stateless
from shared_control_env.core.authority import barrier, predictive_filter, safehil
from shared_control_env.core.authority.alerts import ALERTS


class _Compiled(Stateless):
    """Base of allocators whose equations are compiled."""

    compiled: Callable[..., Any]
    needs_assess = True

    def allocate(self, scene: np.ndarray, signals: np.ndarray, assess: Assessor) -> Allocation:
        """What the compiled function decides.

        Args:
            scene: record of :data:`core.records.SCENE`; not used.
            signals: record of :data:`core.records.SIGNALS`; not used.
            assess: the environment's present step.
        """
        over_a, over_delta, alert = assess.decide(self.compiled)
        return Allocation((over_a, over_delta), ALERTS[alert])


class SafeHIL(_Compiled):
    """Authority by the growth of the risk under each command, see :mod:`core.authority.safehil`.

    Args:
        growing: whether only a growing risk counts; as published, a falling one counts too.

    Attributes:
        compiled: the allocator for the kernel.
    """

    def __init__(self, growing: bool = False) -> None:
        self.compiled = safehil.safehil_growing if growing else safehil.safehil


class BarrierAuthority(_Compiled):
    """Largest authority in each channel that barrier functions allow, see :mod:`core.authority.barrier`.

    Attributes:
        compiled: the allocator for the kernel.
    """

    def __init__(self) -> None:
        self.compiled = barrier.barrier


class PredictiveFilter(_Compiled):
    """Largest authority that leaves a way back, see :mod:`core.authority.predictive_filter`.

    Attributes:
        compiled: the allocator for the kernel.
    """

    def __init__(self) -> None:
        self.compiled = predictive_filter.predictive_filter
