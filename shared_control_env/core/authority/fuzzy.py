"""Fuzzy inference of the automation's authority alpha_a from the two risks (Eq. 9, Section IV).

The paper prints neither the operators, nor the rule table, nor the breakpoints of the memberships. The choices made
here are evenly spaced terms, Z- and S-shaped at the ends and triangular in between; Mamdani inference; and the centre
of gravity on 501 points. Two pairs of operators can be selected. With product for "and" and sum for aggregation,
alpha_a is monotone in both risks. With minimum and maximum, alpha_a can rise by up to 0.007 as a risk grows.
"""

from __future__ import annotations

import numpy as np

from shared_control_env.core.compile.jit import jit, jit_allocating, jit_inlined

OPERATORS = ("product-sum", "min-max")
"""Names of the pairs of inference operators; the index of a pair is its code in compiled functions."""

RISK_TERMS = ("very small", "small", "medium", "big", "very big")
AUTHORITY_TERMS = ("VVL", "VL", "L", "M", "H", "VH", "VVH")

RULES = np.array(
    [
        # r_y: VS S  M  B  VB        r_x:
        [6, 5, 3, 1, 0],  # very small
        [5, 4, 3, 1, 0],  # small
        [3, 3, 2, 1, 0],  # medium
        [1, 1, 1, 0, 0],  # big
        [0, 0, 0, 0, 0],  # very big
    ],
    dtype=np.int64,
)
"""Rule table (our choice): index of the authority term for each pair of risk terms; it decreases with both risks."""

UNIVERSE = np.linspace(0.0, 1.0, 501)
"""Points of the output range over which the centre of gravity is computed [-]."""


@jit
def membership(value: float, term: int, n_terms: int) -> float:
    """Degree to which a value in [0, 1] belongs to one of n evenly spaced terms.

    Inner terms are triangles of half-width ``w = 1/(n-1)`` about ``term w``. The first term is Z-shaped and the last
    S-shaped: each consists of two parabolas that meet at half the width, ``1 - 2 q^2`` and ``2 (1 - q)^2``, where q is
    the distance from the end of the range divided by w.

    Args:
        value: risk or authority in [0, 1] [-].
        term: index of the term, 0 to n_terms - 1.
        n_terms: number of terms.

    Returns:
        Degree in [0, 1] [-].
    """
    q = abs(value * (n_terms - 1) - term)
    if q >= 1.0:
        return 0.0
    if 0 < term < n_terms - 1:
        return 1.0 - q
    return 1.0 - 2.0 * q * q if q <= 0.5 else 2.0 * (1.0 - q) * (1.0 - q)


OUTPUT_TERMS = np.array([[membership(value, term, 7) for value in UNIVERSE] for term in range(7)])
"""Membership of every output term at the points of :data:`UNIVERSE`, shape (7, 501)."""

_MASS = OUTPUT_TERMS.sum(axis=1)
_MOMENT = OUTPUT_TERMS @ UNIVERSE


@jit_inlined
def centroid_product_sum(r_x: float, r_y: float) -> float:
    """Centre of gravity with product for "and" and implication, and sum for aggregation.

    The aggregate is ``sum_ij mu_i(r_x) mu_j(r_y) B_ij(z)``. It is linear in the output sets, so its mass and moment
    over the 501 points are sums of the masses and moments of the seven terms.

    Args:
        r_x, r_y: longitudinal and lateral risk in [0, 1] [-].

    Returns:
        Centre of gravity, before :func:`authority` rescales it.
    """
    mass = moment = 0.0
    for i in range(5):
        mu_x = membership(r_x, i, 5)
        if mu_x > 0.0:
            for j in range(5):
                strength = mu_x * membership(r_y, j, 5)
                mass += strength * _MASS[RULES[i, j]]
                moment += strength * _MOMENT[RULES[i, j]]
    return moment / mass


@jit_allocating
def centroid_min_max(r_x: float, r_y: float) -> float:
    """Centre of gravity with minimum for "and" and implication, and maximum for aggregation.

    Args:
        r_x, r_y: longitudinal and lateral risk in [0, 1] [-].

    Returns:
        Centre of gravity, before :func:`authority` rescales it.
    """
    strength = np.empty(7)
    for term in range(7):
        strength[term] = 0.0
    for i in range(5):
        for j in range(5):
            rule = RULES[i, j]
            strength[rule] = max(strength[rule], min(membership(r_x, i, 5), membership(r_y, j, 5)))
    mass = moment = 0.0
    for k in range(UNIVERSE.shape[0]):
        degree = 0.0
        for term in range(7):
            degree = max(degree, min(strength[term], OUTPUT_TERMS[term, k]))
        mass += degree
        moment += degree * UNIVERSE[k]
    return moment / mass


_LOW, _HIGH = _MOMENT[0] / _MASS[0], _MOMENT[6] / _MASS[6]


@jit_inlined
def authority(r_x: float, r_y: float, operators: int) -> float:
    """Authority of the automation, ``alpha_a = FIS(r_x, r_y)``.

    The centre of gravity alone spans only 0.048 to 0.952. It is rescaled so that alpha_a(0, 0) = 1 ("very
    high, -> 1" in the text) and the strongest rule gives 0.

    Args:
        r_x, r_y: longitudinal and lateral risk in [0, 1] [-].
        operators: index in :data:`OPERATORS`.

    Returns:
        alpha_a in [0, 1] [-].
    """
    centre = centroid_product_sum(r_x, r_y) if operators == 0 else centroid_min_max(r_x, r_y)
    return min(max((centre - _LOW) / (_HIGH - _LOW), 0.0), 1.0)
