"""Three-degree-of-freedom dynamic bicycle model (Eq. 11), from standstill to motorway speed.

State ``z = [s, y, psi, v_x, v_y, r]``: position along a path of curvature kappa and to the left of the path [m],
heading relative to the path [rad], longitudinal and lateral velocity in the body frame [m/s], yaw rate [rad/s]. With
``kappa = 0`` the path is a straight line and ``[s, y, psi]`` is Eq. 11's ``[x, y, psi]``. The plant runs in the
Cartesian frame with kappa = 0, the predictive controllers run in the road frame.
Axes follow ISO 8855: x forward, y to the left, positive steering and yaw rate turn left.

The speed v_x does not fall below 0. A car that spins past 90 deg against its path is therefore outside the model: v_x
is then held at 0. Such episodes nearly always end off the road.
"""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import TypeAlias

import numpy as np

from shared_control_env.core.compile.jit import jit, jit_allocating, jit_inlined
from shared_control_env.core.parameters import VehicleParameters
from shared_control_env.core.world.tyre import FORCE

S, Y, PSI, V_X, V_Y, R = range(6)
"""Indices in the state vector."""

PLANT_SUBSTEPS = 2
"""Number of extrapolated substeps of one 0.05 s plant step; the tests check the error against an exact solution."""

GRAVITY = 9.81
"""Gravitational acceleration [m/s^2]."""

SLOWEST_SLIP = 0.5
"""Smallest speed in the slip of nonlinear tyres [m/s].

Without it a car that slides sideways would lose its lateral velocity at once where v_x reaches 0. Linear tyres need
none: their force grows without bound.
"""

SMALLEST_SLIP = 1e-9
"""Slip angle below which the secant of a tyre's force is its slope at zero [rad]."""

LONGITUDINAL_SHARE = 0.9
"""Largest share of the friction that acceleration and braking use [-]; assumed.

An anti-lock brake leaves the tyres a lateral force: sqrt(1 - 0.9^2) = 0.44 of the friction.
"""

_force = FORCE.call

Direction: TypeAlias = tuple[float, float]
"""Cosine and sine of an angle."""

Axles: TypeAlias = tuple[float, float, float]
"""Stiffness K of the front and the rear axle [N/rad], and the smallest speed v_s in a slip [m/s].

An axle's lateral force is ``-K slip``; the slip is its lateral velocity divided by ``max(v_x, v_s)``.
"""


@jit_allocating
def derivative(z: np.ndarray, a: float, delta: float, kappa: float, vehicle: VehicleParameters) -> np.ndarray:
    """Right-hand side of Eq. 11 in the road frame.

    ::

        alpha_f = (v_y + l_f r) / v_x - delta        F_cf = -C_f alpha_f
        alpha_r = (v_y - l_r r) / v_x                F_cr = -C_r alpha_r
        v_x' = r v_y + a
        v_y' = -r v_x + 2 (F_cf cos(delta) + F_cr) / m
        r'   = 2 (l_f F_cf - l_r F_cr) / I_z
        s'   = (v_x cos(psi) - v_y sin(psi)) / (1 - kappa y)
        y'   = v_x sin(psi) + v_y cos(psi)
        psi' = r - kappa s'

    Args:
        z: state, shape (6,); v_x must not be 0.
        a: acceleration command [m/s^2].
        delta: front steering angle [rad].
        kappa: curvature of the path [1/m]; 0 for the Cartesian frame.
        vehicle: parameters of the vehicle.

    Returns:
        Time derivative of the state, shape (6,).
    """
    y, psi, v_x, v_y, r = z[Y], z[PSI], z[V_X], z[V_Y], z[R]
    F_cf = -vehicle.C_f * ((v_y + vehicle.l_f * r) / v_x - delta)
    F_cr = -vehicle.C_r * ((v_y - vehicle.l_r * r) / v_x)
    dz = np.empty(6)
    dz[V_X] = r * v_y + a
    dz[V_Y] = -r * v_x + 2.0 * (F_cf * cos(delta) + F_cr) / vehicle.m
    dz[R] = 2.0 * (vehicle.l_f * F_cf - vehicle.l_r * F_cr) / vehicle.I_z
    dz[S] = (v_x * cos(psi) - v_y * sin(psi)) / (1.0 - kappa * y)
    dz[Y] = v_x * sin(psi) + v_y * cos(psi)
    dz[PSI] = r - kappa * dz[S]
    return dz


