"""Constant turn rate and acceleration (CTRA) prediction, Eq. 1."""

from __future__ import annotations

from math import cos, sin

from shared_control_env.core.compile.jit import jit

_SERIES_BELOW = 1e-2
"""|theta| below which series replace the quotients [rad]; the first neglected term is then below 1e-16."""


@jit
def turn_integrals(theta: float) -> tuple[float, float, float, float]:
    """Integrals over a unit turn, smooth through ``theta = 0``.

    ::

        c0 = int_0^1 cos(theta u) du     s0 = int_0^1 sin(theta u) du
        c1 = int_0^1 u cos(theta u) du   s1 = int_0^1 u sin(theta u) du

    Eq. 1 prints these integrals multiplied out and divided by r^2, which is 0/0 on a straight road. Near zero their
    Taylor series are used instead.

    Args:
        theta: angle turned over the horizon [rad].

    Returns:
        ``c0, s0, c1, s1``.
    """
    t2 = theta * theta
    if abs(theta) < _SERIES_BELOW:
        c0 = 1.0 - t2 / 6.0 * (1.0 - t2 / 20.0 * (1.0 - t2 / 42.0))
        s0 = theta / 2.0 * (1.0 - t2 / 12.0 * (1.0 - t2 / 30.0))
        c1 = 0.5 - t2 / 8.0 * (1.0 - t2 / 18.0 * (1.0 - t2 / 40.0))
        s1 = theta * (1.0 / 3.0 - t2 / 30.0 * (1.0 - t2 / 28.0))
        return c0, s0, c1, s1
    sn, cs = sin(theta), cos(theta)
    return sn / theta, (1.0 - cs) / theta, sn / theta + (cs - 1.0) / t2, (sn - theta * cs) / t2


@jit
def ctra(
    x: float, y: float, psi: float, v: float, a: float, r: float, tau: float
) -> tuple[float, float, float, float, float, float]:
    """Predict a vehicle over tau under constant acceleration and yaw rate (Eq. 1).

    ::

        dx = int_0^tau (v + a t) cos(psi + r t) dt      dy = int_0^tau (v + a t) sin(psi + r t) dt

    A braking vehicle stops and remains at rest: the integral ends at the time ``-v/a`` if that is less than tau.

    Args:
        x, y: position [m].
        psi: heading [rad], in the same Cartesian frame.
        v: speed [m/s], at least 0.
        a: acceleration [m/s^2].
        r: yaw rate [rad/s].
        tau: horizon [s].

    Returns:
        ``xi = x, y, psi, v, a, r`` after tau.
    """
    if v + a * tau < 0.0:
        tau = -v / a
    c0, s0, c1, s1 = turn_integrals(r * tau)
    along = tau * (v * c0 + a * tau * c1)
    across = tau * (v * s0 + a * tau * s1)
    cp, sp = cos(psi), sin(psi)
    return x + cp * along - sp * across, y + sp * along + cp * across, psi + r * tau, max(0.0, v + a * tau), a, r
