"""The reference: how much fault two populations of persons control under every authority, on dry and on wet road.

``python -m experiments.reference`` runs one controllability study for each road, and writes docs/reference.md, its
picture, and five lines of it into README.md. An interrupted run resumes.
"""

from __future__ import annotations

import os
import re
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any

import numpy as np
import pandas as pd
import typer
from jinja2 import Template
from rich.console import Console

from experiments import style
from shared_control_env.evaluation.catalogue import AUTHORITIES
from shared_control_env.evaluation.controllability import study_controllability
from shared_control_env.evaluation.controllability_report import is_best, severity
from shared_control_env.evaluation.episodes import versions
from shared_control_env.evaluation.interrupt import resumable
from shared_control_env.evaluation.progress import progress_bar
from shared_control_env.evaluation.storage import write_atomically
from shared_control_env.evaluation.study import Controllability, Study, planned_study

POPULATIONS = ("hands_on", "hands_off")
"""Drivers of the reference: persons who rest until they notice something."""

SCENARIOS = ("lane_keeping", "bend", "curve_with_lead", "dense_traffic", "motorway")
"""Scenarios of the reference: lane keeping in all forms, which a sound automation controls on both roads."""

FAULTS = (
    *("bias", "oscillation", "lane_offset"),  # that act
    *("loss_of_effectiveness", "stuck", "drop_out", "delay"),  # that withhold
)
"""Faults of the reference, of the steering."""

ROADS: dict[str, dict[str, Any]] = {"dry": {}, "wet": {"vehicle": {"mu": 0.5}}}
"""Changes to the settings for each road."""

PAPER = "proportional"
"""The paper's fuzzy inference under the law that needs no command without the fault."""

HELD_OUT = ("delay", "coloured_noise", "sign_error")
"""Kinds that the trained policies have not seen."""

DIFFERENT = ("paper", "driver_only", "safehil", "safehil_growing")
"""Authorities that are no competitors.

Eq. 10's law (``paper``) falls back on the command without the fault; the others take the automation out, or nearly so.
"""

BLOCK = re.compile(r"(?<=<!-- reference -->\n).*(?=<!-- /reference -->)", re.DOTALL)
"""The lines of the reference in README.md."""


def study_of(road: str, budget: int) -> Study:
    """The study of one road.

    Args:
        road: key of :data:`ROADS`.
        budget: largest number of episodes.
    """
    return planned_study(
        FAULTS, list(AUTHORITIES), POPULATIONS, "steering", SCENARIOS, "lane", None, False, budget, 0.1, 0, ROADS[road]
    )


def learned_studies(budget: int) -> dict[str, Study]:
    """Studies of the trained driver and of the trained allocator on kinds that they have not seen.

    Args:
        budget: largest number of episodes of each.
    """
    options: tuple[Any, ...] = ("steering", SCENARIOS, "lane", None, False, budget, 0.1, 3_000_000, {})
    drivers = ("learned", "internal_model", "attentive")
    authorities = ("learned", "proportional", "none", "barrier")
    return {
        "driver": planned_study(HELD_OUT, PAPER, drivers, *options),
        "allocator": planned_study(HELD_OUT, authorities, "population", *options),
    }


def part(result: Controllability, driver: str, baseline: str) -> pd.DataFrame:
    """Ranking of one population against one authority.

    Args:
        result: result of a study.
        driver: name of the population.
        baseline: name of the authority.
    """
    table = result.ranking
    return table[(table["driver"] == driver) & (table["baseline"] == baseline)]