@jit
def implicit_step(
    z: np.ndarray,
    heading: Direction,
    a: float,
    delta: float,
    wheel: Direction,
    kappa: float,
    h: float,
    vehicle: VehicleParameters,
    z_next: np.ndarray,
) -> Direction:
    """One step of length h that is implicit in the lateral motion: the discrete model f^d of Eq. 12.

    One explicit step of 0.05 s is unstable below about 15 m/s, since the yaw damping grows as 1/v_x. Moreover, the slip
    angles are singular at standstill. As in Ge et al. (arXiv 2011.09612), the lateral equations are evaluated at the
    end of the step and multiplied by v_x, which removes both problems. Unlike there, v_y and r are solved for together,
    since the coupled backward Euler step is stable wherever Eq. 11 is stable. The speed stops at zero: braking never
    reverses the car.

    ::

        v     = max(0, v_x + h (a + r v_y))
        v v_y+ = v v_y + h (-r+ v^2 - (K_f c (v_y+ + l_f r+) + K_r (v_y+ - l_r r+)) / m + K_f c delta v / m)
        v r+   = v r   + h (-(l_f K_f (v_y+ + l_f r+) - l_r K_r (v_y+ - l_r r+)) / I_z + l_f K_f delta v / I_z)
        s'    = (v cos(psi) - v_y+ sin(psi)) / (1 - kappa y)
        psi+  = psi + h (r+ - kappa s')        s+ = s + h s'
        y+    = y + h (v sin(psi+) + v_y+ cos(psi+))

    with the stiffness ``K = 2 C`` of an axle and ``c = cos(delta)``. The step is of first order in h. Sines and cosines
    are passed on from step to step, since they cost as much as the rest of the step.

    Args:
        z: state, shape (6,).
        heading: cosine and sine of psi.
        a: acceleration [m/s^2].
        delta: front steering angle [rad].
        wheel: cosine and sine of delta.
        kappa: curvature of the path [1/m].
        h: step [s].
        vehicle: parameters of the vehicle; its tyres count as linear.
        z_next: new state, written, shape (6,); may be ``z`` itself.

    Returns:
        Cosine and sine of the new psi.
    """
    return _implicit_step(z, heading, a, delta, wheel, kappa, h, vehicle, linear_axles(vehicle), z_next)


@jit_inlined
def _implicit_step(
    z: np.ndarray,
    heading: Direction,
    a: float,
    delta: float,
    wheel: Direction,
    kappa: float,
    h: float,
    vehicle: VehicleParameters,
    axles: Axles,
    z_next: np.ndarray,
) -> Direction:
    """:func:`implicit_step` with a given stiffness of the axles."""
    (v, v_y, r), _ = _step_velocities(z, a, delta, wheel, h, vehicle, axles)
    heading, _ = _step_pose(z, heading, v, v_y, r, kappa, h, z_next)
    z_next[V_X], z_next[V_Y], z_next[R] = v, v_y, r
    return heading


@jit_inlined
def linear_axles(vehicle: VehicleParameters) -> Axles:
    """Both axles with the linear tyres of Eq. 11: ``K = 2 C``.

    Args:
        vehicle: parameters of the vehicle.
    """
    return 2.0 * vehicle.C_f, 2.0 * vehicle.C_r, 0.0


@jit
def transmitted(a: float, vehicle: VehicleParameters) -> float:
    """Acceleration that the tyres transmit [m/s^2]: a share of the friction, without a limit for linear tyres.

    Args:
        a: commanded acceleration [m/s^2].
        vehicle: parameters of the vehicle.
    """
    if vehicle.tyre == 0:
        return a
    bound = LONGITUDINAL_SHARE * vehicle.mu * GRAVITY
    return min(max(a, -bound), bound)


