"""The table of failures: every authority with every driver on the full suite, and the findings in words.

``python -m experiments.benchmark`` runs the suite and writes docs/benchmark.md.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer

from shared_control_env.cli import benchmark as run_suite
from shared_control_env.evaluation import AUTHORITIES, DRIVERS
from shared_control_env.evaluation.statistics import intervals
from shared_control_env.evaluation.storage import TABLE, write_atomically

SHOWN = ("mpc", "internal_model", "scripted", "attentive", "hands_on", "hands_off", "none")
"""Drivers of the table."""

INTRODUCTION = """# Failures on the full suite

`make benchmark` writes this page. The drivers differ in what they can show. `mpc` fails by itself. `internal_model`
and `attentive` hardly fail and cannot tell the authorities apart; the persons with resting hands can. `paper` differs
from the other authorities because Eq. 10 falls back on u_a,des, the command that the automation would have given
without the fault. `driver_only` and `safehil` take the automation out, so that the driver drives from the start. The
intervals below are those of paired differences between episodes. [reference.md](reference.md) ranks the authorities
by how large a fault may get.

"""
"""Beginning of the page."""

RESAMPLES = 2000
"""Number of bootstrap resamples."""


def failures_and_error(table: pd.DataFrame) -> pd.DataFrame:
    """Share of episodes that end in a collision or off the road [%], and mean lateral RMS error [m], in one cell.

    Args:
        table: results of the benchmark, one row per episode.

    Returns:
        Text cells, authorities as rows and drivers as columns.
    """
    groups = table.groupby(["authority", "driver"], sort=False)
    cells = groups[["terminated", "lateral_rms"]].mean()
    text = [f"{100.0 * rate:.1f} / {error:.2f}" for rate, error in cells.to_numpy(dtype=float).tolist()]
    square = pd.Series(text, index=cells.index).unstack("driver")
    return square.loc[[a for a in AUTHORITIES if a in square.index], [d for d in DRIVERS if d in square.columns]]


def difference(
    table: pd.DataFrame, driver: str, first: str, second: str, metric: str = "terminated"
) -> tuple[float, float, float]:
    """Mean of a metric under one authority minus that under another, on the same episodes, and its 95 % interval.

    Pairs of episodes are resampled (percentile bootstrap).

    Args:
        table: results of the benchmark, one row per episode.
        driver: name of the driver.
        first, second: names of the authorities.
        metric: column of the table.

    Returns:
        Mean, lower end and upper end of the interval.
    """
    one = table[table["driver"] == driver]
    keys = ["scenario", "degradation", "seed"]
    pairs = one[one["authority"] == first].merge(one[one["authority"] == second], on=keys, suffixes=("", "_other"))
    change = pairs[metric].to_numpy(dtype=float) - pairs[f"{metric}_other"].to_numpy(dtype=float)
    columns = intervals({metric: change}, np.zeros(len(change)), np.random.default_rng(0), RESAMPLES)
    mean = columns[metric]["mean"]
    return mean.estimate, mean.low, mean.high


def compared(table: pd.DataFrame, driver: str, first: str, second: str) -> str:
    """A sentence on the failures under two authorities that claims no more than the interval supports.

    Args:
        table: results of the benchmark, one row per episode.
        driver: name of the driver.
        first, second: names of the authorities.
    """
    change, low, high = (100.0 * value for value in difference(table, driver, first, second))
    numbers = f"{change:+.1f} percentage points (95 % interval {low:+.1f} to {high:+.1f})"
    if low <= 0.0 <= high:
        return (
            f"with the driver `{driver}`, the failures under `{first}` and `{second}` cannot be told apart: {numbers}"
        )
    verdict = "fewer" if high < 0.0 else "more"
    return f"with the driver `{driver}`, `{first}` has {verdict} failures than `{second}`: {numbers}"


def finding(table: pd.DataFrame) -> list[str]:
    """The findings as sentences that are built from the numbers of the table.

    Args:
        table: results of the benchmark, one row per episode.
    """
    rates = 100.0 * table.groupby(["authority", "driver"])["terminated"].mean()
    healthy = 100.0 * table[table["degradation"] == "none"].groupby("authority")["terminated"].mean()
    worst = 100.0 * table[table["authority"] == "none"].groupby("degradation")["terminated"].mean()
    lines = []
    for driver in [name for name in SHOWN if name in set(table["driver"])]:
        of_driver = rates.xs(driver, level="driver").sort_values()
        fewest = ", ".join(f"`{name}`" for name in of_driver.index[of_driver == of_driver.iloc[0]])
        if of_driver.iloc[0] == of_driver.iloc[-1]:
            lines.append(f"`{driver}`: the same under all authorities ({of_driver.iloc[0]:.1f} %)")
            continue
        lines.append(
            f"`{driver}`: fewest failures under {fewest} ({of_driver.iloc[0]:.1f} %), most under "
            f"`{of_driver.index[-1]}` ({of_driver.iloc[-1]:.1f} %)"
        )
    present = set(table["authority"])
    for driver, first, second in (
        ("mpc", "paper", "none"),
        ("mpc", "paper", "proportional"),
        ("mpc", "proportional", "none"),
        ("hands_on", "paper", "none"),
        ("hands_on", "proportional", "none"),
        ("hands_on", "linear", "proportional"),
        ("hands_on", "takeover", "proportional"),
        ("hands_off", "proportional", "none"),
        ("none", "proportional", "none"),
    ):
        if {first, second} <= present and driver in set(table["driver"]):
            lines.append(compared(table, driver, first, second))
    lines.append(
        f"without a limit the degradation that fails most is `{worst.idxmax()}` ({worst.max():.0f} %); without a "
        f"fault the failures are between {healthy.min():.1f} % (`{healthy.idxmin()}`) and {healthy.max():.1f} % "
        f"(`{healthy.idxmax()}`)"
    )
    return lines


def as_markdown(table: pd.DataFrame) -> str:
    """The table of the drivers in :data:`SHOWN`, and the findings, in Markdown.

    Args:
        table: results of the benchmark, one row per episode.
    """
    square = failures_and_error(table)
    rows = [f"| {name} | " + " | ".join(row) + " |" for name, row in zip(square.index, square.to_numpy(), strict=True)]
    lines = [
        f"Failures [%] / mean lateral RMS error [m]; {len(table):,} episodes, seeds {sorted(set(table['seed']))}.",
        "",
        "| authority | " + " | ".join(square.columns) + " |",
        "| --- |" + " --- |" * len(square.columns),
        *rows,
        "",
        *(f"- {line}." for line in finding(table)),
        "",
        f"Made with {table['versions'].iloc[0]}.",
    ]
    return "\n".join(lines) + "\n"


def main(
    out: Annotated[Path, typer.Option(help="Folder of the results.")] = Path("results/full"),
    seeds: Annotated[int, typer.Option(min=1, help="How many.")] = 3,
    jobs: Annotated[int, typer.Option(min=1, help="Processes.")] = os.cpu_count() or 1,
    docs: Annotated[Path, typer.Option(help="Folder of the page.")] = Path("docs"),
    fresh: Annotated[bool, typer.Option(help="Replace other results in the folder.")] = False,
) -> None:
    """Run every authority with every driver on the full suite; stopped, it goes on where it was."""
    run_suite("full", ",".join(SHOWN), "all", f"0-{seeds - 1}", jobs, out=out, fresh=fresh)
    table = pd.read_parquet(out / TABLE)
    text = as_markdown(table)
    write_atomically(docs / "benchmark.md", lambda path: path.write_text(INTRODUCTION + text))
    typer.echo(text)


if __name__ == "__main__":
    typer.run(main)
