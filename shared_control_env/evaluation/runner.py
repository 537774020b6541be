"""``evaluate``: runs drivers and authorities on a suite, and returns a table with one row per episode."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from shared_control_env.controllers.automation import Planner
from shared_control_env.envs.scenarios import SCENARIOS
from shared_control_env.envs.seeds import checked_seed
from shared_control_env.envs.settings import Settings, as_plain, combined
from shared_control_env.evaluation import engines
from shared_control_env.evaluation.additions import additions, described
from shared_control_env.evaluation.catalogue import (
    AUTHORITIES,
    DRIVERS,
    Authorities,
    AuthorityEntry,
    DriverEntry,
    Drivers,
    Suite,
    checked_automation,
    choose_one,
    chosen_authorities,
    chosen_drivers,
    chosen_suite,
)
from shared_control_env.evaluation.episodes import MOST_SEEDS, EpisodeBatch, plan, settings_of, versions
from shared_control_env.evaluation.fingerprint import fingerprint
from shared_control_env.evaluation.replay import GIVEN
from shared_control_env.evaluation.storage import MAY_GROW, REPORT, TABLE, ResultsFolder, sorted_table, write_atomically
from shared_control_env.vector.checks import settings_for_kernel

ENGINES = ("local", "ray")
"""Names of the engines."""


def evaluate(
    driver: Drivers = "mpc",
    authority: Authorities = "paper",
    suite: str | Suite = "paper",
    *,
    seeds: Iterable[int] = (0,),
    config: Mapping[str, Any] | None = None,
    automation: Callable[[], Planner] | None = None,
    out: Path | str | None = None,
    fresh: bool = False,
    jobs: int = 1,
    engine: str = "local",
    progress: Callable[[int, int], None] | None = None,
) -> pd.DataFrame:
    """Run every episode of a suite with every driver under every authority.

    Args:
        driver: a name of :data:`catalogue.DRIVERS`, several names, ``all``, or your own drivers as a mapping of names
            to makers. A maker returns a :class:`~shared_control_env.controllers.driver.Driver`, such as its class
            does; ``act`` returns the command in m/s^2 and rad.
        authority: likewise for :data:`catalogue.AUTHORITIES`. Your own
            :class:`~shared_control_env.controllers.allocators.Allocator` acts by the law ``proportional`` unless it is
            given as an :class:`AuthorityEntry`.
        suite: a name of :data:`catalogue.SUITES`, or your own suite.
        seeds: seeds of the episodes; a seed gives the same episode to every driver and authority.
        config: changes to the settings of all scenarios. Settings that define an entry, such as the lag of ``mpc_1``,
            cannot be changed.
        automation: makes a user-defined automation for each episode, such as its class, with ``reset()`` and
            ``act(scene)``. Its episodes run one by one, without the kernel.
        out: folder that stores the results as they are completed; an interrupted run resumes from there. At the end
            ``episodes.parquet`` and ``report.html`` are written into it. If one of your own drivers or allocators has
            changed, its episodes are run again.
        fresh: remove all earlier results from the folder.
        jobs: number of processes. They import the program that starts them, so a script must call this function under
            ``if __name__ == "__main__":``. Your own drivers must be picklable by name, so they cannot be defined in a
            notebook.
        engine: ``local``, or ``ray`` for the connected Ray cluster, or for one that is started here.
        progress: called with the number of completed episodes and the number of all episodes.

    Returns:
        One row per episode: scenario, degradation, driver, authority, seed, whether it was terminated, its
        duration [s], the driver's K_h [-] and T_h [s], the person at the wheel, the response time and the time at
        which that person noticed something [s], every metric of :data:`metrics.METRICS`, the digest of its settings,
        and the versions.

    Raises:
        ValueError: for unknown names, with the nearest and all valid ones; for an entry that does not make a driver or
            allocator; for settings that contradict each other; or for a folder of another benchmark. All checks are
            made before the first episode runs.
    """
    drivers, authorities, chosen = chosen_drivers(driver), chosen_authorities(authority), chosen_suite(suite)
    numbers = _checked_seeds(seeds)
    check_options(jobs, engine, fresh)
    changes = checked_changes(config)
    checked_automation(automation)
    batches = list(plan(chosen, drivers, authorities, numbers, changes, automation))
    check_settings(batches)
    if out is None:
        done = [
            row for _, rows in _progressing(run_batches(batches, None, jobs, engine), batches, progress) for row in rows
        ]
        return sorted_table(pd.DataFrame(done))
    manifest = {
        "suite": suite if isinstance(suite, str) else chosen._asdict(),
        "seeds": numbers,
        "config": changes,
        **described_entries(drivers, authorities),
    }
    if automation is not None:
        manifest["automation"] = _origin_and_fingerprint("automation", "given", automation)
    folder = ResultsFolder(Path(out).expanduser(), manifest, fresh)
    try:
        for notice in folder.notices:
            warnings.warn(notice, stacklevel=2)
        for _ in _progressing(run_batches(batches, folder, jobs, engine), batches, progress):
            pass
        return _finish(folder)
    finally:
        folder.close()


def check_options(jobs: int, engine: str, fresh: bool) -> None:
    """Check how episodes are to be run.

    Args:
        jobs: number of processes.
        engine: one of :data:`ENGINES`.
        fresh: whether earlier results are removed.

    Raises:
        ValueError: for a wrong number of processes, an unknown engine, or a ``fresh`` that is neither True nor False.
    """
    if isinstance(jobs, bool) or not isinstance(jobs, int) or jobs < 1:
        raise ValueError(f"jobs = {jobs!r} must be an integer of at least 1")
    choose_one("engine", engine, dict.fromkeys(ENGINES))
    if not isinstance(fresh, bool):
        raise ValueError(f"fresh = {fresh!r} must be True or False")


def checked_changes(config: Mapping[str, Any] | None) -> dict[str, Any]:
    """Changes to settings in plain types.

    Args:
        config: the changes; None for none.

    Raises:
        ValueError: if they are no dict.
    """
    if config is not None and not isinstance(config, Mapping):
        raise ValueError(f"config = {config!r} must be a dict")
    return as_plain(config or {})


def described_entries(drivers: Mapping[str, DriverEntry], authorities: Mapping[str, AuthorityEntry]) -> dict[str, Any]:
    """Parts of a folder's manifest: versions, drivers, authorities, and what the program has added to the tables.

    Args:
        drivers, authorities: entries by name.
    """
    manifest: dict[str, Any] = {
        "versions": versions(),
        "drivers": {name: _described("driver", name, entry, DRIVERS) for name, entry in drivers.items()},
        "authorities": {name: _described("authority", name, entry, AUTHORITIES) for name, entry in authorities.items()},
    }
    added = additions()
    return {**manifest, "additions": described(added)} if added else manifest


def _checked_seeds(seeds: Iterable[int]) -> list[int]:
    """Check the seeds: integers that fit a column of the table. Duplicates are removed."""
    if not isinstance(seeds, Iterable) or isinstance(seeds, str | bytes):
        raise ValueError(f"seeds = {seeds!r} must be several integers, such as range(10)")
    numbers: dict[int, None] = {}
    for seed in seeds:
        number = checked_seed(seed, "seeds: an entry")
        if number is None or number >= 2**63:
            raise ValueError(f"seeds: an entry = {seed!r} must be an integer in [0, {2**63 - 1}]")
        numbers[number] = None
        if len(numbers) > MOST_SEEDS:
            raise ValueError(f"seeds has more than {MOST_SEEDS} entries, the largest number allowed")
    if not numbers:
        raise ValueError("seeds is empty; it must hold at least one integer")
    return list(numbers)


def check_settings(batches: Sequence[EpisodeBatch]) -> None:
    """Check the settings of all batches before the first episode runs.

    Args:
        batches: the batches.

    Raises:
        ValueError: for wrong settings, or a person in the settings who would not act.
    """
    checked: dict[tuple[str, bool, str], Settings] = {}
    for batch in batches:
        scenario, in_kernel = SCENARIOS[batch.scenario], batch.automation is None
        config = settings_of(batch, batch.episodes[0][0])
        key = batch.scenario, in_kernel, json.dumps(config, sort_keys=True, default=repr)
        if key not in checked:
            if in_kernel:
                checked[key] = settings_for_kernel(scenario, config)
            else:
                checked[key] = combined(scenario.settings, config)
        if checked[key].has_person and batch.driver[1].make is not None:
            raise ValueError(
                "the person in config['person'] or config['persons'] would not act: "
                f"{batch.driver[0]!r} is no driver of the kernel"
            )


def _described(
    what: str, name: str, entry: DriverEntry | AuthorityEntry, known: Mapping[str, DriverEntry | AuthorityEntry]
) -> dict[str, Any]:
    """Description of an entry in the manifest of a folder: its identity, and where to find it again.

    ``origin`` is ``catalogue``; ``settings`` for an entry that the kernel runs; the path ``module:name`` of a class or
    function; or None if there is no such path.
    """
    own: dict[str, Any] = (
        {"law": entry.law}
        if isinstance(entry, AuthorityEntry)
        else {
            "config": as_plain(entry.config),
            "draws": as_plain(entry.draws),
        }
    )
    if known.get(name) == entry:
        return {"origin": "catalogue", "fingerprint": None, **own}
    make: Any = entry.make
    if make is None:
        return {"origin": "settings", "fingerprint": entry.fingerprint, **own}
    return {**_origin_and_fingerprint(what, name, make, entry.fingerprint), **own}


def _origin_and_fingerprint(
    what: str, name: str, make: Callable[..., Any], given: str | None = None
) -> dict[str, str | None]:
    """Import path of a user's class or function, and the fingerprint that distinguishes it from others."""
    module, path = getattr(make, "__module__", None), getattr(make, "__qualname__", None)
    found = module not in (None, "__main__", "__mp_main__") and path is not None and "<" not in path
    try:
        told = fingerprint(make) if given is None else f"{GIVEN}{given}"
    except ValueError as error:
        raise ValueError(f"{what} {name!r}: {error}") from None
    return {"origin": f"{module}:{path}" if found else None, "fingerprint": told}


