"""Errors of the automation's perception, and the scene as the automation perceives it."""

from __future__ import annotations

import numpy as np

from shared_control_env.core.compile.jit import jit
from shared_control_env.core.faults.command import severity
from shared_control_env.core.faults.kinds import PERCEIVE
from shared_control_env.core.parameters import Parameters
from shared_control_env.core.records import Scene, Signals

_perceive = PERCEIVE.call


@jit
def misperceive(t: float, faults: np.ndarray, signals: Signals) -> None:
    """Compute the errors of the automation's perception, summed over all degradations.

    Args:
        t: time [s].
        faults: records of :class:`DegradationParameters`, shape (n,).
        signals: record of :data:`records.SIGNALS`; ``misperception`` is written: the offset to the left [m], and 1
            if the preceding vehicle is missed, else 0.
    """
    signals.misperception[0], signals.misperception[1] = 0.0, 0.0
    for i in range(faults.shape[0]):
        if faults[i].perceive != 0:
            _perceive(faults[i].perceive, faults[i], severity(faults[i], t), signals)


@jit
def see_as_automation(misperception: np.ndarray, p: Parameters, view: Scene) -> None:
    """Change a copy of the scene to the scene that the automation perceives.

    An automation that misses the preceding vehicle tracks the target speed of the task.

    Args:
        misperception: errors from :func:`misperceive`: offset to the left [m], 1 if the preceding vehicle is missed;
            shape (2,).
        p: parameters.
        view: copy of the scene, record of :data:`records.SCENE`, changed in place.
    """
    view.z[1] += misperception[0]
    if misperception[1] > 0.0:
        view.v_target = p.task.target_speed
