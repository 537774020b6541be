"""Degradation of the automation's command (Eq. 17, 18): an additive bias that ramps up and stays."""

from __future__ import annotations

import numpy as np

from shared_control_env.core.jit import jit, jit_inlined
from shared_control_env.core.parameters import Limits

CHANNELS = ("acceleration", "steering")
"""Names of the command's channels, in the order of every command array ``[a, delta]``."""

CHANNEL, ONSET, RAMP, SIZE = range(4)
"""Places in a fault's row: channel index, onset [s], ramp duration [s], size [m/s^2 or rad]."""


@jit
def bias(fault: np.ndarray, t: float) -> float:
    """Bias of one fault at time t: ``size min(max(t - onset, 0) / ramp, 1)``; a step where ramp is 0.

    The paper's Case 1 is onset 0.5 s, ramp 1 s, size 0.3 rad; Case 2 is 0.25 s, 0.25 s, 3 m/s^2.

    Args:
        fault: row ``[channel, onset, ramp, size]``, shape (4,).
        t: time [s].

    Returns:
        Bias in the channel's unit.
    """
    elapsed = t - fault[ONSET]
    if elapsed < 0.0:
        return 0.0
    if elapsed >= fault[RAMP]:
        return fault[SIZE]
    return fault[SIZE] * elapsed / fault[RAMP]


@jit_inlined
def degrade(u_des: np.ndarray, t: float, faults: np.ndarray, limits: Limits, u_f: np.ndarray) -> None:
    """Apply every fault to the automation's desired command and clip to the physical limits.

    Args:
        u_des: desired command ``[a, delta]`` [m/s^2, rad], shape (2,).
        t: time [s].
        faults: rows of :func:`bias`, shape (n, 4).
        limits: physical limits.
        u_f: the degraded command is written here, shape (2,).
    """
    a, delta = u_des[0], u_des[1]
    for i in range(faults.shape[0]):
        if faults[i, CHANNEL] == 0.0:
            a += bias(faults[i], t)
        else:
            delta += bias(faults[i], t)
    u_f[0] = min(max(a, -limits.a_max), limits.a_max)
    u_f[1] = min(max(delta, -limits.delta_max), limits.delta_max)
