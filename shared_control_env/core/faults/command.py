"""Degradations of the automation's command: Eq. 17, 18 and the further kinds of :mod:`faults.kinds`.

Every degradation begins at its onset, grows over a ramp and lasts for a duration. It may be intermittent.
"""

from __future__ import annotations

from math import floor

import numpy as np

from shared_control_env.core.compile.jit import jit
from shared_control_env.core.faults.kinds import ACT, ADVANCE, Acting
from shared_control_env.core.parameters import DegradationParameters, Limits
from shared_control_env.core.records import MAX_DELAY, FaultMemory

CHANNELS = ("acceleration", "steering")
"""Names of the command's channels, in the order of every command array ``[a, delta]``."""

PLACES = ("planner", "command", "actuator")
"""Places where degradations of the command act; the index of a place is its code.

``planner``: u_a,des itself is wrong, and the correct command is unknown. ``command``: between the automation and the
limiter, which knows u_a,des; this is the paper's place. ``actuator``: on u_a,act, after the limiter.
"""

PLANNER, COMMAND, ACTUATOR = range(3)

_act, _advance = ACT.call, ADVANCE.call


@jit
def has_set_in(fault: DegradationParameters, t: float) -> bool:
    """Whether time t lies between the onset and the end of a degradation, pauses of an intermittent one included.

    Args:
        fault: parameters of the degradation.
        t: time [s].
    """
    return fault.kind != 0 and fault.onset <= t < fault.onset + fault.duration


@jit
def severity(fault: DegradationParameters, t: float) -> float:
    """Severity g of a degradation at time t: the present share of its full size.

    ``g = min((t - onset) / ramp, 1)`` from onset to onset + duration, and a step where ramp is 0. An intermittent
    degradation acts in the first part of each period, of length ``duty period``; in the rest of the period g is 0.

    Args:
        fault: parameters of the degradation.
        t: time [s].

    Returns:
        g in [0, 1] [-].
    """
    if not has_set_in(fault, t):
        return 0.0
    elapsed = t - fault.onset
    if fault.period > 0.0 and elapsed - fault.period * floor(elapsed / fault.period) >= fault.duty * fault.period:
        return 0.0
    return 1.0 if elapsed >= fault.ramp else elapsed / fault.ramp


@jit
def clear_faults(memories: np.ndarray) -> None:
    """Reset the memories of all degradations at the start of an episode.

    Args:
        memories: records of :data:`records.FAULT_MEMORY`, shape (n,), overwritten.
    """
    for i in range(memories.shape[0]):
        memory = memories[i]
        memory.acting = False
        for channel in range(2):
            memory.kept[channel] = memory.noise[channel] = memory.last[channel] = 0.0
            for j in range(MAX_DELAY):
                memory.past[j, channel] = 0.0


@jit
def _remember(memory: FaultMemory, u: np.ndarray, acting: bool, k: int) -> None:
    """Store what later steps of a degradation may need of the present command u, shape (2,)."""
    for channel in range(2):
        memory.past[k % MAX_DELAY, channel] = u[channel]
        if acting and not memory.acting:
            memory.kept[channel] = u[channel]
        if not acting:
            memory.last[channel] = u[channel]
    memory.acting = acting


@jit
def degrade(
    u_des: np.ndarray,
    k: int,
    dt: float,
    faults: np.ndarray,
    memories: np.ndarray,
    limits: Limits,
    u_f: np.ndarray,
) -> None:
    """Apply all degradations in turn to the automation's command, and clip the result to the physical limits.

    A degradation may act on both channels and have a size in the unit of its channel. The size is then a steering
    angle or steering rate, and the acceleration changes by the same share of its limit. The function must be called
    exactly once per time step.

    Args:
        u_des: desired command ``[a, delta]`` [m/s^2, rad], shape (2,).
        k: index of the time step.
        dt: duration of a time step [s].
        faults: records of :class:`DegradationParameters`, shape (n,).
        memories: records of :data:`records.FAULT_MEMORY`, updated, shape (n,).
        limits: physical limits of the commands.
        u_f: degraded command [m/s^2, rad], written, shape (2,); may be ``u_des`` itself.
    """
    u_f[0], u_f[1] = u_des[0], u_des[1]
    for i in range(faults.shape[0]):
        fault, memory = faults[i], memories[i]
        if fault.kind == 0:
            continue
        g = severity(fault, k * dt)
        _remember(memory, u_f, g > 0.0, k)
        if fault.advance != 0:
            _advance(fault.advance, fault, memory, k, dt)
        for channel in range(2):
            if fault.act == 0 or not (fault.acceleration if channel == 0 else fault.steering):
                continue
            bound = limits.a_max if channel == 0 else limits.delta_max
            size = fault.size
            if channel == 0 and fault.steering and fault.in_unit_of_channel:
                size *= limits.a_max / limits.delta_max
            if memory.acting:
                acting = Acting(fault, memory, channel, u_f[channel], g, size, bound, k, dt)
                u_f[channel] = _act(fault.act, acting)
                memory.last[channel] = u_f[channel]
    u_f[0] = min(max(u_f[0], -limits.a_max), limits.a_max)
    u_f[1] = min(max(u_f[1], -limits.delta_max), limits.delta_max)
