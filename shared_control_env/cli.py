"""The command ``shared-control``: run the benchmark, replay an episode, and list the available names."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

try:
    import typer
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table
except ImportError:
    sys.exit('shared-control needs the extra "benchmark": pip install "shared_control_env[benchmark]"')

from shared_control_env.core.parameters import IDENTIFIED_DRIVERS
from shared_control_env.envs.degradations import DEGRADATIONS
from shared_control_env.envs.scenarios import SCENARIOS
from shared_control_env.envs.settings import combined
from shared_control_env.evaluation.catalogue import AUTHORITIES, DRIVERS, SUITES, choose_one
from shared_control_env.evaluation.episodes import AS_GIVEN, MOST_SEEDS, EpisodeBatch, fault_named, settings_of
from shared_control_env.evaluation.interrupt import resumable
from shared_control_env.evaluation.metrics import METRICS
from shared_control_env.evaluation.storage import MARGINS, REPORT, TABLE
from shared_control_env.nearest import hint

HELP = """Shared control under automation degradation: benchmark, controllability, and people at the wheel.

A run that is stopped goes on with the same command, and no folder of other results is overwritten. "list" names what
the options take; "extras" says what is installed here.
"""
app = typer.Typer(no_args_is_help=True, help=HELP, pretty_exceptions_enable=False)
COLUMNS = {
    "terminated": "failures",
    "collisions": "collisions",
    "lateral_rms": "lateral rms",
    "driver_effort": "driver effort",
}
"""Columns of the results whose means are printed, and their titles; a failure is a collision or a road departure."""


def _version(wanted: bool) -> None:
    if wanted:
        from shared_control_env import __version__

        typer.echo(f"shared_control_env {__version__}")
        raise typer.Exit


@app.callback()
def _main(
    version: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Print it.")] = False,
) -> None:
    """Read what goes before a command."""


@app.command("extras")
def extras() -> None:
    """Say which extras of the package are installed here, and what the others would add."""
    from shared_control_env.extras import EXTRAS, missing_for

    table = Table("extra", "for", "installed")
    for name, what in EXTRAS.items():
        missing = missing_for(name)
        install = escape(f'no: pip install "shared_control_env[{name}]" (lacks {", ".join(missing)})')
        table.add_row(name, what, install if missing else "yes")
    Console().print(table)


def _names(text: str) -> list[str] | str:
    """Names in an option's text, separated by commas, or ``all``."""
    return text if text == "all" else [name.strip() for name in text.split(",") if name.strip()]


def _seeds(text: str) -> list[int]:
    """Seeds in an option's text: numbers, and ranges such as 0-9, separated by commas."""
    numbers: list[int] = []
    for part in text.split(","):
        low, dash, high = part.strip().partition("-")
        if not low.isdecimal() or (dash and not high.isdecimal()):
            raise typer.BadParameter(f"seeds = {text!r} must be non-negative numbers and ranges, such as 0-9 or 1,2,5")
        first, last = int(low), int(high or low)
        if first > last or last >= 2**63 or last - first >= MOST_SEEDS:
            raise typer.BadParameter(
                f"seeds = {text!r}: {part.strip()!r} must be an ascending range of at most {MOST_SEEDS} seeds, none "
                f"above {2**63 - 1}"
            )
        numbers += range(first, last + 1)
    return list(dict.fromkeys(numbers))


@contextmanager
def _in_words(console: Console) -> Iterator[None]:
    """Print each warning on one line, and turn errors in the user's request into command-line errors."""

    def tell(message: Any, *_: Any, **__: Any) -> None:
        console.print(f"Note: {message}", markup=False, highlight=False)

    from shared_control_env.evaluation.engines import WorkersLostError

    with warnings.catch_warnings():
        warnings.simplefilter("always", UserWarning)
        warnings.showwarning = tell
        try:
            yield
        except (ValueError, ImportError, WorkersLostError) as error:
            raise typer.BadParameter(str(error)) from None


@contextmanager
def _running(console: Console, out: Path) -> Iterator[Callable[[int, int], None]]:
    """Show the progress of episodes whose results go to a folder, and end in words where they cannot go on."""
    from shared_control_env.evaluation.progress import progress_bar

    with _in_words(console), resumable(out), progress_bar(console) as bar:
        task = bar.add_task("episodes", total=None)
        try:
            yield lambda done, total: bar.update(task, completed=done, total=total)
        except OSError as error:
            bar.stop()
            text = f"{error}: what could be written until then is in {out}; start again to continue."
            console.print(text, style="red", markup=False)
            raise typer.Exit(1) from None


