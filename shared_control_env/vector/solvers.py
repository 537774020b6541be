"""The solvers of a step, each compiled apart from the kernel, which calls them by their addresses.

LLVM optimises all that a function calls anew together with it. Through an address the kernel stays small, the solver
of a driver that nobody bound is never compiled, and two processes can compile at the same time (:mod:`cold_start`).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from numba import float64, from_dtype, int64, types
from numba.core.ccallback import CFunc

from shared_control_env.core import active_set_qp, closed_loop, condensing
from shared_control_env.core.cache import cache_of
from shared_control_env.core.driver_qp import build_program, count_rows
from shared_control_env.core.jit import jit_inlined
from shared_control_env.core.parameters import Parameters
from shared_control_env.core.person import take_in, with_arm_noise
from shared_control_env.core.records import AUTOMATION_MEMORY, MEMORY, PERSON_MEMORY, SCENE, Record, record_dtype
from shared_control_env.core.safe_area import Scratch, search_triangles, triangulate_compiled
from shared_control_env.vector.intrinsics import call_of
from shared_control_env.vector.records import PROGRAM, SOLVER, WORKSPACE, Addresses


class Solver:
    """A compiled function with an address.

    Args:
        function: what it does, in terms of compiled functions of the core.
        result: type of what it returns.
        arguments: types of its arguments: structured types for records.

    Attributes:
        call: for compiled code, ``call(address, *arguments)``.
    """

    def __init__(self, function: Callable[..., Any], result: Any, *arguments: Any) -> None:
        kinds = [from_dtype(kind) if isinstance(kind, np.dtype) else kind for kind in arguments]
        self._function, self._signature = function, result(*kinds)
        self.call = call_of(self._signature)

    @cached_property
    def address(self) -> int:
        """Where it is in memory; it is compiled for that, or read from numba's cache."""
        options: Any = {"error_model": "numpy", "_nrt": False}  # as core.jit has them
        compiled: Any = CFunc(
            self._function, (self._signature.args, self._signature.return_type), locals={}, options=options
        )
        compiled._cache = cache_of(self._function)
        compiled.compile()
        self._compiled = compiled  # lest its code is freed
        return compiled.address


def automate(scene: Record, p: Parameters, memory: Record, work: Record) -> tuple[int, int, float]:
    """:func:`closed_loop.automate`."""
    return closed_loop.automate(scene, p, memory, work)


def triangulate(scene: Record, count: int, work: Record) -> int:
    """:func:`safe_area.triangulate_compiled` of a scene, the triangles left in ``work.triangles``.

    Args:
        scene: record of :data:`records.SCENE`.
        count: vehicles in the region; ``work.corners`` holds their corners.
        work: record of :data:`records.WORKSPACE`.

    Returns:
        How many.
    """
    return triangulate_compiled(scene.region, work.corners, count, work.triangles)


def search(scene: Record, p: Parameters, n: int, work: Record) -> None:
    """Safe area through the first n triangles of ``work.triangles`` by :func:`safe_area.search_triangles`.

    Args:
        scene: record of :data:`records.SCENE`; its area is written.
        p: parameters.
        n: triangles.
        work: record of :data:`records.WORKSPACE`.
    """
    triangles, w = work.triangles.triangles[:n], work.search
    scratch = Scratch(w.neighbours, w.distance, w.at, w.parent, w.entry, w.done, w.sequence, w.stack, w.ring)
    search_triangles(triangles, scene.region[0], scene.region[1], scene.z[1], p.vehicle.width, scratch, scene.area)


def drive(
    scene: Record, p: Parameters, memory: Record, person: Record, work: Record, program: Record, report: Record
) -> None:
    """The predictive driver's command (Eq. 15) by the active-set method, or a person's, left in ``work.command``.

    Hands that rest follow what they feel of the automation. When the solver fails the last command is held and the
    failure counted.

    Args:
        scene: record of :data:`records.SCENE`.
        p: parameters.
        memory: record of :data:`records.MEMORY`.
        person: record of :data:`records.PERSON_MEMORY`.
        work: record of :data:`records.WORKSPACE`.
        program: record of :data:`records.PROGRAM`.
        report: record of :data:`records.SOLVER`, written.
    """
    if not p.person.active:
        report.engaged, report.noticed, report.reason = True, np.inf, 0
        _solve(scene, p, memory, work, program, report)
        return
    work.seen[0] = scene
    seen = work.seen[0]
    if take_in(scene, memory.u, memory.alpha_a, person, p, seen):
        _solve(seen, p, memory, work, program, report)
        with_arm_noise(work.command, person, p)
    else:
        work.command[0], work.command[1] = scene.felt[0], scene.felt[1]
        report.status, report.iterations, report.failures = active_set_qp.SOLVED, 0, memory.driver_failures
        report.primal_residual, report.dual_residual = 0.0, 0.0
    report.engaged, report.noticed, report.reason = person.engaged, person.noticed, person.reason


@jit_inlined
def _solve(scene: Record, p: Parameters, memory: Record, work: Record, program: Record, report: Record) -> None:
    """The program of a scene as the driver sees it; arguments as those of :func:`drive`."""
    g = program
    build_program(scene, memory.u_h_des, memory.u_h_act, p, work.solver, g.P, g.q, g.A, g.low, g.high)
    n, m = 2 * p.driver.H_c + 1, count_rows(p)
    status, iterations, primal, dual = active_set_qp.solve_qp(
        n, m, g.P, g.q, g.A, g.low, g.high, g.x, g.multipliers, g.active_set
    )
    if status == active_set_qp.SOLVED and np.isfinite(g.x[0] + g.x[1]):
        work.command[0] = min(max(g.x[0], -1.0), 1.0) * p.limits.a_max
        work.command[1] = min(max(g.x[1], -1.0), 1.0) * p.limits.delta_max
    else:
        work.command[0], work.command[1] = memory.u_h_des[0], memory.u_h_des[1]
        memory.driver_failures += 1
    report.status, report.iterations = status, iterations
    report.primal_residual, report.dual_residual = primal, dual
    report.failures = memory.driver_failures


_P = record_dtype(Parameters)

AUTOMATE = Solver(automate, types.Tuple((int64, int64, float64)), SCENE, _P, AUTOMATION_MEMORY, condensing.WORKSPACE)
TRIANGULATE = Solver(triangulate, int64, SCENE, int64, WORKSPACE)
SEARCH = Solver(search, types.void, SCENE, _P, int64, WORKSPACE)
DRIVE = Solver(drive, types.void, SCENE, _P, MEMORY, PERSON_MEMORY, WORKSPACE, PROGRAM, SOLVER)


def addresses(driver: bool) -> Addresses:
    """Addresses of the solvers, compiled now unless they are in numba's cache; 0 for a driver that is not bound."""
    return Addresses(AUTOMATE.address, TRIANGULATE.address, SEARCH.address, DRIVE.address if driver else 0)
