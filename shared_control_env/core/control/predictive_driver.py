"""The predictive driver in the kernel: the program of :mod:`control.driver`, solved by the active-set method."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numba import types

from shared_control_env.core.compile.calls import Interface, array_of
from shared_control_env.core.compile.jit import jit_inlined
from shared_control_env.core.control.block import empty, gather
from shared_control_env.core.control.driver import (
    Drivers,
    condense,
    count_rows,
    count_variables,
    enter,
    program_of,
)
from shared_control_env.core.control.person import add_arm_noise, perceive_and_attend, response_time
from shared_control_env.core.control.qp import active_set
from shared_control_env.core.control.qp.active_set import MAX_ROWS, MAX_VARIABLES, SOLVED, solve_qp
from shared_control_env.core.parameters import Parameters
from shared_control_env.core.records import Memory, PersonMemory, Scene, record_dtype


class Program:
    """The driver's quadratic program, its solution and its scratch memory.

    Attributes:
        active_set: scratch of the solver.
        P, q, A, low, high: the program, see :func:`control.driver.program_of`.
        x: solution of the program.
        multipliers: Lagrange multipliers of the rows of A.
        seen: the scene as a person perceives it.
        drivers: the problems of a block of environments.
    """

    active_set: active_set.Workspace
    P: Annotated[np.ndarray, (MAX_VARIABLES, MAX_VARIABLES)]
    q: Annotated[np.ndarray, (MAX_VARIABLES,)]
    A: Annotated[np.ndarray, (MAX_ROWS, MAX_VARIABLES)]
    low: Annotated[np.ndarray, (MAX_ROWS,)]
    high: Annotated[np.ndarray, (MAX_ROWS,)]
    x: Annotated[np.ndarray, (MAX_VARIABLES,)]
    multipliers: Annotated[np.ndarray, (MAX_ROWS,)]
    seen: Scene
    drivers: Drivers


PROGRAM = record_dtype(Program)


class DriverReport:
    """Outcome of the driver's solver and state of the person, reported as ``info["driver"]``.

    Attributes:
        status: active_set.SOLVED, ITERATION_LIMIT or FAILED.
        iterations: number of rows added to and dropped from the active set.
        primal_residual, dual_residual: residuals of the solution.
        failures: number of steps so far at which the solver failed, so that the last command was held.
        engaged: whether the person drives; if not, the hands rest.
        noticed: time at which a person with resting hands noticed something [s]; infinite before.
        reason: what the person noticed, index in person.REASONS.
        response: time from noticing to acting of the person with resting hands [s]; 0 for other drivers.
        K_h, T_h: gain [-] and time constant [s] of the driver's arm.
    """

    status: int
    iterations: int
    primal_residual: float
    dual_residual: float
    failures: int
    engaged: bool
    noticed: float
    reason: int
    response: float
    K_h: float
    T_h: float


DRIVER_REPORT = record_dtype(DriverReport)


@jit_inlined
def clear_report(p: Parameters, report: DriverReport) -> None:
    """Reset the driver's report at the start of an episode.

    Args:
        p: parameters.
        report: record of :data:`DRIVER_REPORT`, overwritten.
    """
    report.status, report.iterations, report.failures = 0, 0, 0
    report.primal_residual, report.dual_residual = 0.0, 0.0
    report.engaged, report.noticed, report.reason = not p.person.active or p.person.engaged, np.inf, 0
    report.response = response_time(p) if not report.engaged else 0.0
    report.K_h, report.T_h = p.lag.K_h, p.lag.T_h


def drive(
    members: np.ndarray,
    scenes: np.ndarray,
    parameters: np.ndarray,
    memories: np.ndarray,
    persons: np.ndarray,
    program: Program,
    reports: np.ndarray,
) -> None:
    """Compute the commands of predictive drivers (Eq. 15) or persons, and write them to ``program.drivers.command``.

    Hands at rest command nothing; the loop then takes u_a,act for u_h,des. If the solver fails, the last command is
    held and the failure is counted.

    Args:
        members: indices of the environments, shape (n,) with n at most WIDTH.
        scenes: records of :data:`records.SCENE`, shape (N,).
        parameters: records of :class:`Parameters`, shape (N,).
        memories: records of :data:`records.MEMORY`; ``resting`` is written, and failures are counted, shape (N,).
        persons: records of :data:`records.PERSON_MEMORY`, updated where the driver is a person, shape (N,).
        program: record of :data:`PROGRAM`, written.
        reports: records of :data:`DRIVER_REPORT`, written, shape (N,).
    """
    drivers = program.drivers
    empty(drivers.block)
    for lane in range(members.shape[0]):
        i = members[lane]
        p, memory, report = parameters[i], memories[i], reports[i]
        report.K_h, report.T_h = p.lag.K_h, p.lag.T_h
        if not p.person.active:
            report.engaged, report.noticed, report.reason, report.response = True, np.inf, 0, 0.0
            enter(lane, i, scenes[i], memory.u_h_des, memory.u_h_act, p, drivers)
            continue
        person = persons[i]
        program.seen = scenes[i]
        if perceive_and_attend(scenes[i], memory.u, person, p, program.seen):
            enter(lane, i, program.seen, memory.u_h_des, memory.u_h_act, p, drivers)
        else:
            report.status, report.iterations, report.failures = SOLVED, 0, memory.driver_failures
            report.primal_residual, report.dual_residual = 0.0, 0.0
        memory.resting = not person.engaged
        report.engaged, report.noticed, report.reason = person.engaged, person.noticed, person.reason
        report.response = person.response
    while gather(drivers.block):
        condense(scenes, drivers)
        for lane in range(members.shape[0]):
            if drivers.block.entered[lane] > 0.0:
                i = members[lane]
                _solve(lane, parameters[i], memories[i], program, reports[i])
                if parameters[i].person.active:
                    add_arm_noise(drivers.command[lane], persons[i], parameters[i])


@jit_inlined
def _solve(lane: int, p: Parameters, memory: Memory, program: Program, report: DriverReport) -> None:
    """Solve the program of a lane, and write its command and its outcome."""
    g, command = program, program.drivers.command[lane]
    program_of(lane, p, g.drivers, g.P, g.q, g.A, g.low, g.high)
    n, m = count_variables(p), count_rows(p)
    status, iterations, primal, dual = solve_qp(n, m, g.P, g.q, g.A, g.low, g.high, g.x, g.multipliers, g.active_set)
    if status == SOLVED and np.isfinite(g.x[0] + g.x[1]):
        command[0] = min(max(g.x[0], -1.0), 1.0) * p.limits.a_max
        command[1] = min(max(g.x[1], -1.0), 1.0) * p.limits.delta_max
    else:
        command[0], command[1] = memory.u_h_des[0], memory.u_h_des[1]
        memory.driver_failures += 1
    report.status, report.iterations = status, iterations
    report.primal_residual, report.dual_residual = primal, dual
    report.failures = memory.driver_failures


DRIVE = Interface(
    None,
    types.Array(types.int64, 1, "C"),
    array_of(Scene),
    array_of(Parameters),
    array_of(Memory),
    array_of(PersonMemory),
    Program,
    array_of(DriverReport),
)
"""``drive(members, scenes, parameters, memories, persons, program, reports)``, compiled by itself."""