Names = Annotated[str, typer.Option(help="Names separated by commas, or all.")]
Jobs = Annotated[int, typer.Option(min=1, help="Processes.")]
Engine = Annotated[str, typer.Option(help="local, or ray for a Ray cluster.")]
Out = Annotated[Path, typer.Option(help="Folder of the results.")]
Wheel = Annotated[str, typer.Option(help="Part of the name of a wheel to read without the browser, or any.")]
Torque = Annotated[float, typer.Option(min=0.0, max=0.3, help="Force feedback, share of the wheel's torque (Linux).")]
Port = Annotated[int, typer.Option(min=0, max=65535, help="Port on this machine; 0 for any.")]
Browser = Annotated[bool, typer.Option(help="Open the page in a browser.")]
Fresh = Annotated[bool, typer.Option(help="Remove the results that the folder holds, and begin again.")]


@app.command()
def benchmark(
    suite: Annotated[str, typer.Option(help=f"One of: {', '.join(SUITES)}.")] = "paper",
    drivers: Names = "mpc,scripted,none",
    authorities: Names = "all",
    seeds: Annotated[str, typer.Option(help="Such as 0-9 or 1,2,5.")] = "0-4",
    jobs: Jobs = 1,
    engine: Engine = "local",
    out: Out = Path("results/benchmark"),
    fresh: Fresh = False,
    recordings: Annotated[
        str, typer.Option(help="Recording, or folder of them, for the suite recorded; that of the package by default.")
    ] = "",
) -> None:
    """Run a suite with drivers under authorities; stopped at any moment, it goes on where it was."""
    from shared_control_env.evaluation.runner import evaluate

    console = Console()
    out = out.expanduser()
    if suite != "recorded":
        _refuse({"--recordings": bool(recordings)}, "without --suite recorded")
    with _running(console, out) as progress:
        table = evaluate(
            _names(drivers),
            _names(authorities),
            suite,
            seeds=_seeds(seeds),
            config={"recording": {"file": str(Path(recordings).expanduser().resolve())}} if recordings else None,
            out=out,
            fresh=fresh,
            jobs=jobs,
            engine=engine,
            progress=progress,
        )
    console.print(summary(table, console.width), markup=False)
    console.print(f"{len(table)} episodes are in {out / TABLE}; the report is {out / REPORT}.", markup=False)


@app.command()
def controllability(
    kinds: Annotated[str, typer.Option(help="Kinds of fault separated by commas, or all.")] = "all",
    channel: Annotated[str, typer.Option(help="steering, acceleration or both.")] = "steering",
    drivers: Names = "population",
    authorities: Names = "all",
    scenarios: Names = "all",
    keep: Annotated[str, typer.Option(help="What counts as controlled: lane, road or collision.")] = "lane",
    at: Annotated[str, typer.Option(help="Severity to classify, such as 0.1, or bias=0.1,delay=0.4.")] = "",
    last: Annotated[bool, typer.Option(help="How long a fault of that severity may last, too.")] = False,
    budget: Annotated[int, typer.Option(min=1, help="Largest number of episodes.")] = 20_000,
    width: Annotated[float, typer.Option(help="Wanted width of the intervals, share of the largest severity.")] = 0.1,
    seed: Annotated[int, typer.Option(min=0, help="First seed.")] = 0,
    jobs: Jobs = 1,
    engine: Engine = "local",
    out: Out = Path("results/controllability"),
    fresh: Fresh = False,
) -> None:
    """How large a fault drivers control under each authority; stopped at any moment, it goes on where it was."""
    from shared_control_env.evaluation.controllability import controllability as run_study
    from shared_control_env.evaluation.controllability_report import severity

    console = Console()
    out = out.expanduser()
    with _running(console, out) as progress:
        table = run_study(
            _names(kinds),
            _names(authorities),
            _names(drivers),
            channel=channel,
            scenarios=_names(scenarios),
            keep=keep,
            at=_severities(at),
            last=last,
            budget=budget,
            width=width,
            seed=seed,
            out=out,
            fresh=fresh,
            jobs=jobs,
            engine=engine,
            progress=progress,
        )
    printed = Table(title="Largest severity that 90 % control, and its 95 % interval", pad_edge=False)
    for name in ("fault", "driver", "authority", "s_90", "class"):
        printed.add_column(name, justify="right" if name == "s_90" else "left")
    for row in table.to_dict("records"):
        margin, low, high = (severity(row[name]) for name in ("s_90", "s_90_low", "s_90_high"))
        at_most = f"{row['class']} at {row['at']:.3g}" if row["class"] else "-"
        cells = (row["fault"], row["driver"], row["authority"], f"{margin} ({low} to {high}) {row['unit']}", at_most)
        printed.add_row(*(escape(str(cell)) for cell in cells))
    console.print(printed)
    wide = int((~table["settled"]).sum())
    if wide:
        console.print(
            f"{wide} of {len(table)} intervals are wider than {width:g} of the grid; a larger --budget narrows them. "
            "That is another study: name another --out, or replace this one (--fresh)."
        )
    console.print(f"The report is {out / REPORT}, the margins {out / MARGINS[0]}.", markup=False)


