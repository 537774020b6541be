"""Entry points for one environment, called from Python.

Numba takes an array of any type in half a microsecond but a record by itself in ten, so these take
arrays of no dimension and hand their one record, ``array[()]``, to the functions that hold the model.
"""

from __future__ import annotations

import numpy as np

from shared_control_env.core import (
    automation_mpc,
    closed_loop,
    driver_lag,
    driver_qp,
    dynamics,
    fuzzy,
    info,
    observation,
    person,
    safe_area,
)
from shared_control_env.core import (
    scene as scenes,
)
from shared_control_env.core import (
    traffic as vehicles,
)
from shared_control_env.core.jit import jit, jit_allocating
from shared_control_env.core.records import Record


@jit
def sense(
    k: int,
    state: np.ndarray,
    traffic: np.ndarray,
    line: np.ndarray,
    parameters: Record,
    scene: Record,
    corners: np.ndarray,
) -> int:
    """:func:`scene.perceive`, then :func:`scene.holes_in_region`; returns the number of holes."""
    scenes.perceive(k, state, traffic, line, parameters[()], scene[()])
    return scenes.holes_in_region(traffic, line, scene[()].region, corners)


@jit_allocating
def find_area(corners: np.ndarray, count: int, parameters: Record, scene: Record, work: Record) -> None:
    """Safe area of a scene around at most MAX_HOLES vehicles.

    Args:
        corners: of the vehicles in the driving region, shape (>= count, 4, 2).
        count: how many there are.
        parameters, scene: records; the scene's area is written.
        work: record of :data:`delaunay.WORKSPACE`.
    """
    s, w = scene[()], work[()]
    if safe_area.is_whole(count, s.region, parameters[()].vehicle.width):
        safe_area.whole_region(s.region, s.area)
    else:
        n = safe_area.triangulate_compiled(s.region, corners, count, w)
        search(w.triangles[:n], parameters, scene)


@jit_allocating
def search(triangles: np.ndarray, parameters: Record, scene: Record) -> None:
    """:func:`safe_area.search_triangles` of a scene's driving region."""
    s, p, scratch = scene[()], parameters[()], safe_area.new_scratch(triangles.shape[0])
    safe_area.search_triangles(triangles, s.region[0], s.region[1], s.z[1], p.vehicle.width, scratch, s.area)


@jit
def decide_acceleration(
    row: np.ndarray,
    plan: Record,
    t: float,
    ego: np.ndarray,
    traffic: np.ndarray,
    line: np.ndarray,
    lane_width: float,
) -> None:
    """:func:`traffic.decide_acceleration`."""
    vehicles.decide_acceleration(row, plan[()], t, ego, traffic, line, lane_width)


@jit
def move(row: np.ndarray, plan: Record, line: np.ndarray, t: float, dt: float) -> None:
    """:func:`traffic.move`."""
    vehicles.move(row, plan[()], line, t, dt)


@jit
def misjudge(scene: Record, faults: np.ndarray, parameters: Record, signals: Record) -> tuple[float, float]:
    """:func:`closed_loop.misjudge`."""
    return closed_loop.misjudge(scene[()], faults, parameters[()], signals[()])


@jit
def judge_rightly(scene: Record, y: float, v_target: float) -> None:
    """:func:`closed_loop.judge_rightly`."""
    closed_loop.judge_rightly(scene[()], y, v_target)


@jit
def clear_memory(memory: Record) -> None:
    """:func:`closed_loop.clear_memory`."""
    closed_loop.clear_memory(memory[()])


@jit
def clear_signals(signals: Record) -> None:
    """:func:`closed_loop.clear_signals`."""
    closed_loop.clear_signals(signals[()])


@jit
def clear_automation(memory: Record) -> None:
    """:func:`closed_loop.clear_automation`."""
    closed_loop.clear_automation(memory[()])


@jit
def automate(scene: Record, parameters: Record, memory: Record, work: Record) -> tuple[int, int, float]:
    """:func:`closed_loop.automate`."""
    return closed_loop.automate(scene[()], parameters[()], memory[()], work[()])


@jit
def solve_automation(
    U: np.ndarray, scene: Record, parameters: Record, iterations: int, work: Record
) -> tuple[int, int, float, float]:
    """:func:`automation_mpc.solve`."""
    return automation_mpc.solve(U, scene[()], parameters[()], iterations, work[()])


@jit
def automation_cost(U: np.ndarray, scene: Record, parameters: Record, work: Record) -> float:
    """:func:`automation_mpc.cost`."""
    return automation_mpc.cost(U, scene[()], parameters[()], work[()])


