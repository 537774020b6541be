"""The kernel that steps many environments, composed of the core's functions that the single one calls."""

from __future__ import annotations

import numpy as np

from shared_control_env.core import closed_loop, fuzzy
from shared_control_env.core.collision import overlap
from shared_control_env.core.degradation import ACTUATOR
from shared_control_env.core.dynamics import plant_step
from shared_control_env.core.info import note_outcome, note_signals
from shared_control_env.core.jit import jit, jit_inlined
from shared_control_env.core.observation import observe
from shared_control_env.core.parameters import Parameters
from shared_control_env.core.records import BODY_LENGTH, BODY_WIDTH, HEADING, SPEED, Record, X, Y
from shared_control_env.core.safe_area import is_whole, whole_region
from shared_control_env.core.scene import holes_in_region, perceive
from shared_control_env.core.traffic import decide_acceleration, move
from shared_control_env.vector import solvers
from shared_control_env.vector.intrinsics import fetch_add
from shared_control_env.vector.records import Batch, Outputs, Setup

automate, drive = solvers.AUTOMATE.call, solvers.DRIVE.call
triangulate, search = solvers.TRIANGULATE.call, solvers.SEARCH.call
"""Calls of the solvers, at their addresses in :class:`Setup`."""

TAKEN_AT_ONCE = 4
"""Environments that a thread takes at a time: few, so that one that is held up leaves the others no long wait."""


@jit_inlined
def find_area(scene: Record, traffic: np.ndarray, line: np.ndarray, p: Parameters, setup: Setup, work: Record) -> None:
    """Safe area of a scene, as :func:`single.find_area`."""
    count = holes_in_region(traffic, line, scene.region, work.corners)
    if is_whole(count, scene.region, p.vehicle.width):
        whole_region(scene.region, scene.area)
        return
    n = triangulate(setup.solvers.triangulate, scene, count, work)
    search(setup.solvers.search, scene, p, n, work)


@jit_inlined
def perceive_and_plan(i: int, k: int, batch: Batch, setup: Setup, work: Record) -> None:
    """Perceive environment i's scene at time step k, let the automation decide, degrade it, assess the risk."""
    p, scene, signals = batch.parameters[i], batch.scenes[i], batch.signals[i]
    line, faults = batch.lines[i], batch.faults[i]
    perceive(k, batch.states[i], batch.traffic[i], line, p, scene)
    find_area(scene, batch.traffic[i], line, p, setup, work)
    automation = batch.automations[i]
    y, v_target = closed_loop.misjudge(scene, faults, p, signals)
    status, iterations, residual = automate(setup.solvers.automate, scene, p, automation, work.solver)
    closed_loop.judge_rightly(scene, y, v_target)
    signals.status, signals.iterations, signals.residual = status, iterations, residual
    signals.u_a_des[0], signals.u_a_des[1] = automation.u_a_des[0], automation.u_a_des[1]
    closed_loop.monitor(scene, batch.traffic[i], line, faults, batch.fault_memories[i], p, signals)


@jit_inlined
def decide(
    i: int,
    commands: np.ndarray,
    alphas: np.ndarray,
    batch: Batch,
    setup: Setup,
    work: Record,
    program: Record,
    report: Record,
) -> float:
    """Bring both slots of the action together: the driver's command in ``work.command``, and alpha_a, returned.

    Args:
        i: the environment.
        commands: driver's commands over their limits, (N, 2); not read where the driver is bound.
        alphas: authorities, (N, 1); not read where the limiter is bound.
        batch, setup, work: see their types.
        program: record of :data:`records.PROGRAM`; not read where the driver is not bound.
        report: record of :data:`records.SOLVER`, written.
    """
    p, scene, memory = batch.parameters[i], batch.scenes[i], batch.memories[i]
    if setup.driver:
        drive(setup.solvers.drive, scene, p, memory, batch.persons[i], work, program, report)
    else:
        work.command[0] = min(max(commands[i, 0], -1.0), 1.0) * p.limits.a_max
        work.command[1] = min(max(commands[i, 1], -1.0), 1.0) * p.limits.delta_max
    if setup.limiter:
        return fuzzy.authority(batch.signals[i].r_x, batch.signals[i].r_y, p.authority.operators)
    return min(max(alphas[i, 0], 0.0), 1.0)


