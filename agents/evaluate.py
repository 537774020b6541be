"""Compare trained drivers or allocators with the others, on seeds and faults left out of training.

``python -m agents.evaluate`` compares the policies that ship with the package;
``python -m agents.evaluate results/train/*/best.npz`` compares other policies.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import pandas as pd
import typer
from rich.console import Console
from rich.table import Table
from scipy import stats

from agents.drivers import authority_entry, driver_entry, shipped
from agents.tasks import HELD_OUT_DEGRADATIONS, HELD_OUT_SEED, TASKS
from shared_control_env.envs.degradations import DEGRADATIONS
from shared_control_env.envs.scenarios import SCENARIOS
from shared_control_env.evaluation import Suite, evaluate
from shared_control_env.evaluation.catalogue import choose
from shared_control_env.evaluation.progress import progress_bar
from shared_control_env.evaluation.statistics import COVERAGE, Interval, intervals
from shared_control_env.learned.policy import Policy
from shared_control_env.registration import ENVIRONMENTS

METRICS = (
    "lateral_rms",
    "driver_effort",
    "terminated",
    "collisions",
    "road_departures",
    "lane_departures",
    "speed_rms",
)
"""Columns of the benchmark's table that are compared; smaller is better. ``terminated`` combines the next two."""

COMPARED = {
    "driver": ("internal_model", "mpc", "scripted", "none"),
    "allocator": ("proportional", "none", "fixed", "linear", "takeover", "time_based"),
}
"""Drivers and authorities of the catalogue that the trained ones are compared with, by task."""

BASELINE = {"driver": "internal_model", "allocator": "proportional"}
"""The baseline of each task: the predictive driver who knows its own lag, and the paper's fuzzy inference.

The paper's own driver (``mpc``) is a weak opponent: it does not know its lag and often steers itself off the road.
"""

BESIDE = "population"
"""Driver beside whom authorities are compared: the persons that the allocators were trained with."""

LEARNED = "learned"
"""Name of all trained policies together; each training seed is one sample."""

KINDS = ("left out of training", "seen in training")
"""Whether a degradation was left out of training or seen in training."""


Values = dict[str, Interval]
"""Mean of every metric with its interval."""


class Row(NamedTuple):
    """A row of the comparison.

    Attributes:
        kind: one of :data:`KINDS`.
        name: name of a driver or an authority; :data:`LEARNED`; or ``learned - baseline``.
        values: means and intervals of :data:`METRICS`.
    """

    kind: str
    name: str
    values: Values


def measure(
    task: str,
    sources: Sequence[str],
    scenarios: Sequence[str],
    seeds: int,
    jobs: int = 1,
    progress: Callable[[int, int], None] | None = None,
    trusted: bool = False,
) -> pd.DataFrame:
    """Run episodes of all drivers under the fuzzy limiter, or of all authorities beside a population of persons.

    Args:
        task: key of :data:`agents.tasks.TASKS`.
        sources: the trained policies, as :func:`agents.drivers.driver_entry` takes them.
        scenarios: keys of :data:`envs.scenarios.SCENARIOS`.
        seeds: number of seeds per scenario and degradation; the first is :data:`agents.tasks.HELD_OUT_SEED`.
        jobs: number of processes.
        progress: called with the number of finished episodes and the number of all episodes.
        trusted: whether models of Stable-Baselines3 may be read.

    Returns:
        The benchmark's table; ``name`` is the driver or authority, and ``kind`` says whether training used the fault.
    """
    make: Callable[[str], Any] = partial(driver_entry, trusted=trusted) if task == "driver" else authority_entry
    learned = {f"{LEARNED} {i}": make(source) for i, source in enumerate(sources)}
    entries = {**learned, **{name: make(name) for name in COMPARED[task]}}
    drivers, authorities = (entries, "proportional") if task == "driver" else (BESIDE, entries)
    suite = Suite("held-out seeds", tuple(scenarios), tuple(DEGRADATIONS))
    numbers = range(HELD_OUT_SEED, HELD_OUT_SEED + seeds)
    table = evaluate(drivers, authorities, suite, seeds=numbers, jobs=jobs, progress=progress)
    held_out = table["degradation"].isin(HELD_OUT_DEGRADATIONS)
    name = table["driver" if task == "driver" else "authority"]
    return table.assign(name=name, kind=np.where(held_out, *KINDS))


