"""First-order neuromuscular response of the driver (Eq. 16)."""

from __future__ import annotations

from math import exp

import numpy as np

from shared_control_env.core.compile.jit import jit
from shared_control_env.core.parameters import DriverLagParameters


@jit
def advance_lag(
    u_h_act: np.ndarray, u_h_des: np.ndarray, u_a_act: np.ndarray, dt: float, lag: DriverLagParameters
) -> None:
    """Advance the driver's actual command in place over one step.

    ``u_h,act = K_h / (T_h s + 1) (u_h,des - u_a,act)``, discretised exactly with the input held over the step
    (zero-order hold)::

        u_h,act(k+1) = phi u_h,act(k) + K_h (1 - phi) (u_h,des(k) - u_a,act(k)),   phi = exp(-dt / T_h)

    The filter has no direct feed-through: the driver's decision at k reaches the vehicle at k + 1.

    Args:
        u_h_act: actual command at k [m/s^2, rad], overwritten with that at k + 1, shape (2,).
        u_h_des: the driver's desired command [m/s^2, rad], shape (2,).
        u_a_act: the automation's actual command [m/s^2, rad], shape (2,).
        dt: step [s].
        lag: gain K_h and time constant T_h.
    """
    phi = exp(-dt / lag.T_h)
    for i in range(2):
        u_h_act[i] = phi * u_h_act[i] + lag.K_h * (1.0 - phi) * (u_h_des[i] - u_a_act[i])
