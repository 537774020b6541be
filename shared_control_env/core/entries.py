"""Calls of single functions from Python, for controllers and vehicles that have their own objects there.

Numba takes an array of any type in half a microsecond but a record by itself in ten, so these take 0-d arrays and hand
their one record, ``array[()]``, on.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

from shared_control_env.core.compile.jit import jit
from shared_control_env.core.control import driver, driver_lag, person
from shared_control_env.core.control.automation import AUTOMATE
from shared_control_env.core.control.automation import clear_automation as forget
from shared_control_env.core.world import traffic as vehicles
from shared_control_env.core.world import vehicle

Boxed: TypeAlias = Any
"""A record as a 0-d array."""

_automate = AUTOMATE.call


@jit
def drive(state: np.ndarray, a: float, delta: float, dt: float, parameters: Boxed, work: Boxed) -> None:
    """:func:`world.vehicle.plant_step`."""
    vehicle.plant_step(state, a, delta, dt, parameters[()].vehicle, work)


@jit
def decide_acceleration(
    row: np.ndarray,
    plan: Boxed,
    t: float,
    ego: np.ndarray,
    traffic: np.ndarray,
    line: np.ndarray,
    lane_width: float,
) -> None:
    """:func:`world.traffic.decide_acceleration`."""
    vehicles.decide_acceleration(row, plan[()], t, ego, traffic, line, lane_width)


@jit
def move_along(row: np.ndarray, plan: Boxed, line: np.ndarray, t: float, dt: float) -> None:
    """:func:`world.traffic.move_along`."""
    vehicles.move_along(row, plan[()], line, t, dt)


@jit
def clear_automation(memory: Boxed) -> None:
    """:func:`control.automation.clear_automation`."""
    forget(memory[()])


@jit
def automate(address: int, scene: Boxed, parameters: Boxed, memory: Boxed, work: Boxed) -> tuple[int, int, float]:
    """:func:`control.automation.automate`, at the address of its compiled form."""
    return _automate(address, scene[()], parameters[()], memory[()], work[()])


@jit
def build_program(
    scene: Boxed,
    u_last: np.ndarray,
    u_h_act: np.ndarray,
    parameters: Boxed,
    work: Boxed,
    P: np.ndarray,
    q: np.ndarray,
    A: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
) -> None:
    """:func:`control.driver.build_program`."""
    driver.build_program(scene[()], u_last, u_h_act, parameters[()], work[()], P, q, A, low, high)


@jit
def advance_arm(u_h_act: np.ndarray, u_h_des: np.ndarray, u_a_act: np.ndarray, parameters: Boxed) -> None:
    """:func:`control.driver_lag.advance_lag` of a driver's arm."""
    p = parameters[()]
    driver_lag.advance_lag(u_h_act, u_h_des, u_a_act, p.task.dt, p.lag)


@jit
def clear_person(memory: Boxed, parameters: Boxed) -> None:
    """:func:`control.person.clear_person`."""
    person.clear_person(memory[()], parameters[()])


@jit
def take_in(
    scene: Boxed,
    u_last: np.ndarray,
    memory: Boxed,
    parameters: Boxed,
    seen: Boxed,
) -> bool:
    """:func:`control.person.take_in`."""
    return person.take_in(scene[()], u_last, memory[()], parameters[()], seen[()])


@jit
def with_arm_noise(u_h_des: np.ndarray, memory: Boxed, parameters: Boxed) -> None:
    """:func:`control.person.with_arm_noise`."""
    person.with_arm_noise(u_h_des, memory[()], parameters[()])