@jit_inlined
def axles_at(z: np.ndarray, a: float, delta: float, vehicle: VehicleParameters) -> Axles:
    """Both axles at a state: their stiffness is the secant of the tyres' forces at the present slip.

    Readings: tangent or secant. The tangent is 0 where a tyre slides, and the implicit step is then singular at
    standstill. The secant damps at every slip, and agrees to first order in the step.

    Each tyre has its static load. The longitudinal force is shared in proportion to the loads, so that all tyres use
    up the same share of their friction: the friction ellipse leaves ``mu_y = mu sqrt(1 - (a / (mu g))^2)`` to the
    lateral force.

    Args:
        z: state, shape (6,).
        a: transmitted acceleration [m/s^2].
        delta: front steering angle [rad].
        vehicle: parameters of the vehicle.
    """
    if vehicle.tyre == 0:
        return linear_axles(vehicle)
    v = max(z[V_X], SLOWEST_SLIP)
    used = a / (vehicle.mu * GRAVITY)
    mu_y = vehicle.mu * sqrt(1.0 - used * used)
    load = 0.5 * vehicle.m * GRAVITY / (vehicle.l_f + vehicle.l_r)
    slip_f = (z[V_Y] + vehicle.l_f * z[R] - z[V_X] * delta) / v
    slip_r = (z[V_Y] - vehicle.l_r * z[R]) / v
    front = _secant(vehicle.tyre, slip_f, vehicle.C_f, mu_y, load * vehicle.l_r)
    return 2.0 * front, 2.0 * _secant(vehicle.tyre, slip_r, vehicle.C_r, mu_y, load * vehicle.l_f), SLOWEST_SLIP


@jit
def _secant(tyre: int, slip: float, C: float, mu: float, F_z: float) -> float:
    """Stiffness K of one tyre with the force ``-K slip`` [N/rad]."""
    force, slope = _force(tyre, slip, C, mu, F_z)
    return -slope if abs(slip) < SMALLEST_SLIP else -force / slip


@jit_inlined
def _step_velocities(
    z: np.ndarray, a: float, delta: float, wheel: Direction, h: float, vehicle: VehicleParameters, axles: Axles
) -> tuple[tuple[float, float, float], tuple[float, float, float, float]]:
    """New speed, lateral velocity and yaw rate of :func:`implicit_step`, which solve ``M [v_y+, r+] = b``.

    Returns:
        ``(v, v_y+, r+)`` and the entries of M^-1, row by row.
    """
    v_y, r = z[V_Y], z[R]
    v = max(0.0, z[V_X] + h * (a + r * v_y))
    l_f, l_r = vehicle.l_f, vehicle.l_r
    K_f, K_r, slowest = axles
    v_s = max(v, slowest)
    K_fc, h_m, h_I = K_f * wheel[0], h / vehicle.m, h / vehicle.I_z
    m11 = v_s + h_m * (K_fc + K_r)
    m12 = h * v * v_s + h_m * (K_fc * l_f - K_r * l_r)
    m21 = h_I * (l_f * K_f - l_r * K_r)
    m22 = v_s + h_I * (l_f * l_f * K_f + l_r * l_r * K_r)
    b1 = v_s * v_y + h_m * K_fc * delta * v
    b2 = v_s * r + h_I * l_f * K_f * delta * v
    scale = 1.0 / (m11 * m22 - m12 * m21)
    i11, i12, i21, i22 = m22 * scale, -m12 * scale, -m21 * scale, m11 * scale
    return (v, i11 * b1 + i12 * b2, i21 * b1 + i22 * b2), (i11, i12, i21, i22)


@jit_inlined
def _step_pose(
    z: np.ndarray, heading: Direction, v: float, v_y: float, r: float, kappa: float, h: float, z_next: np.ndarray
) -> tuple[Direction, float]:
    """Write the new pose of :func:`implicit_step` under the new velocities.

    Returns:
        Cosine and sine of the new psi, and s'.
    """
    s, y, psi = z[S], z[Y], z[PSI]
    s_rate = (v * heading[0] - v_y * heading[1]) / (1.0 - kappa * y)
    psi += h * (r - kappa * s_rate)
    heading = cos(psi), sin(psi)
    z_next[S] = s + h * s_rate
    z_next[Y] = y + h * (v * heading[1] + v_y * heading[0])
    z_next[PSI] = psi
    return heading, s_rate


