"""The kernel: runs the loop of many independent environments, which several threads share among them.

A single environment is a batch of size one. :func:`advance` makes whole time steps in compiled code. Some steps need
Python in between: those with a user-defined automation, with highway-env's own vehicles, with more than MAX_HOLES
other vehicles, or while every simulation step is recorded. For these, Python calls the parts of a step one after the
other: :func:`respond`, :func:`show`, :func:`search_among`, :func:`show_automation`, :func:`decide`, :func:`finish`.
"""

from __future__ import annotations

import numpy as np

from shared_control_env.core.authority.allocators import ALLOCATE, Situation
from shared_control_env.core.batch import Batch, Environment, Outputs, Setup, Work, environment
from shared_control_env.core.compile.atomics import fetch_add
from shared_control_env.core.compile.jit import jit, jit_inlined
from shared_control_env.core.compile.lanes import WIDTH
from shared_control_env.core.control.automation import AUTOMATE, clear_automation, enter, leave
from shared_control_env.core.control.block import empty
from shared_control_env.core.control.predictive_driver import DRIVE, Program, clear_report
from shared_control_env.core.faults.command import clear_faults
from shared_control_env.core.feedback.info import note_outcome, note_signals
from shared_control_env.core.feedback.observation import observe
from shared_control_env.core.loop import (
    act,
    clear_memory,
    clear_signals,
    clear_transition,
    depart,
    evaluate,
    is_on_road,
    judge,
    look,
    move,
    see,
)
from shared_control_env.core.parameters import Parameters
from shared_control_env.core.risk.corridor import Scratch, search_triangles
from shared_control_env.core.risk.finding import find_area
from shared_control_env.core.risk.triangulation import MAX_HOLES
from shared_control_env.core.world.scene import holes_in_region, perceive

allocate, automate, drive = ALLOCATE.call, AUTOMATE.call, DRIVE.call


@jit_inlined
def let_drive(
    i: int, lane: int, commands: np.ndarray, p: Parameters, setup: Setup, work: Work, program: Program
) -> None:
    """Fill the driver's slot of a step, from the bound driver or from the action.

    Args:
        i: index of the environment.
        lane: lane of the bound driver.
        commands: the driver's commands divided by their limits [-], shape (N, 2); ignored where a driver is bound.
        p: parameters of the environment.
        setup: what all environments share; its calls say whether a driver is bound.
        work: scratch; ``work.command`` receives the driver's desired command [m/s^2, rad].
        program: record of :data:`predictive_driver.PROGRAM`, solved where a driver is bound.
    """
    if setup.calls.drive != 0:
        command = program.drivers.command[lane]
        work.command[0], work.command[1] = command[0], command[1]
    else:
        work.command[0] = min(max(commands[i, 0], -1.0), 1.0) * p.limits.a_max
        work.command[1] = min(max(commands[i, 1], -1.0), 1.0) * p.limits.delta_max


@jit_inlined
def let_allocate(i: int, alphas: np.ndarray, e: Environment, setup: Setup, work: Work) -> None:
    """Fill the allocator's slot of a step, from the compiled allocator or from the action.

    Args:
        i: index of the environment.
        alphas: authorities of the automation over each channel [-], NaN where the compiled allocator decides,
            shape (N, 2).
        e: environment i; ``signals.alpha``, clipped to [0, 1], and an allocator's ``signals.alert`` are written.
        setup: what all environments share; its calls hold the allocator's address.
        work: scratch.
    """
    over_a, over_delta = alphas[i, 0], alphas[i, 1]
    if setup.calls.allocate != 0 and np.isnan(over_a):
        situation = Situation(
            e.scene,
            e.signals,
            e.memory,
            e.p,
            e.traffic,
            e.line,
            work.trial,
            work.motion,
            setup.calls.assess,
        )
        over_a, over_delta, e.signals.alert = allocate(setup.calls.allocate, situation)
    e.signals.alpha[0], e.signals.alpha[1] = min(max(over_a, 0.0), 1.0), min(max(over_delta, 0.0), 1.0)


