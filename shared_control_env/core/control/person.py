"""A person at the wheel: perception, attention and arm of the predictive driver.

Perception is delayed, and its error is proportional to the perceived quantity. The person compensates for the delay
with a model of the car. Resting hands follow the wheel until the person notices something; the person then acts after a
response time. The error of the arm is proportional to its command. The numbers and their sources are in
:class:`core.parameters.PersonParameters`.
"""

from __future__ import annotations

from math import exp

import numpy as np

from shared_control_env.core.authority.alerts import NO_ALERT, TACTILE, VISUAL
from shared_control_env.core.compile.jit import jit, jit_inlined
from shared_control_env.core.faults.noise import coloured, standard_normal
from shared_control_env.core.parameters import Parameters
from shared_control_env.core.records import MAX_DELAY, PersonMemory, Scene
from shared_control_env.core.world.scene import gap_ahead
from shared_control_env.core.world.vehicle import PSI, V_X, Y, step_in_place

REASONS = ("nothing", "lane position", "heading", "headway", "felt steering", "felt acceleration", "display", "alert")
"""What a person may notice; the index of a reason is its code."""

NOTHING, LANE_POSITION, HEADING, HEADWAY, FELT_STEERING, FELT_ACCELERATION, DISPLAY, ALERT = range(8)

LATERAL, DIRECTION, SPEED, ARM = range(4)
"""Indices of the errors in a person's memory."""

ADJUSTING = 2.0
"""Time constant with which a person would approach the target speed [s]; assumed."""

GLANCE = 1.0
"""Time for which a visual alert must last to be noticed [s]; assumed. A tactile alert is noticed at once.

In 129 studies the take-over times were shorter after auditory or vibrotactile requests than after visual ones or none
(Zhang et al., 2019).
"""

_RESPONSE = 1_000_000_000
"""Counter of the random number for the response time; the counters of the steps are smaller."""


@jit
def response_time(p: Parameters) -> float:
    """Time from noticing to acting [s]: log-normal over persons, constant throughout an episode.

    Args:
        p: parameters.
    """
    return p.person.response * exp(p.person.response_spread * standard_normal(p.person.seed, _RESPONSE))


@jit
def clear_person(memory: PersonMemory, p: Parameters) -> None:
    """Reset the person's memory at the start of an episode; the parameters say whether the person drives already.

    Args:
        memory: record of :data:`records.PERSON_MEMORY`, overwritten except for the past, which is always written
            before it is read.
        p: parameters.
    """
    memory.engaged = p.person.engaged
    memory.noticed = np.inf
    memory.response = 0.0 if p.person.engaged else response_time(p)
    memory.reason, memory.alerted = NOTHING, 0.0
    for i in range(4):
        memory.error[i] = 0.0


@jit
def advance_errors(memory: PersonMemory, k: int, p: Parameters) -> None:
    """Advance the errors of perception and arm to step k.

    Each error is a first-order process of unit variance with the person's noise time.

    Args:
        memory: record of :data:`records.PERSON_MEMORY`; ``error`` is written.
        k: index of the time step.
        p: parameters.
    """
    for i in range(4):
        memory.error[i] = coloured(memory.error[i], p.person.seed, 4 * k + i, k, p.person.noise_time, p.task.dt)


@jit
def perceive_late(scene: Scene, u_last: np.ndarray, memory: PersonMemory, p: Parameters, seen: Scene) -> None:
    """Compute the car's motion as the person perceives it: a delayed state, predicted to the present, with errors.

    ::

        z_seen = f(... f(z(k - d), u(k - d)) ..., u(k - 1)),   d = delay / dt, f the model of the controllers
        y, psi, v_x:  error (1 + weber n),   n the random error of each

    The errors of y, psi and v_x are the deviations from the target position, the road and the target speed.

    The person perceives the road ahead and the other vehicles correctly. The prediction uses the present curvature at
    the car for the whole delay.

    Args:
        scene: record of :data:`records.SCENE`.
        u_last: command that drove the car in the previous step [m/s^2, rad], shape (2,).
        memory: record of :data:`records.PERSON_MEMORY`; the past states and commands are updated.
        p: parameters.
        seen: copy of the scene, record of :data:`records.SCENE`; ``z`` is written.
    """
    k, z = scene.k, seen.z
    for i in range(6):
        memory.past[k % MAX_DELAY, i] = scene.z[i]
    if k > 0:
        memory.commands[(k - 1) % MAX_DELAY, 0] = u_last[0]
        memory.commands[(k - 1) % MAX_DELAY, 1] = u_last[1]
    late = min(round(p.person.delay / p.task.dt), k, MAX_DELAY - 1)
    for i in range(6):
        z[i] = memory.past[(k - late) % MAX_DELAY, i]
    for step in range(k - late, k):
        a, delta = memory.commands[step % MAX_DELAY, 0], memory.commands[step % MAX_DELAY, 1]
        step_in_place(z, a, delta, scene.kappa[0], p.task.dt, p.model)
    z[Y] += p.person.weber * memory.error[LATERAL] * (z[Y] - scene.y_target)
    z[PSI] += p.person.weber * memory.error[DIRECTION] * z[PSI]
    z[V_X] = max(0.0, z[V_X] + p.person.weber * memory.error[SPEED] * (z[V_X] - scene.v_target))


