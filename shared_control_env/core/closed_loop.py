"""The closed loop of one time step, in the two halves that the decision of alpha_a and the driver divides.

``automate`` and ``monitor`` run on a perceived scene: the automation decides, the fault acts, the risk is
assessed. ``blend`` runs once alpha_a and the driver's command are known: authority law, driver's lag, sum.
"""

from __future__ import annotations

import numpy as np

from shared_control_env.core import automation_mpc
from shared_control_env.core.assessment import assess
from shared_control_env.core.authority import apply_law
from shared_control_env.core.degradation import ACTUATOR, PLANNER, degrade, misperceive
from shared_control_env.core.driver_lag import advance_lag
from shared_control_env.core.info import note_outcome
from shared_control_env.core.jit import jit, jit_inlined
from shared_control_env.core.parameters import Parameters
from shared_control_env.core.records import Record
from shared_control_env.core.reward import reward_terms, weighted_sum


@jit_inlined
def clear_memory(memory: Record) -> None:
    """State of a loop that has not run: no command, full authority on display."""
    for i in range(2):
        memory.u_h_act[i] = memory.u_h_des[i] = memory.u[i] = 0.0
    memory.alpha_a = 1.0
    memory.in_lane = True
    memory.lane_departures = 0
    memory.driver_failures = 0


@jit_inlined
def clear_signals(signals: Record) -> None:
    """Signals before anything is planned or applied: no command, full authority on display."""
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
def clear_sequence(U: np.ndarray) -> None:
    """A sequence of commands that does nothing, shape (n, 2)."""
    for j in range(U.shape[0]):
        U[j, 0], U[j, 1] = 0.0, 0.0


@jit_inlined
def clear_automation(memory: Record) -> None:
    """State of an automation that has not run."""
    clear_sequence(memory.U)
    memory.u_a_des[0], memory.u_a_des[1] = 0.0, 0.0
    memory.failures = 0


@jit_inlined
def clear_faults(memories: np.ndarray) -> None:
    """State of degradations that have not acted; what else they keep is written before it is read."""
    for i in range(memories.shape[0]):
        memories[i].acting = False
        memories[i].last[0] = memories[i].last[1] = 0.0


@jit
def misjudge(scene: Record, faults: np.ndarray, p: Parameters, signals: Record) -> tuple[float, float]:
    """Make the scene what the automation takes it for; :func:`judge_rightly` puts it right again.

    Missing the vehicle that precedes, it drives at its own target speed.

    Args:
        scene: record of :data:`records.SCENE`, changed.
        faults: records of :class:`DegradationParameters`, shape (n,).
        p: parameters.
        signals: record of :data:`records.SIGNALS`; ``misperception`` is written.

    Returns:
        The true lateral position [m] and target speed [m/s].
    """
    y, v_target = scene.z[1], scene.v_target
    misperceive(scene.t, faults, signals.misperception)
    scene.z[1] += signals.misperception[0]
    if signals.misperception[1] > 0.0:
        scene.v_target = p.task.target_speed
    return y, v_target


@jit
def judge_rightly(scene: Record, y: float, v_target: float) -> None:
    """Undo :func:`misjudge`: for the monitor and for the driver the scene is what it is."""
    scene.z[1], scene.v_target = y, v_target


@jit_inlined
def automate(scene: Record, p: Parameters, memory: Record, work: Record) -> tuple[int, int, float]:
    """The automation's desired command u_a,des (Eq. 13), left in ``memory.u_a_des``.

    When the solver fails the last feasible command is held and the failure counted.

    Args:
        scene: record of :data:`records.SCENE`, its safe area found.
        p: parameters.
        memory: record of :data:`records.AUTOMATION_MEMORY`.
        work: record of :data:`condensing.WORKSPACE`.

    Returns:
        Status, iterations and residual of :func:`automation_mpc.solve`.
    """
    iterations = p.authority.first_iterations if scene.k == 0 else p.authority.iterations
    status, done, residual, _ = automation_mpc.solve(memory.U, scene, p, iterations, work)
    if status == automation_mpc.FAILED:
        memory.failures += 1
        clear_sequence(memory.U)
    else:
        memory.u_a_des[0], memory.u_a_des[1] = memory.U[0, 0], memory.U[0, 1]
        automation_mpc.shift(memory.U, p.automation.H_c)
    return status, done, residual


@jit_inlined
def monitor(
    scene: Record,
    traffic: np.ndarray,
    line: np.ndarray,
    faults: np.ndarray,
    fault_memories: np.ndarray,
    p: Parameters,
    signals: Record,
) -> None:
    """First half of a step, after the automation: its degradation u_a,f, the prediction xi, the risks r_y, r_x.

    Args:
        scene: record of :data:`records.SCENE`, its safe area found.
        traffic: other vehicles, shape (n, 8).
        line: reference line.
        faults: records of :class:`DegradationParameters`, shape (m,).
        fault_memories: records of :data:`records.FAULT_MEMORY`, shape (m,).
        p: parameters.
        signals: record of :data:`records.SIGNALS` that holds ``u_a_des``, written.
    """
    if p.authority.fault_at == ACTUATOR:
        for i in range(2):
            signals.u_a_f[i] = signals.u_a_des[i]
    else:
        degrade(signals.u_a_des, scene.k, p.task.dt, faults, fault_memories, p.limits, signals.u_a_f)
        for i in range(2):
            signals.fault[i] = signals.u_a_f[i] - signals.u_a_des[i]
            if p.authority.fault_at == PLANNER:
                signals.u_a_des[i] = signals.u_a_f[i]
    assess(scene, traffic, line, p, signals)