@jit_inlined
def ask_drivers(count: int, batch: Batch, setup: Setup, out: Outputs, work: Work, program: Program) -> None:
    """Let the bound driver, if there is one, decide in the environments ``work.driving``.

    Args:
        count: number of these environments.
        batch: state of all environments.
        setup: what all environments share.
        out: outputs of all environments; the reports of these drivers are written.
        work: scratch.
        program: record of :data:`predictive_driver.PROGRAM`, written.
    """
    if setup.calls.drive != 0 and count > 0:
        drive(
            setup.calls.drive,
            work.driving[:count],
            batch.scenes,
            batch.parameters,
            batch.memories,
            batch.persons,
            program,
            out.drivers,
        )


@jit
def copy_rows(source: np.ndarray, target: np.ndarray) -> None:
    """Copy a two-dimensional array into another.

    Args:
        source: array to copy, shape (n, m).
        target: array of the same shape, overwritten.
    """
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@jit_inlined
def begin(i: int, batch: Batch, setup: Setup, out: Outputs) -> None:
    """Begin an episode of environment i: set its start and clear all that the last episode left.

    A fixed start is copied from ``setup.starts`` into the batch. Where starts are drawn at random, ``setup.starts``
    is empty and the batch already holds the start.

    Args:
        i: index of the environment.
        batch: state of all environments; entry i is written.
        setup: what all environments share.
        out: outputs of all environments; the driver's report of environment i is cleared.
    """
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
    batch.scenes[i].displayed, batch.scenes[i].alert = 1.0, 0
    clear_faults(batch.fault_memories[i])
    clear_memory(batch.memories[i])
    clear_automation(batch.automations[i])
    clear_signals(batch.signals[i])
    clear_transition(batch.transitions[i])
    clear_report(batch.parameters[i], out.drivers[i])


@jit_inlined
def note(i: int, e: Environment, out: Outputs) -> None:
    """Copy the signals of the present time step of environment i to its info.

    Args:
        i: index of the environment.
        e: environment i.
        out: outputs of all environments; the info of environment i is written up to ``automation``.
    """
    note_signals(e.scene, e.signals, e.faults, e.automation.failures, out.infos[i])


@jit_inlined
def write_outputs(i: int, resetting: bool, e: Environment, setup: Setup, out: Outputs) -> None:
    """Write the outputs of a step or of a reset: reward, end of the episode, info and observation.

    Args:
        i: index of the environment.
        resetting: whether an episode has just begun; the reward is then 0 and no end is reported.
        e: environment i.
        setup: what all environments share.
        out: outputs of all environments; the entries of environment i are written.
    """
    if resetting:
        note(i, e, out)
        e.transition.on_road = is_on_road(e.scene)
        out.rewards[i] = 0.0
        out.terminations[i] = out.truncations[i] = False
    else:
        out.rewards[i], out.terminations[i], out.truncations[i] = evaluate(e, setup.steps)
    note_outcome(e.scene.z[3], e.transition, e.memory, out.infos[i])
    observe(setup.calls.observe, setup.scales, e.scene, e.memory, e.line, e.p, out.observations[i])


@jit_inlined
def choose_members(
    first: int, last: int, active: np.ndarray, autoreset: bool, batch: Batch, work: Work
) -> tuple[int, int]:
    """Find the environments of a block that make a step, ``work.members``, and those that drive in it.

    Args:
        first, last: indices of the first environment of the block and of the one after its last.
        active: whether each environment is advanced, shape (N,).
        autoreset: whether an environment whose episode has ended begins the next one in this step.
        batch: state of all environments.
        work: scratch; ``members`` and ``driving`` are written.

    Returns:
        Numbers of members and of drivers.
    """
    count = driving = 0
    for i in range(first, last):
        if active[i] and (autoreset or not batch.ended[i]):
            work.members[count] = i
            count += 1
            if not batch.ended[i]:
                work.driving[driving] = i
                driving += 1
    return count, driving


