"""The loop of human-machine shared control, one call a signal, in the order of the paper.

A time step k has two halves. :func:`plan` runs on what is perceived: the automation decides, the fault acts, the risk
of letting that drive is assessed. :func:`act` runs once alpha_a and the driver's command are known: authority law,
driver's lag, sum. Between them stand the two slots, of the allocator and of the driver (:mod:`core.kernel`)::

    perceive             scene      road frame, neighbours, driving region, targets
    find_safe_area       C          safe area (Table I)
    decide_automation    u_a,des    the automation's desired command (Eq. 12, 13)
    degrade_command      u_a,f      the same, degraded (Eq. 17, 18)
    assess               xi         prediction under u_a,f over tau_p (Eq. 1)
                         r_y, r_x   lateral and longitudinal risk (Eq. 2-8)
    (allocator)          alpha_a    authority of the automation (Eq. 9)
    apply_authority      u_a,act    the automation's actual command (Eq. 10)
    (driver)             u_h,des    the driver's desired command (Eq. 14, 15)
    apply_driver         u_h,act    the driver's actual command (Eq. 16)
                         u          u_a,act + u_h,act within the limits, which drives the vehicle
    move                            vehicle (Eq. 11) and traffic, to k + 1
    evaluate                        reward and end, once the scene at k + 1 is planned for
"""

from __future__ import annotations

import numpy as np

from shared_control_env.core.authority.laws import apply_law
from shared_control_env.core.batch import Calls, Environment, Setup, Work
from shared_control_env.core.compile.jit import jit, jit_inlined
from shared_control_env.core.control.automation import AUTOMATE
from shared_control_env.core.control.driver_lag import advance_lag
from shared_control_env.core.faults.command import ACTUATOR, PLANNER, degrade
from shared_control_env.core.faults.perception import misperceive, see_as_automation
from shared_control_env.core.feedback.reward import reward
from shared_control_env.core.parameters import Parameters
from shared_control_env.core.records import (
    BODY_LENGTH,
    BODY_WIDTH,
    HEADING,
    SPEED,
    Memory,
    Scene,
    Signals,
    Transition,
    X,
    Y,
)
from shared_control_env.core.risk.assessment import assess
from shared_control_env.core.risk.finding import find_area
from shared_control_env.core.world.collision import overlap
from shared_control_env.core.world.scene import holes_in_region, perceive
from shared_control_env.core.world.traffic import decide_acceleration, move_along
from shared_control_env.core.world.vehicle import plant_step

automate = AUTOMATE.call


@jit_inlined
def plan(k: int, e: Environment, calls: Calls, work: Work) -> None:
    """First half of a time step: from the poses of all vehicles to the risk of what the automation would do.

    Args:
        k: time step.
        e: the environment; scene and signals are written.
        calls: where the compiled functions are.
        work: scratch.
    """
    perceive(k, e.state, e.traffic, e.line, e.p, e.scene)
    find_safe_area(e, calls, work)
    decide_automation(see(e, work), e, calls, work)
    degrade_command(e)
    assess(e.scene, e.traffic, e.line, e.p, e.signals)


@jit_inlined
def find_safe_area(e: Environment, calls: Calls, work: Work) -> None:
    """The safe area C of the scene, around the vehicles in its driving region."""
    count = holes_in_region(e.traffic, e.line, e.scene.region, work.finding.corners)
    find_area(count, e.scene, e.p, calls.triangulate, calls.search, work.finding)


@jit_inlined
def see(e: Environment, work: Work) -> Scene:
    """The scene as the automation takes it to be; all others see it as it is."""
    misperceive(e.scene.t, e.faults, e.signals)
    if e.signals.misperception[0] == 0.0 and e.signals.misperception[1] == 0.0:
        return e.scene
    work.automation_view = e.scene
    see_as_automation(e.signals.misperception, e.p, work.automation_view)
    return work.automation_view


@jit_inlined
def decide_automation(seen: Scene, e: Environment, calls: Calls, work: Work) -> None:
    """u_a,des from the scene as the automation sees it, and how the solver came to it."""
    signals = e.signals
    status, iterations, residual = automate(calls.automate, seen, e.p, e.automation, work.condensing)
    signals.status, signals.iterations, signals.residual = status, iterations, residual
    signals.u_a_des[0], signals.u_a_des[1] = e.automation.u_a_des[0], e.automation.u_a_des[1]


