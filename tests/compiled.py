"""Compiled functions of the core for tests, which call them from Python: records come as 0-d arrays."""

from __future__ import annotations

from typing import Any

import numpy as np

from shared_control_env.core.compile.jit import jit
from shared_control_env.core.control.qp.active_set import solve_qp
from shared_control_env.core.faults.command import degrade
from shared_control_env.core.records import record_dtype
from shared_control_env.core.risk.assessment import ASSESS, assess
from shared_control_env.core.risk.corridor import new_scratch, search_triangles
from shared_control_env.core.risk.triangulation import triangulate
from shared_control_env.core.world.motion import Motion
from shared_control_env.core.world.scene import holes_in_region, perceive

_assess = ASSESS.call


@jit
def sense(k: int, state: Any, traffic: Any, line: Any, parameters: Any, scene: Any, corners: Any) -> int:
    """Perceive a scene; the corners of the vehicles in its driving region, and how many there are."""
    perceive(k, state, traffic, line, parameters[()], scene[()])
    return holes_in_region(traffic, line, scene[()].region, corners)


@jit
def search_with(triangles: Any, parameters: Any, scene: Any, scratch: Any) -> None:
    s = scene[()]
    search_triangles(triangles, s.region[0], s.region[1], s.z[1], parameters[()].vehicle.width, scratch, s.area)


def search(triangles: np.ndarray, parameters: np.ndarray, scene: np.ndarray) -> None:
    """Safe area of a scene through triangles of its driving region."""
    search_with(triangles, parameters, scene, new_scratch(len(triangles)))


@jit
def monitor_with(
    address: int,
    scene: Any,
    traffic: Any,
    line: Any,
    faults: Any,
    memories: Any,
    parameters: Any,
    signals: Any,
    work: Any,
) -> None:
    s, p, g = scene[()], parameters[()], signals[()]
    degrade(g.u_a_des, s.k, p.task.dt, faults, memories, p.limits, g.u_a_f)
    _assess(address, p.task.tau_p, s, traffic, line, p, g, work[()])


def monitor(
    scene: np.ndarray,
    traffic: np.ndarray,
    line: np.ndarray,
    faults: np.ndarray,
    memories: np.ndarray,
    parameters: np.ndarray,
    signals: np.ndarray,
) -> None:
    """u_a,f and the risks of a scene, given u_a,des in the signals."""
    work = np.zeros((), record_dtype(Motion))
    monitor_with(ASSESS.address(assess), scene, traffic, line, faults, memories, parameters, signals, work)


@jit
def triangulate_array(region: Any, holes: Any, n_holes: int, work: Any) -> int:
    """:func:`risk.triangulation.triangulate`."""
    return triangulate(region, holes, n_holes, work[()])


@jit
def solve_qp_array(
    n: int, m: int, P: Any, q: Any, A: Any, low: Any, high: Any, x: Any, multipliers: Any, work: Any
) -> tuple[int, int, float, float]:
    """:func:`control.qp.active_set.solve_qp`."""
    return solve_qp(n, m, P, q, A, low, high, x, multipliers, work[()])