@jit_inlined
def simulate(i: int, batch: Batch, setup: Setup, work: Record) -> None:
    """Move environment i's vehicles through one decision's simulation steps and check the ego's collisions."""
    p, u, state, traffic, row = batch.parameters[i], batch.signals[i].u, batch.states[i], batch.traffic[i], work.row
    line, plans = batch.lines[i], batch.plans[i]
    row[BODY_LENGTH], row[BODY_WIDTH] = p.vehicle.length, p.vehicle.width
    for frame in range(setup.frames):
        t = (batch.scenes[i].k * setup.frames + frame) * setup.dt
        row[X], row[Y], row[SPEED] = state[0], state[1], state[3]
        for j in range(traffic.shape[0]):
            decide_acceleration(traffic[j], plans[j], t, row, traffic, line, p.task.lane_width)
        plant_step(state, u[0], u[1], setup.dt, p.vehicle, work.plant)
        row[X], row[Y], row[HEADING] = state[0], state[1], state[2]
        for j in range(traffic.shape[0]):
            move(traffic[j], plans[j], line, t, setup.dt)
        for j in range(traffic.shape[0]):
            if overlap(row, traffic[j]):
                batch.crashed[i] = True


@jit_inlined
def apply(
    i: int,
    commands: np.ndarray,
    alphas: np.ndarray,
    batch: Batch,
    setup: Setup,
    out: Outputs,
    work: Record,
    program: Record,
) -> None:
    """First half of a decision of environment i: both slots, the loop's commands, the vehicles' motion."""
    scene, signals, memory = batch.scenes[i], batch.signals[i], batch.memories[i]
    alpha_a = decide(i, commands, alphas, batch, setup, work, program, out.solver[i])
    p = batch.parameters[i]
    if p.authority.fault_at == ACTUATOR:
        memories = batch.fault_memories[i]
        closed_loop.blend_degraded(work.command, alpha_a, p, batch.faults[i], memories, scene, memory, signals)
    else:
        closed_loop.blend(work.command, alpha_a, p, scene, memory, signals)
    note_signals(scene, signals, batch.faults[i], batch.automations[i].failures, out.infos[i])
    simulate(i, batch, setup, work)


@jit
def copy_rows(source: np.ndarray, target: np.ndarray) -> None:
    """Copy an array of rows into another of the same shape."""
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@jit_inlined
def restore(i: int, batch: Batch, setup: Setup, out: Outputs) -> None:
    """Begin an episode of environment i, whose drawn start is in the batch or whose fixed one is copied there."""
    starts = setup.starts
    if starts.parameters.shape[0] > 0:
        batch.parameters[i] = starts.parameters[0]
        copy_rows(starts.lines[0], batch.lines[i])
        copy_rows(starts.traffic[0], batch.traffic[i])
        for j in range(6):
            batch.states[i, j] = starts.states[0, j]
        for j in range(starts.faults.shape[1]):
            batch.faults[i, j] = starts.faults[0, j]
        for j in range(starts.plans.shape[1]):
            batch.plans[i, j] = starts.plans[0, j]
    closed_loop.clear_faults(batch.fault_memories[i])
    batch.scenes[i].felt[0] = batch.scenes[i].felt[1] = 0.0
    batch.crashed[i] = batch.ended[i] = False
    closed_loop.clear_memory(batch.memories[i])
    closed_loop.clear_automation(batch.automations[i])
    closed_loop.clear_signals(batch.signals[i])
    report = out.solver[i]
    report.status, report.iterations, report.failures = 0, 0, 0
    report.primal_residual, report.dual_residual = 0.0, 0.0
    report.engaged, report.noticed, report.reason = batch.parameters[i].person.engaged, np.inf, 0