@jit_inlined
def degrade_command(e: Environment) -> None:
    """u_a,f; where the fault is in the planner, u_a,des is wrong too, and at the actuator nothing is yet."""
    signals = e.signals
    if e.p.authority.fault_at == ACTUATOR:
        for i in range(2):
            signals.u_a_f[i] = signals.u_a_des[i]
        return
    degrade(signals.u_a_des, e.scene.k, e.p.task.dt, e.faults, e.fault_memories, e.p.limits, signals.u_a_f)
    for i in range(2):
        signals.fault[i] = signals.u_a_f[i] - signals.u_a_des[i]
        if e.p.authority.fault_at == PLANNER:
            signals.u_a_des[i] = signals.u_a_f[i]


@jit_inlined
def act(u_h_des: np.ndarray, alpha_a: float, e: Environment) -> None:
    """Second half of a time step: from alpha_a and the driver's command to the one that drives the vehicle.

    Args:
        u_h_des: the driver's desired command ``[a, delta]`` [m/s^2, rad], shape (2,).
        alpha_a: authority of the automation in [0, 1].
        e: the environment; signals and memory are written.
    """
    apply_authority(alpha_a, e)
    apply_driver(u_h_des, e.p, e.scene, e.memory, e.signals)


@jit_inlined
def apply_authority(alpha_a: float, e: Environment) -> None:
    """u_a,act by Eq. 10, or another law; degradations at the actuator act on it after that."""
    signals, choice = e.signals, e.p.authority
    signals.alpha_a = alpha_a
    apply_law(choice.law, signals.u_a_des, signals.u_a_f, alpha_a, e.p.law, choice.strict, signals.u_a_act)
    if choice.fault_at == ACTUATOR:
        sound_a, sound_delta = signals.u_a_act[0], signals.u_a_act[1]
        degrade(signals.u_a_act, e.scene.k, e.p.task.dt, e.faults, e.fault_memories, e.p.limits, signals.u_a_act)
        signals.fault[0], signals.fault[1] = signals.u_a_act[0] - sound_a, signals.u_a_act[1] - sound_delta


@jit
def apply_driver(u_h_des: np.ndarray, p: Parameters, scene: Scene, memory: Memory, signals: Signals) -> None:
    """u_h,act (Eq. 16), and ``u = clip(u_a,act + u_h,act)``.

    Args:
        u_h_des: the driver's desired command ``[a, delta]`` [m/s^2, rad], shape (2,).
        p: parameters.
        scene: record of :data:`records.SCENE`; the driver will have felt u_a,act and seen alpha_a.
        memory: record of :data:`records.MEMORY`; the driver's lag advances.
        signals: record of :data:`records.SIGNALS`, completed.
    """
    for i in range(2):
        bound = p.limits.a_max if i == 0 else p.limits.delta_max
        signals.u_h_des[i] = u_h_des[i]
        signals.u_h_act[i] = memory.u_h_act[i]
        signals.u[i] = min(max(signals.u_a_act[i] + signals.u_h_act[i], -bound), bound)
        memory.u_h_des[i], memory.u[i], scene.felt[i] = u_h_des[i], signals.u[i], signals.u_a_act[i]
    advance_lag(memory.u_h_act, signals.u_h_des, signals.u_a_act, p.task.dt, p.lag)
    scene.displayed = signals.alpha_a


