"""Laws that turn the automation's authority alpha_a into its actual command (Eq. 10)."""

from __future__ import annotations

import numpy as np

from shared_control_env.core.compile.jit import jit, jit_inlined
from shared_control_env.core.parameters import LawParameters

LAWS = ("paper", "proportional", "none", "driver_only")
"""Names of the laws; the index of a law is its code in compiled functions."""

PAPER, PROPORTIONAL, NONE, DRIVER_ONLY = range(4)


@jit
def limit_channel(u_des: float, u_f: float, alpha: float, tolerance: float, strict: bool) -> float:
    """Eq. 10 for one channel.

    ::

        u_act = u_f            if u_f / (u_des + eps) ~ 1
        u_act = u_f            if 0 < max(0, u_f / (u_des + eps)) < alpha < 1
        u_act = alpha u_des    otherwise

    Readings of the first line: a ratio with a small eps, or a difference. On a straight road u_des is about 0 and the
    ratio is dominated by noise. Equality is therefore ``|u_f - u_des| <= tolerance`` in physical units. Even then u_f
    is limited to ``|u_act| <= |u_des|``, which the text asserts of all three lines.

    Readings of the second line: as printed, the line does not apply for alpha = 1; the third line would then raise a
    degraded command that is smaller than the desired one to the desired one. Alternatively, the line also applies for
    alpha = 1, so that u_act does not jump as alpha reaches 1. The alternative is the default; ``strict`` selects the
    printed form.

    Args:
        u_des: desired command [m/s^2 or rad].
        u_f: degraded command [m/s^2 or rad].
        alpha: authority in [0, 1] [-].
        tolerance: largest difference that counts as equal [m/s^2 or rad].
        strict: whether the second line applies only for alpha < 1, as printed.

    Returns:
        Actual command of the automation [m/s^2 or rad].
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
    alpha: np.ndarray,
    parameters: LawParameters,
    strict: bool,
    u_act: np.ndarray,
) -> None:
    """Compute the automation's actual command under one of :data:`LAWS`.

    ``paper`` is Eq. 10. ``proportional`` is alpha u_f, which is all that a limiter upstream of the fault can achieve.
    ``none`` passes u_f unchanged. ``driver_only`` passes no command of the automation.

    Args:
        law: index in :data:`LAWS`.
        u_des, u_f: desired and degraded command ``[a, delta]`` [m/s^2, rad], shape (2,).
        alpha: authority over each channel in [0, 1], shape (2,) [-].
        parameters: tolerances of Eq. 10.
        strict: whether the second line of Eq. 10 applies only for alpha < 1, as printed.
        u_act: actual command [m/s^2, rad], written, shape (2,).
    """
    if law == PAPER:
        u_act[0] = limit_channel(u_des[0], u_f[0], alpha[0], parameters.tolerance_a, strict)
        u_act[1] = limit_channel(u_des[1], u_f[1], alpha[1], parameters.tolerance_delta, strict)
        return
    for i in range(2):
        gain = 0.0
        if law == PROPORTIONAL:
            gain = alpha[i]
        elif law == NONE:
            gain = 1.0
        u_act[i] = gain * u_f[i]