def measure_and_show(
    console: Console,
    task: str,
    sources: Sequence[str],
    scenarios: Sequence[str],
    seeds: int,
    jobs: int,
    trusted: bool = False,
) -> pd.DataFrame:
    """Run :func:`measure` with a progress bar.

    Args:
        console: where the progress is shown.
        task, sources, scenarios, seeds, jobs, trusted: as in :func:`measure`.
    """
    with progress_bar(console) as bar:
        running = bar.add_task(f"episodes, {task}", total=None)
        update = lambda done, total: bar.update(running, completed=done, total=total)
        return measure(task, sources, scenarios, seeds, jobs, update, trusted)


def compare(table: pd.DataFrame, task: str) -> list[Row]:
    """Every metric by kind of fault and by name, and the difference between the trained policies and the baseline.

    The interval of the trained policies is Student's over training seeds: each seed gives one mean, over the same
    episodes. The intervals of the others are bootstrapped over episodes. The interval of a difference contains the
    intervals of both kinds, for paired episodes. There is no interval if there is only one training seed, or only one
    episode per scenario and degradation.

    Args:
        table: result of :func:`measure`.
        task: key of :data:`agents.tasks.TASKS`.
    """
    rng, baseline = np.random.default_rng(0), BASELINE[task]
    rows = []
    for kind, part in table.groupby("kind"):
        learned = part[part["name"].str.startswith(LEARNED)]
        means = learned.groupby("name")[list(METRICS)].mean()
        rows.append(Row(str(kind), LEARNED, {m: over_seeds(means[m].to_numpy(float)) for m in METRICS}))
        for name in COMPARED[task]:
            episodes = part[part["name"] == name]
            strata = episodes.groupby(["scenario", "degradation"]).ngroup().to_numpy()
            columns = {m: episodes[m].to_numpy(float) for m in METRICS}
            found = {m: statistics["mean"] for m, statistics in intervals(columns, strata, rng).items()}
            rows.append(Row(str(kind), name, found))
        rows.append(Row(str(kind), f"{LEARNED} - {baseline}", _difference(part, means, baseline, rng)))
    return rows


def _difference(
    part: pd.DataFrame, means: pd.DataFrame, baseline: str, rng: np.random.Generator
) -> dict[str, Interval]:
    """Difference between the trained policies and the baseline; the interval covers both seeds and episodes."""
    keys = ["scenario", "degradation", "seed"]
    reference = part[part["name"] == baseline].set_index(keys)[list(METRICS)]
    learned = part[part["name"].str.startswith(LEARNED)].groupby(keys)[list(METRICS)].mean()
    paired = (learned - reference).reset_index()
    strata = paired.groupby(keys[:2]).ngroup().to_numpy()
    bootstrapped = intervals({m: paired[m].to_numpy(float) for m in METRICS}, strata, rng)
    found = {}
    for metric in METRICS:
        both = over_seeds(means[metric].to_numpy(float) - reference[metric].mean()), bootstrapped[metric]["mean"]
        low, high = float(np.min([each.low for each in both])), float(np.max([each.high for each in both]))
        found[metric] = Interval(both[0].estimate, low, high, both[0].n)
    return found


def over_seeds(values: np.ndarray) -> Interval:
    """Mean of one value per training seed, with Student's interval; a single seed gives no interval.

    Args:
        values: one value per training seed, shape (n,).
    """
    n, mean = len(values), float(np.mean(values))
    if n < 2:
        return Interval(mean, np.nan, np.nan, n)
    half = stats.t.ppf(0.5 + COVERAGE / 200.0, n - 1) * np.std(values, ddof=1) / np.sqrt(n)
    return Interval(mean, mean - half, mean + half, n)


def losses(table: pd.DataFrame, task: str) -> pd.DataFrame:
    """Scenarios and degradations in which the trained policies are worse than the baseline.

    A loss is counted if the whole interval of the difference over training seeds lies above zero. The many pairs are
    tested one by one, so some losses are due to chance.

    Args:
        table: result of :func:`measure`.
        task: key of :data:`agents.tasks.TASKS`.

    Returns:
        One row per loss: scenario, degradation, metric, and both means.
    """
    keys, baseline = ["scenario", "degradation"], BASELINE[task]
    learned = table[table["name"].str.startswith(LEARNED)].groupby([*keys, "name"])[list(METRICS)].mean()
    reference = table[table["name"] == baseline].groupby(keys)[list(METRICS)].mean()
    rows = []
    for where in reference.index:
        for metric in METRICS:
            values = learned.xs(where)[metric].to_numpy(float)
            expected = float(reference.loc[where, metric])
            if over_seeds(values - expected).low > 0.0:
                rows.append([*where, metric, float(values.mean()), expected])
    return pd.DataFrame(rows, columns=[*keys, "metric", LEARNED, baseline])


