"""Solvers against SciPy on the same compiled cost, their gap to the optimum, and the time of the OSQP driver."""

from __future__ import annotations

from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from scipy.optimize import minimize

from benchmarks.timing import Timing, time_block
from shared_control_env.core.compile.jit import jit
from shared_control_env.core.control.automation import AUTOMATIONS, enter, roll_out, solve
from shared_control_env.core.control.block import empty, gather
from shared_control_env.core.records import MAX_CONTROL
from shared_control_env.wrappers import DriverModel


@jit
def pose(U: np.ndarray, scenes: np.ndarray, parameters: np.ndarray, iterations: int, automations: Any) -> None:
    """Let one automation enter a block of its own.

    Args:
        U: guess of the commands [m/s^2, rad], shape (MAX_CONTROL, 2).
        scenes, parameters: the scene and the parameters, shape (1,).
        iterations: number of Gauss-Newton iterations.
        automations: record of :data:`control.automation.AUTOMATIONS`, a 0-d array, written.
    """
    work = automations[()]
    empty(work.block)
    enter(0, 0, scenes[0], parameters[0], U, work)
    work.limit[0] = float(iterations)
    gather(work.block)


@jit
def solve_posed(scenes: np.ndarray, parameters: np.ndarray, automations: Any) -> None:
    """Call :func:`core.control.automation.solve` with its record as a 0-d array.

    Args:
        scenes, parameters: the scene and the parameters, shape (1,).
        automations: record of :data:`control.automation.AUTOMATIONS`, a 0-d array, written.
    """
    solve(scenes, parameters, automations[()])


@jit
def roll_out_posed(with_model: bool, scenes: np.ndarray, parameters: np.ndarray, automations: Any) -> None:
    """Call :func:`core.control.automation.roll_out` with its record as a 0-d array.

    Args:
        with_model: whether the quadratic model is computed.
        scenes, parameters: the scene and the parameters, shape (1,).
        automations: record of :data:`control.automation.AUTOMATIONS`, a 0-d array, written.
    """
    roll_out(with_model, scenes, parameters, automations[()])


def solve_automation(
    U: np.ndarray, scene: np.ndarray, parameters: np.ndarray, iterations: int, work: np.ndarray
) -> tuple[int, int, float, float]:
    """Solve one automation's problem with :func:`core.control.automation.solve`.

    Args:
        U: commands, start and result [m/s^2, rad], shape (MAX_CONTROL, 2).
        scene, parameters, work: records as 0-d arrays.
        iterations: number of Gauss-Newton iterations.

    Returns:
        Status, number of iterations, residual and cost.
    """
    pose(U, scene.reshape(1), parameters.reshape(1), iterations, work)
    solve_posed(scene.reshape(1), parameters.reshape(1), work)
    U[:] = work["block"]["U"][:, :, 0]
    return int(work["status"][0]), int(work["iterations"][0]), float(work["residual"][0]), float(work["cost"][0])


def automation_cost(U: np.ndarray, scene: np.ndarray, parameters: np.ndarray, work: np.ndarray) -> float:
    """Cost of commands, see :func:`core.control.automation.roll_out`.

    Args:
        U: commands [m/s^2, rad], shape (MAX_CONTROL, 2).
        scene, parameters, work: records as 0-d arrays.
    """
    pose(U, scene.reshape(1), parameters.reshape(1), 0, work)
    roll_out_posed(False, scene.reshape(1), parameters.reshape(1), work)
    return float(work["block"]["value"][0])


class Gaps(NamedTuple):
    """Relative cost gap to the converged optimum, 95th percentile.

    Attributes:
        cold: gap from a start at zero, with the iterations of the first step [-].
        warm: gap from the solution of the step before, with the iterations of later steps [-].
    """

    cold: float
    warm: float


