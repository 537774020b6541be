"""The command ``shared-control``: the benchmark, the replay of an episode, and what there is by name."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

try:
    import typer
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )
    from rich.table import Table
except ImportError:
    sys.exit('shared-control needs the extra "benchmark": pip install "shared_control_env[benchmark]"')

from shared_control_env.envs.cases import CASES
from shared_control_env.envs.degradations import DEGRADATIONS
from shared_control_env.evaluation.catalogue import AUTHORITIES, DRIVERS, SUITES, choose
from shared_control_env.evaluation.episodes import AS_GIVEN
from shared_control_env.evaluation.interrupt import resumable
from shared_control_env.evaluation.metrics import METRICS
from shared_control_env.evaluation.storage import REPORT, TABLE

app = typer.Typer(no_args_is_help=True, add_completion=False, help=__doc__, pretty_exceptions_enable=False)
COLUMNS = {
    "terminated": "failures",
    "collisions": "collisions",
    "lateral_rms": "lateral rms",
    "driver_effort": "driver effort",
}
"""Columns of the results whose means are printed, and their titles; a failure is a collision or a road departure."""


def _names(text: str, known: dict[str, Any]) -> list[str]:
    """Names of an option: separated by commas, or ``all``."""
    return list(known) if text == "all" else [name.strip() for name in text.split(",") if name.strip()]


def _seeds(text: str) -> list[int]:
    """Seeds of an option: numbers and ranges such as 0-9, separated by commas."""
    try:
        numbers: list[int] = []
        for part in text.split(","):
            low, _, high = part.partition("-")
            numbers += range(int(low), int(high or low) + 1)
    except ValueError:
        raise typer.BadParameter(f"seeds = {text!r} must be numbers and ranges, such as 0-9 or 1,2,5") from None
    if not numbers or min(numbers) < 0:
        raise typer.BadParameter(f"seeds = {text!r} must name at least one seed, none below 0")
    return list(dict.fromkeys(numbers))


@app.command()
def benchmark(
    suite: Annotated[str, typer.Option(help=f"One of: {', '.join(SUITES)}.")] = "paper",
    drivers: Annotated[str, typer.Option(help="Names separated by commas, or all.")] = "mpc,scripted,none",
    authorities: Annotated[str, typer.Option(help="Names separated by commas, or all.")] = "all",
    seeds: Annotated[str, typer.Option(help="Such as 0-9 or 1,2,5.")] = "0-4",
    jobs: Annotated[int, typer.Option(min=1, help="Processes.")] = 1,
    engine: Annotated[str, typer.Option(help="local, or ray for a Ray cluster.")] = "local",
    out: Annotated[Path, typer.Option(help="Folder of the results.")] = Path("results/benchmark"),
    fresh: Annotated[bool, typer.Option(help="Replace results of another benchmark in that folder.")] = False,
) -> None:
    """Run a suite with drivers under authorities; stopped at any moment, it goes on where it was."""
    from shared_control_env.evaluation.runner import evaluate

    console = Console()
    columns = (TextColumn("episodes"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with resumable(out), Progress(*columns, console=console) as bar:
        task = bar.add_task("episodes", total=None)
        try:
            table = evaluate(
                _names(drivers, DRIVERS),
                _names(authorities, AUTHORITIES),
                suite,
                seeds=_seeds(seeds),
                out=out,
                fresh=fresh,
                jobs=jobs,
                engine=engine,
                progress=lambda done, total: bar.update(task, completed=done, total=total),
            )
        except (ValueError, ImportError) as error:
            raise typer.BadParameter(str(error)) from None
        except OSError as error:
            bar.stop()
            console.print(f"[red]{error}[/]: what could be written until then is in {out}; start again to go on.")
            raise typer.Exit(1) from None
    console.print(summary(table))
    console.print(f"{len(table)} episodes are in {out / TABLE}; the report is {out / REPORT}.")


def summary(table: Any) -> Table:
    """Means of the main metrics by authority and driver."""
    printed = Table(title="Means over all episodes", pad_edge=False)
    for name in ("authority", "driver"):
        printed.add_column(name, no_wrap=True)
    for title in COLUMNS.values():
        printed.add_column(title, justify="right", min_width=len(max(title.split(), key=len)))
    means = table.groupby(["authority", "driver"])[list(COLUMNS)].mean()
    for (authority, driver), row in means.iterrows():
        printed.add_row(authority, driver, *(f"{value:.2g}" for value in row))
    return printed


@app.command()
def replay(
    scenario: Annotated[str, typer.Option(help="Scenario of the episode.")],
    driver: Annotated[str, typer.Option(help="Driver.")] = "mpc",
    authority: Annotated[str, typer.Option(help="Authority.")] = "paper",
    degradation: Annotated[str, typer.Option(help="Degradation; own for the scenario's.")] = AS_GIVEN,
    seed: Annotated[int, typer.Option(min=0, help="Seed.")] = 0,
    video: Annotated[Path | None, typer.Option(help="MP4 to write.")] = None,
) -> None:
    """Run one episode of the benchmark in the single environment, and show its metrics or its video."""
    from shared_control_env.evaluation.replay import record, replay_episode

    try:
        choose("scenario", scenario, CASES)
        choose("degradation", degradation, {AS_GIVEN: None, **DEGRADATIONS})
        entries = choose("driver", driver, DRIVERS)[driver], choose("authority", authority, AUTHORITIES)[authority]
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None
    if video is not None and video.suffix != ".mp4":
        raise typer.BadParameter(f"video = {video} must end with .mp4")
    if video is not None and video.exists():
        raise typer.BadParameter(f"{video} exists already; choose another name")
    given = None if degradation == AS_GIVEN else degradation
    frames: list[Any] | None = None if video is None else []
    measured = replay_episode(scenario, (driver, entries[0]), (authority, entries[1]), given, seed, frames)
    console = Console()
    table = Table("metric", "value", "unit", title=f"{scenario}, {degradation}, {driver}, {authority}, seed {seed}")
    for name, value in measured.items():
        table.add_row(name, f"{value:.4g}", METRICS[name].unit)
    console.print(table)
    if video is not None and frames is not None:
        record(frames, video)
        console.print(f"The video is {video}.")


@app.command(name="list")
def list_all() -> None:
    """Print the names of scenarios, degradations, drivers, authorities, suites and metrics."""
    console = Console()
    for title, entries in (
        ("scenarios", {name: f"{case.description} ({case.id})" for name, case in CASES.items()}),
        ("degradations", {name: entry.description if entry else "no fault" for name, entry in DEGRADATIONS.items()}),
        ("drivers", {name: driver.description for name, driver in DRIVERS.items()}),
        ("authorities", {name: authority.description for name, authority in AUTHORITIES.items()}),
        ("suites", {name: suite.description for name, suite in SUITES.items()}),
        ("metrics", {name: f"[{m.unit}] {m.definition}" for name, m in METRICS.items()}),
    ):
        table = Table("name", "what it is", title=title, title_justify="left", show_lines=False)
        for name, text in entries.items():
            table.add_row(name, text.replace("[", "\\["))
        console.print(table)


if __name__ == "__main__":
    app()
