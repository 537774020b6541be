"""Episodes of the full suite through the kernel: how long 10,000 of them take."""

from __future__ import annotations

import os
from time import perf_counter

from shared_control_env.evaluation import evaluate

DRIVERS, AUTHORITIES, SEEDS = ("mpc", "scripted"), ("paper", "linear"), 4
"""What the episodes are made of: with the driver and the authority in the kernel, and in Python."""


def seconds_for(episodes: int, repeats: int, suite: str = "full") -> list[float]:
    """Time that so many episodes of 10 s take, from the rate of smaller runs of the whole suite on all cores [s]."""
    found = []
    for repeat in range(repeats + 1):
        begin = perf_counter()
        seeds = range(SEEDS * repeat, SEEDS * (repeat + 1))
        table = evaluate(DRIVERS, AUTHORITIES, suite, seeds=seeds, jobs=os.cpu_count() or 1)
        found.append((perf_counter() - begin) * episodes / len(table))
    return found[1:]