@jit_inlined
def implicit_step_jacobian(
    z: np.ndarray,
    heading: Direction,
    a: float,
    delta: float,
    wheel: Direction,
    kappa: float,
    h: float,
    vehicle: VehicleParameters,
    z_next: np.ndarray,
    A: np.ndarray,
    B: np.ndarray,
) -> Direction:
    """:func:`implicit_step` with its derivatives ``A = dz+/dz`` and ``B = dz+/d[a, delta]``.

    The pair ``x = [v_y+, r+]`` solves ``M x = b``, so its derivative solves ``M dx = db - dM x``. Where braking holds
    the speed at zero, the derivatives of the speed vanish. The tyres are linear, as in the controllers' model.

    Args:
        z, heading, a, delta, wheel, kappa, h, vehicle, z_next: as in :func:`implicit_step`.
        A: derivative of the new state with respect to the state, written, shape (6, 6).
        B: derivative of the new state with respect to the command, written, shape (6, 2).

    Returns:
        Cosine and sine of the new psi.
    """
    y, v_x, v_y, r = z[Y], z[V_X], z[V_Y], z[R]
    (v, v_y1, r1), (i11, i12, i21, i22) = _step_velocities(z, a, delta, wheel, h, vehicle, linear_axles(vehicle))
    heading1, s_rate = _step_pose(z, heading, v, v_y1, r1, kappa, h, z_next)
    z_next[V_X], z_next[V_Y], z_next[R] = v, v_y1, r1
    # At rest the derivative is that for a car that starts to move; otherwise a controller would never start the car.
    moving = 1.0 if v_x + h * (a + r * v_y) >= 0.0 else 0.0
    K_f, c, sn, h_m, h_I = 2.0 * vehicle.C_f, wheel[0], wheel[1], h / vehicle.m, h / vehicle.I_z

    # Derivatives of (v_y+, r+) with respect to the new speed v, then v_y, r and delta.
    e1 = v_y + h_m * K_f * c * delta - v_y1 - 2.0 * h * v * r1
    e2 = r + h_I * vehicle.l_f * K_f * delta - r1
    V_v, R_v = i11 * e1 + i12 * e2, i21 * e1 + i22 * e2
    V_vy, R_vy = i11 * v, i21 * v
    V_r, R_r = i12 * v, i22 * v
    e1 = h_m * K_f * (v * (c - delta * sn) + sn * (v_y1 + vehicle.l_f * r1))
    e2 = h_I * vehicle.l_f * K_f * v
    V_d, R_d = i11 * e1 + i12 * e2, i21 * e1 + i22 * e2

    for i in range(6):
        for j in range(6):
            A[i, j] = 0.0
        B[i, 0] = B[i, 1] = 0.0
    v_vx, v_vy, v_r, v_a = moving, moving * h * r, moving * h * v_y, moving * h
    A[V_X, V_X], A[V_X, V_Y], A[V_X, R], B[V_X, 0] = v_vx, v_vy, v_r, v_a
    A[V_Y, V_X], A[V_Y, V_Y], A[V_Y, R] = V_v * v_vx, V_vy + V_v * v_vy, V_r + V_v * v_r
    A[R, V_X], A[R, V_Y], A[R, R] = R_v * v_vx, R_vy + R_v * v_vy, R_r + R_v * v_r
    B[V_Y, 0], B[V_Y, 1], B[R, 0], B[R, 1] = V_v * v_a, V_d, R_v * v_a, R_d

    # s', psi+ and y+ by the chain rule through v, v_y+ and r+.
    stretch = 1.0 / (1.0 - kappa * y)
    cp, sp = heading
    cp1, sp1 = heading1
    s_rate_y = kappa * s_rate * stretch
    s_rate_psi = -(v * sp + v_y1 * cp) * stretch
    y_psi1 = v * cp1 - v_y1 * sp1
    A[S, S], A[Y, Y], A[PSI, PSI] = 1.0, 1.0, 1.0
    A[S, Y], A[S, PSI] = h * s_rate_y, h * s_rate_psi
    A[PSI, Y], A[PSI, PSI] = -h * kappa * s_rate_y, 1.0 - h * kappa * s_rate_psi
    A[Y, Y] += h * y_psi1 * A[PSI, Y]
    A[Y, PSI] = h * y_psi1 * A[PSI, PSI]
    for j in (V_X, V_Y, R):
        ds = (A[V_X, j] * cp - A[V_Y, j] * sp) * stretch
        A[S, j] = h * ds
        A[PSI, j] = h * (A[R, j] - kappa * ds)
        A[Y, j] = h * (A[V_X, j] * sp1 + A[V_Y, j] * cp1 + y_psi1 * A[PSI, j])
    for j in range(2):
        ds = (B[V_X, j] * cp - B[V_Y, j] * sp) * stretch
        B[S, j] = h * ds
        B[PSI, j] = h * (B[R, j] - kappa * ds)
        B[Y, j] = h * (B[V_X, j] * sp1 + B[V_Y, j] * cp1 + y_psi1 * B[PSI, j])
    return heading1