def run_batches(
    batches: Sequence[EpisodeBatch], folder: ResultsFolder | None, jobs: int, engine: str
) -> Iterator[tuple[EpisodeBatch, engines.Rows]]:
    """Run the batches that a folder does not hold yet, and store them there; those that it holds come first.

    Args:
        batches: batches to run.
        folder: folder of the results; None for none.
        jobs: number of processes.
        engine: one of :data:`ENGINES`.

    Returns:
        Each batch with its rows, as an iterator.
    """
    missing = []
    for batch in batches:
        found = None if folder is None else folder.rows(batch.driver[0], batch.authority[0], batch.key)
        if found is None:
            missing.append(batch)
        else:
            yield batch, found
    if not missing:
        return
    for batch, rows in _run(missing, jobs, engine):
        if folder is not None:
            folder.add(batch.driver[0], batch.authority[0], batch.key, rows)
        yield batch, rows


def _run(batches: Sequence[EpisodeBatch], jobs: int, engine: str) -> Iterator[tuple[EpisodeBatch, engines.Rows]]:
    if engine == "ray":
        return engines.ray_cluster(batches, jobs)
    return engines.processes(batches, jobs) if jobs > 1 else engines.serial(batches)


def _progressing(
    results: Iterator[tuple[EpisodeBatch, engines.Rows]],
    batches: Sequence[EpisodeBatch],
    progress: Callable[[int, int], None] | None,
) -> Iterator[tuple[EpisodeBatch, engines.Rows]]:
    """Pass the results on as they come, and report each to ``progress``."""
    report = progress or (lambda done, total: None)
    done, total = 0, sum(len(batch.episodes) for batch in batches)
    report(done, total)
    for batch, rows in results:
        yield batch, rows
        done += len(rows)
        report(done, total)


def _finish(folder: ResultsFolder) -> pd.DataFrame:
    """Write the table and the report, and return the table."""
    from shared_control_env.evaluation.metrics import METRICS
    from shared_control_env.evaluation.report import write_report

    table = folder.table()
    write_atomically(folder.path / TABLE, table.to_parquet)
    names = {part: list(folder.manifest[part]) for part in MAY_GROW}
    write_report(table, METRICS, folder.path / REPORT, {**folder.manifest, **names}, folder)
    return table
