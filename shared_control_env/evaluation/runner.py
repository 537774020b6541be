"""``evaluate``: drivers and authorities on a suite, as a table of one row an episode."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from shared_control_env.controllers.allocators import Allocator
from shared_control_env.controllers.driver import Driver
from shared_control_env.evaluation import engines
from shared_control_env.evaluation.catalogue import (
    AUTHORITIES,
    DRIVERS,
    SUITES,
    AuthorityEntry,
    DriverEntry,
    Suite,
    choose,
)
from shared_control_env.evaluation.episodes import Batch, plan, versions
from shared_control_env.evaluation.storage import REPORT, TABLE, ResultsFolder, sorted_table, write_atomically

ENGINES = ("local", "ray")
"""Names of the engines."""

Drivers = str | Iterable[str] | Mapping[str, DriverEntry | Callable[[], Driver]]
Authorities = str | Iterable[str] | Mapping[str, AuthorityEntry | Callable[[], Allocator]]


def evaluate(
    driver: Drivers = "mpc",
    authority: Authorities = "paper",
    suite: str | Suite = "paper",
    *,
    seeds: Iterable[int] = (0,),
    config: Mapping[str, Any] | None = None,
    out: Path | str | None = None,
    fresh: bool = False,
    jobs: int = 1,
    engine: str = "local",
    progress: Callable[[int, int], None] | None = None,
) -> pd.DataFrame:
    """Run every episode of a suite with every driver under every authority.

    Args:
        driver: a name of :data:`catalogue.DRIVERS`, several, or your own: a mapping of names to whatever makes a
            :class:`~shared_control_env.controllers.driver.Driver`, such as its class.
        authority: the same of :data:`catalogue.AUTHORITIES`; your own
            :class:`~shared_control_env.controllers.allocators.Allocator` acts by the law ``proportional`` unless
            given as an :class:`AuthorityEntry`.
        suite: a name of :data:`catalogue.SUITES`, or your own.
        seeds: of the episodes; one seed gives every driver and authority the same episode.
        config: changes to the settings of all scenarios.
        out: folder to keep the results in, as they come; a run that was stopped goes on from there. With it
            ``episodes.parquet`` and ``report.html`` are written at the end.
        fresh: replace what the folder holds of another benchmark.
        jobs: processes.
        engine: ``local``, or ``ray`` for the Ray cluster that is connected, or one started here.
        progress: called with the number of episodes done and of all.

    Returns:
        One row an episode: scenario, degradation, driver, authority, seed, whether it was terminated, its
        duration [s], every metric of :data:`metrics.METRICS`, digest of its settings, versions.

    Raises:
        ValueError: for unknown names, naming the nearest and all valid ones, or a folder of another benchmark.
    """
    drivers = {name: _driver_entry(entry) for name, entry in choose("driver", driver, DRIVERS).items()}
    authorities = {name: _authority_entry(e) for name, e in choose("authority", authority, AUTHORITIES).items()}
    chosen = suite if isinstance(suite, Suite) else choose("suite", suite, SUITES)[suite]
    numbers = list(seeds)
    if jobs < 1:
        raise ValueError(f"jobs = {jobs} must be at least 1")
    choose("engine", engine, dict.fromkeys(ENGINES))
    batches = list(plan(chosen, drivers, authorities, numbers, config or {}))
    if out is None:
        done = [row for _, rows in _progressing(_run(batches, jobs, engine), batches, 0, progress) for row in rows]
        return sorted_table(pd.DataFrame(done))
    manifest = {
        "suite": suite if isinstance(suite, str) else chosen._asdict(),
        "seeds": numbers,
        "drivers": list(drivers),
        "authorities": list(authorities),
        "config": dict(config or {}),
        "versions": versions(),
    }
    folder = ResultsFolder(Path(out), manifest, fresh)
    missing = [batch for batch in batches if not folder.has(batch.name)]
    found = sum(len(batch.episodes) for batch in batches) - sum(len(batch.episodes) for batch in missing)
    for batch, rows in _progressing(_run(missing, jobs, engine), batches, found, progress):
        folder.add(batch.name, rows)
    return _finish(folder, manifest)


def _driver_entry(entry: DriverEntry | Callable[[], Driver]) -> DriverEntry:
    return entry if isinstance(entry, DriverEntry) else DriverEntry("given by the user", entry)


def _authority_entry(entry: AuthorityEntry | Callable[[], Allocator]) -> AuthorityEntry:
    return entry if isinstance(entry, AuthorityEntry) else AuthorityEntry("given by the user", "proportional", entry)


def _run(batches: Sequence[Batch], jobs: int, engine: str) -> Iterator[tuple[Batch, engines.Rows]]:
    if engine == "ray":
        return engines.ray_cluster(batches, jobs)
    return engines.processes(batches, jobs) if jobs > 1 else engines.serial(batches)


def _progressing(
    results: Iterator[tuple[Batch, engines.Rows]],
    batches: Sequence[Batch],
    done: int,
    progress: Callable[[int, int], None] | None,
) -> Iterator[tuple[Batch, engines.Rows]]:
    """The results as they come, each told to ``progress``."""
    report = progress or (lambda done, total: None)
    total = sum(len(batch.episodes) for batch in batches)
    report(done, total)
    for batch, rows in results:
        yield batch, rows
        done += len(rows)
        report(done, total)


def _finish(folder: ResultsFolder, manifest: Mapping[str, Any]) -> pd.DataFrame:
    """Write the table and the report."""
    from shared_control_env.evaluation.metrics import METRICS
    from shared_control_env.evaluation.report import write_report

    table = folder.table()
    write_atomically(folder.path / TABLE, table.to_parquet)
    write_report(table, METRICS, folder.path / REPORT, manifest)
    return table