@jit
def tyre_step(
    z: np.ndarray,
    heading: Direction,
    a: float,
    delta: float,
    wheel: Direction,
    h: float,
    vehicle: VehicleParameters,
    z_next: np.ndarray,
) -> Direction:
    """:func:`implicit_step` in the Cartesian frame, on the tyres that the vehicle has.

    Args:
        z: state, shape (6,).
        heading: cosine and sine of psi.
        a: transmitted acceleration [m/s^2].
        delta: front steering angle [rad].
        wheel: cosine and sine of delta.
        h: step [s].
        vehicle: parameters.
        z_next: the new state is written here, shape (6,); may be ``z`` itself.

    Returns:
        Cosine and sine of the new psi.
    """
    return _implicit_step(z, heading, a, delta, wheel, 0.0, h, vehicle, axles_at(z, a, delta, vehicle), z_next)


@jit
def extrapolated_step(
    z: np.ndarray, a: float, delta: float, h: float, vehicle: VehicleParameters, work: np.ndarray
) -> None:
    """Advance the state in place by h in the Cartesian frame, with second order in h.

    This is the Richardson extrapolation of the implicit step, ``z(h) = 2 f(h/2, f(h/2, z)) - f(h, z)``. It keeps the
    implicit step's damping of the stiff lateral motion at any step size (Hairer & Wanner, Solving ODEs II, Section
    IV.9).

    Args:
        z: state ``[x, y, psi, v_x, v_y, r]``, overwritten, shape (6,).
        a, delta: command [m/s^2, rad].
        h: step [s].
        vehicle: parameters of the vehicle.
        work: scratch, shape (2, 6).
    """
    coarse, fine = work[0], work[1]
    heading, wheel = (cos(z[PSI]), sin(z[PSI])), (cos(delta), sin(delta))
    tyre_step(z, heading, a, delta, wheel, h, vehicle, coarse)
    heading = tyre_step(z, heading, a, delta, wheel, 0.5 * h, vehicle, fine)
    tyre_step(fine, heading, a, delta, wheel, 0.5 * h, vehicle, fine)
    for i in range(6):
        z[i] = 2.0 * fine[i] - coarse[i]
    z[V_X] = max(0.0, z[V_X])


@jit
def plant_step(z: np.ndarray, a: float, delta: float, dt: float, vehicle: VehicleParameters, work: np.ndarray) -> None:
    """Advance the plant in place by dt: :data:`PLANT_SUBSTEPS` extrapolated steps with a constant command.

    Args:
        z: state ``[x, y, psi, v_x, v_y, r]``, overwritten, shape (6,).
        a, delta: command [m/s^2, rad], held over the step.
        dt: step [s].
        vehicle: parameters of the vehicle.
        work: scratch, shape (2, 6).
    """
    a = transmitted(a, vehicle)
    for _ in range(PLANT_SUBSTEPS):
        extrapolated_step(z, a, delta, dt / PLANT_SUBSTEPS, vehicle, work)
