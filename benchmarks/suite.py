"""Time of 10,000 episodes of the full suite in the kernel."""

from __future__ import annotations

import os
from time import perf_counter

from shared_control_env.evaluation import evaluate

DRIVERS, AUTHORITIES, SEEDS = ("mpc", "scripted"), ("paper", "linear"), 4
"""Drivers and authorities of the episodes, one of each in the kernel and one in Python, and the number of seeds."""


def seconds_for(episodes: int, repeats: int, suite: str = "full") -> list[float]:
    """Time of a number of episodes of 10 s, extrapolated from smaller runs of the whole suite on all cores [s].

    Args:
        episodes: number of episodes.
        repeats: number of measured runs; one more runs before, unmeasured.
        suite: name of the suite.

    Returns:
        One time per measured run.
    """
    found = []
    for repeat in range(repeats + 1):
        begin = perf_counter()
        seeds = range(SEEDS * repeat, SEEDS * (repeat + 1))
        table = evaluate(DRIVERS, AUTHORITIES, suite, seeds=seeds, jobs=os.cpu_count() or 1)
        found.append((perf_counter() - begin) * episodes / len(table))
    return found[1:]
