"""The loop of human-machine shared control: one function call per signal, in the order of the paper.

A time step k has two halves. The first runs on the perceived scene: :func:`look`, the automation's decision, and
:func:`judge`, in which the fault acts on the command and the risk of the degraded command is assessed. :func:`act` runs
once alpha_a and the driver's command are known: it applies the authority law and the driver's lag, and adds both
commands. Between the two halves lie the slots of the allocator and of the driver. :mod:`core.kernel` fills them, and
lets the automations of eight environments decide at once::

    perceive             scene      road frame, neighbours, driving region, targets
    find_safe_area       C          safe area (Table I)
    (automation)         u_a,des    the automation's desired command (Eq. 12, 13)
    degrade_command      u_a,f      the degraded command (Eq. 17, 18)
    assess               xi         prediction under u_a,f over tau_p (Eq. 1)
                         r_y, r_x   lateral and longitudinal risk (Eq. 2-8)
    (allocator)          alpha_a    authority of the automation (Eq. 9)
    apply_authority      u_a,act    the automation's actual command (Eq. 10)
    (driver)             u_h,des    the driver's desired command (Eq. 14, 15)
    apply_driver         u_h,act    the driver's actual command (Eq. 16)
                         u          command of the vehicle: u_a,act + u_h,act, clipped to the limits
    move                            actuators, vehicle (Eq. 11) and traffic, to k + 1
    evaluate                        reward and end of the episode, after judge has run at k + 1
"""

from __future__ import annotations

import numpy as np

from shared_control_env.core.authority.laws import apply_law
from shared_control_env.core.batch import Calls, Environment, Setup, Work
from shared_control_env.core.compile.jit import jit, jit_inlined
from shared_control_env.core.control.automation import enter
from shared_control_env.core.control.driver_lag import advance_lag
from shared_control_env.core.faults.command import ACTUATOR, PLANNER, degrade
from shared_control_env.core.faults.perception import misperceive, see_as_automation
from shared_control_env.core.feedback.reward import reward
from shared_control_env.core.parameters import Parameters
from shared_control_env.core.records import Memory, Scene, Signals, Transition
from shared_control_env.core.risk.assessment import ASSESS
from shared_control_env.core.risk.finding import find_area
from shared_control_env.core.world.motion import MOVE
from shared_control_env.core.world.scene import holes_in_region, perceive

assess, move_all = ASSESS.call, MOVE.call


@jit_inlined
def look(k: int, lane: int, i: int, e: Environment, calls: Calls, work: Work) -> None:
    """Begin the first half of a time step: from the poses of all vehicles to the automation's problem.

    Args:
        k: time step.
        lane: lane of the block that the automation enters, see :mod:`control.block`.
        i: index of the environment.
        e: the environment; its scene and signals are written.
        calls: addresses of the compiled functions.
        work: scratch.
    """
    perceive(k, e.state, e.traffic, e.line, e.p, e.scene)
    find_safe_area(e, calls, work)
    enter(lane, i, see(e, work), e.p, e.automation.U, work.automations)


@jit_inlined
def judge(e: Environment, calls: Calls, work: Work) -> None:
    """Complete the first half: from the automation's decision u_a,des to the risk of the degraded command.

    Args:
        e: the environment; its signals and the memories of the faults are written.
        calls: addresses of the compiled functions.
        work: scratch.
    """
    degrade_command(e)
    assess(calls.assess, e.p.task.tau_p, e.scene, e.traffic, e.line, e.p, e.signals, work.motion)


@jit_inlined
def find_safe_area(e: Environment, calls: Calls, work: Work) -> None:
    """Find the safe area C of the scene, which excludes the vehicles in the driving region.

    Args:
        e: the environment; ``e.scene.area`` is written.
        calls: addresses of the compiled functions.
        work: scratch.
    """
    count = holes_in_region(e.traffic, e.line, e.scene.region, work.finding.corners)
    find_area(count, e.scene, e.p, calls.triangulate, calls.search, work.finding)