def _severities(text: str) -> float | dict[str, float] | None:
    """Severities in an option's text: one number, or one for each kind; None for an empty text."""
    if not text:
        return None
    try:
        if "=" not in text:
            return float(text)
        return {kind.strip(): float(value) for kind, value in (part.split("=") for part in text.split(","))}
    except ValueError:
        raise typer.BadParameter(f"at = {text!r} must be a number, or kind=number for each kind, by commas") from None


def summary(table: Any, width: int = 80) -> Table | str:
    """Means of the main metrics by authority and driver: a table, or lines of text if the terminal is too narrow.

    Args:
        table: results of the benchmark, one row per episode.
        width: width of the terminal [characters].
    """
    means = table.groupby(["authority", "driver"])[list(COLUMNS)].mean()
    if max(sum(map(len, pair)) for pair in means.index) + 55 > width:
        return "\n".join(
            f"{authority}, {driver}: " + ", ".join(f"{t} {v:.2g}" for t, v in zip(COLUMNS.values(), row, strict=True))
            for (authority, driver), row in means.iterrows()
        )
    printed = Table(title="Means over all episodes", pad_edge=False)
    for name in ("authority", "driver"):
        printed.add_column(name, no_wrap=True)
    for title in COLUMNS.values():
        printed.add_column(title, justify="right", min_width=len(max(title.split(), key=len)))
    for (authority, driver), row in means.iterrows():
        printed.add_row(escape(authority), escape(driver), *(f"{value:.2g}" for value in row))
    return printed


@app.command()
def replay(
    scenario: Annotated[str, typer.Option(help="Scenario of the episode.")],
    driver: Annotated[str, typer.Option(help="Driver.")] = "mpc",
    authority: Annotated[str, typer.Option(help="Authority.")] = "paper",
    degradation: Annotated[
        str, typer.Option(help="Degradation; own for the scenario's; or kind:channel:size:duration.")
    ] = AS_GIVEN,
    seed: Annotated[int, typer.Option(min=0, help="Seed.")] = 0,
    source: Annotated[
        Path | None, typer.Option("--from", help="Folder of a benchmark, whose settings and own drivers it has.")
    ] = None,
    video: Annotated[Path | None, typer.Option(help="MP4 to write.")] = None,
) -> None:
    """Run one episode of the benchmark again, and show its metrics or its video."""
    from shared_control_env.evaluation.replay import entries_of, record, replay_episode

    console = Console()
    place = None if video is None else _checked_video(video)
    with _in_words(console):
        if source is None:
            first, second = choose_one("driver", driver, DRIVERS), choose_one("authority", authority, AUTHORITIES)
            config: Any = {}
            automation = None
        else:
            # First of all, since what it imports may add the scenario or the degradation.
            first, second, config, automation = entries_of(source.expanduser(), driver, authority)
        choose_one("scenario", scenario, SCENARIOS)
        given = fault_named(degradation)
        frames: list[Any] | None = None if video is None else []
        pair = (driver, first), (authority, second)
        batch = EpisodeBatch(scenario, *pair, ((given, seed),), config, automation)
        frequency = combined(SCENARIOS[scenario].settings, settings_of(batch, given)).policy_frequency
        measured = replay_episode(scenario, *pair, given, seed, frames, config, automation)
    title = f"{scenario}, {degradation}, {driver}, {authority}, seed {seed}"
    table = Table("metric", "value", "unit", title=escape(title))
    for name, value in measured.items():
        table.add_row(name, f"{value:.4g}", METRICS[name].unit)
    console.print(table)
    if place is not None and frames is not None:
        record(frames, place, frequency)
        console.print(f"The video is {video}.", markup=False)