@jit
def monitor(
    scene: Record,
    traffic: np.ndarray,
    line: np.ndarray,
    faults: np.ndarray,
    fault_memories: np.ndarray,
    parameters: Record,
    signals: Record,
) -> None:
    """:func:`closed_loop.monitor`."""
    closed_loop.monitor(scene[()], traffic, line, faults, fault_memories, parameters[()], signals[()])


@jit
def fuzzy_authority(signals: Record, parameters: Record) -> float:
    """alpha_a = FIS(r_x, r_y) of a monitored step (Eq. 9)."""
    s = signals[()]
    return fuzzy.authority(s.r_x, s.r_y, parameters[()].authority.operators)


@jit
def blend(
    u_h_des: np.ndarray,
    alpha_a: float,
    parameters: Record,
    scene: Record,
    memory: Record,
    signals: Record,
) -> None:
    """:func:`closed_loop.blend`."""
    closed_loop.blend(u_h_des, alpha_a, parameters[()], scene[()], memory[()], signals[()])


@jit
def blend_degraded(
    u_h_des: np.ndarray,
    alpha_a: float,
    parameters: Record,
    faults: np.ndarray,
    fault_memories: np.ndarray,
    scene: Record,
    memory: Record,
    signals: Record,
) -> None:
    """:func:`closed_loop.blend_degraded`."""
    p, s, m, g = parameters[()], scene[()], memory[()], signals[()]
    closed_loop.blend_degraded(u_h_des, alpha_a, p, faults, fault_memories, s, m, g)


@jit
def drive(state: np.ndarray, a: float, delta: float, dt: float, parameters: Record, work: Record) -> None:
    """:func:`dynamics.plant_step`."""
    dynamics.plant_step(state, a, delta, dt, parameters[()].vehicle, work)


@jit
def observe(scene: Record, memory: Record, line: np.ndarray, parameters: Record, out: np.ndarray) -> None:
    """:func:`observation.observe`."""
    observation.observe(scene[()], memory[()], line, parameters[()], out)


@jit
def note_signals(scene: Record, signals: Record, faults: np.ndarray, failures: int, info_record: Record) -> None:
    """:func:`info.note_signals`."""
    info.note_signals(scene[()], signals[()], faults, failures, info_record[()])


@jit_allocating
def note_start(scene: Record, parameters: Record, memory: Record, info_record: Record) -> None:
    """:func:`info.note_outcome` of a reset, with zero reward terms."""
    s = scene[()]
    on_road = closed_loop.is_on_road(s, parameters[()])
    info.note_outcome(s.z[3], False, on_road, memory[()], np.zeros(7), info_record[()])


@jit
def conclude(
    previous_s: float,
    last_a: float,
    crashed: bool,
    scene: Record,
    signals: Record,
    parameters: Record,
    memory: Record,
    terms: np.ndarray,
    info_record: Record,
    steps: int,
) -> tuple[float, bool, bool]:
    """:func:`closed_loop.conclude`."""
    return closed_loop.conclude(
        previous_s, last_a, crashed, scene[()], signals[()], parameters[()], memory[()], terms, info_record[()], steps
    )


@jit
def build_program(
    scene: Record,
    u_last: np.ndarray,
    u_h_act: np.ndarray,
    parameters: Record,
    work: Record,
    P: np.ndarray,
    q: np.ndarray,
    A: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
) -> None:
    """:func:`driver_qp.build_program`."""
    driver_qp.build_program(scene[()], u_last, u_h_act, parameters[()], work[()], P, q, A, low, high)


@jit
def clear_person(memory: Record, parameters: Record) -> None:
    """:func:`person.clear_person`."""
    person.clear_person(memory[()], parameters[()])


@jit
def take_in(
    scene: Record, u_last: np.ndarray, alpha_a: float, memory: Record, parameters: Record, seen: Record
) -> bool:
    """:func:`person.take_in`."""
    return person.take_in(scene[()], u_last, alpha_a, memory[()], parameters[()], seen[()])


@jit
def with_arm_noise(u_h_des: np.ndarray, memory: Record, parameters: Record) -> None:
    """:func:`person.with_arm_noise`."""
    person.with_arm_noise(u_h_des, memory[()], parameters[()])


@jit
def advance_arm(u_h_act: np.ndarray, u_h_des: np.ndarray, u_a_act: np.ndarray, parameters: Record) -> None:
    """:func:`driver_lag.advance_lag` of a driver's arm."""
    p = parameters[()]
    driver_lag.advance_lag(u_h_act, u_h_des, u_a_act, p.task.dt, p.lag)
