"""The trained policies that come with the package, with their card in ``policies/README.md``."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

from shared_control_env.learned.policy import LearnedAllocator, LearnedDriver, Policy

POLICIES = Path(__file__).parent / "policies"
"""Folder of the policies and of their card."""

BEST = "best.json"
"""File that names the policy of each task with the largest return in validation."""


def shipped(task: str) -> dict[str, Path]:
    """Files of the policies that come with the package, by name.

    Args:
        task: ``driver`` or ``allocator``.
    """
    return {path.stem: path for path in sorted(POLICIES.glob(f"{task}-*.npz"))}


@cache
def best(task: str) -> Policy:
    """The policy of a task with the largest return in validation, on episodes that no comparison uses.

    Args:
        task: ``driver`` or ``allocator``.
    """
    return Policy.load(shipped(task)[json.loads((POLICIES / BEST).read_text())[task]])


def learned_driver() -> LearnedDriver:
    """The best driver that comes with the package."""
    return LearnedDriver(best("driver"))


def learned_allocator() -> LearnedAllocator:
    """The best allocator that comes with the package."""
    return LearnedAllocator(best("allocator"))
