"""Allocators of the automation's authority that run in the kernel: their interface, and the paper's fuzzy inference."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from shared_control_env.core.authority import fuzzy
from shared_control_env.core.authority.alerts import NO_ALERT
from shared_control_env.core.compile.calls import MATRIX, Interface, by_value
from shared_control_env.core.compile.jit import jit
from shared_control_env.core.parameters import Parameters
from shared_control_env.core.records import Memory, Scene, Signals
from shared_control_env.core.risk.assessment import ASSESS
from shared_control_env.core.world.motion import Motion

_assess = ASSESS.call


class Situation(NamedTuple):
    """What an allocator decides on.

    Attributes:
        scene: what the sensors give.
        signals: signals of this step up to the risks; the driver's are those of the previous step. An allocator must
            not use ``fault`` and ``misperception``, which are ground truth, nor ``u_a_des``, which only the paper's law
            knows.
        memory: what the loop carries; ``u_h_act`` is the driver's present actual command [m/s^2, rad].
        p: parameters.
        traffic: other vehicles, shape (n, 8).
        line: reference line of the road, shape (m, 12).
        trial: scratch for :func:`risks_of`.
        motion: scratch for :func:`risks_of`.
        assess: address of the risk assessment.
    """

    scene: Scene
    signals: Signals
    memory: Memory
    p: Parameters
    traffic: Annotated[np.ndarray, MATRIX]
    line: Annotated[np.ndarray, MATRIX]
    trial: Signals
    motion: Motion
    assess: int


ALLOCATE = Interface((float, float, int), by_value(Situation))
"""``allocate(situation) -> (alpha over acceleration, alpha over steering, alert)``.

The caller clips both authorities to [0, 1]. The alert is an index in :data:`alerts.ALERTS`.
"""


@jit
def risks_of(a: float, delta: float, tau: float, now: Situation) -> tuple[float, float]:
    """Risks that arise if any command drives the car (Eq. 1-8).

    Args:
        a: acceleration [m/s^2].
        delta: steering angle [rad].
        tau: prediction horizon [s]; with 0 the risks of the present position.
        now: the situation; its scratch is written.

    Returns:
        r_x and r_y [-].
    """
    trial = now.trial
    trial.u_a_f[0], trial.u_a_f[1] = a, delta
    for i in range(2):
        trial.misperception[i] = now.signals.misperception[i]
    _assess(now.assess, tau, now.scene, now.traffic, now.line, now.p, trial, now.motion)
    return trial.r_x, trial.r_y


def fuzzy_authority(now: Situation) -> tuple[float, float, int]:
    """``alpha_a = FIS(r_x, r_y)`` (Eq. 9), with the operators of the settings.

    Args:
        now: the situation.

    Returns:
        alpha_a for both channels [-]; no alert.
    """
    alpha = fuzzy.authority(now.signals.r_x, now.signals.r_y, now.p.authority.operators)
    return alpha, alpha, NO_ALERT


def _product_sum(now: Situation) -> tuple[float, float, int]:
    """:func:`fuzzy_authority` with product and sum, regardless of the settings."""
    alpha = fuzzy.authority(now.signals.r_x, now.signals.r_y, 0)
    return alpha, alpha, NO_ALERT


def _min_max(now: Situation) -> tuple[float, float, int]:
    """:func:`fuzzy_authority` with minimum and maximum, regardless of the settings."""
    alpha = fuzzy.authority(now.signals.r_x, now.signals.r_y, 1)
    return alpha, alpha, NO_ALERT


FUZZY = dict(zip(fuzzy.OPERATORS, (_product_sum, _min_max), strict=True))
"""Allocators by fuzzy inference, by the names of their operators."""


def full_authority(now: Situation) -> tuple[float, float, int]:
    """``alpha_a = 1``.

    Args:
        now: the situation; not used.

    Returns:
        1 for both channels [-]; no alert.
    """
    return 1.0, 1.0, NO_ALERT


def no_authority(now: Situation) -> tuple[float, float, int]:
    """``alpha_a = 0``.

    Args:
        now: the situation; not used.

    Returns:
        0 for both channels [-]; no alert.
    """
    return 0.0, 0.0, NO_ALERT
