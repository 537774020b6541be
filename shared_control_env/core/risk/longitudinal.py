"""Longitudinal risk by the dynamic potential field (Eq. 5-8)."""

from __future__ import annotations

from math import exp, pi, sqrt

import numpy as np
from numpy.polynomial import chebyshev
from scipy import special

from shared_control_env.core.compile.jit import jit, jit_inlined
from shared_control_env.core.parameters import LongitudinalRiskParameters

# Compiled functions cannot call scipy.special, so two Chebyshev series are fitted once to SciPy's values:
# exp(-x) I_0(x) on [0, 8], and sqrt(x) exp(-x) I_0(x) as a function of 16/x - 1 on [8, inf).
_I0E_NEAR = chebyshev.chebinterpolate(lambda t: special.i0e(4.0 * (t + 1.0)), 29)
_I0E_FAR = chebyshev.chebinterpolate(
    lambda t: np.sqrt(16.0 / (t + 1.0 + 1e-300)) * special.i0e(16.0 / (t + 1.0 + 1e-300)), 24
)


@jit
def _chebyshev_sum(coefficients: np.ndarray, t: float) -> float:
    """Sum of a Chebyshev series at t in [-1, 1], by Clenshaw's algorithm."""
    b0 = b1 = 0.0
    for i in range(coefficients.shape[0] - 1, 0, -1):
        b0, b1 = coefficients[i] + 2.0 * t * b0 - b1, b0
    return coefficients[0] + t * b0 - b1


@jit
def i0e(x: float) -> float:
    """Exponentially scaled modified Bessel function ``exp(-|x|) I_0(x)``, equal to scipy.special.i0e.

    Args:
        x: argument [-].
    """
    x = abs(x)
    if x <= 8.0:
        return _chebyshev_sum(_I0E_NEAR, x / 4.0 - 1.0)
    return _chebyshev_sum(_I0E_FAR, 16.0 / x - 1.0) / sqrt(x)


@jit
def relative_speed_field(dv: float, dx: float, alpha: float) -> float:
    """Field of the relative speed, Eq. 5: positive while the gap closes.

    ``U_eo = alpha (exp(dv cos(theta)) - 1) / (2 pi I_0(dv))`` with cos(theta) = +1 for an obstacle ahead and -1 for
    one behind.

    Readings: the printed form is ``exp(dv cos(theta) - I)`` with theta = pi ahead. Its sign is reversed (closing at
    3 m/s gives 0.006, opening at 3 m/s gives 2.41), and no value is <= 0, in contradiction to the text and its figure.
    If I is read as the constant 1 subtracted from the exponential, and theta as 0 ahead, the field agrees with both
    (+3 m/s: 6.22, 0: 0, -3 m/s: -0.31). This reading is used. Numerator and denominator are scaled by exp(-|dv|).

    Args:
        dv: ego speed minus obstacle speed [m/s].
        dx: obstacle position minus ego position along the road [m].
        alpha: height of the field [-].

    Returns:
        Field value [-].
    """
    closing = dv if dx >= 0.0 else -dv
    return alpha * (exp(closing - abs(dv)) - exp(-abs(dv))) / (2.0 * pi * i0e(dv))


@jit
def distance_field(dx: float, sigma_x: float, parameters: LongitudinalRiskParameters) -> float:
    """Field of the distance, Eq. 5: ``U_rd = A_f exp(-dx^2b / (2 sigma_x^2b))`` [-].

    Args:
        dx: obstacle position minus ego position along the road [m].
        sigma_x: width of the field [m].
        parameters: parameters of the field.
    """
    return parameters.A_f * exp(-0.5 * (abs(dx) / sigma_x) ** (2.0 * parameters.b))


@jit
def safe_distance(v_e: float, v_o: float, parameters: LongitudinalRiskParameters) -> float:
    """Minimal safe distance of a pair [m], Eq. 8.

    ``d^s = |v_e^2 - v_o^2| / (2 a_max) + max(v_o, v_e) (t_r + t_i / 2) + d_o``

    Args:
        v_e, v_o: speeds of ego and obstacle [m/s].
        parameters: largest deceleration a_max, times t_r and t_i, and clearance d_o.
    """
    braking = abs(v_e * v_e - v_o * v_o) / (2.0 * parameters.a_max)
    return braking + max(v_o, v_e) * (parameters.t_r + 0.5 * parameters.t_i) + parameters.d_o