def where_it_loses(table: pd.DataFrame, task: str) -> list[str]:
    """The number of :func:`losses` in each metric, and the three largest, as lines of text.

    Args:
        table: result of :func:`measure`.
        task: key of :data:`agents.tasks.TASKS`.
    """
    if table["name"][table["name"].str.startswith(LEARNED)].nunique() < 2:
        return ["- not known: a single training seed gives no interval; name the policies of several."]
    lost, baseline = losses(table, task), BASELINE[task]
    lines = []
    for metric, part in lost.groupby("metric", sort=False):
        worst = part.iloc[(part[LEARNED] - part[baseline]).argsort()[::-1][:3]]
        examples = ", ".join(
            f"{scenario} under {degradation} ({ours:.3g}, not {theirs:.3g})"
            for scenario, degradation, _, ours, theirs in worst.itertuples(index=False)
        )
        lines.append(f"- {str(metric).replace('_', ' ')}: {len(part)}; most in {examples}.")
    return lines or ["- nowhere."]


def shown(value: Interval) -> str:
    """A mean as text, with its interval if it has one.

    Args:
        value: the mean and its interval.
    """
    return f"{value.estimate:.3g}" + (f" [{value.low:.3g}, {value.high:.3g}]" if np.isfinite(value.low) else "")


def show(rows: Sequence[Row], console: Console) -> None:
    """Print the means by kind of fault, and the differences of the trained policies with their intervals.

    Args:
        rows: result of :func:`compare`.
        console: where the tables are printed.
    """
    for kind in KINDS:
        of_kind = [row for row in rows if row.kind == kind]
        table = Table(
            "", *(name.replace("_", "\n") for name in METRICS), title=f"faults {kind}", box=None, padding=(0, 1, 0, 0)
        )
        for row in of_kind[:-1]:
            table.add_row(row.name, *(f"{value.estimate:.3g}" for value in row.values.values()))
        console.print(table)
        difference = of_kind[-1]
        known = any(np.isfinite(value.low) for value in difference.values.values())
        console.print(
            f"{difference.name}, {'95 % interval' if known else 'without intervals, from one training seed'}:"
        )
        for metric, value in difference.values.items():
            console.print(f"  {metric.replace('_', ' ')}: {shown(value)}", markup=False)


def scenarios_of(sources: Sequence[str], task: str) -> list[str]:
    """Scenarios in which every policy among the sources was trained; lane keeping if there are none.

    Args:
        sources: names or files of policies.
        task: key of :data:`agents.tasks.TASKS`.
    """
    paths = [shipped(task).get(source, Path(source)) for source in sources]
    known = [Policy.load(path).card["environments"] for path in paths if path.suffix == ".npz"]
    common = [id for id in ENVIRONMENTS if known and all(id in ids for ids in known)]
    return [ENVIRONMENTS[id] for id in common] or ["lane_keeping"]


def main(
    sources: Annotated[list[str] | None, typer.Argument(help="Names or files, one a training seed.")] = None,
    task: Annotated[str, typer.Option(help=f"One of: {', '.join(TASKS)}.")] = "driver",
    scenarios: Annotated[str, typer.Option(help="Names, separated by commas; by default those of training.")] = "",
    seeds: Annotated[int, typer.Option(min=1, help="Held-out seeds of each degradation.")] = 3,
    jobs: Annotated[int, typer.Option(min=1, help="Processes.")] = 1,
    trusted: Annotated[bool, typer.Option(help="Read models (.zip), whose code runs as they are read.")] = False,
) -> None:
    """Print how trained drivers (or allocators) compare, and where they lose."""
    console = Console()
    try:
        choose("task", task, TASKS)
        chosen = sources or list(shipped(task))
        if not chosen:
            raise ValueError(f"the package ships no policy of the task {task!r}; give files")
        names = [name.strip() for name in scenarios.split(",")] if scenarios else scenarios_of(chosen, task)
        choose("scenario", names, SCENARIOS)
        table = measure_and_show(console, task, chosen, names, seeds, jobs, trusted)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None
    console.print(f"{len(table)} episodes of {', '.join(names)}")
    show(compare(table, task), console)
    cells = len(table[["scenario", "degradation"]].drop_duplicates())
    console.print(
        f"{LEARNED} is worse than {BASELINE[task]}, with all of the interval over training seeds, in so many of "
        f"{cells} pairs of scenario and degradation:"
    )
    console.print("\n".join(where_it_loses(table, task)), markup=False)


if __name__ == "__main__":
    typer.run(main)
