"""Train the policies that ship, compare them on episodes left out of training, and write their model card.

``python -m experiments.policies`` trains five seeds of a driver and of an allocator. An interrupted run resumes. The
command replaces ``shared_control_env/learned/policies``: the policies, their learning curves, and the card in
README.md with the numbers of this run.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Mapping
from concurrent.futures import wait
from multiprocessing import active_children
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
import typer
from jinja2 import Template
from rich.console import Console

from agents.evaluate import BASELINE, KINDS, LEARNED, METRICS, Row, compare, measure_and_show, shown, where_it_loses
from agents.tasks import HELD_OUT_DEGRADATIONS, TASKS
from agents.train import BEST, PROGRESS, Training
from experiments import style
from shared_control_env.evaluation import SUITES
from shared_control_env.evaluation.engines import worker_pool
from shared_control_env.evaluation.episodes import versions
from shared_control_env.evaluation.interrupt import resumable
from shared_control_env.evaluation.progress import progress_bar
from shared_control_env.evaluation.storage import write_atomically
from shared_control_env.learned.shipped import BEST as NAMES_OF_BEST
from shared_control_env.learned.shipped import POLICIES
from shared_control_env.learned.views import DEAD_ZONE
from shared_control_env.registration import ENVIRONMENTS

SEEDS = range(5)
"""Training seeds of each task."""

SCENARIOS = SUITES["full"].scenarios
"""Scenarios with random draws, in which the policies are compared."""

IDS = [id for id, scenario in ENVIRONMENTS.items() if scenario in SCENARIOS]
IDS += ["SharedControl/LeadBraking-v1", "SharedControl/LaneChange-v1"]
"""Environments of training. Two have a double share: there, a driver who brakes or accelerates too slowly collides."""

STEPS = {"driver": 4_900_000, "allocator": 2_900_000}
"""Number of steps of each training; complete segments are learned."""

FOLDER = Path("results/policies")
"""Folder of the trainings."""


def folder_of(task: str, seed: int) -> Path:
    """Folder of one training.

    Args:
        task: key of :data:`agents.tasks.TASKS`.
        seed: training seed.
    """
    return FOLDER / f"{task}-{seed}"


def state_of(task: str, seed: int) -> dict[str, Any]:
    """Progress and results of one training.

    Args:
        task: key of :data:`agents.tasks.TASKS`.
        seed: training seed.
    """
    path = folder_of(task, seed) / PROGRESS
    return json.loads(path.read_text()) if path.is_file() else {"steps": 0}


def best_score(task: str, seed: int) -> float:
    """Largest mean return of a training in validation.

    Args:
        task: key of :data:`agents.tasks.TASKS`.
        seed: training seed.
    """
    return max(score for _, score in state_of(task, seed)["scores"])


def train(task: str, seed: int, steps: int) -> None:
    """Train one policy to the end.

    Args:
        task: key of :data:`agents.tasks.TASKS`.
        seed: training seed.
        steps: number of steps [-].
    """
    training = Training(folder_of(task, seed), "ppo", IDS, task, seed)
    while training.state["steps"] < steps:
        training.run_segment(lambda _: None)


def train_all(jobs: int, console: Console) -> None:
    """Train all policies, several at once.

    Args:
        jobs: number of trainings at once.
        console: where the progress is shown.
    """
    runs = [(task, seed) for task in TASKS for seed in SEEDS]
    with progress_bar(console) as bar, worker_pool(jobs) as pool:
        progress = bar.add_task("steps", total=sum(STEPS[task] for task, _ in runs))
        waiting = {pool.submit(train, task, seed, STEPS[task]) for task, seed in runs}
        try:
            while waiting:
                done, waiting = wait(waiting, timeout=2.0)
                for future in done:
                    future.result()
                bar.update(progress, completed=sum(min(state_of(*run)["steps"], STEPS[run[0]]) for run in runs))
        except KeyboardInterrupt:
            for process in active_children():  # otherwise they would begin the next training
                process.terminate()
            raise


def draw_curves(path: Path) -> None:
    """Draw the validation return of every seed over the steps, one panel per task.

    Args:
        path: file of the picture.
    """
    with style.figure(path, 1, len(TASKS), (9.0, 3.2)) as (_, axes):
        for axis, task in zip(axes[0], TASKS, strict=True):
            curves = [np.array(state_of(task, seed)["scores"]).T for seed in SEEDS]
            for seed, (steps, scores) in zip(SEEDS, curves, strict=True):
                axis.plot(steps / 1e6, scores, label=f"seed {seed}")
            later = np.concatenate([scores[1:] for _, scores in curves])
            if later.size:  # the low first scores would hide the differences between the later ones
                axis.set_ylim(later.min() - 0.1 * np.ptp(later) - 0.1, later.max() + 0.1 * np.ptp(later) + 0.1)
            axis.set(title=task, xlabel="steps [million]", ylabel="mean return, validation episodes")
        axes[0, 0].legend()


def as_markdown(rows: list[Row]) -> list[str]:
    """The comparison as a Markdown table.

    Args:
        rows: result of :func:`agents.evaluate.compare`.

    Returns:
        Lines of the table.
    """
    head = ["faults", "name", *(name.replace("_", " ") for name in METRICS)]
    lines = [head, ["---"] * len(head)]
    lines += [[row.kind, row.name, *(shown(value) for value in row.values.values())] for row in rows]
    return [f"| {' | '.join(line)} |" for line in lines]


def verdict(rows: list[Row], task: str) -> list[str]:
    """The differences from the baseline in words, for every metric.

    Args:
        rows: result of :func:`agents.evaluate.compare`.
        task: key of :data:`agents.tasks.TASKS`.
    """
    lines = []
    for kind in KINDS:
        (differences,) = [
            row.values for row in rows if row.kind == kind and row.name == f"{LEARNED} - {BASELINE[task]}"
        ]
        named: dict[str, list[str]] = {"less": [], "more": [], "not told apart": []}
        for metric, value in differences.items():
            how = "less" if value.high < 0.0 else "more" if value.low > 0.0 else "not told apart"
            named[how].append(metric.replace("_", " "))
        said = "; ".join(f"{how}: {', '.join(names)}" for how, names in named.items() if names)
        lines.append(f"- Faults {kind}, {LEARNED} against `{BASELINE[task]}`: {said}.")
    return lines


def in_words(draw: Mapping[str, Any]) -> str:
    """A random draw of the settings in words.

    Args:
        draw: entry of ``config["randomise"]``.
    """
    name = draw["setting"].split(".")[-1]
    if "low" in draw:
        return f"{name} {draw['low']} to {draw['high']}"
    return f"{name} log-normal with median {draw['median']:.3g} and spread {draw['spread']:.2g}"


def part_of_card(task: str, table: pd.DataFrame) -> dict[str, Any]:
    """Values of the model card for one task.

    Args:
        task: key of :data:`agents.tasks.TASKS`.
        table: result of :func:`agents.evaluate.measure`.
    """
    states = [state_of(task, seed) for seed in SEEDS]
    seconds = [state["seconds"] for state in states]
    rows = compare(table, task)
    return {
        "task": task,
        "description": TASKS[task].description,
        "reward": ", ".join(f"{name} {value:g}" for name, value in TASKS[task].reward.items()),
        "draws": ", ".join(in_words(draw) for draw in TASKS[task].draws),
        "versions": states[0]["card"]["versions"],
        "asked": STEPS[task],
        "steps": f"{states[0]['steps']:,}",
        "fastest": round(min(seconds)),
        "slowest": round(max(seconds)),
        "share": round(100.0 * sum(state["seconds_in"]["environment"] for state in states) / sum(seconds)),
        "episodes": f"{len(table):,}",
        "table": "\n".join(as_markdown(rows)),
        "verdict": "\n".join(verdict(rows, task)),
        "baseline": BASELINE[task],
        "cells": len(table[["scenario", "degradation"]].drop_duplicates()),
        "losses": "\n".join(where_it_loses(table, task)),
    }


def card(tables: dict[str, pd.DataFrame], jobs: int) -> str:
    """The model card in Markdown.

    Args:
        tables: result of :func:`agents.evaluate.measure` for each task.
        jobs: number of trainings at once.
    """
    template = Template(Path(__file__).with_suffix(".md.j2").read_text(), keep_trailing_newline=True)
    return template.render(
        ids=IDS,
        scenarios=len(SCENARIOS),
        seeds=list(SEEDS),
        versions=versions(),
        jobs=jobs,
        cores=os.cpu_count(),
        dead_zone=round(100.0 * DEAD_ZONE),
        held_out=[f"`{kind}`" for kind in HELD_OUT_DEGRADATIONS],
        seeds_compared=tables["driver"]["seed"].nunique(),
        parts=[part_of_card(task, table) for task, table in tables.items()],
    )


def publish(seeds: int, jobs: int, console: Console) -> None:
    """Compare the trained policies, and replace the policies that ship and their card.

    Args:
        seeds: number of held-out seeds of the comparison.
        jobs: number of processes.
        console: where the progress is shown.
    """
    tables = {}
    for task in TASKS:
        sources = [str(folder_of(task, seed) / BEST) for seed in SEEDS]
        tables[task] = measure_and_show(console, task, sources, SCENARIOS, seeds, jobs)
        write_atomically(FOLDER / f"{task}.parquet", tables[task].to_parquet)
    POLICIES.mkdir(exist_ok=True)
    for task in TASKS:
        for seed in SEEDS:
            shutil.copyfile(folder_of(task, seed) / BEST, POLICIES / f"{task}-{seed}.npz")
    names = {task: f"{task}-{max(SEEDS, key=lambda seed: best_score(task, seed))}" for task in TASKS}
    write_atomically(POLICIES / NAMES_OF_BEST, lambda draft: draft.write_text(json.dumps(names)))
    draw_curves(POLICIES / "curves.png")
    write_atomically(POLICIES / "README.md", lambda draft: draft.write_text(card(tables, jobs)))
    console.print(f"The policies and their card are in {POLICIES}.")


def main(
    seeds: Annotated[int, typer.Option(min=1, help="Held-out seeds of the comparison.")] = 20,
    jobs: Annotated[int, typer.Option(min=1, help="Trainings at once.")] = os.cpu_count() or 1,
) -> None:
    """Train, compare, and replace what ships; stopped, it goes on where it was."""
    console = Console()
    with resumable(FOLDER):
        train_all(jobs, console)
        publish(seeds, jobs, console)


if __name__ == "__main__":
    typer.run(main)