def rows_of(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Rows of a table by column.

    Args:
        table: the table.
    """
    return [{str(name): value for name, value in row.items()} for row in table.to_dict("records")]


def tied(row: dict[str, Any], table: pd.DataFrame) -> str:
    """Whether an authority is told apart from the best competitor, in words.

    Args:
        row: row of the ranking.
        table: the ranking.
    """
    if row["authority"] in DIFFERENT:
        return " (no competitor)"
    return " (tied with the best)" if is_best(row, table[~table["authority"].isin(DIFFERENT)]) else ""


def with_interval(row: dict[str, Any], name: str, digits: int = 2) -> str:
    """An estimate with its interval as text.

    Args:
        row: row of the ranking.
        name: column of the estimate.
        digits: number of decimals.
    """
    value, low, high = (f"{row[name + end]:z.{digits}f}" for end in ("", "_low", "_high"))
    return f"{value} ({low} to {high})"


def margin(result: Controllability, driver: str, authority: str, fault: str) -> dict[str, Any]:
    """Row of the margins of one curve.

    Args:
        result: result of a study.
        driver, authority, fault: names of the curve.
    """
    table = result.margins
    chosen = (table["driver"] == driver) & (table["authority"] == authority) & (table["fault"] == fault)
    return rows_of(table[chosen])[0]


def effort(result: Controllability, row: dict[str, Any]) -> float:
    """Mean effort of the driver in the episodes of a curve [-].

    Args:
        result: result of a study.
        row: row of the margins.
    """
    table = result.episodes
    chosen = (table["driver"] == row["driver"]) & (table["fault_kind"] == row["kind"])
    return float(table[chosen]["driver_effort"].mean())


def findings(results: dict[str, Controllability]) -> list[str]:
    """The five lines of the README, in words that claim no more than the intervals support.

    Args:
        results: results by road.
    """
    lines = []
    for road, result in results.items():
        for driver in POPULATIONS:
            others = [row for row in rows_of(part(result, driver, PAPER)) if row["authority"] not in DIFFERENT]
            free = [row for row in others if row["more_effort_low"] <= 0.0 and row["authority"] != PAPER]
            best, cheap = others[0], free[0]
            lines.append(
                f"{road} road, `{driver}`: `{best['authority']}` controls {with_interval(best, 'margin', 1)} times the "
                f"fault of the fuzzy inference (`{PAPER}`), at {with_interval(best, 'more_effort', 3)} more effort; of "
                f"those with no more, `{cheap['authority']}` controls most: {with_interval(cheap, 'margin', 1)}"
            )
    against = [part(result, driver, "none") for result in results.values() for driver in POPULATIONS]
    own = [rows_of(table[table["authority"] == PAPER])[0] for table in against]
    worse, better = sum(row["margin_high"] < 1.0 for row in own), sum(row["margin_low"] > 1.0 for row in own)
    lines.append(
        f"against no limit the fuzzy inference controls more in {better} and less in {worse} of these {len(own)} cases"
    )
    return lines


def draw(results: dict[str, Controllability], path: Path) -> None:
    """Draw margin against effort, one panel for each road and population.

    Args:
        results: results by road.
        path: file of the picture.
    """
    with style.figure(path, len(results), len(POPULATIONS), (12.0, 4.6 * len(results))) as (_, axes):
        for row, (road, result) in zip(axes, results.items(), strict=True):
            for axis, driver in zip(row, POPULATIONS, strict=True):
                for each in part(result, driver, "none").to_dict("records"):
                    x, y = each["more_effort"], each["margin"]
                    spread = [[max(y - each["margin_low"], 0.0)], [max(each["margin_high"] - y, 0.0)]]
                    axis.errorbar(x, y, yerr=spread, fmt="o", ms=4, lw=0.8, color=style.ACTUAL)
                    axis.annotate(each["authority"], (x, y), xytext=(4, 3), textcoords="offset points", fontsize=7)
                axis.axhline(1.0, color="0.6", lw=0.8)
                axis.set_yscale("log")
                axis.set(
                    title=f"{road} road, {driver}",
                    xlabel="effort more than without a limit [-]",
                    ylabel="s_90 against no limit [-]",
                )


def page(
    results: dict[str, Controllability],
    studies: dict[str, Study],
    learned: dict[str, Controllability],
    minutes: float,
) -> str:
    """The page in Markdown.

    Args:
        results, studies: by road.
        learned: results of :func:`learned_studies`.
        minutes: duration of the run [min].
    """
    template = Template(Path(__file__).with_suffix(".md.j2").read_text(), keep_trailing_newline=True)
    return template.render(
        results=results,
        study=next(iter(studies.values())),
        populations=POPULATIONS,
        paper=PAPER,
        different=DIFFERENT,
        part=part,
        interval=with_interval,
        tied=tied,
        learned=learned,
        held_out=HELD_OUT,
        rows_of=rows_of,
        effort=effort,
        severity=severity,
        margin=margin,
        findings=findings(results),
        authorities=AUTHORITIES,
        episodes=sum(len(result.episodes) for result in results.values()),
        minutes=minutes,
        cores=os.cpu_count(),
        dips={
            road: [row for row in result.margins.to_dict("records") if row["dips"]] for road, result in results.items()
        },
        sound=lambda result, driver: float(
            np.nanmin(result.points[(result.points["severity"] == 0) & (result.points["driver"] == driver)]["share"])
        ),
        versions=versions(),
    )


def main(
    budget: Annotated[int, typer.Option(min=1, help="Largest number of episodes on each road.")] = 45_000,
    jobs: Annotated[int, typer.Option(min=1, help="Processes.")] = os.cpu_count() or 1,
    folder: Annotated[Path, typer.Option(help="Folder of the results.")] = Path("results/reference"),
    docs: Annotated[Path, typer.Option(help="Folder of the page and the picture.")] = Path("docs"),
    readme: Annotated[Path, typer.Option(help="File that gets five lines.")] = Path("README.md"),
    fresh: Annotated[bool, typer.Option(help="Replace other results in the folder.")] = False,
) -> None:
    """Run both studies, and write the page; stopped, it goes on where it was."""
    console = Console()
    begin = perf_counter()
    results, studies = {}, {}
    with resumable(folder), progress_bar(console) as bar:
        for road in ROADS:
            studies[road] = study_of(road, budget)
            task = bar.add_task(f"{road} road", total=budget)
            advance = partial(_advance, bar, task)
            results[road] = study_controllability(studies[road], folder / road, fresh, jobs, progress=advance)
        learned = {}
        for name, study in learned_studies(max(budget // 10, 1500)).items():
            task = bar.add_task(f"learned {name}", total=study.budget)
            advance = partial(_advance, bar, task)
            learned[name] = study_controllability(study, folder / f"learned_{name}", fresh, jobs, progress=advance)
    minutes = (perf_counter() - begin) / 60.0
    write_atomically(docs / "reference.png", partial(draw, results))
    write_atomically(docs / "reference.md", lambda path: path.write_text(page(results, studies, learned, minutes)))
    lines = "".join(f"- {line}.\n" for line in findings(results))
    text = BLOCK.sub(lambda _: lines, readme.read_text())
    write_atomically(readme, lambda path: path.write_text(text))
    console.print(f"The page is {docs / 'reference.md'}; the reports are in {folder}.")


def _advance(bar: Any, task: Any, done: int, total: int) -> None:
    bar.update(task, completed=done, total=total)


if __name__ == "__main__":
    typer.run(main)
