"""Degradations of the automation: of its command (Eq. 17, 18 and kinds of our own), and of its perception.

Names follow the usage of fault-tolerant control (Blanke et al., Diagnosis and Fault-Tolerant Control, Chapter 1;
Zhang & Jiang, Bibliographical Review on Reconfigurable Fault-Tolerant Control Systems, 2008): bias, loss of
effectiveness, stuck (lock in place), saturation, and so on. Every degradation grows over a ramp from its onset
on, lasts for a duration, and may come and go.
"""

from __future__ import annotations

from math import floor, pi, sin

import numpy as np

from shared_control_env.core.jit import jit
from shared_control_env.core.noise import coloured, standard_normal
from shared_control_env.core.parameters import DegradationParameters, Limits
from shared_control_env.core.records import MAX_DELAY, Record

CHANNELS = ("acceleration", "steering")
"""Names of the command's channels, in the order of every command array ``[a, delta]``."""

PLACES = ("planner", "command", "actuator")
"""Where degradations of the command act; a place's index is its code.

``planner``: u_a,des itself is wrong, and nobody knows what it should be. ``command``: between the automation and the
limiter, which knows u_a,des; the paper's. ``actuator``: on u_a,act, whatever the limiter has made of it.
"""

PLANNER, COMMAND, ACTUATOR = range(3)

KINDS = (
    "none",
    "bias",
    "loss_of_effectiveness",
    "stuck",
    "rate_limit",
    "saturation",
    "delay",
    "white_noise",
    "coloured_noise",
    "oscillation",
    "drop_out",
    "sign_error",
    "lane_offset",
    "missed_lead",
)
"""Names of the kinds; a kind's index is its code in compiled functions."""

(
    NO_FAULT,
    BIAS,
    LOSS_OF_EFFECTIVENESS,
    STUCK,
    RATE_LIMIT,
    SATURATION,
    DELAY,
    WHITE_NOISE,
    COLOURED_NOISE,
    OSCILLATION,
    DROP_OUT,
    SIGN_ERROR,
    LANE_OFFSET,
    MISSED_LEAD,
) = range(len(KINDS))


@jit
def has_set_in(fault: DegradationParameters, t: float) -> bool:
    """Whether a degradation is there at time t [s]; one that comes and goes is there throughout."""
    return fault.kind != NO_FAULT and fault.onset <= t < fault.onset + fault.duration


@jit
def severity(fault: DegradationParameters, t: float) -> float:
    """Share of its full size that a degradation has at time t.

    ``g = min((t - onset) / ramp, 1)`` from onset to onset + duration; a step where ramp is 0; and 0 in the
    rest of every period of one that comes and goes, after the first ``duty period``.

    Args:
        fault: the degradation.
        t: time [s].

    Returns:
        g in [0, 1].
    """
    if not has_set_in(fault, t):
        return 0.0
    elapsed = t - fault.onset
    if fault.period > 0.0 and elapsed - fault.period * floor(elapsed / fault.period) >= fault.duty * fault.period:
        return 0.0
    return 1.0 if elapsed >= fault.ramp else elapsed / fault.ramp


@jit
def degrade_channel(
    fault: DegradationParameters,
    memory: Record,
    channel: int,
    u: float,
    g: float,
    size: float,
    bound: float,
    k: int,
    dt: float,
    elapsed: float,
) -> float:
    """One channel's command under one degradation, where it acts (g > 0).

    ::

        bias                   u + g size                         size [m/s^2 or rad]
        loss_of_effectiveness  (1 - g size) u                     size in [0, 1]
        stuck                  u at the moment it set in
        rate_limit             u within size dt of the last one   size [m/s^3 or rad/s]
        saturation             u within (1 - g size) bound        size in [0, 1]
        delay                  u of the time t - g size           size [s]
        white_noise            u + g size n_k                     size: standard deviation [m/s^2 or rad]
        coloured_noise         u + g size x_k                     the same, of a first-order process:
                               :func:`core.noise.coloured`
        oscillation            u + g size sin(2 pi frequency (t - onset))
        drop_out               0
        sign_error             -u

    with n_k independent standard normal numbers. The perceptual kinds leave the command alone.

    Args:
        fault: the degradation.
        memory: record of :data:`records.FAULT_MEMORY`.
        channel: 0 for the acceleration, 1 for the steering.
        u: the channel's command.
        g: :func:`severity`.
        size: of this channel.
        bound: the channel's physical limit.
        k: time step.
        dt: time step [s].
        elapsed: time since the onset [s].

    Returns:
        The degraded command.
    """
    kind = fault.kind
    if kind == BIAS:
        return u + g * size
    if kind == LOSS_OF_EFFECTIVENESS:
        return (1.0 - g * size) * u
    if kind == STUCK:
        return memory.kept[channel]
    if kind == RATE_LIMIT:
        return min(max(u, memory.last[channel] - size * dt), memory.last[channel] + size * dt)
    if kind == SATURATION:
        return min(max(u, -(1.0 - g * size) * bound), (1.0 - g * size) * bound)
    if kind == DELAY:
        steps = min(round(g * size / dt), MAX_DELAY - 1)
        return memory.past[max(k - steps, 0) % MAX_DELAY, channel]
    if kind == WHITE_NOISE:
        return u + g * size * standard_normal(fault.seed, 2 * k + channel)
    if kind == COLOURED_NOISE:
        return u + g * size * memory.kept[channel]
    if kind == OSCILLATION:
        return u + g * size * sin(2.0 * pi * fault.frequency * elapsed)
    if kind == DROP_OUT:
        return 0.0
    if kind == SIGN_ERROR:
        return -u
    return u


