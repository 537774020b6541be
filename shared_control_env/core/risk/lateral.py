"""Lateral risk by the artificial potential field of the safe area's boundaries (Eq. 2, 3)."""

from __future__ import annotations

from math import exp

from shared_control_env.core.compile.jit import jit
from shared_control_env.core.parameters import LateralRiskParameters
from shared_control_env.core.records import SafeArea
from shared_control_env.core.risk.safe_area import boundary_distance, boundary_offset


@jit
def cut_off(parameters: LateralRiskParameters) -> float:
    """Distance from the boundaries beyond which the field is 0 [m]: ``d_c + v_w / 2``.

    Args:
        parameters: parameters of the field.
    """
    return parameters.d_c + 0.5 * parameters.v_w


@jit
def boundary_field(r_b: float, parameters: LateralRiskParameters) -> float:
    """Potential field of the boundaries, Eq. 2.

    ``P^r = alpha_f exp(-r_b^2 / sigma_y^2)`` for ``r_b <= d_c + v_w / 2``, else 0. The paper prints r_i in the
    exponent, which must be r_b. The field jumps by 0.039 alpha_f at the cut-off; the risk keeps the printed form.

    Args:
        r_b: distance to the nearer boundary [m].
        parameters: parameters of the field.

    Returns:
        Field value [-].
    """
    if r_b > cut_off(parameters):
        return 0.0
    return parameters.alpha_f * exp(-((r_b / parameters.sigma_y) ** 2))


@jit
def continuous_field(
    area: SafeArea, s: float, d: float, parameters: LateralRiskParameters
) -> tuple[float, float, float]:
    """Eq. 2 minus its value at the cut-off, which makes a controller's cost continuous; outside C the field's peak.

    Args:
        area: record of :data:`records.SAFE_AREA`.
        s, d: position in the road frame [m].
        parameters: parameters of the field.

    Returns:
        Field value [-] and its derivatives with respect to s and d [1/m].
    """
    cut = cut_off(parameters)
    square, ds, dd = boundary_offset(area, s, d)
    if square > cut * cut:
        return 0.0, 0.0, 0.0
    variance = parameters.sigma_y * parameters.sigma_y
    field = parameters.alpha_f * exp(-square / variance)
    slope = -2.0 / variance * field
    return field - parameters.alpha_f * exp(-cut * cut / variance), slope * ds, slope * dd


@jit
def lateral_risk(area: SafeArea, s: float, d: float, parameters: LateralRiskParameters) -> float:
    """Lateral risk of a predicted position, Eq. 3: ``r_y = max(0, P^r / alpha_f)``; 1 outside C.

    Args:
        area: record of :data:`records.SAFE_AREA`.
        s, d: predicted position in the road frame [m].
        parameters: parameters of the field.

    Returns:
        Risk in [0, 1] [-].
    """
    r_b = boundary_distance(area, s, d)
    return max(0.0, boundary_field(r_b, parameters) / parameters.alpha_f)