@app.command()
def drive(
    scenario: Annotated[str, typer.Option(help="Scenario that is chosen at first.")] = "lane_change",
    degradation: Annotated[str, typer.Option(help="Degradation; own; or kind:channel:size:duration.")] = "bias_ramp",
    authority: Annotated[str, typer.Option(help="Authority.")] = "proportional",
    seed: Annotated[int, typer.Option(min=0, help="Seed.")] = 0,
    wheel: Wheel = "",
    torque: Torque = 0.0,
    out: Annotated[Path, typer.Option(help="Folder of the recordings.")] = Path("results/drives"),
    port: Port = 8642,
    browser: Browser = True,
) -> None:
    """Take the wheel: serves a page on this machine on which you drive, by keyboard, gamepad or wheel."""
    with _needs("drive"):
        from shared_control_env.drive import run
        from shared_control_env.drive.session import Choice

    console = Console()
    with _in_words(console):
        choice = Choice(scenario, degradation, authority, "", seed)
        _refuse({"--torque": torque != 0.0 and not wheel}, "without --wheel")
        run.drive(choice, out.expanduser(), port, browser, wheel, torque, console)


@app.command()
def study(
    plan: Annotated[Path, typer.Argument(help="Plan of the study, a TOML file.")],
    code: Annotated[str, typer.Option(help="Code of the person; the next free one by default.")] = "",
    simulate: Annotated[str, typer.Option(help="Drivers of the catalogue who take part as simulated people.")] = "",
    people: Annotated[int, typer.Option(min=1, max=10_000, help="Number of simulated people.")] = 1,
    remnant: Annotated[float, typer.Option(min=0.0, max=0.5, help="Noise of their steering [rad].")] = 0.0,
    wheel: Wheel = "",
    torque: Torque = 0.0,
    out: Annotated[Path | None, typer.Option(help="Folder of the study; results/study/NAME OF THE PLAN.")] = None,
    port: Port = 8642,
    browser: Browser = True,
) -> None:
    """Run an experiment with people; stopped at any moment, it goes on with the next trial."""
    with _needs("drive"):
        from shared_control_env.drive.simulated import Remnant
        from shared_control_env.drive.study.plan import read_plan
        from shared_control_env.drive.study.run import with_person, with_simulated

    console = Console()
    with _in_words(console):
        checked = read_plan(plan.expanduser())
        folder = (out or Path("results/study") / plan.stem).expanduser()
        if simulate:
            person = {
                "--code": bool(code),
                "--no-browser": not browser,
                "--wheel": bool(wheel),
                "--torque": torque != 0.0,
            }
            _refuse({**person, "--port": port != 8642}, "with --simulate")
            with_simulated(checked, folder, _names(simulate), people, Remnant(steering=remnant), console)
        else:
            _refuse({"--people": people != 1, "--remnant": remnant != 0.0}, "without --simulate")
            _refuse({"--torque": torque != 0.0 and not wheel}, "without --wheel")
            with_person(checked, folder, code, port, browser, wheel, torque, console)


IDENTIFIED = Path("results/identification")


