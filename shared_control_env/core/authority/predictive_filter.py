"""Allocation by a predictive safety filter: as much of u_a,f as leaves a way back.

Predictive safety filter: Wabersich & Zeilinger, A predictive safety filter for learning-based control of constrained
nonlinear dynamical systems, Automatica 129, 2021. Instead of an optimisation over backups, one backup is simulated.
"""

from __future__ import annotations

from math import exp

from shared_control_env.core.authority.alerts import NO_ALERT
from shared_control_env.core.authority.allocators import Situation
from shared_control_env.core.compile.jit import jit
from shared_control_env.core.records import NEAR_SPEED, PRECEDING
from shared_control_env.core.risk.safe_area import lateral_bounds
from shared_control_env.core.world.scene import gap_ahead
from shared_control_env.core.world.vehicle import PSI, V_X, S, Y, step_in_place

CANDIDATES = 21
"""Number of authorities that are tried, evenly spaced from 1 to 0."""

STEPS = 40
"""Length of a trial [time steps]: 2 s, in which the backup has brought the car back or has not; ours."""

BACKUP_BRAKE = 2.0
"""Deceleration of the backup, range [0, 5] [m/s^2]; ours: comfortable braking."""

CENTRING_RATE = 1.0
"""Rate with which the backup corrects the lateral position, range (0, 5] [1/s]; ours."""

HEADING_RATE = 2.0
"""Rate with which the backup corrects the heading, range (0, 5] [1/s]; ours."""


@jit
def leaves_a_way_back(alpha: float, now: Situation) -> bool:
    """Whether one step under ``alpha u_a,f`` can be followed by a backup that stays in C and off the vehicle ahead.

    After the step the automation commands nothing. The driver brakes and returns to the middle of C, through the lag of
    Eq. 16 with the known K_h and T_h::

        u_h,des = [-2 m/s^2, L (kappa - (psi' wanted) / v)],   psi' wanted = -2 (psi + (y - y_mid) / max(v, 1))

    Args:
        alpha: authority that is tried [-].
        now: the situation; ``trial.prediction`` is used as scratch.

    Returns:
        Whether the body's edge stays within C, and the gap above 0, for :data:`STEPS` steps.
    """
    scene, p, z = now.scene, now.p, now.trial.prediction
    for i in range(6):
        z[i] = scene.z[i]
    dt, half, car = p.task.dt, 0.5 * p.vehicle.width, p.model
    phi = exp(-dt / p.lag.T_h)
    a_h, delta_h = now.memory.u_h_act[0], now.memory.u_h_act[1]
    a, delta = alpha * now.signals.u_a_f[0], alpha * now.signals.u_a_f[1]
    gap, v_lead, start = gap_ahead(scene), scene.neighbours[PRECEDING, NEAR_SPEED], scene.z[S]
    for k in range(STEPS):
        u_a = min(max(a + a_h, -p.limits.a_max), p.limits.a_max)
        u_delta = min(max(delta + delta_h, -p.limits.delta_max), p.limits.delta_max)
        kappa = scene.kappa[min(k, p.automation.H_p - 1)]
        step_in_place(z, u_a, u_delta, kappa, dt, car)
        low, high = lateral_bounds(scene.area, z[S])
        if z[Y] - half < low or z[Y] + half > high or gap + (k + 1) * dt * v_lead - (z[S] - start) < 0.0:
            return False
        v = max(z[V_X], 1.0)
        turn = -HEADING_RATE * (z[PSI] + CENTRING_RATE * (z[Y] - 0.5 * (low + high)) / v)
        wanted = (car.l_f + car.l_r) * (kappa + turn / v)
        a_h = phi * a_h + p.lag.K_h * (1.0 - phi) * (-BACKUP_BRAKE - a)
        delta_h = phi * delta_h + p.lag.K_h * (1.0 - phi) * (wanted - delta)
        a = delta = 0.0
    return True


def predictive_filter(now: Situation) -> tuple[float, float, int]:
    """Largest of :data:`CANDIDATES` authorities that leaves a way back; 0 if none does.

    Args:
        now: the situation.

    Returns:
        alpha_a for both channels [-]; no alert.
    """
    for i in range(CANDIDATES):
        alpha = 1.0 - i / (CANDIDATES - 1)
        if leaves_a_way_back(alpha, now):
            return alpha, alpha, NO_ALERT
    return 0.0, 0.0, NO_ALERT
