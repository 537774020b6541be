"""Time from the import to the end of the first step, in a new process."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile

from benchmarks.timing import Timing

CODE = """
from time import perf_counter
begin = perf_counter()
import gymnasium as gym
import shared_control_env
imported = perf_counter()
env = gym.make("SharedControl/TwoLane-v1")
env.reset(seed=0)
env.step(env.action_space.sample())
print(perf_counter() - imported, perf_counter() - begin)
"""


VECTOR_CODE = """
import sys
from time import perf_counter
begin = perf_counter()
import gymnasium as gym, numpy as np
import shared_control_env
env = gym.make_vec("SharedControl/TwoLane-v1", num_envs=64, threads=1, driver=sys.argv[1] == "driver")
env.reset(seed=0)
env.step(np.zeros((64, 2)))
print(perf_counter() - begin)
"""


def vector_start(cold: bool, driver: bool = False) -> float:
    """Time from the import to the end of the kernel's first step, in a new process [s].

    Args:
        cold: whether numba's cache is empty; it is then a temporary folder.
        driver: whether the predictive driver is bound.
    """
    environment = dict(os.environ)
    with tempfile.TemporaryDirectory() as folder:
        if cold:
            environment["NUMBA_CACHE_DIR"] = folder
        command = [sys.executable, "-c", VECTOR_CODE, "driver" if driver else "random"]
        result = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    return float(result.stdout)


def first_step(repeats: int) -> tuple[Timing, Timing]:
    """Time to the end of the first step in a new process, with warm numba caches.

    Args:
        repeats: number of measured processes; one more runs before, unmeasured.

    Returns:
        Time from the end of the import, and time from its beginning.
    """
    times = []
    for _ in range(repeats + 1):
        result = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=True)
        times.append([float(value) for value in result.stdout.split()])
    after, whole = zip(*times[1:], strict=True)
    return Timing.of(list(after)), Timing.of(list(whole))
