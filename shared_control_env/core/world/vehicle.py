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
from typing import NamedTuple, TypeAlias

import numpy as np

from shared_control_env.core.compile.jit import jit, jit_allocating, jit_inlined
from shared_control_env.core.compile.lanes import Number, choose
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

State: TypeAlias = tuple[Number, Number, Number, Number, Number, Number]
"""A state z, or a change of one."""

Direction: TypeAlias = tuple[Number, Number]
"""Cosine and sine of an angle."""

Inner: TypeAlias = tuple[Number, Number, Number, Number, Number]
"""What a step has computed on its way, see :func:`implicit_step`."""

Axles: TypeAlias = tuple[Number, Number, Number]
"""Stiffness K of the front and the rear axle [N/rad], and the smallest speed v_s in a slip [m/s].

An axle's lateral force is ``-K slip``; the slip is its lateral velocity divided by ``max(v_x, v_s)``.
"""


class Dynamics(NamedTuple):
    """The parameters of a vehicle that :func:`implicit_step` reads, as lanes; :class:`VehicleParameters` has them too.

    Attributes:
        m: mass [kg].
        I_z: yaw inertia [kg m^2].
        l_f, l_r: distances from the centre of gravity to the front and to the rear axle [m].
        C_f, C_r: cornering stiffness of one front and of one rear tyre [N/rad].
    """

    m: Number
    I_z: Number
    l_f: Number
    l_r: Number
    C_f: Number
    C_r: Number


Car: TypeAlias = Dynamics | VehicleParameters
"""Parameters of one vehicle, or of those of a block."""


class Derivatives(NamedTuple):
    """Derivatives of a step: changes of the new state, each for a unit of one quantity. That of s is one of s alone.

    Attributes:
        y, psi: for the state's y and psi; the new s, y and psi alone, since the velocities do not depend on them.
        v_x, v_y, r: for the state's velocities.
        a, delta: for the command.
    """

    y: tuple[Number, Number, Number]
    psi: tuple[Number, Number, Number]
    v_x: State
    v_y: State
    r: State
    a: State
    delta: State


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


