"""Replay of one episode of the benchmark, with entries of the catalogue or of the folder of a run."""

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
from shared_control_env.evaluation.episodes import EpisodeBatch, Fault, run, versions
from shared_control_env.evaluation.fingerprint import fingerprint
from shared_control_env.evaluation.metrics import METRICS
from shared_control_env.evaluation.storage import read_manifest

GIVEN = "given: "
"""Prefix of a fingerprint that the user gave."""


def replay_episode(
    scenario: str,
    driver: tuple[str, DriverEntry],
    authority: tuple[str, AuthorityEntry],
    degradation: Fault,
    seed: int,
    frames: list[np.ndarray] | None = None,
    config: Mapping[str, Any] | None = None,
    automation: Callable[[], Planner] | None = None,
) -> dict[str, float]:
    """Run one episode in the same way as the benchmark.

    Args:
        scenario: key of :data:`envs.scenarios.SCENARIOS`.
        driver, authority: name and entry.
        degradation: key of :data:`envs.degradations.DEGRADATIONS`, or a
            :class:`~shared_control_env.evaluation.severity.GradedFault`; None for the scenario's own.
        seed: seed of the episode.
        frames: list to which pictures of every step are appended; None for no pictures.
        config: changes to the scenario's settings, as in the benchmark.
        automation: makes a user-defined automation; None for the predictive controller.

    Returns:
        Metrics of the episode by name.
    """
    (row,) = run(EpisodeBatch(scenario, driver, authority, ((degradation, seed),), config or {}, automation), frames)
    return {name: row[name] for name in METRICS}


class Entries(NamedTuple):
    """Driver, authority, settings and automation of an episode of a benchmark.

    Attributes:
        driver, authority: entries of driver and authority.
        config: changes to the scenario's settings.
        automation: makes a user-defined automation; None for the predictive controller.
    """

    driver: DriverEntry
    authority: AuthorityEntry
    config: Mapping[str, Any]
    automation: Callable[[], Planner] | None


def entries_of(folder: Path, driver: str, authority: str) -> Entries:
    """Read driver, authority, settings and automation of a benchmark's episodes from a results folder.

    A user's own class is imported by its path, with the working directory in the import path.

    Args:
        folder: folder of the results.
        driver, authority: names in the results.

    Raises:
        ValueError: if the results have no such names, or if a class is no longer found or has changed.
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
    """Raise ValueError unless this program has made the additions of the program that ran the benchmark."""
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
    """Import the maker of a user's driver, allocator or automation."""
    if described["origin"] == "settings":
        return None
    if described["origin"] is None:
        raise ValueError(
            f"{what} {name!r} belongs to the program that ran it and cannot be imported; replay its episodes "
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
    """Write frames as an MP4 file.

    Args:
        frames: frames of shape (height, width, 3).
        path: path of the file; its folder is made.
        fps: frames per second [1/s].
    """
    from moviepy import ImageSequenceClip

    path.parent.mkdir(parents=True, exist_ok=True)
    ImageSequenceClip(list(frames), fps=fps).write_videofile(str(path), logger=None)