@jit
def limit(alpha_a: float, p: Parameters, signals: Record) -> None:
    """The automation's actual command u_a,act (Eq. 10), or under another law.

    Args:
        alpha_a: authority in [0, 1].
        p: parameters.
        signals: record of :data:`records.SIGNALS` that holds ``u_a_des`` and ``u_a_f``, written.
    """
    signals.alpha_a = alpha_a
    choice = p.authority
    apply_law(choice.law, signals.u_a_des, signals.u_a_f, alpha_a, p.law, choice.strict, signals.u_a_act)


@jit
def join(u_h_des: np.ndarray, p: Parameters, scene: Record, memory: Record, signals: Record) -> None:
    """The driver's actual command u_h,act (Eq. 16), and ``u = clip(u_a,act + u_h,act)``.

    Args:
        u_h_des: the driver's desired command ``[a, delta]`` [m/s^2, rad], shape (2,).
        p: parameters.
        scene: record of :data:`records.SCENE`; the driver will have felt u_a,act.
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
    memory.alpha_a = signals.alpha_a


@jit_inlined
def blend(u_h_des: np.ndarray, alpha_a: float, p: Parameters, scene: Record, memory: Record, signals: Record) -> None:
    """Second half of a step: :func:`limit`, then :func:`join`; arguments as theirs."""
    limit(alpha_a, p, signals)
    join(u_h_des, p, scene, memory, signals)


@jit_inlined
def blend_degraded(
    u_h_des: np.ndarray,
    alpha_a: float,
    p: Parameters,
    faults: np.ndarray,
    fault_memories: np.ndarray,
    scene: Record,
    memory: Record,
    signals: Record,
) -> None:
    """:func:`blend` with the degradations at the actuator: on u_a,act, whatever the limiter has made of it.

    Args:
        u_h_des, alpha_a, p, scene, memory, signals: as in :func:`limit` and :func:`join`.
        faults: records of :class:`DegradationParameters`, shape (m,).
        fault_memories: records of :data:`records.FAULT_MEMORY`, shape (m,).
    """
    limit(alpha_a, p, signals)
    sound_a, sound_delta = signals.u_a_act[0], signals.u_a_act[1]
    degrade(signals.u_a_act, scene.k, p.task.dt, faults, fault_memories, p.limits, signals.u_a_act)
    signals.fault[0], signals.fault[1] = signals.u_a_act[0] - sound_a, signals.u_a_act[1] - sound_delta
    join(u_h_des, p, scene, memory, signals)


@jit
def is_on_road(scene: Record, p: Parameters) -> bool:
    """Whether the ego's centre is between the road's edges."""
    return -0.5 * p.task.lane_width <= scene.z[1] <= p.task.road_high


@jit_inlined
def count_departures(scene: Record, p: Parameters, memory: Record) -> None:
    """Count in memory each time that the ego's centre leaves the lane to keep."""
    in_lane = abs(scene.z[1] - scene.y_target) <= 0.5 * p.task.lane_width
    if memory.in_lane and not in_lane:
        memory.lane_departures += 1
    memory.in_lane = in_lane


@jit_inlined
def conclude(
    previous_s: float,
    last_a: float,
    crashed: bool,
    scene: Record,
    signals: Record,
    p: Parameters,
    memory: Record,
    terms: np.ndarray,
    info: Record,
    steps: int,
) -> tuple[float, bool, bool]:
    """Reward and end of a step, once the scene it led to is perceived.

    Args:
        previous_s: path length before the step [m].
        last_a: acceleration command of the step before [m/s^2].
        crashed: whether the ego has collided.
        scene: record of :data:`records.SCENE` after the step.
        signals: record of :data:`records.SIGNALS` that holds the step's commands.
        p: parameters.
        memory: record of :data:`records.MEMORY`.
        terms: written, shape (7,).
        info: record of :data:`info.INFO`, completed.
        steps: duration of the episode in time steps.

    Returns:
        Reward; whether the episode terminates: by a collision, off the road, or in a state that is not finite; whether
        it is truncated: by its duration, or since the road ends.
    """
    x = scene.state
    on_road = is_on_road(scene, p) and np.isfinite(x[0] + x[1] + x[2] + x[3] + x[4] + x[5])
    terminated = crashed or not on_road
    reward_terms(previous_s, scene, signals, last_a, terminated, p, terms)
    count_departures(scene, p, memory)
    note_outcome(scene.z[3], crashed, on_road, memory, terms, info)
    truncated = scene.k >= steps or scene.z[0] >= p.task.road_end
    return weighted_sum(terms, p.reward), terminated, truncated
