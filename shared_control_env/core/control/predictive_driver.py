"""The predictive driver in the kernel: the program of :mod:`control.driver`, solved by the active-set method."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from shared_control_env.core.compile.calls import Interface
from shared_control_env.core.compile.jit import jit_inlined
from shared_control_env.core.control.condensing import Workspace
from shared_control_env.core.control.driver import build_program, count_rows, count_variables
from shared_control_env.core.control.person import add_arm_noise, perceive_and_attend, response_time
from shared_control_env.core.control.qp import active_set
from shared_control_env.core.control.qp.active_set import MAX_ROWS, MAX_VARIABLES, SOLVED, solve_qp
from shared_control_env.core.parameters import Parameters
from shared_control_env.core.records import Memory, PersonMemory, Scene, Vector2, record_dtype


class Program:
    """The driver's quadratic program, its solution and its scratch memory.

    Attributes:
        active_set: scratch of the solver.
        P, q, A, low, high: the program, see :func:`control.driver.build_program`.
        x: solution of the program.
        multipliers: Lagrange multipliers of the rows of A.
        seen: the scene as a person perceives it.
        command: the driver's desired command ``[a, delta]`` [m/s^2, rad].
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
    command: Vector2


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
    scene: Scene,
    p: Parameters,
    memory: Memory,
    person: PersonMemory,
    work: Workspace,
    program: Program,
    report: DriverReport,
) -> None:
    """Compute the command of the predictive driver (Eq. 15) or of a person, and write it to ``program.command``.

    Hands at rest command nothing; the loop then takes u_a,act for u_h,des. If the solver fails, the last command is
    held and the failure is counted.

    Args:
        scene: record of :data:`records.SCENE`.
        p: parameters.
        memory: record of :data:`records.MEMORY`; ``resting`` is written, and failures are counted.
        person: record of :data:`records.PERSON_MEMORY`, updated if the driver is a person.
        work: record of :data:`condensing.WORKSPACE`.
        program: record of :data:`PROGRAM`, written.
        report: record of :data:`DRIVER_REPORT`, written.
    """
    report.K_h, report.T_h = p.lag.K_h, p.lag.T_h
    if not p.person.active:
        report.engaged, report.noticed, report.reason, report.response = True, np.inf, 0, 0.0
        _solve(scene, p, memory, work, program, report)
        return
    program.seen = scene
    if perceive_and_attend(scene, memory.u, person, p, program.seen):
        _solve(program.seen, p, memory, work, program, report)
        add_arm_noise(program.command, person, p)
    else:
        report.status, report.iterations, report.failures = SOLVED, 0, memory.driver_failures
        report.primal_residual, report.dual_residual = 0.0, 0.0
    memory.resting = not person.engaged
    report.engaged, report.noticed, report.reason = person.engaged, person.noticed, person.reason
    report.response = person.response


@jit_inlined
def _solve(
    scene: Scene, p: Parameters, memory: Memory, work: Workspace, program: Program, report: DriverReport
) -> None:
    """Build and solve the program for a scene as the driver perceives it; the arguments are those of :func:`drive`."""
    g = program
    build_program(scene, memory.u_h_des, memory.u_h_act, p, work, g.P, g.q, g.A, g.low, g.high)
    n, m = count_variables(p), count_rows(p)
    status, iterations, primal, dual = solve_qp(n, m, g.P, g.q, g.A, g.low, g.high, g.x, g.multipliers, g.active_set)
    if status == SOLVED and np.isfinite(g.x[0] + g.x[1]):
        g.command[0] = min(max(g.x[0], -1.0), 1.0) * p.limits.a_max
        g.command[1] = min(max(g.x[1], -1.0), 1.0) * p.limits.delta_max
    else:
        g.command[0], g.command[1] = memory.u_h_des[0], memory.u_h_des[1]
        memory.driver_failures += 1
    report.status, report.iterations = status, iterations
    report.primal_residual, report.dual_residual = primal, dual
    report.failures = memory.driver_failures


DRIVE = Interface(None, Scene, Parameters, Memory, PersonMemory, Workspace, Program, DriverReport)
"""``drive(scene, p, memory, person, work, program, report)``, compiled separately from the loop."""
