"""Compare trained drivers with the predictive and the scripted one, on seeds and faults that training left out."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer
from rich.console import Console
from rich.table import Table

from agents.policy import LearnedDriver, Policy
from agents.tasks import HELD_OUT_KINDS, HELD_OUT_SEED
from shared_control_env.envs.cases import CASES
from shared_control_env.envs.degradations import DEGRADATIONS
from shared_control_env.evaluation import DRIVERS, DriverEntry, Suite, evaluate
from shared_control_env.evaluation.statistics import Interval, intervals

METRICS = ("lateral_rms", "driver_effort", "collisions", "road_departures", "lane_departures")
"""Metrics of the table."""

COMPARED = ("mpc", "scripted", "none")
"""Drivers that the trained ones are compared with, under the same lag and the same limiter."""

LEARNED = "learned"
"""Name of the trained drivers, with the number of the file where there are several."""


def measure(policies: list[Policy], scenarios: tuple[str, ...], seeds: int) -> pd.DataFrame:
    """Episodes of all drivers under every degradation, with held-out seeds; ``kind`` says whether training knew it."""
    makers = [partial(LearnedDriver, policy) for policy in policies]
    learned = {f"{LEARNED} {i}": DriverEntry("trained", make) for i, make in enumerate(makers)}
    drivers = {**learned, **{name: DRIVERS[name] for name in COMPARED}}
    suite = Suite("held-out seeds", scenarios, tuple(DEGRADATIONS))
    table = evaluate(drivers, "proportional", suite, seeds=range(HELD_OUT_SEED, HELD_OUT_SEED + seeds))
    held_out = table["degradation"].isin(HELD_OUT_KINDS)
    return table.assign(kind=np.where(held_out, "left out of training", "seen in training"))


def compared(table: pd.DataFrame) -> dict[tuple[str, str], dict[str, Interval]]:
    """Every metric by kind of fault and driver; the trained drivers as one, their seeds the sample.

    The interval of the trained ones is over training seeds, one mean each; that of the others is over episodes.
    """
    rng = np.random.default_rng(0)
    found: dict[tuple[str, str], dict[str, Interval]] = {}
    for kind, part in table.groupby("kind"):
        learned = part[part["driver"].str.startswith(LEARNED)]
        means = learned.groupby("driver")[list(METRICS)].mean()
        found[str(kind), LEARNED] = _means(means, np.zeros(len(means)), rng)
        for driver in COMPARED:
            episodes = part[part["driver"] == driver]
            strata = episodes.groupby(["scenario", "degradation"]).ngroup().to_numpy()
            found[str(kind), driver] = _means(episodes, strata, rng)
    return found


def _means(values: pd.DataFrame, strata: np.ndarray, rng: np.random.Generator) -> dict[str, Interval]:
    """Mean of every metric with its interval."""
    columns = {name: values[name].to_numpy(dtype=float) for name in METRICS}
    return {name: statistics["mean"] for name, statistics in intervals(columns, strata, rng).items()}


def _shown(value: Interval) -> str:
    """A mean with its interval; one training seed has none."""
    return f"{value.estimate:.3g}" + (f" \\[{value.low:.3g}, {value.high:.3g}]" if np.isfinite(value.low) else "")


def main(
    policies: Annotated[list[Path], typer.Argument(help="Files best.npz, one a training seed.", exists=True)],
    scenarios: Annotated[str, typer.Option(help="Names separated by commas.")] = "lane_keeping",
    seeds: Annotated[int, typer.Option(min=1, help="Held-out seeds of each degradation.")] = 10,
) -> None:
    """Print the table."""
    names = tuple(scenarios.split(","))
    for name in names:
        if name not in CASES:
            raise typer.BadParameter(f"scenario {name!r} is not known; valid are {', '.join(CASES)}")
    try:
        loaded = [Policy.load(path) for path in policies]
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None
    table = measure(loaded, names, seeds)
    title = f"{len(table)} episodes, law proportional, mean and 95 % interval"
    printed = Table("faults", "driver", *METRICS, title=title)
    for (kind, driver), values in compared(table).items():
        printed.add_row(kind, driver, *(_shown(value) for value in values.values()))
    Console().print(printed)


if __name__ == "__main__":
    typer.run(main)
