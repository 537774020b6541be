"""Time from the import to the end of the first step, in a new process."""

from __future__ import annotations

import subprocess
import sys

from benchmarks.timing import Timing

CODE = """
from time import perf_counter
begin = perf_counter()
import gymnasium as gym
import shared_control_env
imported = perf_counter()
env = gym.make("SharedControl/TwoLane-v0")
env.reset(seed=0)
env.step(env.action_space.sample())
print(perf_counter() - imported, perf_counter() - begin)
"""


def first_step(repeats: int) -> tuple[Timing, Timing]:
    """After the import, and with it; numba's caches are warm."""
    times = []
    for _ in range(repeats + 1):
        result = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=True)
        times.append([float(value) for value in result.stdout.split()])
    after, whole = zip(*times[1:], strict=True)
    return Timing.of(list(after)), Timing.of(list(whole))
