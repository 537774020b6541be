"""A tyre, an observation and a term of the reward that tests add to those of the package, and take away again."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from math import tanh

from shared_control_env.core.feedback.observation import OBSERVATIONS, Observation, add_observation
from shared_control_env.core.feedback.reward import TERMS, Term, add_term
from shared_control_env.core.world.tyre import TYRES, add_tyre

TYRE, OBSERVATION, TERM = "saturating", "brief-v0", "lateral_speed"


def _saturating(slip, C, mu, F_z):
    """A force that levels off at mu F_z."""
    share = tanh(C * slip / (mu * F_z))
    return -mu * F_z * share, -C * (1.0 - share * share)


def _brief(scene, memory, line, p, out):
    out[0], out[1] = scene.z[1] - scene.y_target, scene.z[2]


def _lateral_speed(step):
    return -min(1.0, abs(step.scene.z[4]))


@contextmanager
def added() -> Iterator[None]:
    """Have the additions while the context lasts: results of other tests of the process do not depend on them."""
    add_tyre(TYRE, _saturating)
    add_observation(Observation(OBSERVATION, (("lateral error [m]", 4.0), ("heading [rad]", 0.8)), _brief))
    add_term(Term(TERM, 0.1, _lateral_speed))
    try:
        yield
    finally:
        del TYRES[TYRE], OBSERVATIONS[OBSERVATION], TERMS[TERM]
