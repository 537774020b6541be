"""One episode of the benchmark again: to see it, from its names or from the folder of a run."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from shared_control_env.controllers.automation import Planner
from shared_control_env.evaluation.additions import additions, described
from shared_control_env.evaluation.catalogue import AUTHORITIES, DRIVERS, AuthorityEntry, DriverEntry, choose_one
from shared_control_env.evaluation.episodes import Batch, run, versions
from shared_control_env.evaluation.fingerprint import fingerprint
from shared_control_env.evaluation.metrics import METRICS
from shared_control_env.evaluation.storage import read_manifest

GIVEN = "given: "
"""Begins a fingerprint that the user gave."""


def replay_episode(
    scenario: str,
    driver: tuple[str, DriverEntry],
    authority: tuple[str, AuthorityEntry],
    degradation: str | None,
    seed: int,
    frames: list[np.ndarray] | None = None,
    config: Mapping[str, Any] | None = None,
    automation: Callable[[], Planner] | None = None,
) -> dict[str, float]:
    """Run one episode, as the benchmark runs it.

    Args:
        scenario, driver, authority, degradation, seed: as in the benchmark's table; no degradation for the
            scenario's own.
        frames: pictures of every step are appended, where a list is given.
        config: changes to the scenario's settings, those of the benchmark.
        automation: makes another automation; None for the predictive controller.

    Returns:
        Its metrics.
    """
    (row,) = run(Batch(scenario, driver, authority, ((degradation, seed),), config or {}, automation), frames)
    return {name: row[name] for name in METRICS}


class Entries(NamedTuple):
    """What an episode of a benchmark was run with.

    Attributes:
        driver, authority: their entries.
        config: changes to the scenario's settings.
        automation: makes another automation; None for the predictive controller.
    """

    driver: DriverEntry
    authority: AuthorityEntry
    config: Mapping[str, Any]
    automation: Callable[[], Planner] | None


def entries_of(folder: Path, driver: str, authority: str) -> Entries:
    """What an episode of the benchmark that a folder holds was run with.

    A user's own class is imported by its path, as from the present folder.

    Args:
        folder: of the benchmark.
        driver, authority: their names there.

    Raises:
        ValueError: if the folder has no such names, or a class is not found any more or has changed.
    """
    manifest = read_manifest(folder)
    if manifest["versions"] != versions():
        warnings.warn(f"{folder} holds results of {manifest['versions']}; now it is {versions()}", stacklevel=2)
    first = choose_one("driver", driver, manifest["drivers"])
    second = choose_one("authority", authority, manifest["authorities"])
    if first["origin"] == "catalogue":
        driver_entry = choose_one("driver", driver, DRIVERS)
    else:
        make, draws = _make("driver", driver, first), tuple(first["draws"])
        driver_entry = DriverEntry("given by the user", make, first["config"], draws=draws)
    if second["origin"] == "catalogue":
        authority_entry = choose_one("authority", authority, AUTHORITIES)
    else:
        make = _make("authority", authority, second)
        authority_entry = AuthorityEntry("given by the user", second["law"], make)
    automation = _make("automation", "given", manifest["automation"]) if manifest.get("automation") else None
    _check_additions(folder, manifest.get("additions", {}))
    return Entries(driver_entry, authority_entry, manifest["config"], automation)


def _check_additions(folder: Path, expected: Mapping[str, Mapping[str, str]]) -> None:
    """Raise ValueError unless this program has added what the one that ran the benchmark had."""
    present = described(additions())
    for table, entries in expected.items():
        for name, digest in entries.items():
            if name not in present.get(table, {}):
                raise ValueError(
                    f"{folder} was made with {name!r} added to the {table}, which this program has not added; replay "
                    "its episodes in the program that does, by shared_control_env.evaluation.replay_episode"
                )
            if present[table][name] != digest:
                raise ValueError(f"{name!r}, added to the {table}, has changed since {folder} was made")


def _make(what: str, name: str, described: Mapping[str, Any]) -> Any:
    """What makes a user's driver or allocator, imported."""
    if described["origin"] == "settings":
        return None
    if described["origin"] is None:
        raise ValueError(
            f"{what} {name!r} is of the program that ran the benchmark and cannot be imported; replay its episodes "
            "there, by shared_control_env.evaluation.replay_episode"
        )
    module, _, path = described["origin"].partition(":")
    if str(Path.cwd()) not in sys.path:
        sys.path.insert(0, str(Path.cwd()))
    try:
        found: Any = import_module(module)
        for part in path.split("."):
            found = getattr(found, part)
    except (ImportError, AttributeError) as error:
        raise ValueError(f"{what} {name!r} is {described['origin']}, which cannot be imported: {error}") from None
    if not described["fingerprint"].startswith(GIVEN) and fingerprint(found) != described["fingerprint"]:
        raise ValueError(
            f"{what} {name!r}: {described['origin']} has changed since; its old episodes cannot be replayed"
        )
    return found


def record(frames: Sequence[np.ndarray], path: Path, fps: int = 20) -> None:
    """Write frames as an MP4 at the speed of the drive."""
    from moviepy import ImageSequenceClip

    path.parent.mkdir(parents=True, exist_ok=True)
    ImageSequenceClip(list(frames), fps=fps).write_videofile(str(path), logger=None)
