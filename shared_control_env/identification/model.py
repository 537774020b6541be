"""The arm of Eq. 16 as a discrete filter, with a delay that need not be whole steps."""

from __future__ import annotations

from math import exp, floor
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter


class Arm(NamedTuple):
    """An arm.

    Attributes:
        K_h: gain [-].
        T_h: time constant [s].
        delay: delay [s]; the step that a decision takes to act is not in it.
    """

    K_h: float
    T_h: float
    delay: float = 0.0


def respond(v: np.ndarray, arm: Arm, dt: float) -> np.ndarray:
    """Response of an arm at rest to its input, held over each step.

    ::

        y(k+1) = phi y(k) + K [(1 - phi^(1-m)) v(k-d) + phi^(1-m) (1 - phi^m) v(k-d-1)],   phi = exp(-dt / T)

    with the delay ``(d + m) dt``, 0 <= m < 1: within a step the input changes from v(k-d-1) to v(k-d) after m dt.

    Args:
        v: input u_h,des - u_a,act, shape (..., T); it is 0 before the first step.
        arm: the arm.
        dt: time step [s].

    Returns:
        Output u_h,act, shape (..., T); its first entry is 0.
    """
    steps = arm.delay / dt
    d = floor(steps)
    m = steps - d
    phi = exp(-dt / arm.T_h)
    late = phi ** (1.0 - m)
    b = np.zeros(d + 3)
    b[d + 1] = arm.K_h * (1.0 - late)
    b[d + 2] = arm.K_h * late * (1.0 - phi**m)
    return lfilter(b, [1.0, -phi], v, axis=-1)
