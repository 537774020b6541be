"""Entries that a program adds to the tables of the package. Other processes need them, and results depend on them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from shared_control_env.core.faults import kinds
from shared_control_env.core.feedback import observation, reward
from shared_control_env.core.world import tyre
from shared_control_env.envs import degradations, scenarios
from shared_control_env.evaluation import metrics
from shared_control_env.evaluation.fingerprint import fingerprint

TABLES: dict[str, dict[str, Any]] = {
    "kinds": kinds.KINDS,
    "tyres": tyre.TYRES,
    "observations": observation.OBSERVATIONS,
    "reward terms": reward.TERMS,
    "degradations": degradations.DEGRADATIONS,
    "scenarios": scenarios.SCENARIOS,
    "metrics": metrics.METRICS,
}
"""The tables that a program can add entries to, by name."""

OWN = {
    "kinds": kinds.STANDARD,
    "tyres": tyre.STANDARD,
    "observations": observation.STANDARD,
    "reward terms": reward.STANDARD,
    "degradations": degradations.STANDARD,
    "scenarios": scenarios.STANDARD,
    "metrics": metrics.STANDARD,
}
"""Names of the entries that the package defines, by table."""


def additions() -> dict[str, dict[str, Any]]:
    """Entries that the program has added, by table and name. Tables without additions are left out."""
    found = {
        name: {key: entry for key, entry in table.items() if key not in OWN[name]} for name, table in TABLES.items()
    }
    return {name: entries for name, entries in found.items() if entries}


def adopt(added: Mapping[str, Mapping[str, Any]]) -> None:
    """Add the additions of another process. Entries that imported modules have already added are kept.

    Args:
        added: result of :func:`additions` in the other process.
    """
    for name, entries in added.items():
        for key, entry in entries.items():
            if key in TABLES[name]:
                continue
            if name == "scenarios":
                scenarios.add_scenario(key, entry)
            else:
                TABLES[name][key] = entry


def described(added: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, str]]:
    """Digest of every added entry, which distinguishes it from other entries of the same name.

    Args:
        added: result of :func:`additions`.

    Returns:
        Digests by table and name.
    """
    return {name: {key: fingerprint(entry) for key, entry in entries.items()} for name, entries in added.items()}