@jit_inlined
def see(e: Environment, work: Work) -> Scene:
    """Scene as the automation perceives it, with the errors of its perception.

    The driver and the risk assessment use the true scene; the assessment adds the errors itself if it shares them.

    Args:
        e: the environment; ``e.signals.misperception`` is written.
        work: scratch; ``work.automation_view`` holds the returned scene where the automation misperceives.

    Returns:
        Record of :data:`records.SCENE`; the true scene itself where nothing is misperceived.
    """
    misperceive(e.scene.t, e.faults, e.signals)
    if e.signals.misperception[0] == 0.0 and e.signals.misperception[1] == 0.0:
        return e.scene
    work.automation_view = e.scene
    see_as_automation(e.signals.misperception, e.p, work.automation_view)
    return work.automation_view


@jit_inlined
def degrade_command(e: Environment) -> None:
    """Compute u_a,f, the degraded command.

    A fault in the planner also changes u_a,des. A fault at the actuator leaves u_a,f = u_a,des: it acts on u_a,act
    in :func:`apply_authority`.

    Args:
        e: the environment; its signals and fault memories are written.
    """
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
def act(u_h_des: np.ndarray, e: Environment) -> None:
    """Run the second half of a time step: from ``signals.alpha`` and the driver's command to the command u.

    Args:
        u_h_des: the driver's desired command ``[a, delta]`` [m/s^2, rad], shape (2,).
        e: the environment; its signals, its memory and what the driver feels and sees of the automation are written.
    """
    apply_authority(e)
    apply_driver(u_h_des, e.p, e.scene, e.memory, e.signals)


@jit_inlined
def apply_authority(e: Environment) -> None:
    """Compute u_a,act by Eq. 10 or another law, then apply the degradations at the actuator to it.

    Args:
        e: the environment; its signals and fault memories are written.
    """
    signals, choice = e.signals, e.p.authority
    signals.alpha_a = min(signals.alpha[0], signals.alpha[1])
    apply_law(choice.law, signals.u_a_des, signals.u_a_f, signals.alpha, e.p.law, choice.strict, signals.u_a_act)
    if choice.fault_at == ACTUATOR:
        sound_a, sound_delta = signals.u_a_act[0], signals.u_a_act[1]
        degrade(signals.u_a_act, e.scene.k, e.p.task.dt, e.faults, e.fault_memories, e.p.limits, signals.u_a_act)
        signals.fault[0], signals.fault[1] = signals.u_a_act[0] - sound_a, signals.u_a_act[1] - sound_delta


@jit
def apply_driver(u_h_des: np.ndarray, p: Parameters, scene: Scene, memory: Memory, signals: Signals) -> None:
    """Compute u_h,act (Eq. 16) and the vehicle's command ``u = clip(u_a,act + u_h,act)``.

    The lag advances after u is formed, so u_h,des first has an effect in the next time step. Hands at rest go along
    with the automation, u_h,des = u_a,act, so that the arm adds nothing.

    A direct driver gives u_h,act itself, which acts at once. Its u_h,des is then the command for which Eq. 16 with
    K_h = 1 comes to rest at u_h,act: u_a,act + u_h,act.

    Args:
        u_h_des: the driver's desired command ``[a, delta]`` [m/s^2, rad]; u_h,act if the driver is direct, shape (2,).
        p: parameters.
        scene: record of :data:`records.SCENE`; ``felt`` (u_a,act), ``displayed`` (alpha_a) and ``alert`` are
            written.
        memory: record of :data:`records.MEMORY`; the driver's lag advances, and the last commands are stored.
        signals: record of :data:`records.SIGNALS`; ``u_h_des``, ``u_h_act`` and ``u`` are written.
    """
    for i in range(2):
        bound = p.limits.a_max if i == 0 else p.limits.delta_max
        if p.lag.direct:
            memory.u_h_act[i] = u_h_des[i]
            signals.u_h_des[i] = signals.u_a_act[i] + u_h_des[i]
        else:
            signals.u_h_des[i] = signals.u_a_act[i] if memory.resting else u_h_des[i]
        signals.u_h_act[i] = memory.u_h_act[i]
        signals.u[i] = min(max(signals.u_a_act[i] + signals.u_h_act[i], -bound), bound)
        memory.u_h_des[i], memory.u[i], scene.felt[i] = signals.u_h_des[i], signals.u[i], signals.u_a_act[i]
    if not p.lag.direct:
        advance_lag(memory.u_h_act, signals.u_h_des, signals.u_a_act, p.task.dt, p.lag)
    scene.displayed, scene.alert = signals.alpha_a, signals.alert