@jit
def _remember(fault: DegradationParameters, memory: Record, u: np.ndarray, acting: bool, k: int, dt: float) -> None:
    """Keep what a later step of a degradation needs of the present command u, shape (2,)."""
    for channel in range(2):
        memory.past[k % MAX_DELAY, channel] = u[channel]
        if fault.kind == STUCK and acting and not memory.acting:
            memory.kept[channel] = u[channel]
        if not acting:
            memory.last[channel] = u[channel]
        if fault.kind == COLOURED_NOISE:
            kept = memory.kept[channel]
            memory.kept[channel] = coloured(kept, fault.seed, 2 * k + channel, k, fault.time_constant, dt)
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
    """Apply one degradation after the other to the automation's desired command, and clip to the physical limits.

    A degradation of both channels has its size as a steering angle, or as its rate; the acceleration takes
    the same share of its limit. To be called once at every time step.

    Args:
        u_des: desired command ``[a, delta]`` [m/s^2, rad], shape (2,).
        k: time step.
        dt: time step [s].
        faults: records of :class:`DegradationParameters`, shape (n,).
        memories: records of :data:`records.FAULT_MEMORY`, shape (n,).
        limits: physical limits.
        u_f: the degraded command is written here, shape (2,).
    """
    u_f[0], u_f[1] = u_des[0], u_des[1]
    for i in range(faults.shape[0]):
        fault, memory = faults[i], memories[i]
        if fault.kind == NO_FAULT:
            continue
        g = severity(fault, k * dt)
        _remember(fault, memory, u_f, g > 0.0, k, dt)
        for channel in range(2):
            if not (fault.acceleration if channel == 0 else fault.steering):
                continue
            bound = limits.a_max if channel == 0 else limits.delta_max
            size = fault.size
            if channel == 0 and fault.steering and _has_unit_of_command(fault.kind):
                size *= limits.a_max / limits.delta_max
            if memory.acting:
                elapsed = k * dt - fault.onset
                u_f[channel] = degrade_channel(fault, memory, channel, u_f[channel], g, size, bound, k, dt, elapsed)
                memory.last[channel] = u_f[channel]
    u_f[0] = min(max(u_f[0], -limits.a_max), limits.a_max)
    u_f[1] = min(max(u_f[1], -limits.delta_max), limits.delta_max)


@jit
def _has_unit_of_command(kind: int) -> bool:
    """Whether a kind's size is in its channel's unit; else it is a share or a time."""
    return kind not in (LOSS_OF_EFFECTIVENESS, SATURATION, DELAY)


@jit
def misperceive(t: float, faults: np.ndarray, misperception: np.ndarray) -> None:
    """What the automation's perception has wrong.

    ::

        lane_offset  it believes to be g size further to the left than it is; size [m]
        missed_lead  it does not see the vehicle that precedes

    Args:
        t: time [s].
        faults: records of :class:`DegradationParameters`, shape (n,).
        misperception: offset [m], and 1 where the lead is missed, else 0; written, shape (2,).
    """
    misperception[0], misperception[1] = 0.0, 0.0
    for i in range(faults.shape[0]):
        g = severity(faults[i], t)
        if faults[i].kind == LANE_OFFSET:
            misperception[0] += g * faults[i].size
        elif faults[i].kind == MISSED_LEAD and g > 0.0:
            misperception[1] = 1.0
