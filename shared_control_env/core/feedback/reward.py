"""The reward: a weighted sum of named terms, each of the order of 1. :data:`TERMS` has one row per term.

:func:`add_term` adds a term from outside the package; the settings then give its weight.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from shared_control_env.core.compile.calls import Interface, by_value
from shared_control_env.core.compile.jit import jit
from shared_control_env.core.parameters import Parameters
from shared_control_env.core.records import Scene, Signals, Transition
from shared_control_env.nearest import check_new_name

COMFORT_JERK = 5.0
"""Jerk at which the comfort term saturates [m/s^3]: the average limit of ISO 11270 over half a second."""

COMFORT_LATERAL = 3.0
"""Lateral acceleration at which the comfort term saturates [m/s^2]; ISO 11270."""


class Step(NamedTuple):
    """What a term of the reward is computed from.

    Attributes:
        transition: values from before the step, and whether the step ended in a failure.
        scene: scene after the step.
        signals: signals of the step.
        p: parameters.
    """

    transition: Transition
    scene: Scene
    signals: Signals
    p: Parameters


VALUE = Interface(float, by_value(Step))
"""``value(step) -> value``: unweighted value of a term [-]."""

_value = VALUE.call


class Term(NamedTuple):
    """A term of the reward.

    Attributes:
        name: name of the term in the settings and in ``info``.
        weight: default weight [-].
        value: function that returns the unweighted value for a :class:`Step`.
    """

    name: str
    weight: float
    value: Callable[[Step], float]


def _progress(step: Step) -> float:
    """``ds / (dt target_speed)`` in [-1, 1]: progress along the lane; standing or turning in place gives no reward."""
    task = step.p.task
    progress = (step.scene.z[0] - step.transition.previous_s) / (task.dt * task.target_speed)
    return min(max(progress, -1.0), 1.0)


def _lane(step: Step) -> float:
    """``-min(1, ((y - y_target) / (lane_width / 2))^2)``."""
    return -min(1.0, (2.0 * (step.scene.z[1] - step.scene.y_target) / step.scene.lane_width) ** 2)


def _speed(step: Step) -> float:
    """``-min(1, |v_x - v_target| / target_speed)``."""
    return -min(1.0, abs(step.scene.z[3] - step.scene.v_target) / step.p.task.target_speed)


def _effort(step: Step) -> float:
    """``-((a_h,act / a_max)^2 + (delta_h,act / delta_max)^2)``."""
    u_h, limits = step.signals.u_h_act, step.p.limits
    return -((u_h[0] / limits.a_max) ** 2) - (u_h[1] / limits.delta_max) ** 2


def _comfort(step: Step) -> float:
    """``-min(1, (jerk / 5)^2) / 2 - min(1, (r v_x / 3)^2) / 2``."""
    z = step.scene.z
    jerk = (step.signals.u[0] - step.transition.last_a) / step.p.task.dt
    value = -0.5 * min(1.0, (jerk / COMFORT_JERK) ** 2)
    return value - 0.5 * min(1.0, (z[5] * z[3] / COMFORT_LATERAL) ** 2)


def _conflict(step: Step) -> float:
    """``-sum max(0, -u_h,act u_a,act) / bound^2``: penalty where driver and automation act against each other."""
    u_h, u_a, limits = step.signals.u_h_act, step.signals.u_a_act, step.p.limits
    value = -max(0.0, -u_h[0] * u_a[0]) / limits.a_max**2
    return value - max(0.0, -u_h[1] * u_a[1]) / limits.delta_max**2


def _failure(step: Step) -> float:
    """-1 on a collision or off the road, else 0."""
    return -1.0 if step.transition.failed else 0.0


TERMS: dict[str, Term] = {
    term.name: term
    for term in (
        Term("progress", 1.0, _progress),
        Term("lane", 0.5, _lane),
        Term("speed", 0.5, _speed),
        Term("effort", 0.1, _effort),
        Term("comfort", 0.05, _comfort),
        Term("conflict", 0.1, _conflict),
        Term("failure", 50.0, _failure),
    )
}
"""All terms by name. The weights are choices of this implementation."""

STANDARD = tuple(TERMS)
"""Names of the terms that every environment has; other terms apply only where the settings name them."""


def add_term(term: Term) -> None:
    """Add a term. Settings can then give it a weight; no registered environment has it.

    Args:
        term: term whose function has the signature :data:`VALUE`; the function is compiled here.

    Raises:
        ValueError: if the name is taken, or if numba cannot compile the function.
    """
    check_new_name("reward term", term.name, TERMS)
    VALUE.address(term.value)
    TERMS[term.name] = term


@jit
def reward(transition: Transition, scene: Scene, signals: Signals, p: Parameters) -> float:
    """Reward of one step: the weighted sum of its terms.

    Args:
        transition: record of :data:`records.TRANSITION`; the unweighted ``terms`` are written.
        scene: record of :data:`records.SCENE` after the step.
        signals: record of :data:`records.SIGNALS` of the step.
        p: parameters; ``p.reward`` holds the terms and their weights.

    Returns:
        The weighted sum [-].
    """
    total = 0.0
    for i in range(p.reward.n_terms):
        transition.terms[i] = _value(p.reward.addresses[i], Step(transition, scene, signals, p))
        total += p.reward.weights[i] * transition.terms[i]
    return total
