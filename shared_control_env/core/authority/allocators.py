"""Allocators of the automation's authority that run in the kernel, as functions of one step's scene and signals."""

from __future__ import annotations

from shared_control_env.core.authority import fuzzy
from shared_control_env.core.compile.calls import Interface
from shared_control_env.core.parameters import Parameters
from shared_control_env.core.records import Scene, Signals

ALLOCATE = Interface(float, Scene, Signals, Parameters)
"""``allocate(scene, signals, p) -> alpha_a``; the caller clips the result to [0, 1]."""


def fuzzy_authority(scene: Scene, signals: Signals, p: Parameters) -> float:
    """``alpha_a = FIS(r_x, r_y)`` (Eq. 9).

    Args:
        scene: record of :data:`records.SCENE`.
        signals: record of :data:`records.SIGNALS` with the assessed risks.
        p: parameters, which select the operators.

    Returns:
        alpha_a in [0, 1] [-].
    """
    return fuzzy.authority(signals.r_x, signals.r_y, p.authority.operators)


def _product_sum(scene: Scene, signals: Signals, p: Parameters) -> float:
    """:func:`fuzzy_authority` with product and sum, regardless of the settings."""
    return fuzzy.authority(signals.r_x, signals.r_y, 0)


def _min_max(scene: Scene, signals: Signals, p: Parameters) -> float:
    """:func:`fuzzy_authority` with minimum and maximum, regardless of the settings."""
    return fuzzy.authority(signals.r_x, signals.r_y, 1)


FUZZY = dict(zip(fuzzy.OPERATORS, (_product_sum, _min_max), strict=True))
"""Allocators by fuzzy inference, by the names of their operators."""
