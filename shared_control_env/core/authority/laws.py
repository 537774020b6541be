"""Laws that turn the automation's authority alpha_a into its actual command (Eq. 10)."""

from __future__ import annotations

import numpy as np

from shared_control_env.core.compile.jit import jit, jit_inlined
from shared_control_env.core.parameters import LawParameters

LAWS = ("paper", "proportional", "none", "driver_only")
"""Names of the laws; a law's index is its code in compiled functions."""

PAPER, PROPORTIONAL, NONE, DRIVER_ONLY = range(4)


@jit
def limit_channel(u_des: float, u_f: float, alpha: float, tolerance: float, strict: bool) -> float:
    """Eq. 10 for one channel.

    ::

        u_act = u_f            if u_f / (u_des + eps) ~ 1
        u_act = u_f            if 0 < max(0, u_f / (u_des + eps)) < alpha < 1
        u_act = alpha u_des    otherwise

    Readings of the first line: a ratio with a small eps, or a difference. On a straight u_des is
    about 0 and the ratio is noise, so equality is ``|u_f - u_des| <= tolerance`` in physical units.
    Within it u_f is still kept to ``|u_act| <= |u_des|``, which the text asserts of all three lines.

    Readings of the second line: as printed it does not hold for alpha = 1, where a degraded command smaller than the
    desired one would then be raised to it by the third line; or it does, so that nothing jumps as alpha reaches 1.
    The latter is the default, ``strict`` the former.

    Args:
        u_des: desired command.
        u_f: degraded command, same unit.
        alpha: authority in [0, 1].
        tolerance: in the unit of the command.
        strict: whether the second line is as printed.

    Returns:
        Actual command of the automation.
    """
    if abs(u_f - u_des) <= tolerance:
        return min(max(u_f, -abs(u_des)), abs(u_des))
    if u_f * u_des > 0.0 and abs(u_f) < alpha * abs(u_des) and (alpha < 1.0 or not strict):
        return u_f
    return alpha * u_des


@jit_inlined
def apply_law(
    law: int,
    u_des: np.ndarray,
    u_f: np.ndarray,
    alpha: float,
    parameters: LawParameters,
    strict: bool,
    u_act: np.ndarray,
) -> None:
    """The automation's actual command under one of :data:`LAWS`.

    ``paper`` is Eq. 10; ``proportional`` is alpha u_f, all that a limiter upstream of the fault can do;
    ``none`` passes u_f; ``driver_only`` passes nothing.

    Args:
        law: code of the law.
        u_des, u_f: desired and degraded command ``[a, delta]``, shape (2,).
        alpha: authority in [0, 1].
        parameters: tolerances of Eq. 10.
        strict: whether its second line is as printed.
        u_act: written, shape (2,).
    """
    if law == PAPER:
        u_act[0] = limit_channel(u_des[0], u_f[0], alpha, parameters.tolerance_a, strict)
        u_act[1] = limit_channel(u_des[1], u_f[1], alpha, parameters.tolerance_delta, strict)
        return
    gain = 0.0
    if law == PROPORTIONAL:
        gain = alpha
    elif law == NONE:
        gain = 1.0
    u_act[0] = gain * u_f[0]
    u_act[1] = gain * u_f[1]
