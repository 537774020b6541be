"""A person at the wheel: what is between the eye and the desired command of the predictive driver.

Perception comes late, and errs in proportion to what is perceived; the person makes up for the delay with the own model
of the car. Hands that rest follow the wheel until something is noticed, and act a while after that. The arm errs in
proportion to what it does. The numbers and their sources are in :class:`core.parameters.PersonParameters`.
"""

from __future__ import annotations

from math import cos, exp, sin

import numpy as np

from shared_control_env.core.compile.jit import jit, jit_inlined
from shared_control_env.core.faults.noise import coloured, standard_normal
from shared_control_env.core.parameters import Parameters
from shared_control_env.core.records import MAX_DELAY, PersonMemory, Scene
from shared_control_env.core.world.scene import gap_ahead
from shared_control_env.core.world.vehicle import PSI, V_X, Y, implicit_step

REASONS = ("nothing", "lane position", "heading", "headway", "felt steering", "felt acceleration", "display")
"""What a person may notice; a reason's index is its code."""

NOTHING, LANE_POSITION, HEADING, HEADWAY, FELT_STEERING, FELT_ACCELERATION, DISPLAY = range(7)

LATERAL, DIRECTION, SPEED, ARM = range(4)
"""Places of the errors in a person's memory."""

ADJUSTING = 2.0
"""Time in which a person would bring the speed to the target speed [s]; assumed."""

_RESPONSE = 1_000_000_000
"""Counter of the random number that the response time is drawn with; those of the steps are smaller."""


@jit
def clear_person(memory: PersonMemory, p: Parameters) -> None:
    """Begin an episode: who drives from the start does so now, the others rest.

    Args:
        memory: record of :data:`records.PERSON_MEMORY`; the past is written before it is read.
        p: parameters.
    """
    memory.engaged = p.person.engaged
    memory.noticed = np.inf
    memory.reason = NOTHING
    for i in range(4):
        memory.error[i] = 0.0


@jit
def advance_errors(memory: PersonMemory, k: int, p: Parameters) -> None:
    """Errors of perception and arm, each a first-order process of unit variance and the person's noise time."""
    for i in range(4):
        memory.error[i] = coloured(memory.error[i], p.person.seed, 4 * k + i, k, p.person.noise_time, p.task.dt)


@jit
def perceive_late(scene: Scene, u_last: np.ndarray, memory: PersonMemory, p: Parameters, seen: Scene) -> None:
    """What the person takes the car's motion for: that of a while ago, carried on by the own model, with an error.

    ::

        z_seen = f(... f(z(k - d), u(k - d)) ..., u(k - 1)),   d = delay / dt, f the model of the controllers
        y, psi, v_x:  error (1 + weber n),   with the errors from target, road and target speed

    The road ahead and the other vehicles are seen as they are; the curvature at the car stands for that on the way.

    Args:
        scene: record of :data:`records.SCENE`.
        u_last: command that drove the car in the step before, shape (2,) [m/s^2, rad].
        memory: record of :data:`records.PERSON_MEMORY`.
        p: parameters.
        seen: record of :data:`records.SCENE`, a copy of the scene; its ``z`` is written.
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
        heading, wheel = (cos(z[PSI]), sin(z[PSI])), (cos(delta), sin(delta))
        implicit_step(z, heading, a, delta, wheel, scene.kappa[0], p.task.dt, p.model, z)
    z[Y] += p.person.weber * memory.error[LATERAL] * (z[Y] - scene.y_target)
    z[PSI] += p.person.weber * memory.error[DIRECTION] * z[PSI]
    z[V_X] = max(0.0, z[V_X] + p.person.weber * memory.error[SPEED] * (z[V_X] - scene.v_target))


@jit
def what_is_noticed(seen: Scene, p: Parameters) -> int:
    """The first reason of :data:`REASONS` that a scene gives to take over, as it is seen; nothing is felt at k = 0.

    Args:
        seen: record of :data:`records.SCENE`.
        p: parameters.
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
    return DISPLAY if seen.displayed < person.display else NOTHING


@jit
def response_time(p: Parameters) -> float:
    """The person's time from noticing to acting [s]: log-normal, the same throughout an episode."""
    return p.person.response * exp(p.person.response_spread * standard_normal(p.person.seed, _RESPONSE))


@jit_inlined
def take_in(scene: Scene, u_last: np.ndarray, memory: PersonMemory, p: Parameters, seen: Scene) -> bool:
    """One step of a person, before the command: what is seen, and whether the person drives.

    Args:
        scene: record of :data:`records.SCENE`.
        u_last: command that drove the car in the step before, shape (2,).
        memory: record of :data:`records.PERSON_MEMORY`.
        p: parameters.
        seen: record of :data:`records.SCENE`, a copy of the scene, changed to what is seen.

    Returns:
        Whether the person drives; else the hands rest, so that u_h,des is what is felt of the automation.
    """
    if scene.k == 0:
        clear_person(memory, p)
    advance_errors(memory, scene.k, p)
    perceive_late(scene, u_last, memory, p, seen)
    if not memory.engaged:
        if memory.noticed == np.inf:
            memory.reason = what_is_noticed(seen, p)
            if memory.reason != NOTHING:
                memory.noticed = scene.t
        memory.engaged = scene.t >= memory.noticed + response_time(p)
    return memory.engaged


@jit
def with_arm_noise(u_h_des: np.ndarray, memory: PersonMemory, p: Parameters) -> None:
    """Signal-dependent noise of the arm: the command times ``1 + arm_noise n``, within the limits; shape (2,)."""
    scale = 1.0 + p.person.arm_noise * memory.error[ARM]
    u_h_des[0] = min(max(scale * u_h_des[0], -p.limits.a_max), p.limits.a_max)
    u_h_des[1] = min(max(scale * u_h_des[1], -p.limits.delta_max), p.limits.delta_max)