@jit_inlined
def implicit_step(
    z: State,
    heading: Direction,
    a: Number,
    delta: Number,
    wheel: Direction,
    kappa: Number,
    h: float,
    vehicle: Car,
    axles: Axles,
) -> tuple[State, Direction, Inner]:
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
    are passed on from step to step, see :func:`turned`. Numbers may be floats, or lanes of eight environments.

    Args:
        z: state.
        heading: cosine and sine of psi.
        a: acceleration [m/s^2].
        delta: front steering angle [rad].
        wheel: cosine and sine of delta.
        kappa: curvature of the path [1/m].
        h: step [s].
        vehicle: parameters of the vehicle; those of its tyres are in ``axles``.
        axles: see :data:`Axles`; the controllers' are linear.

    Returns:
        New state; cosine and sine of the new psi; s' and the entries of M^-1, row by row, where ``M [v_y+, r+] = b``.
    """
    s, y, psi, v_x, v_y, r = z
    v = v_x + h * (a + r * v_y)
    v = choose(v < 0.0, 0.0, v)
    l_f, l_r = vehicle.l_f, vehicle.l_r
    K_f, K_r, slowest = axles
    v_s = choose(v < slowest, slowest, v)
    K_fc, h_m, h_I = K_f * wheel[0], h / vehicle.m, h / vehicle.I_z
    m11 = v_s + h_m * (K_fc + K_r)
    m12 = h * v * v_s + h_m * (K_fc * l_f - K_r * l_r)
    m21 = h_I * (l_f * K_f - l_r * K_r)
    m22 = v_s + h_I * (l_f * l_f * K_f + l_r * l_r * K_r)
    b1 = v_s * v_y + h_m * K_fc * delta * v
    b2 = v_s * r + h_I * l_f * K_f * delta * v
    scale = 1.0 / (m11 * m22 - m12 * m21)
    i11, i12, i21, i22 = m22 * scale, -m12 * scale, -m21 * scale, m11 * scale
    v_y1, r1 = i11 * b1 + i12 * b2, i21 * b1 + i22 * b2
    s_rate = (v * heading[0] - v_y1 * heading[1]) / (1.0 - kappa * y)
    turn = h * (r1 - kappa * s_rate)
    heading1 = turned(heading, turn)
    y1 = y + h * (v * heading1[1] + v_y1 * heading1[0])
    return (s + h * s_rate, y1, psi + turn, v, v_y1, r1), heading1, (s_rate, i11, i12, i21, i22)


@jit_inlined
def turned(heading: Direction, angle: Number) -> Direction:
    """Cosine and sine after a turn by a small angle, by the series of both, which needs no call of a library.

    Args:
        heading: cosine and sine before.
        angle: the turn [rad]. Exact in double precision up to 0.5 rad in a step, to 1e-11 up to 1 rad.

    Returns:
        Cosine and sine.
    """
    q = angle * angle
    c = 1.0 - q * (1 / 2 - q * (1 / 24 - q * (1 / 720 - q * (1 / 40320 - q * (1 / 3628800 - q * (1 / 479001600))))))
    s = 1 / 362880 - q * (1 / 39916800 - q * (1 / 6227020800))
    s = angle * (1.0 - q * (1 / 6 - q * (1 / 120 - q * (1 / 5040 - q * s))))
    return heading[0] * c - heading[1] * s, heading[1] * c + heading[0] * s


@jit
def step_in_place(z: np.ndarray, a: float, delta: float, kappa: float, h: float, vehicle: VehicleParameters) -> None:
    """Advance an array by :func:`implicit_step` with linear tyres.

    Args:
        z: state, overwritten, shape (6,).
        a: acceleration [m/s^2].
        delta: front steering angle [rad].
        kappa: curvature of the path [1/m].
        h: step [s].
        vehicle: parameters of the vehicle.
    """
    heading, wheel = (cos(z[PSI]), sin(z[PSI])), (cos(delta), sin(delta))
    start = z[S], z[Y], z[PSI], z[V_X], z[V_Y], z[R]
    (z[S], z[Y], z[PSI], z[V_X], z[V_Y], z[R]), _ = _step_of_one(
        start, heading, a, delta, wheel, kappa, h, vehicle, linear_axles(vehicle)
    )


@jit
def _step_of_one(
    z: State,
    heading: Direction,
    a: float,
    delta: float,
    wheel: Direction,
    kappa: float,
    h: float,
    vehicle: VehicleParameters,
    axles: Axles,
) -> tuple[State, Direction]:
    """State and direction after :func:`implicit_step`, which is compiled once for all that step a single car."""
    z, heading, _ = implicit_step(z, heading, a, delta, wheel, kappa, h, vehicle, axles)
    return z, heading


@jit_inlined
def linear_axles(vehicle: Car) -> Axles:
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


@jit
def axles_at(z: State, a: float, delta: float, vehicle: VehicleParameters) -> Axles:
    """Both axles at a state: their stiffness is the secant of the tyres' forces at the present slip.

    Readings: tangent or secant. The tangent is 0 where a tyre slides, and the implicit step is then singular at
    standstill. The secant damps at every slip, and agrees to first order in the step.

    Each tyre has its static load. The longitudinal force is shared in proportion to the loads, so that all tyres use
    up the same share of their friction: the friction ellipse leaves ``mu_y = mu sqrt(1 - (a / (mu g))^2)`` to the
    lateral force.

    Args:
        z: state.
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
def derivatives(
    z: State,
    heading: Direction,
    a: Number,
    delta: Number,
    wheel: Direction,
    kappa: Number,
    h: float,
    vehicle: Car,
    z_next: State,
    heading_next: Direction,
    inner: Inner,
) -> Derivatives:
    """Derivatives of :func:`implicit_step` on linear tyres with respect to the state and to the command.

    The pair ``x = [v_y+, r+]`` solves ``M x = b``, so its derivative solves ``M dx = db - dM x``. Where braking holds
    the speed at zero, the derivatives of the speed vanish.

    Args:
        z, heading, a, delta, wheel, kappa, h, vehicle: as in :func:`implicit_step`.
        z_next, heading_next, inner: what it returned.
    """
    _, y, _, v_x, v_y, r = z
    _, _, _, v, v_y1, r1 = z_next
    s_rate, i11, i12, i21, i22 = inner
    # At rest the derivative is that for a car that starts to move; otherwise a controller would never start the car.
    moving = choose(v_x + h * (a + r * v_y) >= 0.0, 1.0, 0.0)
    K_f, c, sn, h_m, h_I = 2.0 * vehicle.C_f, wheel[0], wheel[1], h / vehicle.m, h / vehicle.I_z

    # Derivatives of (v_y+, r+) with respect to the new speed v, then v_y, r and delta.
    e1 = v_y + h_m * K_f * c * delta - v_y1 - 2.0 * h * v * r1
    e2 = r + h_I * vehicle.l_f * K_f * delta - r1
    V_v, R_v = i11 * e1 + i12 * e2, i21 * e1 + i22 * e2
    e1 = h_m * K_f * (v * (c - delta * sn) + sn * (v_y1 + vehicle.l_f * r1))
    e2 = h_I * vehicle.l_f * K_f * v
    V_d, R_d = i11 * e1 + i12 * e2, i21 * e1 + i22 * e2
    v_vx, v_vy, v_r, v_a = moving, moving * h * r, moving * h * v_y, moving * h
    by_v_x = v_vx, V_v * v_vx, R_v * v_vx
    by_v_y = v_vy, i11 * v + V_v * v_vy, i21 * v + R_v * v_vy
    by_r = v_r, i12 * v + V_v * v_r, i22 * v + R_v * v_r
    by_a = v_a, V_v * v_a, R_v * v_a
    by_delta = 0.0 * v, V_d, R_d  # a zero of the kind that v is, float or lanes

    # s', psi+ and y+ by the chain rule through v, v_y+ and r+.
    stretch = 1.0 / (1.0 - kappa * y)
    y_psi = v * heading_next[0] - v_y1 * heading_next[1]
    by_y = h * (kappa * s_rate * stretch)
    by_psi = h * (-(v * heading[1] + v_y1 * heading[0]) * stretch)
    turn_y, turn_psi = -kappa * by_y, 1.0 - kappa * by_psi
    return Derivatives(
        (by_y, 1.0 + h * y_psi * turn_y, turn_y),
        (by_psi, h * y_psi * turn_psi, turn_psi),
        _through(by_v_x, heading, heading_next, kappa, h, stretch, y_psi),
        _through(by_v_y, heading, heading_next, kappa, h, stretch, y_psi),
        _through(by_r, heading, heading_next, kappa, h, stretch, y_psi),
        _through(by_a, heading, heading_next, kappa, h, stretch, y_psi),
        _through(by_delta, heading, heading_next, kappa, h, stretch, y_psi),
    )


