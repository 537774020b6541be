"""Arrays of many environments, and the scratch of one thread."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from shared_control_env.core import active_set_qp, condensing, delaunay, safe_area
from shared_control_env.core.active_set_qp import MAX_ROWS, MAX_VARIABLES
from shared_control_env.core.delaunay import MAX_TRIANGLES
from shared_control_env.core.records import SCENE


class Batch(NamedTuple):
    """State of N environments, one entry each.

    Attributes:
        parameters: records of :class:`core.parameters.Parameters`, (N,).
        scenes: of :data:`records.SCENE`, (N,).
        signals: of :data:`records.SIGNALS`, (N,).
        memories: of :data:`records.MEMORY`, (N,).
        automations: of :data:`records.AUTOMATION_MEMORY`, (N,).
        states: ego ``[x, y, psi, v_x, v_y, r]``, (N, 6).
        lines: reference lines of the roads, (N, n, 6).
        faults: records of :class:`core.parameters.DegradationParameters`, (N, m).
        fault_memories: of :data:`records.FAULT_MEMORY`, (N, m).
        persons: of :data:`records.PERSON_MEMORY`, (N,).
        traffic: other vehicles, (N, M, 8).
        plans: what they are going to do, records of :class:`core.parameters.TrafficParameters`, (N, M).
        crashed: whether the ego has collided, (N,).
        ended: whether the episode has ended and awaits its reset, (N,).
    """

    parameters: np.ndarray
    scenes: np.ndarray
    signals: np.ndarray
    memories: np.ndarray
    automations: np.ndarray
    states: np.ndarray
    lines: np.ndarray
    faults: np.ndarray
    fault_memories: np.ndarray
    persons: np.ndarray
    traffic: np.ndarray
    plans: np.ndarray
    crashed: np.ndarray
    ended: np.ndarray


class Starts(NamedTuple):
    """What every episode starts from, one entry; none where episodes are drawn, whose starts are in the batch already.

    Attributes:
        parameters, states, lines, faults, traffic, plans: as those of :class:`Batch`.
    """

    parameters: np.ndarray
    states: np.ndarray
    lines: np.ndarray
    faults: np.ndarray
    traffic: np.ndarray
    plans: np.ndarray


class Addresses(NamedTuple):
    """Where the solvers of :mod:`vector.solvers` are in memory; 0 for one that is not loaded.

    Attributes:
        automate, triangulate, search, drive: of the functions of these names.
    """

    automate: int
    triangulate: int
    search: int
    drive: int


NOT_LOADED = Addresses(0, 0, 0, 0)
"""Before the first reset."""


class Setup(NamedTuple):
    """What all environments share.

    Attributes:
        starts: of the episodes.
        steps: length of an episode in decisions.
        frames: simulation steps of one decision.
        dt: of a simulation step [s].
        limiter: whether the fuzzy inference decides alpha_a.
        driver: whether the predictive driver decides the driver's command.
        solvers: where the compiled solvers are.
    """

    starts: Starts
    steps: int
    frames: int
    dt: float
    limiter: bool
    driver: bool
    solvers: Addresses


class Outputs(NamedTuple):
    """What a step gives, one entry an environment.

    Attributes:
        observations: (N, 25), float32.
        rewards: (N,).
        terminations, truncations: (N,).
        infos: records of :data:`info.INFO`, (N,).
        solver: records of :data:`SOLVER`, the driver's, (N,).
    """

    observations: np.ndarray
    rewards: np.ndarray
    terminations: np.ndarray
    truncations: np.ndarray
    infos: np.ndarray
    solver: np.ndarray


SOLVER = np.dtype(
    [
        ("status", np.int64),  # active_set_qp.SOLVED, ITERATION_LIMIT or FAILED
        ("iterations", np.int64),
        ("primal_residual", np.float64),
        ("dual_residual", np.float64),
        ("failures", np.int64),  # steps so far at which the last command was held
        ("engaged", np.bool_),  # whether a person drives; else the hands rest
        ("noticed", np.float64),  # when a person at rest noticed something [s]; infinite before
        ("reason", np.int64),  # what it was, index in person.REASONS
    ],
    align=True,
)
"""Report of the driver, as ``info["driver"]``: of its solver, and of the person."""

_scratch: Any = safe_area.new_scratch
SEARCH_SCRATCH = np.dtype(
    # As Python, since compiling it would take time.
    [(name, array.dtype, array.shape) for name, array in _scratch.py_func(MAX_TRIANGLES)._asdict().items()],
    align=True,
)
"""Arrays of :class:`safe_area.Scratch`."""

WORKSPACE = np.dtype(
    [
        ("solver", condensing.WORKSPACE),
        ("triangles", delaunay.WORKSPACE),
        ("search", SEARCH_SCRATCH),
        ("corners", np.float64, (delaunay.MAX_HOLES, 4, 2)),  # vehicles in the driving region
        ("row", np.float64, (8,)),  # the ego as a row of traffic
        ("plant", np.float64, (2, 6)),
        ("terms", np.float64, (7,)),  # of the reward
        ("command", np.float64, (2,)),  # the driver's
        ("seen", SCENE, (1,)),  # the scene as a person sees it
    ],
    align=True,
)
"""Scratch of one thread."""

PROGRAM = np.dtype(
    [
        ("active_set", active_set_qp.WORKSPACE),
        ("P", np.float64, (MAX_VARIABLES, MAX_VARIABLES)),
        ("q", np.float64, (MAX_VARIABLES,)),
        ("A", np.float64, (MAX_ROWS, MAX_VARIABLES)),
        ("low", np.float64, (MAX_ROWS,)),
        ("high", np.float64, (MAX_ROWS,)),
        ("x", np.float64, (MAX_VARIABLES,)),
        ("multipliers", np.float64, (MAX_ROWS,)),
    ],
    align=True,
)
"""The driver's quadratic program and its solver's scratch, of one thread."""
