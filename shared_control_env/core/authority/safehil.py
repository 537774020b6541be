"""Allocation by the growth of risk under each of the two commands, after SafeHIL.

The rule is that of Huang et al., SafeHIL (IEEE Transactions on Intelligent Transportation Systems, 2024), as the design
of this package states it; the potential U is here the larger of the paper's two risks r_x and r_y.
"""

from __future__ import annotations

from math import exp

from shared_control_env.core.authority.alerts import NO_ALERT
from shared_control_env.core.authority.allocators import Situation, risks_of
from shared_control_env.core.compile.jit import jit

HORIZON = 0.2
"""Time over which the growth of the risk is looked at [s]; SafeHIL."""

SHARPNESS = 10.0
"""Factor of the growth in the softmax, range (0, inf) [-]; SafeHIL."""

NEGLIGIBLE = 0.1
"""Growth of the driver's risk below which the driver needs no help, range [0, 1] [-]; SafeHIL."""


@jit
def authority_of_growth(r_a: float, r_h: float) -> float:
    """Authority of the automation from the growth of the risk under each command.

    ``alpha_a = 0`` for ``r_h <= r_a`` or ``r_h < 0.1``, else ``e^(10 r_h) / (e^(10 r_a) + e^(10 r_h))``. The automation
    has authority only where the driver's command is the more dangerous one: the driver is the one who drives.

    Args:
        r_a, r_h: growth of the risk under the automation's and the driver's command [-].

    Returns:
        alpha_a: 0, or in [0.5, 1) [-].
    """
    if r_h <= r_a or r_h < NEGLIGIBLE:
        return 0.0
    return 1.0 / (1.0 + exp(SHARPNESS * (r_a - r_h)))


@jit
def _growths(now: Situation) -> tuple[float, float]:
    """Change of the risk U over :data:`HORIZON`, first under u_a,f alone, then under u_h,act alone [-]."""
    x, y = risks_of(0.0, 0.0, 0.0, now)
    x_a, y_a = risks_of(now.signals.u_a_f[0], now.signals.u_a_f[1], HORIZON, now)
    x_h, y_h = risks_of(now.memory.u_h_act[0], now.memory.u_h_act[1], HORIZON, now)
    return max(x_a, y_a) - max(x, y), max(x_h, y_h) - max(x, y)


def safehil(now: Situation) -> tuple[float, float, int]:
    """SafeHIL as published: ``r_i = |U(x + 0.2 s; u_i) - U(x)|``, which punishes a falling risk too.

    Args:
        now: the situation.

    Returns:
        alpha_a for both channels [-]; no alert.
    """
    r_a, r_h = _growths(now)
    alpha = authority_of_growth(abs(r_a), abs(r_h))
    return alpha, alpha, NO_ALERT


def safehil_growing(now: Situation) -> tuple[float, float, int]:
    """SafeHIL with ``r_i = max(0, U(x + 0.2 s; u_i) - U(x))``: only a growing risk counts.

    Args:
        now: the situation.

    Returns:
        alpha_a for both channels [-]; no alert.
    """
    r_a, r_h = _growths(now)
    alpha = authority_of_growth(max(r_a, 0.0), max(r_h, 0.0))
    return alpha, alpha, NO_ALERT
