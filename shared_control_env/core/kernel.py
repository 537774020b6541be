"""The kernel: the loop of many environments, each by itself, shared among threads. A single environment is one of one.

Where Python has to come in between (an automation of one's own, vehicles of highway-env's, more vehicles in the driving
region than the compiled triangulation takes), the same calls of the loop are made one after the other:
:func:`respond`, :func:`look`, :func:`judge`, :func:`finish`.
"""

from __future__ import annotations

import numpy as np

from shared_control_env.core.authority.allocators import ALLOCATE
from shared_control_env.core.batch import Batch, Environment, Outputs, Setup, Work, environment
from shared_control_env.core.compile.atomics import fetch_add
from shared_control_env.core.compile.jit import jit, jit_inlined
from shared_control_env.core.control.automation import clear_automation
from shared_control_env.core.control.predictive_driver import DRIVE, DriverReport, Program, clear_report
from shared_control_env.core.faults.command import clear_faults
from shared_control_env.core.feedback.info import note_outcome, note_signals
from shared_control_env.core.feedback.observation import observe
from shared_control_env.core.loop import (
    act,
    clear_memory,
    clear_signals,
    clear_transition,
    decide_automation,
    degrade_command,
    depart,
    evaluate,
    is_on_road,
    move,
    plan,
    see,
)
from shared_control_env.core.risk.assessment import assess
from shared_control_env.core.risk.corridor import Scratch, search_triangles
from shared_control_env.core.risk.finding import find_area
from shared_control_env.core.risk.triangulation import MAX_HOLES
from shared_control_env.core.world.scene import holes_in_region, perceive

allocate, drive = ALLOCATE.call, DRIVE.call

TAKEN_AT_ONCE = 4
"""Environments that a thread takes at a time: few, so that one that is held up leaves the others no long wait."""


@jit_inlined
def fill_slots(
    i: int,
    commands: np.ndarray,
    alphas: np.ndarray,
    e: Environment,
    setup: Setup,
    work: Work,
    program: Program,
    report: DriverReport,
) -> float:
    """Bring both slots of the action together: the driver's command in ``work.command``, and alpha_a, returned.

    Args:
        i: the environment.
        commands: driver's commands over their limits, (N, 2); not read where a driver is bound.
        alphas: authorities, (N, 1); not read where an allocator is bound.
        e: environment i.
        setup: which slots are bound.
        work: scratch.
        program: record of :data:`predictive_driver.PROGRAM`; not read where no driver is bound.
        report: record of :data:`predictive_driver.DRIVER_REPORT`, written.
    """
    if setup.calls.drive != 0:
        drive(setup.calls.drive, e.scene, e.p, e.memory, e.person, work.condensing, program, report)
        work.command[0], work.command[1] = program.command[0], program.command[1]
    else:
        work.command[0] = min(max(commands[i, 0], -1.0), 1.0) * e.p.limits.a_max
        work.command[1] = min(max(commands[i, 1], -1.0), 1.0) * e.p.limits.delta_max
    alpha_a = alphas[i, 0]
    if setup.calls.allocate != 0:
        alpha_a = allocate(setup.calls.allocate, e.scene, e.signals, e.p)
    return min(max(alpha_a, 0.0), 1.0)


@jit
def copy_rows(source: np.ndarray, target: np.ndarray) -> None:
    """Copy an array of rows into another.

    Args:
        source: shape (n, m).
        target: of the same shape, overwritten.
    """
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@jit_inlined
def begin(i: int, batch: Batch, setup: Setup, out: Outputs) -> None:
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
    batch.ended[i] = False
    batch.scenes[i].felt[0] = batch.scenes[i].felt[1] = 0.0
    batch.scenes[i].displayed = 1.0
    clear_faults(batch.fault_memories[i])
    clear_memory(batch.memories[i])
    clear_automation(batch.automations[i])
    clear_signals(batch.signals[i])
    clear_transition(batch.transitions[i], True)
    clear_report(batch.parameters[i].person.engaged, out.drivers[i])


@jit_inlined
def note(i: int, e: Environment, out: Outputs) -> None:
    """Info of the signals of environment i's present time step."""
    note_signals(e.scene, e.signals, e.faults, e.automation.failures, out.infos[i])


@jit_inlined
def conclude(i: int, resetting: bool, e: Environment, setup: Setup, out: Outputs) -> None:
    """What a step, or a reset, gives: reward, ends, info and observation."""
    if resetting:
        note(i, e, out)
        clear_transition(e.transition, is_on_road(e.scene, e.p))
        out.rewards[i] = 0.0
        out.terminations[i] = out.truncations[i] = False
    else:
        out.rewards[i], out.terminations[i], out.truncations[i] = evaluate(e, setup.steps)
    note_outcome(e.scene.z[3], e.transition, e.memory, out.infos[i])
    observe(setup.calls.observe, setup.scales, e.scene, e.memory, e.line, e.p, out.observations[i])