@jit_inlined
def _through(
    velocities: tuple[Number, Number, Number],
    heading: Direction,
    heading_next: Direction,
    kappa: Number,
    h: float,
    stretch: Number,
    y_psi: Number,
) -> State:
    """Derivative of the new state with respect to what changes the new velocities (v, v_y+, r+) as given."""
    v, v_y, r = velocities
    s = h * ((v * heading[0] - v_y * heading[1]) * stretch)
    psi = h * r - kappa * s
    y = h * (v * heading_next[1] + v_y * heading_next[0] + y_psi * psi)
    return s, y, psi, v, v_y, r


@jit_inlined
def plus(x: State, y: State) -> State:
    """Sum of two states or changes of one.

    Args:
        x, y: the terms.
    """
    return x[0] + y[0], x[1] + y[1], x[2] + y[2], x[3] + y[3], x[4] + y[4], x[5] + y[5]


@jit_inlined
def less(x: State, y: State) -> State:
    """Difference of two states or changes of one.

    Args:
        x: minuend.
        y: subtrahend.
    """
    return x[0] - y[0], x[1] - y[1], x[2] - y[2], x[3] - y[3], x[4] - y[4], x[5] - y[5]


@jit_inlined
def through_step(x: State, d: Derivatives) -> State:
    """Derivative of the new state with respect to what changes the state as given: the matrix A of a step times x.

    Only s depends on s, and the velocities depend only on velocities.

    Args:
        x: change of the state.
        d: derivatives of the step.
    """
    s, y, psi, v_x, v_y, r = x
    return (
        s + d.y[S] * y + d.psi[S] * psi + d.v_x[S] * v_x + d.v_y[S] * v_y + d.r[S] * r,
        d.y[Y] * y + d.psi[Y] * psi + d.v_x[Y] * v_x + d.v_y[Y] * v_y + d.r[Y] * r,
        d.y[PSI] * y + d.psi[PSI] * psi + d.v_x[PSI] * v_x + d.v_y[PSI] * v_y + d.r[PSI] * r,
        d.v_x[V_X] * v_x + d.v_y[V_X] * v_y + d.r[V_X] * r,
        d.v_x[V_Y] * v_x + d.v_y[V_Y] * v_y + d.r[V_Y] * r,
        d.v_x[R] * v_x + d.v_y[R] * v_y + d.r[R] * r,
    )