@jit_inlined
def note_start(i: int, batch: Batch, setup: Setup, out: Outputs, work: Record) -> None:
    """Info of a reset: the signals planned for k = 0, and nothing that came of them yet."""
    scene, info = batch.scenes[i], out.infos[i]
    note_signals(scene, batch.signals[i], batch.faults[i], batch.automations[i].failures, info)
    for n in range(work.terms.shape[0]):
        work.terms[n] = 0.0
    on_road = closed_loop.is_on_road(scene, batch.parameters[i])
    note_outcome(batch.states[i, 3], False, on_road, batch.memories[i], work.terms, info)
    out.rewards[i] = 0.0
    out.terminations[i] = out.truncations[i] = False


@jit_inlined
def advance_one(
    i: int,
    resetting: bool,
    commands: np.ndarray,
    alphas: np.ndarray,
    batch: Batch,
    setup: Setup,
    out: Outputs,
    work: Record,
    program: Record,
) -> None:
    """Step environment i, or begin its next episode; the order is that of :class:`SharedControlEnv`."""
    scene, signals, memory, p = batch.scenes[i], batch.signals[i], batch.memories[i], batch.parameters[i]
    previous_s, last_a = scene.z[0], memory.u[0]
    if resetting:
        restore(i, batch, setup, out)
        scene.k = -1
    else:
        apply(i, commands, alphas, batch, setup, out, work, program)
    perceive_and_plan(i, scene.k + 1, batch, setup, work)
    if resetting:
        note_start(i, batch, setup, out, work)
    else:
        out.rewards[i], out.terminations[i], out.truncations[i] = closed_loop.conclude(
            previous_s, last_a, batch.crashed[i], scene, signals, p, memory, work.terms, out.infos[i], setup.steps
        )
    observe(scene, memory, batch.lines[i], p, out.observations[i])


@jit_inlined
def advance_through(
    i: int,
    steps: int,
    anew: bool,
    commands: np.ndarray,
    alphas: np.ndarray,
    batch: Batch,
    setup: Setup,
    out: Outputs,
    rewards: np.ndarray,
    ends: np.ndarray,
    work: Record,
    program: Record,
) -> None:
    """Advance environment i by some steps in a row; arguments as those of :func:`advance`."""
    for k in range(steps):
        resetting = batch.ended[i]
        if resetting and not anew:
            break
        advance_one(i, resetting, commands, alphas, batch, setup, out, work, program)
        rewards[k, i] = out.rewards[i]
        ends[k, i] = batch.ended[i] = out.terminations[i] or out.truncations[i]


@jit
def advance(
    taken: np.ndarray,
    steps: int,
    active: np.ndarray,
    anew: bool,
    commands: np.ndarray,
    alphas: np.ndarray,
    batch: Batch,
    setup: Setup,
    out: Outputs,
    rewards: np.ndarray,
    ends: np.ndarray,
    works: np.ndarray,
    programs: np.ndarray,
    thread: int,
) -> None:
    """Advance the environments, each by some steps in a row.

    As many threads as there are shares of the environments call it; each first takes those of its own share, which
    its core's cache may hold from the step before, then helps with the other shares.

    Args:
        taken: environments of each share that threads have taken so far, (threads,).
        steps: how many time steps; the actions are held or bound.
        active: environments that are advanced at all, (N,).
        anew: whether an environment whose episode has ended begins the next in a step; if not, it stands still.
        commands: driver's commands over their limits, (N, 2).
        alphas: authorities, (N, 1).
        batch, setup: see their types.
        out: of the last step.
        rewards: of every step, written, (steps, N).
        ends: whether an episode ended at each step, written, (steps, N).
        works: records of :data:`records.WORKSPACE`, one a thread.
        programs: records of :data:`records.PROGRAM`, one a thread; not read where the driver is not bound.
        thread: which of them is ours.
    """
    work, program = works[thread], programs[thread]
    n, shares = active.shape[0], taken.shape[0]
    for turn in range(shares):
        share = (thread + turn) % shares
        begin, end = share * n // shares, (share + 1) * n // shares
        first = begin + fetch_add(taken, share, TAKEN_AT_ONCE)
        while first < end:
            for i in range(first, min(first + TAKEN_AT_ONCE, end)):
                if active[i]:
                    advance_through(i, steps, anew, commands, alphas, batch, setup, out, rewards, ends, work, program)
            first = begin + fetch_add(taken, share, TAKEN_AT_ONCE)