@jit_inlined
def advance_block(
    count: int,
    driving: int,
    commands: np.ndarray,
    alphas: np.ndarray,
    batch: Batch,
    setup: Setup,
    out: Outputs,
    work: Work,
    program: Program,
) -> None:
    """Advance the environments ``work.members`` by one time step; those whose episode has ended begin their next one.

    Args:
        count: number of members.
        driving: number of those that do not begin an episode, ``work.driving``.
        commands: the driver's commands divided by their limits [-], shape (N, 2).
        alphas: authorities of the automation over each channel [-], shape (N, 2).
        batch: state of all environments; the entries of the members are written.
        setup: what all environments share.
        out: outputs of all environments; the entries of the members are written.
        work: scratch of this thread, record of :data:`batch.WORK`.
        program: record of :data:`predictive_driver.PROGRAM` of this thread.
    """
    ask_drivers(driving, batch, setup, out, work, program)
    empty(work.automations.block)
    driver = 0
    for lane in range(count):
        i = work.members[lane]
        e = environment(i, batch)
        k = 0
        if batch.ended[i]:
            begin(i, batch, setup, out)
        else:
            k = e.scene.k + 1
            depart(e)
            let_drive(i, driver, commands, e.p, setup, work, program)
            driver += 1
            let_allocate(i, alphas, e, setup, work)
            act(work.command, e)
            note(i, e, out)
            move(e, setup, work)
        look(k, lane, i, e, setup.calls, work)
    automate(setup.calls.automate, batch.scenes, batch.parameters, work.automations)
    for lane in range(count):
        i = work.members[lane]
        e = environment(i, batch)
        leave(lane, work.automations, e.automation, e.signals)
        judge(e, setup.calls, work)
        write_outputs(i, e.scene.k == 0, e, setup, out)