@jit
def field_width(d_s: float, parameters: LongitudinalRiskParameters) -> float:
    """Width sigma_x of the distance field [m]: the printed constant (preset ``paper``), or 2 d^s (preset ``graded``).

    With sigma_x = 4 and b = 2, the ratio of Eq. 7 is a step at d^s: it is 1.5e-4 one metre outside d^s, and 1 inside.
    The gradual risk of the paper's Case 2 cannot result from this step. The text sets "2 d_o". If the pairwise distance
    d^s of Eq. 8 replaces d_o, the risk grows over some ten metres.

    Args:
        d_s: minimal safe distance of the pair [m].
        parameters: parameters of the field.
    """
    return 2.0 * d_s if parameters.graded else parameters.sigma_x


@jit
def dynamic_field(dv: float, dx: float, d_s: float, parameters: LongitudinalRiskParameters) -> float:
    """Dynamic potential field ``U^d = U_eo U_rd`` of one pair (Eq. 5) [-].

    Args:
        dv: ego speed minus obstacle speed [m/s].
        dx: obstacle position minus ego position along the road [m].
        d_s: minimal safe distance of the pair [m].
        parameters: parameters of the field.
    """
    sigma_x = field_width(d_s, parameters)
    return relative_speed_field(dv, dx, parameters.alpha) * distance_field(dx, sigma_x, parameters)


@jit
def pair_risk(v_e: float, v_o: float, dx: float, parameters: LongitudinalRiskParameters) -> float:
    """One ratio of Eq. 7, ``max(0, U^d(dv, dx)) / U^d(dv, d^s)``, clipped at 1.

    Both fields share the factor U_eo. For a closing pair the ratio is therefore that of the distance fields, computed
    in the exponent: ``exp((d^s / sigma_x)^2b / 2 - (dx / sigma_x)^2b / 2)``. The ratio is clipped, since inside d^s the
    printed ratio exceeds 1, in contradiction to "r_x is always less than 1".

    Args:
        v_e, v_o: predicted speeds of ego and obstacle [m/s].
        dx: predicted distance, positive when the obstacle is ahead [m].
        parameters: parameters of the field.

    Returns:
        Risk of the pair in [0, 1] [-].
    """
    if relative_speed_field(v_e - v_o, dx, parameters.alpha) <= 0.0:
        return 0.0
    d_s = safe_distance(v_e, v_o, parameters)
    sigma_x = field_width(d_s, parameters)
    power = 2.0 * parameters.b
    return exp(min(0.0, 0.5 * ((d_s / sigma_x) ** power - (abs(dx) / sigma_x) ** power)))


@jit_inlined
def longitudinal_risk(
    s_e: float,
    v_e: float,
    neighbours: np.ndarray,
    length: float,
    change_weight: float,
    parameters: LongitudinalRiskParameters,
) -> float:
    """Longitudinal risk r_x (Eq. 7): weighted sum of the ratios of follower, leader and preceding vehicle.

    A neighbour that is absent has weight 0; the other weights are not renormalised.

    Args:
        s_e, v_e: predicted position along the road [m] and predicted speed [m/s] of the ego.
        neighbours: predicted rows ``[1 if present, s, v]`` [-, m, m/s] of follower, leader and preceding vehicle,
            shape (3, 3).
        length: vehicle length [m], subtracted if distances are bumper to bumper.
        change_weight: share of the weights of a lane change; the rest are those of lane keeping [-].
        parameters: weights and parameters of the field.

    Returns:
        Risk in [0, 1] [-].
    """
    risk = 0.0
    keeping = (parameters.w_f, parameters.w_l, parameters.w_p)
    during = (parameters.w_f_change, parameters.w_l_change, parameters.w_p_change)
    for i in range(3):
        if neighbours[i, 0] > 0.0:
            dx = neighbours[i, 1] - s_e
            if parameters.bumper_to_bumper:
                dx = max(dx - length, 0.0) if dx >= 0.0 else min(dx + length, -0.0)
            weight = keeping[i] + change_weight * (during[i] - keeping[i])
            risk += weight * pair_risk(v_e, neighbours[i, 2], dx, parameters)
    return min(risk, 1.0)