@jit_inlined
def advance_one(
    i: int,
    resetting: bool,
    commands: np.ndarray,
    alphas: np.ndarray,
    batch: Batch,
    setup: Setup,
    out: Outputs,
    work: Work,
    program: Program,
) -> None:
    """Step environment i, or begin its next episode; arguments as those of :func:`advance`."""
    e = environment(i, batch)
    k = 0
    if resetting:
        begin(i, batch, setup, out)
    else:
        k = e.scene.k + 1
        depart(e)
        alpha_a = fill_slots(i, commands, alphas, e, setup, work, program, out.drivers[i])
        act(work.command, alpha_a, e)
        note(i, e, out)
        move(e, setup, work)
    plan(k, e, setup.calls, work)
    conclude(i, resetting, e, setup, out)


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
    work: Work,
    program: Program,
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
        works: records of :data:`batch.WORK`, one a thread.
        programs: records of :data:`predictive_driver.PROGRAM`, one a thread.
        thread: which of them is ours.
    """
    work, program = works[thread], programs[thread]
    n, shares = active.shape[0], taken.shape[0]
    for turn in range(shares):
        share = (thread + turn) % shares
        begin_at, end_at = share * n // shares, (share + 1) * n // shares
        first = begin_at + fetch_add(taken, share, TAKEN_AT_ONCE)
        while first < end_at:
            for i in range(first, min(first + TAKEN_AT_ONCE, end_at)):
                if active[i]:
                    advance_through(i, steps, anew, commands, alphas, batch, setup, out, rewards, ends, work, program)
            first = begin_at + fetch_add(taken, share, TAKEN_AT_ONCE)


@jit
def respond(
    commands: np.ndarray,
    alphas: np.ndarray,
    batch: Batch,
    setup: Setup,
    out: Outputs,
    works: np.ndarray,
    programs: np.ndarray,
) -> None:
    """The second half of environment 0's time step, without the motion; arguments as those of :func:`advance`."""
    e = environment(0, batch)
    depart(e)
    alpha_a = fill_slots(0, commands, alphas, e, setup, works[0], programs[0], out.drivers[0])
    act(works[0].command, alpha_a, e)
    note(0, e, out)


@jit
def look(
    k: int, resetting: bool, batch: Batch, setup: Setup, out: Outputs, works: np.ndarray, corners: np.ndarray
) -> int:
    """Perceive environment 0's scene at time step k, its safe area too unless there are too many vehicles in the way.

    Args:
        k: time step.
        resetting: whether an episode begins.
        batch, setup, out, works: as those of :func:`advance`.
        corners: written, of the vehicles in the driving region, (M, 4, 2).

    Returns:
        How many vehicles are in the driving region; beyond MAX_HOLES the safe area is for :func:`search_among`.
    """
    if resetting:
        begin(0, batch, setup, out)
    e, finding = environment(0, batch), works[0].finding
    perceive(k, e.state, e.traffic, e.line, e.p, e.scene)
    count = holes_in_region(e.traffic, e.line, e.scene.region, corners)
    if count <= MAX_HOLES:
        for j in range(count):
            copy_rows(corners[j], finding.corners[j])
        find_area(count, e.scene, e.p, setup.calls.triangulate, setup.calls.search, finding)
    return count


@jit
def search_among(triangles: np.ndarray, batch: Batch, works: np.ndarray, scratch: Scratch) -> None:
    """Safe area of environment 0 through any number of triangles, which :func:`triangulation.triangulate_any` gives.

    Args:
        triangles: shape (n, 3, 2).
        batch, works: as those of :func:`advance`.
        scratch: for as many triangles.
    """
    e = environment(0, batch)
    region = e.scene.region
    search_triangles(triangles, region[0], region[1], e.scene.z[1], e.p.vehicle.width, scratch, e.scene.area)


@jit
def show_automation(batch: Batch, works: np.ndarray) -> None:
    """Environment 0's scene as its automation sees it, left in ``works[0].automation_view``."""
    works[0].automation_view = see(environment(0, batch), works[0])


@jit
def judge(automated: bool, batch: Batch, setup: Setup, works: np.ndarray) -> None:
    """Let environment 0's automation decide, unless another has; then the fault and the risk.

    Args:
        automated: whether u_a,des is in the signals already.
        batch, setup, works: as those of :func:`advance`.
    """
    e = environment(0, batch)
    if not automated:
        decide_automation(see(e, works[0]), e, setup.calls, works[0])
    degrade_command(e)
    assess(e.scene, e.traffic, e.line, e.p, e.signals)


@jit
def finish(resetting: bool, batch: Batch, setup: Setup, out: Outputs) -> None:
    """What environment 0's step, or reset, gives; arguments as those of :func:`look`."""
    conclude(0, resetting, environment(0, batch), setup, out)