@jit_inlined
def move(e: Environment, setup: Setup, work: Work) -> None:
    """Move all vehicles through one decision's simulation steps, and check the ego's collisions.

    Args:
        e: the environment; state, traffic and transition are written.
        setup: number and length of the simulation steps.
        work: scratch.
    """
    u, row = e.signals.u, work.row
    row[BODY_LENGTH], row[BODY_WIDTH] = e.p.vehicle.length, e.p.vehicle.width
    for frame in range(setup.frames):
        t = (e.scene.k * setup.frames + frame) * setup.dt
        row[X], row[Y], row[SPEED] = e.state[0], e.state[1], e.state[3]
        for j in range(e.traffic.shape[0]):
            decide_acceleration(e.traffic[j], e.plans[j], t, row, e.traffic, e.line, e.p.task.lane_width)
        plant_step(e.state, u[0], u[1], setup.dt, e.p.vehicle, work.plant)
        row[X], row[Y], row[HEADING] = e.state[0], e.state[1], e.state[2]
        for j in range(e.traffic.shape[0]):
            move_along(e.traffic[j], e.plans[j], e.line, t, setup.dt)
        for j in range(e.traffic.shape[0]):
            if overlap(row, e.traffic[j]):
                e.transition.crashed = True


@jit_inlined
def depart(e: Environment) -> None:
    """Note what a step leads from, before anything moves."""
    e.transition.previous_s, e.transition.last_a = e.scene.z[0], e.memory.u[0]


@jit_inlined
def evaluate(e: Environment, steps: int) -> tuple[float, bool, bool]:
    """Reward and end of a step, once the scene that it led to is perceived.

    Args:
        e: the environment; memory and transition are written.
        steps: duration of the episode in time steps.

    Returns:
        Reward; whether the episode terminates: by a collision, off the road, or in a state that is not finite; whether
        it is truncated: by its duration, or since the road ends.
    """
    transition, x = e.transition, e.scene.state
    transition.on_road = is_on_road(e.scene, e.p) and np.isfinite(x[0] + x[1] + x[2] + x[3] + x[4] + x[5])
    transition.failed = transition.crashed or not transition.on_road
    value = reward(transition, e.scene, e.signals, e.p)
    count_departures(e.scene, e.p, e.memory)
    return value, transition.failed, e.scene.k >= steps or e.scene.z[0] >= e.p.task.road_end


@jit
def is_on_road(scene: Scene, p: Parameters) -> bool:
    """Whether the ego's centre is between the road's edges.

    Args:
        scene: record of :data:`records.SCENE`.
        p: parameters.
    """
    return -0.5 * p.task.lane_width <= scene.z[1] <= p.task.road_high


@jit_inlined
def count_departures(scene: Scene, p: Parameters, memory: Memory) -> None:
    """Count in memory each time that the ego's centre leaves the lane to keep.

    Args:
        scene: record of :data:`records.SCENE`.
        p: parameters.
        memory: record of :data:`records.MEMORY`.
    """
    in_lane = abs(scene.z[1] - scene.y_target) <= 0.5 * p.task.lane_width
    if memory.in_lane and not in_lane:
        memory.lane_departures += 1
    memory.in_lane = in_lane


@jit
def clear_memory(memory: Memory) -> None:
    """State of a loop that has not run: no command.

    Args:
        memory: record of :data:`records.MEMORY`.
    """
    for i in range(2):
        memory.u_h_act[i] = memory.u_h_des[i] = memory.u[i] = 0.0
    memory.in_lane = True
    memory.lane_departures = 0
    memory.driver_failures = 0


@jit
def clear_signals(signals: Signals) -> None:
    """Signals before anything is planned or applied: no command, full authority.

    Args:
        signals: record of :data:`records.SIGNALS`.
    """
    for vector in (
        signals.u_a_des,
        signals.u_a_f,
        signals.u_a_act,
        signals.u_h_des,
        signals.u_h_act,
        signals.u,
        signals.fault,
        signals.misperception,
        signals.prediction_road,
    ):
        vector[0], vector[1] = 0.0, 0.0
    for i in range(6):
        signals.prediction[i] = 0.0
    signals.r_x, signals.r_y, signals.alpha_a = 0.0, 0.0, 1.0
    signals.status, signals.iterations, signals.residual = 0, 0, 0.0


@jit
def clear_transition(transition: Transition, on_road: bool) -> None:
    """What has come of a start: nothing.

    Args:
        transition: record of :data:`records.TRANSITION`.
        on_road: whether the ego's centre is between the road's edges.
    """
    transition.crashed = transition.failed = False
    transition.on_road = on_road
    for i in range(transition.terms.shape[0]):
        transition.terms[i] = 0.0
