"""Actuators of the car: a first-order lag and a rate limit between the command u and what the car does."""

from __future__ import annotations

from math import exp

import numpy as np

from shared_control_env.core.compile.jit import jit
from shared_control_env.core.parameters import ActuatorParameters


@jit
def actuate(u: np.ndarray, dt: float, actuator: ActuatorParameters, realised: np.ndarray) -> None:
    """Advance the output of the actuators in place by dt.

    The lag ``u_r' = (u - u_r) / T`` is discretised exactly with the command held over the step. The rate limit then
    bounds the change. Without a lag and without a limit the output is the command itself.

    Args:
        u: command ``[a, delta]`` [m/s^2, rad], shape (2,).
        dt: step [s].
        actuator: time constants and largest rates.
        realised: output u_r [m/s^2, rad], overwritten, shape (2,).
    """
    for i in range(2):
        lag = actuator.acceleration_lag if i == 0 else actuator.steering_lag
        rate = actuator.acceleration_rate if i == 0 else actuator.steering_rate
        if lag == 0.0 and rate == np.inf:
            realised[i] = u[i]
            continue
        share = 1.0 - exp(-dt / lag) if lag > 0.0 else 1.0
        realised[i] += min(max(share * (u[i] - realised[i]), -rate * dt), rate * dt)