@app.command()
def identify(
    place: Annotated[
        Path, typer.Argument(help="Folder of recordings, such as that of a study; or a CAN record, .npz.")
    ],
    channel: Annotated[str, typer.Option(help="steering or acceleration.")] = "steering",
    condition: Annotated[str, typer.Option(help="Condition of a study; all but practice by default.")] = "",
    out: Annotated[Path, typer.Option(help="Folder of table and report.")] = IDENTIFIED,
) -> None:
    """Identify K_h and T_h of the people in recordings, beside the paper's Table IV."""
    from shared_control_env.evaluation.progress import progress_bar
    from shared_control_env.identification.data import CHANNELS
    from shared_control_env.identification.people import REPORT
    from shared_control_env.identification.people import identify as run_identification

    console = Console()
    with _in_words(console):
        if place.suffix == ".npz":
            of_people = {"--channel": channel != "steering", "--condition": bool(condition), "--out": out != IDENTIFIED}
            _refuse(of_people, "on a CAN record")
            _print_can(place.expanduser(), console)
            return
        if channel not in CHANNELS:
            raise ValueError(f"channel = {channel!r}; {hint(channel, CHANNELS)}")
        with progress_bar(console) as bar:
            task = bar.add_task("people", total=None)

            def tell(done: int, total: int) -> None:
                bar.update(task, completed=done, total=total)

            table, refused = run_identification(place.expanduser(), out.expanduser(), channel, condition, tell)
    printed = Table(title="Arm of Eq. 16, and 95 % intervals", pad_edge=False)
    for name in ("person", "method", "K_h [-]", "T_h [s]", "fit [%]"):
        printed.add_column(name, justify="left" if name in ("person", "method") else "right")
    for row in table.to_dict("records"):
        values = [f"{row[n]:.3f} ({row[f'{n}_low']:.3f} to {row[f'{n}_high']:.3f})" for n in ("K_h", "T_h")]
        fitted = f"{row['fit']:.1f}" if row["fit"] == row["fit"] else ""
        values = values if row["found"] else ["no result", ""]
        if "delay" in row["method"]:
            continue  # in the report
        printed.add_row(escape(f"{row['person']}"), row["method"], *values, fitted)
    for name, lag in IDENTIFIED_DRIVERS.items():
        printed.add_row(f"paper, {name.replace('_', ' ')}", "Table IV", f"{lag.K_h:.2f}", f"{lag.T_h:.2f}", "")
    console.print(printed)
    for line in refused:
        console.print(f"Refused: {line}", markup=False, soft_wrap=True)
    console.print(f"The report is {out / REPORT}.", markup=False)


def _print_can(path: Path, console: Console) -> None:
    """Print what a CAN record tells, and what it does not."""
    from shared_control_env.identification.can import TOUCHED, WORDS, read_record, study

    found = study(read_record(path))
    console.print(
        f"{found.duration:.0f} s, of which the automation steers {100 * found.engaged:.0f} % "
        f"({found.by_hand:.1f} s by hand).\nCommand to motor torque: delay {1e3 * found.delay:.0f} ms, correlation "
        f"{found.correlation:.2f}.\nWhile it steers, the driver's torque is at most {found.torque:.0f} counts; it is a "
        f"push, of more than {TOUCHED:.0f} counts, in {100 * found.pushing:.1f} % of the time"
        + (f", and against the motor in {100 * found.conflict:.0f} % of that." if found.pushing else "."),
        markup=False,
    )
    console.print(WORDS, markup=False)


def _refuse(given: dict[str, bool], when: str) -> None:
    """Raise BadParameter for the first option that is given but would not act."""
    for option, is_given in given.items():
        if is_given:
            raise typer.BadParameter(f"{option} would not act {when}")


@contextmanager
def _needs(extra: str) -> Iterator[None]:
    """Turn a missing package into a command-line error that names the extra."""
    try:
        yield
    except ImportError as error:
        text = f'this command needs the extra "{extra}": pip install "shared_control_env[{extra}]" ({error})'
        raise typer.BadParameter(text) from None


def _checked_video(path: Path) -> Path:
    """Check that a video can be written to a path and that no file exists there, before the episode is run."""
    place = path.expanduser()
    if place.suffix.lower() != ".mp4":
        raise typer.BadParameter(f"video = {path} must be a name that ends with .mp4, such as drive.mp4")
    if place.exists():
        raise typer.BadParameter(f"{path} exists already; choose another name")
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        place.touch(exist_ok=False)
        place.unlink()
    except OSError as error:
        raise typer.BadParameter(f"video = {path} cannot be written: {error.strerror or error}") from None
    return place


@app.command(name="list")
def list_all() -> None:
    """Print the names of scenarios, degradations, drivers, authorities, suites and metrics."""
    console = Console()
    for title, entries in (
        ("scenarios", {name: f"{entry.description} ({entry.id})" for name, entry in SCENARIOS.items()}),
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