@jit
def advance(
    taken: np.ndarray,
    steps: int,
    active: np.ndarray,
    autoreset: bool,
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
    """Advance all active environments, each by several consecutive time steps; every thread makes this call.

    The environments are divided into as many shares as there are threads. Each thread first takes the environments of
    its own share, a block at a time, since the cache of its core may still hold them from the previous step. Then it
    helps with the other shares.

    Args:
        taken: number of environments of each share that threads have taken so far, shared by them, shape (threads,).
        steps: number of time steps; actions that are not bound are held over them.
        active: whether each environment is advanced, shape (N,).
        autoreset: whether an environment whose episode has ended uses a step to begin the next one; if False, the
            environment stops.
        commands: the driver's commands divided by their limits [-], shape (N, 2).
        alphas: authorities of the automation over each channel [-], shape (N, 2).
        batch: state of all environments, see :class:`batch.Batch`.
        setup: what all environments share, see :class:`batch.Setup`.
        out: outputs of each environment's last step, written, see :class:`batch.Outputs`.
        rewards: reward of every step, written, shape (steps, N).
        ends: whether the episode ended at each step, written, shape (steps, N).
        works: records of :data:`batch.WORK`, one per thread.
        programs: records of :data:`predictive_driver.PROGRAM`, one per thread.
        thread: index of this thread.
    """
    work, program = works[thread], programs[thread]
    n, shares = active.shape[0], taken.shape[0]
    for turn in range(shares):
        share = (thread + turn) % shares
        begin_at, end_at = share * n // shares, (share + 1) * n // shares
        first = begin_at + fetch_add(taken, share, WIDTH)
        while first < end_at:
            for k in range(steps):
                last = min(first + WIDTH, end_at)
                count, driving = choose_members(first, last, active, autoreset, batch, work)
                if count == 0:
                    break
                advance_block(count, driving, commands, alphas, batch, setup, out, work, program)
                for member in range(count):
                    i = work.members[member]
                    rewards[k, i] = out.rewards[i]
                    ends[k, i] = batch.ended[i] = out.terminations[i] or out.truncations[i]
            first = begin_at + fetch_add(taken, share, WIDTH)


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
    """Run the second half of environment 0's time step without moving the vehicles.

    Args:
        commands: the driver's commands divided by their limits [-], shape (N, 2).
        alphas: authorities of the automation over each channel [-], shape (N, 2).
        batch: state of all environments; entry 0 is written.
        setup: what all environments share.
        out: outputs of all environments; info and driver's report of environment 0 are written.
        works: records of :data:`batch.WORK`; the first is used.
        programs: records of :data:`predictive_driver.PROGRAM`; the first is used.
    """
    e, work = environment(0, batch), works[0]
    depart(e)
    work.driving[0] = 0
    ask_drivers(1, batch, setup, out, work, programs[0])
    let_drive(0, 0, commands, e.p, setup, work, programs[0])
    let_allocate(0, alphas, e, setup, work)
    act(work.command, e)
    note(0, e, out)


@jit
def show(
    k: int, resetting: bool, batch: Batch, setup: Setup, out: Outputs, works: np.ndarray, corners: np.ndarray
) -> int:
    """Perceive environment 0's scene at time step k, and find its safe area unless too many vehicles are in the region.

    Args:
        k: time step.
        resetting: whether an episode begins.
        batch: state of all environments; entry 0 is written.
        setup: what all environments share.
        out: outputs of all environments; the driver's report of environment 0 is cleared where an episode begins.
        works: records of :data:`batch.WORK`; the first is used.
        corners: corners (s, d) [m] of the vehicles in the driving region, written, shape (M, 4, 2).

    Returns:
        Number of vehicles in the driving region. With more than MAX_HOLES the safe area is not found here; the caller
        then uses :func:`search_among`.
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
def search_among(triangles: np.ndarray, batch: Batch, scratch: Scratch) -> None:
    """Find the safe area of environment 0 from any number of triangles.

    Args:
        triangles: triangles of :func:`triangulation.triangulate_any`, vertices (s, d) [m], shape (n, 3, 2).
        batch: state of all environments; the safe area of environment 0 is written.
        scratch: scratch for at least n triangles.
    """
    e = environment(0, batch)
    region = e.scene.region
    search_triangles(triangles, region[0], region[1], e.scene.z[1], e.p.vehicle.width, scratch, e.scene.area)


@jit
def show_automation(batch: Batch, works: np.ndarray) -> None:
    """Write environment 0's scene, as its automation perceives it, to ``works[0].automation_view``.

    Args:
        batch: state of all environments.
        works: records of :data:`batch.WORK`; the first is written.
    """
    works[0].automation_view = see(environment(0, batch), works[0])


@jit
def decide(automated: bool, batch: Batch, setup: Setup, works: np.ndarray) -> None:
    """Complete the first half of environment 0's time step: the automation's decision, the fault and the risk.

    Args:
        automated: whether the signals already hold u_a,des of a user-defined automation; the built-in one is then
            skipped.
        batch: state of all environments; the signals of environment 0 are written.
        setup: what all environments share.
        works: records of :data:`batch.WORK`; the first is used.
    """
    e, work = environment(0, batch), works[0]
    if not automated:
        empty(work.automations.block)
        enter(0, 0, see(e, work), e.p, e.automation.U, work.automations)
        automate(setup.calls.automate, batch.scenes, batch.parameters, work.automations)
        leave(0, work.automations, e.automation, e.signals)
    judge(e, setup.calls, work)


@jit
def finish(resetting: bool, batch: Batch, setup: Setup, out: Outputs) -> None:
    """Write the outputs of environment 0's step or reset.

    Args:
        resetting: whether an episode has just begun.
        batch: state of all environments.
        setup: what all environments share.
        out: outputs of all environments; the entries of environment 0 are written.
    """
    write_outputs(0, resetting, environment(0, batch), setup, out)
