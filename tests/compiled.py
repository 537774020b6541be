"""Compiled functions of the core for tests, which call them from Python: records come as 0-d arrays."""

from __future__ import annotations

from math import cos, sin
from typing import Any

import numpy as np

from shared_control_env.core.compile.jit import jit
from shared_control_env.core.compile.lanes import WIDTH, load
from shared_control_env.core.control.qp import box
from shared_control_env.core.control.qp.active_set import solve_qp
from shared_control_env.core.control.qp.box import solve_box_qp
from shared_control_env.core.faults.command import degrade
from shared_control_env.core.records import record_dtype
from shared_control_env.core.risk.assessment import ASSESS, assess
from shared_control_env.core.risk.corridor import new_scratch, search_triangles
from shared_control_env.core.risk.triangulation import triangulate
from shared_control_env.core.world.motion import Motion
from shared_control_env.core.world.scene import holes_in_region, perceive
from shared_control_env.core.world.vehicle import derivatives, implicit_step, linear_axles, through_step

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


@jit
def step_of(z: Any, a: float, delta: float, kappa: float, h: float, car: Any) -> Any:
    heading, wheel = (cos(z[2]), sin(z[2])), (cos(delta), sin(delta))
    z_next, heading_next, inner = implicit_step(z, heading, a, delta, wheel, kappa, h, car, linear_axles(car))
    return z_next, derivatives(z, heading, a, delta, wheel, kappa, h, car, z_next, heading_next, inner)


def step_with_derivatives(
    z: np.ndarray, a: float, delta: float, kappa: float, h: float, car: Any
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """One implicit step on linear tyres: the new state, and its derivatives by the state and by the command."""
    z_next, by = step_of(tuple(map(float, z)), float(a), float(delta), float(kappa), h, car)
    A, B = np.zeros((6, 6)), np.array([by.a, by.delta]).T
    A[0, 0] = 1.0
    A[:3, 1], A[:3, 2], A[:, 3], A[:, 4], A[:, 5] = by.y, by.psi, by.v_x, by.v_y, by.r
    return np.array(z_next), A, B


@jit
def through(x: Any, step: Any) -> Any:
    return through_step(x, step)


def change_through_step(
    x: np.ndarray, z: np.ndarray, a: float, delta: float, kappa: float, h: float, car: Any
) -> np.ndarray:
    """Change of the state after an implicit step, for a change x of the state before."""
    step = step_of(tuple(map(float, z)), float(a), float(delta), float(kappa), h, car)[1]
    return np.array(through(tuple(map(float, x)), step))


@jit
def box_in_lanes(n: int, H: Any, g: Any, low: Any, high: Any, wanted: Any, x: Any, work: Any) -> None:
    solve_box_qp(n, H, g, low, high, load(wanted) > 0.0, x, work[()])


def solve_box(H: np.ndarray, g: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Minimisers of programs with bounds, one for each lane: H is (lanes, n, n), the others are (lanes, n)."""
    count, n = g.shape
    spread = lambda array: np.ascontiguousarray(np.resize(array, (WIDTH, *array.shape[1:])).swapaxes(0, -1))
    wanted = np.arange(WIDTH) < count
    matrices = np.ascontiguousarray(np.moveaxis(np.resize(H, (WIDTH, n, n)), 0, -1))
    x = np.full((n, WIDTH), np.nan)
    work = np.zeros((), box.WORKSPACE)
    box_in_lanes(n, matrices, spread(g), spread(low), spread(high), wanted.astype(float), x, work)
    return x.T[:count]