@jit
def extrapolated_step(z: np.ndarray, a: float, delta: float, h: float, vehicle: VehicleParameters) -> None:
    """Advance the state in place by h in the Cartesian frame, with second order in h, on the tyres that the car has.

    This is the Richardson extrapolation of the implicit step, ``z(h) = 2 f(h/2, f(h/2, z)) - f(h, z)``. It keeps the
    implicit step's damping of the stiff lateral motion at any step size (Hairer & Wanner, Solving ODEs II, Section
    IV.9).

    Args:
        z: state ``[x, y, psi, v_x, v_y, r]``, overwritten, shape (6,).
        a, delta: transmitted acceleration [m/s^2] and steering angle [rad].
        h: step [s].
        vehicle: parameters of the vehicle.
    """
    start = z[S], z[Y], z[PSI], z[V_X], z[V_Y], z[R]
    heading, wheel = (cos(z[PSI]), sin(z[PSI])), (cos(delta), sin(delta))
    axles = axles_at(start, a, delta, vehicle)
    coarse, _ = _step_of_one(start, heading, a, delta, wheel, 0.0, h, vehicle, axles)
    half, heading = _step_of_one(start, heading, a, delta, wheel, 0.0, 0.5 * h, vehicle, axles)
    axles = axles_at(half, a, delta, vehicle)
    fine, _ = _step_of_one(half, heading, a, delta, wheel, 0.0, 0.5 * h, vehicle, axles)
    for i in range(6):
        z[i] = 2.0 * fine[i] - coarse[i]
    z[V_X] = max(0.0, z[V_X])


@jit
def plant_step(z: np.ndarray, a: float, delta: float, dt: float, vehicle: VehicleParameters) -> None:
    """Advance the plant in place by dt: :data:`PLANT_SUBSTEPS` extrapolated steps with a constant command.

    Args:
        z: state ``[x, y, psi, v_x, v_y, r]``, overwritten, shape (6,).
        a, delta: command [m/s^2, rad], held over the step.
        dt: step [s].
        vehicle: parameters of the vehicle.
    """
    a = transmitted(a, vehicle)
    for _ in range(PLANT_SUBSTEPS):
        extrapolated_step(z, a, delta, dt / PLANT_SUBSTEPS, vehicle)
