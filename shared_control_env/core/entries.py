"""Entry points that call single core functions from Python, for controllers and vehicles that are Python objects.

Numba needs half a microsecond for an array argument of any type, but ten for a record argument. These functions
therefore take 0-d arrays and pass on the one record that each array holds, ``array[()]``.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

from shared_control_env.core.authority import allocators
from shared_control_env.core.authority.allocators import Situation
from shared_control_env.core.compile.jit import jit
from shared_control_env.core.control import automation, driver, driver_lag, person
from shared_control_env.core.control.block import empty, gather
from shared_control_env.core.world import actuator, replay, vehicle
from shared_control_env.core.world import traffic as traffic_model

Boxed: TypeAlias = Any
"""A record held in a 0-d array."""

_automate, _allocate = automation.AUTOMATE.call, allocators.ALLOCATE.call
_decide, _advance = replay.DECIDE.call, replay.ADVANCE.call


@jit
def step_plant(state: np.ndarray, u: np.ndarray, realised: np.ndarray, dt: float, parameters: Boxed) -> None:
    """Advance actuators and plant by one step, see :mod:`world.actuator` and :func:`world.vehicle.plant_step`.

    Args:
        state: ego ``[x, y, psi, v_x, v_y, r]``, overwritten, shape (6,).
        u: command ``[a, delta]`` [m/s^2, rad], held over the step, shape (2,).
        realised: output of the actuators [m/s^2, rad], overwritten, shape (2,).
        dt: step [s].
        parameters: :class:`core.parameters.Parameters`, a 0-d array.
    """
    p = parameters[()]
    actuator.actuate(u, dt, p.actuator, realised)
    vehicle.plant_step(state, realised[0], realised[1], dt, p.vehicle)


@jit
def decide_acceleration(
    row: np.ndarray,
    plan: Boxed,
    t: float,
    ego: np.ndarray,
    traffic: np.ndarray,
    line: np.ndarray,
) -> None:
    """Decide the acceleration of one other vehicle, see :func:`world.traffic.decide_acceleration`.

    Args:
        row: the vehicle's row of the traffic array, shape (8,); the acceleration is written.
        plan: :class:`core.parameters.TrafficParameters` of the vehicle, a 0-d array.
        t: time [s].
        ego: the ego as a row of the traffic array, shape (8,).
        traffic: all other vehicles, shape (n, 8).
        line: reference line, shape (m, 12).
    """
    traffic_model.decide_acceleration(row, plan[()], t, ego, traffic, line)


@jit
def decide(
    me: int,
    plans: np.ndarray,
    traffic: np.ndarray,
    ego: np.ndarray,
    step: int,
    dt: float,
    line: np.ndarray,
    work: np.ndarray,
) -> None:
    """Decide how a vehicle with a recorded track moves, see :func:`world.replay.decide`.

    Args:
        me: index of the vehicle.
        plans: records of :class:`core.parameters.TrafficParameters`, shape (n,).
        traffic: all vehicles but the ego, shape (n, 8).
        ego: the ego as a row of the traffic array, shape (8,).
        step: simulation step.
        dt: simulation step [s].
        line: reference line, shape (m, 12).
        work: scratch, shape (3, 8).
    """
    _decide(plans[me].decide, me, plans, traffic, ego, step, dt, line, work)


@jit
def advance(
    me: int, plans: np.ndarray, traffic: np.ndarray, ego: np.ndarray, step: int, dt: float, line: np.ndarray
) -> None:
    """Move a vehicle with a recorded track, see :func:`world.replay.advance`.

    Args:
        me, plans, traffic, ego, step, dt, line: as for :func:`decide`.
    """
    _advance(plans[me].advance, me, plans, traffic, ego, step, dt, line)


@jit
def move_along(row: np.ndarray, plan: Boxed, line: np.ndarray, t: float, dt: float) -> None:
    """Move one other vehicle along the road, see :func:`world.traffic.move_along`.

    Args:
        row: the vehicle's row of the traffic array, overwritten, shape (8,).
        plan: :class:`core.parameters.TrafficParameters` of the vehicle, a 0-d array.
        line: reference line, shape (m, 12).
        t: time [s].
        dt: step [s].
    """
    traffic_model.move_along(row, plan[()], line, t, dt)


@jit
def clear_automation(memory: Boxed) -> None:
    """Reset the automation's memory, see :func:`control.automation.clear_automation`.

    Args:
        memory: record of :data:`records.AUTOMATION_MEMORY`, a 0-d array, overwritten.
    """
    automation.clear_automation(memory[()])


@jit
def automate(
    address: int, scenes: np.ndarray, parameters: np.ndarray, memory: Boxed, signals: Boxed, automations: Boxed
) -> None:
    """Compute one automation's desired command, see :func:`control.automation.automate`.

    Args:
        address: address of the compiled function.
        scenes: record of :data:`records.SCENE`, shape (1,).
        parameters: :class:`core.parameters.Parameters`, shape (1,).
        memory: record of :data:`records.AUTOMATION_MEMORY`, a 0-d array, updated.
        signals: record of :data:`records.SIGNALS`, a 0-d array; ``u_a_des`` and the solver's outcome are written.
        automations: record of :data:`control.automation.AUTOMATIONS`, a 0-d array.
    """
    work = automations[()]
    empty(work.block)
    automation.enter(0, 0, scenes[0], parameters[0], memory[()].U, work)
    _automate(address, scenes, parameters, work)
    automation.leave(0, work, memory[()], signals[()])


@jit
def build_program(
    scenes: np.ndarray,
    u_last: np.ndarray,
    u_h_act: np.ndarray,
    parameters: Boxed,
    drivers: Boxed,
    P: np.ndarray,
    q: np.ndarray,
    A: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
) -> None:
    """Build one driver's quadratic program, see :mod:`control.driver`.

    Args:
        scenes: record of :data:`records.SCENE`, shape (1,).
        u_last: the driver's last desired command [m/s^2, rad], shape (2,).
        u_h_act: the driver's present actual command [m/s^2, rad], shape (2,).
        parameters: :class:`core.parameters.Parameters`, a 0-d array.
        drivers: record of :data:`control.driver.DRIVERS`, a 0-d array.
        P: quadratic cost, written, shape (n, n) with n = :func:`control.driver.count_variables`.
        q: linear cost, written, shape (n,).
        A: constraint matrix, written, shape (:func:`control.driver.count_rows`, n).
        low, high: bounds of the rows of A, written, one entry per row.
    """
    work = drivers[()]
    empty(work.block)
    driver.enter(0, 0, scenes[0], u_last, u_h_act, parameters[()], work)
    gather(work.block)
    driver.condense(scenes, work)
    driver.program_of(0, parameters[()], work, P, q, A, low, high)


@jit
def advance_arm(u_h_act: np.ndarray, u_h_des: np.ndarray, u_a_act: np.ndarray, parameters: Boxed) -> None:
    """Advance the lag of the driver's arm by one time step, see :func:`control.driver_lag.advance_lag`.

    Args:
        u_h_act: the driver's actual command [m/s^2, rad], overwritten, shape (2,).
        u_h_des: the driver's desired command [m/s^2, rad], shape (2,).
        u_a_act: the automation's actual command [m/s^2, rad], shape (2,).
        parameters: :class:`core.parameters.Parameters`, a 0-d array.
    """
    p = parameters[()]
    driver_lag.advance_lag(u_h_act, u_h_des, u_a_act, p.task.dt, p.lag)


@jit
def clear_person(memory: Boxed, parameters: Boxed) -> None:
    """Reset the person's memory, see :func:`control.person.clear_person`.

    Args:
        memory: record of :data:`records.PERSON_MEMORY`, a 0-d array, overwritten.
        parameters: :class:`core.parameters.Parameters`, a 0-d array.
    """
    person.clear_person(memory[()], parameters[()])


@jit
def perceive_and_attend(
    scene: Boxed,
    u_last: np.ndarray,
    memory: Boxed,
    parameters: Boxed,
    seen: Boxed,
) -> bool:
    """Compute what the person perceives, see :func:`control.person.perceive_and_attend`.

    Args:
        scene: record of :data:`records.SCENE`, a 0-d array.
        u_last: command that drove the vehicle in the previous step [m/s^2, rad], shape (2,).
        memory: record of :data:`records.PERSON_MEMORY`, a 0-d array, updated.
        parameters: :class:`core.parameters.Parameters`, a 0-d array.
        seen: copy of the scene, a 0-d array, changed to what the person perceives.

    Returns:
        Whether the person drives.
    """
    return person.perceive_and_attend(scene[()], u_last, memory[()], parameters[()], seen[()])


@jit
def add_arm_noise(u_h_des: np.ndarray, memory: Boxed, parameters: Boxed) -> None:
    """Apply the noise of the person's arm to a command, see :func:`control.person.add_arm_noise`.

    Args:
        u_h_des: the driver's desired command [m/s^2, rad], overwritten, shape (2,).
        memory: record of :data:`records.PERSON_MEMORY`, a 0-d array.
        parameters: :class:`core.parameters.Parameters`, a 0-d array.
    """
    person.add_arm_noise(u_h_des, memory[()], parameters[()])


@jit
def risks_of(
    a: float,
    delta: float,
    tau: float,
    scene: Boxed,
    signals: Boxed,
    memory: Boxed,
    parameters: Boxed,
    traffic: np.ndarray,
    line: np.ndarray,
    trial: Boxed,
    motion: Boxed,
    assess: int,
) -> tuple[float, float]:
    """Compute the risks of any command, see :func:`authority.allocators.risks_of`.

    Args:
        a: acceleration [m/s^2].
        delta: steering angle [rad].
        tau: prediction horizon [s].
        scene, signals, memory, parameters, trial, motion: records of the situation, 0-d arrays.
        traffic, line, assess: as in :class:`authority.allocators.Situation`.

    Returns:
        r_x and r_y [-].
    """
    now = Situation(scene[()], signals[()], memory[()], parameters[()], traffic, line, trial[()], motion[()], assess)
    return allocators.risks_of(a, delta, tau, now)


@jit
def allocate(
    address: int,
    scene: Boxed,
    signals: Boxed,
    memory: Boxed,
    parameters: Boxed,
    traffic: np.ndarray,
    line: np.ndarray,
    trial: Boxed,
    motion: Boxed,
    assess: int,
) -> tuple[float, float, int]:
    """Let a compiled allocator decide, see :data:`authority.allocators.ALLOCATE`.

    Args:
        address: address of the compiled function.
        scene, signals, memory, parameters, trial, motion: records of the situation, 0-d arrays.
        traffic, line, assess: as in :class:`authority.allocators.Situation`.

    Returns:
        Authorities over acceleration and over steering [-]; index of the alert.
    """
    now = Situation(scene[()], signals[()], memory[()], parameters[()], traffic, line, trial[()], motion[()], assess)
    return _allocate(address, now)