@jit
def what_is_noticed(seen: Scene, alerted: float, p: Parameters) -> int:
    """First of the :data:`REASONS` to take over that a perceived scene gives.

    At k = 0 nothing is felt at the wheel.

    Args:
        seen: the scene as the person perceives it, record of :data:`records.SCENE`.
        alerted: time for which an alert has lasted [s].
        p: parameters.

    Returns:
        Index in :data:`REASONS`; NOTHING if there is no reason.
    """
    person, z = p.person, seen.z
    if abs(z[Y] - seen.y_target) > person.lane_position:
        return LANE_POSITION
    if abs(z[PSI]) > person.heading:
        return HEADING
    if gap_ahead(seen) < person.headway * z[V_X]:
        return HEADWAY
    wheelbase = p.model.l_f + p.model.l_r
    if seen.k > 0 and abs(seen.felt[1] - wheelbase * seen.kappa[0]) > person.felt_steering:
        return FELT_STEERING
    wanted = min(max((seen.v_target - z[V_X]) / ADJUSTING, -p.limits.a_max), p.limits.a_max)
    if seen.k > 0 and abs(seen.felt[0] - wanted) > person.felt_acceleration:
        return FELT_ACCELERATION
    if seen.displayed < person.display:
        return DISPLAY
    called = seen.alert == TACTILE or (seen.alert == VISUAL and alerted >= GLANCE)
    return ALERT if called else NOTHING


@jit_inlined
def perceive_and_attend(scene: Scene, u_last: np.ndarray, memory: PersonMemory, p: Parameters, seen: Scene) -> bool:
    """Advance perception and attention by one step: compute the perceived scene and whether the person drives.

    Args:
        scene: record of :data:`records.SCENE`.
        u_last: command that drove the car in the previous step [m/s^2, rad], shape (2,).
        memory: record of :data:`records.PERSON_MEMORY`, updated.
        p: parameters.
        seen: copy of the scene, record of :data:`records.SCENE`; changed to the perceived scene.

    Returns:
        Whether the person drives. If not, the hands rest, and u_h,des is u_a,act.
    """
    if scene.k == 0:
        clear_person(memory, p)
    advance_errors(memory, scene.k, p)
    perceive_late(scene, u_last, memory, p, seen)
    if not memory.engaged:
        if memory.noticed == np.inf:
            memory.alerted = memory.alerted + p.task.dt if seen.alert != NO_ALERT else 0.0
            memory.reason = what_is_noticed(seen, memory.alerted, p)
            if memory.reason != NOTHING:
                memory.noticed = scene.t
        memory.engaged = scene.t >= memory.noticed + memory.response
    return memory.engaged


@jit
def add_arm_noise(u_h_des: np.ndarray, memory: PersonMemory, p: Parameters) -> None:
    """Apply the signal-dependent noise of the arm: multiply the command by ``1 + arm_noise n``, and clip the result.

    Args:
        u_h_des: the driver's desired command [m/s^2, rad], overwritten, shape (2,).
        memory: record of :data:`records.PERSON_MEMORY`, which holds the present error n of the arm.
        p: parameters.
    """
    scale = 1.0 + p.person.arm_noise * memory.error[ARM]
    u_h_des[0] = min(max(scale * u_h_des[0], -p.limits.a_max), p.limits.a_max)
    u_h_des[1] = min(max(scale * u_h_des[1], -p.limits.delta_max), p.limits.delta_max)