@jit_inlined
def move(e: Environment, setup: Setup, work: Work) -> None:
    """Move all vehicles to the next time step (:func:`core.world.motion.move`).

    Args:
        e: the environment; its state, traffic, actuators and transition are written.
        setup: number and duration of the simulation steps.
        work: scratch.
    """
    address, k, frames, dt = setup.calls.move, e.scene.k, setup.frames, setup.dt
    memory, transition, motion = e.memory, e.transition, work.motion
    move_all(address, k, frames, dt, e.signals, e.p, e.state, e.traffic, e.plans, e.line, memory, transition, motion)


@jit_inlined
def depart(e: Environment) -> None:
    """Store the path length and the acceleration command from before a step, which the reward needs.

    Args:
        e: the environment; its transition is written.
    """
    e.transition.previous_s, e.transition.last_a = e.scene.z[0], e.memory.u[0]


@jit_inlined
def evaluate(e: Environment, steps: int) -> tuple[float, bool, bool]:
    """Compute the reward of a step and whether the episode ends, after the resulting scene has been perceived.

    Args:
        e: the environment; its memory and transition are written.
        steps: duration of the episode [time steps].

    Returns:
        Reward; whether the episode terminates (collision, departure from the road, or a state that is not finite);
        whether the episode is truncated (its duration has passed, or the road ends).
    """
    transition, x = e.transition, e.scene.state
    transition.on_road = is_on_road(e.scene) and np.isfinite(x[0] + x[1] + x[2] + x[3] + x[4] + x[5])
    transition.failed = transition.crashed or not transition.on_road
    value = reward(transition, e.scene, e.signals, e.p)
    count_departures(e.scene, e.memory)
    return value, transition.failed, e.scene.k >= steps or e.scene.z[0] >= e.p.task.road_end


@jit
def is_on_road(scene: Scene) -> bool:
    """Whether the ego's centre lies between the edges of the road.

    Args:
        scene: record of :data:`records.SCENE`.
    """
    return scene.road_low <= scene.z[1] <= scene.road_high


@jit_inlined
def count_departures(scene: Scene, memory: Memory) -> None:
    """Count how often the ego's centre has left the lane to keep.

    Args:
        scene: record of :data:`records.SCENE`.
        memory: record of :data:`records.MEMORY`; ``in_lane`` and ``lane_departures`` are written.
    """
    in_lane = abs(scene.z[1] - scene.y_target) <= 0.5 * scene.lane_width
    if memory.in_lane and not in_lane:
        memory.lane_departures += 1
    memory.in_lane = in_lane


@jit
def clear_memory(memory: Memory) -> None:
    """Reset the loop's memory to its state before the first step: no commands, the ego in its lane.

    Args:
        memory: record of :data:`records.MEMORY`, overwritten.
    """
    for i in range(2):
        memory.u_h_act[i] = memory.u_h_des[i] = memory.u[i] = memory.realised[i] = 0.0
    memory.in_lane = True
    memory.lane_departures = 0
    memory.driver_failures = 0
    memory.resting = False


@jit
def clear_signals(signals: Signals) -> None:
    """Reset the signals to their values before the first step: no commands, no risk, full authority.

    Args:
        signals: record of :data:`records.SIGNALS`, overwritten.
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
    signals.alpha[0] = signals.alpha[1] = 1.0
    signals.r_x, signals.r_y, signals.alpha_a, signals.alert = 0.0, 0.0, 1.0, 0
    signals.status, signals.iterations, signals.residual = 0, 0, 0.0


@jit
def clear_transition(transition: Transition) -> None:
    """Reset the transition at the start of an episode: no collision, no failure, all reward terms zero.

    Args:
        transition: record of :data:`records.TRANSITION`, overwritten up to ``previous_s`` and ``last_a``.
    """
    transition.crashed = transition.failed = False
    transition.on_road = True
    for i in range(transition.terms.shape[0]):
        transition.terms[i] = 0.0