def scenes(count: int) -> list[np.ndarray]:
    """Scenes of a closed loop with a degraded automation, from random starts.

    Args:
        count: number of scenes.
    """
    rng = np.random.default_rng(0)
    found: list[np.ndarray] = []
    while len(found) < count:
        start = {"speed": float(rng.uniform(6.0, 25.0)), "lateral_offset": float(rng.uniform(-1.5, 1.5))}
        config = {"ego": start, "authority": {"law": "proportional"}}
        env = DriverModel(gym.make("SharedControl/TwoLane-v1", config=config))
        env.reset(seed=0)
        for _ in range(20):
            found.append(env.unwrapped.scene.copy())  # type: ignore[attr-defined]
            if env.step(0)[2]:
                break
    return found[:count]


def parameters_and_limits() -> tuple[np.ndarray, np.ndarray]:
    """Packed parameters of the environment, and the limits of the commands."""
    env = gym.make("SharedControl/TwoLane-v1").unwrapped
    return env.parameters, env.command_limits  # type: ignore[attr-defined]


def automation(found: list[np.ndarray], repeats: int) -> tuple[Timing, Timing, Gaps]:
    """Time two Gauss-Newton iterations, and SLSQP to convergence, and measure the gaps in cost.

    Args:
        found: scenes of :func:`scenes`.
        repeats: number of repeats of the timings.

    Returns:
        Time of the Gauss-Newton iterations, time of SLSQP, and the gaps.
    """
    parameters, scale = parameters_and_limits()
    work, U = np.zeros((), AUTOMATIONS), np.zeros((MAX_CONTROL, 2))
    H_c = int(parameters["automation"]["H_c"])

    def ours() -> int:
        for scene in found:
            U[:] = 0.0
            solve_automation(U, scene, parameters, 2, work)
        return len(found)

    def slsqp(scene: np.ndarray) -> float:
        trial = np.zeros((MAX_CONTROL, 2))

        def cost_of(x: np.ndarray) -> float:
            trial[:H_c] = x.reshape(H_c, 2) * scale
            return automation_cost(trial, scene, parameters, work)

        bounds = [(-1.0, 1.0)] * (2 * H_c)
        return minimize(cost_of, np.zeros(2 * H_c), method="SLSQP", bounds=bounds, options={"ftol": 1e-10}).fun

    some = found[:: max(1, len(found) // 40)]

    def theirs() -> int:
        for scene in some:
            slsqp(scene)
        return len(some)

    cold, warm = [], []
    for before, scene in zip(found[:-1], found[1:], strict=True):
        U[:] = 0.0
        best = solve_automation(U, scene, parameters, 200, work)[3]
        U[:] = 0.0
        first = int(parameters["solver"]["first_iterations"])
        value = solve_automation(U, scene, parameters, first, work)[3]
        cold.append((value - best) / max(best, 1e-6))
        if scene["k"] > 0:
            U[:] = 0.0
            solve_automation(U, before, parameters, 200, work)
            U[: H_c - 1] = U[1:H_c]
            value = solve_automation(U, scene, parameters, int(parameters["solver"]["iterations"]), work)[3]
            warm.append((value - best) / max(best, 1e-6))
    gaps = Gaps(float(np.percentile(cold, 95)), float(np.percentile(warm, 95)))
    return time_block(ours, repeats), time_block(theirs, max(3, repeats // 5)), gaps


def osqp_driver(episodes: int) -> Timing:
    """Time of condensing and solving the driver's program at eps = 1e-5 in closed-loop episodes of both cases.

    Args:
        episodes: number of episodes of each case.
    """
    seconds = []
    for name in ("SharedControl/TwoLane-v1", "SharedControl/Curve-v1"):
        env = DriverModel(gym.make(name, config={"authority": {"law": "proportional"}}))
        for _ in range(episodes):
            env.reset(seed=0)
            done = False
            while not done:
                _, _, terminated, truncated, _ = env.step(0)
                done = terminated or truncated
                seconds.append(env.driver.solution.time)  # type: ignore[attr-defined]
    return Timing.of(seconds)
