"""Cost of each part of a vectorised step, timed in compiled loops over the situations of a closed loop."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import gymnasium as gym
import numpy as np
from numba import njit

from benchmarks.timing import Timing, time_block
from shared_control_env.core.authority import fuzzy
from shared_control_env.core.batch import WORK, Batch, Setup
from shared_control_env.core.compile.lanes import WIDTH
from shared_control_env.core.control import automation
from shared_control_env.core.control.block import empty, gather
from shared_control_env.core.control.predictive_driver import DRIVE, DRIVER_REPORT, PROGRAM
from shared_control_env.core.feedback import observation
from shared_control_env.core.risk.assessment import ASSESS
from shared_control_env.core.risk.finding import SEARCH, TRIANGULATE
from shared_control_env.core.world import scene as scenes
from shared_control_env.core.world import vehicle

triangulate, search, assess, drive = TRIANGULATE.call, SEARCH.call, ASSESS.call, DRIVE.call

N = 256
"""Number of environments in one loop."""


@njit
def _automation(batch: Batch, setup: Setup, works: np.ndarray, programs: np.ndarray) -> None:
    work = works[0].automations
    for i in range(batch.scenes.shape[0]):
        lane = i % WIDTH
        if lane == 0:
            empty(work.block)
        automation.enter(lane, i, batch.scenes[i], batch.parameters[i], batch.automations[i].U, work)
        work.limit[lane] = 2.0
        if lane == WIDTH - 1:
            gather(work.block)
            automation.solve(batch.scenes, batch.parameters, work)


@njit
def _perception(batch: Batch, setup: Setup, works: np.ndarray, programs: np.ndarray) -> None:
    for i in range(batch.scenes.shape[0]):
        scene = batch.scenes[i]
        scenes.perceive(scene.k, batch.states[i], batch.traffic[i], batch.lines[i], batch.parameters[i], scene)


@njit
def _triangulation(batch: Batch, setup: Setup, works: np.ndarray, programs: np.ndarray) -> None:
    finding = works[0].finding
    for i in range(batch.scenes.shape[0]):
        scene = batch.scenes[i]
        s = scene.region[0] + 0.5 * (scene.region[1] - scene.region[0])
        for n in range(4):
            finding.corners[0, n, 0] = s + (2.5 if n < 2 else -2.5)
            finding.corners[0, n, 1] = scene.region[3] + (0.7 if n == 0 or n == 3 else -0.6)
        n = triangulate(setup.calls.triangulate, scene, 1, finding)
        search(setup.calls.search, scene, batch.parameters[i], n, finding)


@njit
def _risk(batch: Batch, setup: Setup, works: np.ndarray, programs: np.ndarray) -> None:
    for i in range(batch.scenes.shape[0]):
        scene, p = batch.scenes[i], batch.parameters[i]
        assess(
            setup.calls.assess,
            p.task.tau_p,
            scene,
            batch.traffic[i],
            batch.lines[i],
            p,
            batch.signals[i],
            works[0].motion,
        )


@njit
def _fuzzy(batch: Batch, setup: Setup, works: np.ndarray, programs: np.ndarray) -> None:
    for i in range(batch.scenes.shape[0]):
        batch.signals[i].alpha_a = fuzzy.authority(batch.signals[i].r_x, batch.signals[i].r_y, 0)


@njit
def _dynamics(batch: Batch, setup: Setup, works: np.ndarray, programs: np.ndarray) -> None:
    for i in range(batch.scenes.shape[0]):
        u = batch.signals[i].u
        vehicle.plant_step(batch.states[i], u[0], u[1], setup.dt, batch.parameters[i].vehicle)


@njit
def _observation(batch: Batch, setup: Setup, works: np.ndarray, programs: np.ndarray) -> None:
    out, calls = np.empty(setup.scales.shape[0], dtype=np.float32), setup.calls
    for i in range(batch.scenes.shape[0]):
        p, memory, line = batch.parameters[i], batch.memories[i], batch.lines[i]
        observation.observe(calls.observe, setup.scales, batch.scenes[i], memory, line, p, out)


@njit
def _driver(batch: Batch, setup: Setup, works: np.ndarray, programs: np.ndarray) -> None:
    members, reports = np.empty(WIDTH, np.int64), np.empty(batch.scenes.shape[0], DRIVER_REPORT)
    for first in range(0, batch.scenes.shape[0], WIDTH):
        for lane in range(WIDTH):
            members[lane] = first + lane
        drive(
            setup.calls.drive,
            members,
            batch.scenes,
            batch.parameters,
            batch.memories,
            batch.persons,
            programs[0],
            reports,
        )


PARTS: dict[str, Callable[..., None]] = {
    "automation, 2 Gauss-Newton iterations": _automation,
    "scene: road frame, neighbours, region": _perception,
    "triangulation and search, 1 vehicle inside": _triangulation,
    "risk: prediction, both fields": _risk,
    "fuzzy inference": _fuzzy,
    "dynamics": _dynamics,
    "observation": _observation,
    "driver's program and active-set solver": _driver,
}
"""Name and loop of every part."""


def _anew(batch: Batch, automations: np.ndarray, states: np.ndarray, run: Callable[[], None]) -> int:
    """Run a loop again from the same situations, and return their number."""
    batch.automations[:], batch.states[:] = automations, states
    run()
    return N


def times(repeats: int, id: str = "SharedControl/TwoLane-v1") -> dict[str, Timing]:
    """Time of each part for one environment.

    Args:
        repeats: number of repeats.
        id: id of the environment.

    Returns:
        Time by the name of the part in :data:`PARTS`.
    """
    found = {}
    for name, loop in PARTS.items():
        env = gym.make_vec(id, num_envs=N, threads=1, driver=loop is _driver)
        env.reset(seed=0)
        rng = np.random.default_rng(0)
        for _ in range(25):
            action = 0.1 * rng.normal(size=(N, 2)).clip(-1, 1)
            env.step(np.zeros(N, int) if loop is _driver else action)
        batch, setup = env.unwrapped._batch, env.unwrapped._setup  # type: ignore[attr-defined]
        run = partial(loop, batch, setup, np.zeros(1, WORK), np.zeros(1, PROGRAM))
        found[name] = time_block(partial(_anew, batch, batch.automations.copy(), batch.states.copy(), run), repeats)
    return found
