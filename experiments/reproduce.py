"""Reproduce the paper's results: all runs, figures, videos and claims, with one command."""

from __future__ import annotations

import platform
import shutil
from collections.abc import Callable
from functools import partial
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any

import pandas as pd
import typer
from rich.console import Console
from rich.table import Table

from experiments import (
    claims,
    figure_authority_surface,
    figure_commands,
    figure_dpf,
    figure_memberships,
    figure_path,
    figure_risk,
    video,
)
from experiments.case_runs import SCENARIOS, SEED, Run, all_runs, simulate
from shared_control_env.evaluation.interrupt import resumable
from shared_control_env.evaluation.progress import progress_bar
from shared_control_env.evaluation.storage import write_atomically

ROOT = Path(__file__).parent.parent
STAMP = "fingerprint.txt"
"""File that identifies the version of the sources from which the results in a folder come."""


def fingerprint() -> str:
    """Digest of the sources of the package and the experiments, and of the versions that affect the results."""
    digest = sha256(repr(sorted(provenance().items())).encode())
    for folder in ("shared_control_env", "experiments"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            digest.update(path.read_bytes())
    return digest.hexdigest()


def provenance() -> dict[str, Any]:
    """Versions and seed of the results."""
    packages = ("shared_control_env", "highway-env", "gymnasium", "numpy", "numba", "osqp", "shapely", "scipy")
    return {"seed": SEED, "python": platform.python_version(), **{name: version(name) for name in packages}}


def prepare(out: Path, fresh: bool) -> None:
    """Prepare the folder: create it, resume in it, or replace it if requested.

    Args:
        out: folder of the results.
        fresh: whether results of other sources or versions are replaced.

    Raises:
        typer.BadParameter: if the folder holds other files, or results that must not be replaced.
    """
    stamp = out / STAMP
    if out.exists() and any(out.iterdir()):
        if not stamp.is_file():
            raise typer.BadParameter(f"{out} holds files that are no results of this command; choose another --out")
        if stamp.read_text().strip() != fingerprint():
            if not fresh:
                raise typer.BadParameter(
                    f"{out} holds results of other sources or versions; pass --fresh to replace them, or another --out"
                )
            shutil.rmtree(out)
    out.mkdir(parents=True, exist_ok=True)
    stamp.write_text(fingerprint() + "\n")


def load_or_simulate(run: Run, folder: Path) -> pd.DataFrame:
    """Signals of a run, read from its file if an earlier start has already finished it.

    Args:
        run: the run.
        folder: folder of the files.
    """
    path = folder / f"{run.name}.parquet"
    if not path.is_file():
        table = simulate(run)
        write_atomically(path, table.to_parquet)
    return pd.read_parquet(path)


def figures(runs: dict[Run, pd.DataFrame], out: Path) -> dict[Path, Callable[[Path], None]]:
    """File of every picture, and the function that draws it.

    Args:
        runs: signals of all runs.
        out: folder of the results.
    """
    drawings: dict[Path, Callable[[Path], None]] = {
        out / "memberships.png": figure_memberships.draw,
        out / "authority_surface.png": figure_authority_surface.draw,
        out / "dpf_surface.png": figure_dpf.draw,
    }
    for case in SCENARIOS:
        for name, module in (("path", figure_path), ("risk", figure_risk), ("commands", figure_commands)):
            drawings[out / f"case{case}_{name}.png"] = partial(module.draw, runs, case)
    return drawings


def all_signals(runs: dict[Run, pd.DataFrame]) -> pd.DataFrame:
    """Signals of all runs in one table.

    Args:
        runs: signals of all runs.
    """
    tables = [
        table.assign(case=run.case, law=run.law, preset=run.preset, driver=run.driver) for run, table in runs.items()
    ]
    return pd.concat(tables, ignore_index=True)


def main(
    out: Annotated[Path, typer.Option(help="Folder of the results.")] = Path("results/paper"),
    fresh: Annotated[bool, typer.Option(help="Replace results of other sources or versions.")] = False,
) -> None:
    """Run both cases under every authority law and risk preset, and the degraded automation alone.

    Writes figures, one MP4 a case, signals.parquet, claims.md and claims.json. Stopped, it goes on where it was.
    """
    console = Console()
    prepare(out, fresh)
    with resumable(out), progress_bar(console) as progress:
        planned = all_runs()
        task = progress.add_task("closed-loop runs", total=len(planned))
        runs = {}
        for run in planned:
            progress.update(task, description=run.name)
            runs[run] = load_or_simulate(run, out / "runs")
            progress.advance(task)
        progress.update(task, description="closed-loop runs")
        write_atomically(out / "signals.parquet", all_signals(runs).to_parquet)

        drawings = figures(runs, out)
        task = progress.add_task("figures", total=len(drawings))
        for path, draw in drawings.items():
            write_atomically(path, draw)
            progress.advance(task)

        for case in SCENARIOS:
            path = out / f"case{case}.mp4"
            main_run = Run(case, "paper", "graded")
            task = progress.add_task(f"video of case {case}", total=len(runs[main_run]))
            if path.is_file():
                progress.update(task, completed=len(runs[main_run]))
            else:
                video.record(main_run, path, progress=partial(progress.advance, task))

    rows = claims.judge(runs)
    (out / "claims.json").write_text(claims.as_json(rows, provenance()))
    (out / "claims.md").write_text(claims.as_markdown(rows, provenance()))
    _print_claims(console, rows)
    console.print(f"Results are in {out}: figures (.png), videos (.mp4), signals.parquet, claims.md and claims.json.")


def _print_claims(console: Console, rows: list[dict[str, Any]]) -> None:
    table = Table("case", "claim", "printed risk", "graded risk", "verdict", title="Claims of the paper")
    colours = {claims.HOLDS: "green", claims.HOLDS_GRADED: "yellow", claims.FAILS: "red"}
    for row in rows:
        numbers = ["-" if row[key] is None else f"{row[key]:.3g}" for key in ("value_paper_risk", "value_graded_risk")]
        case = "-" if row["case"] == 0 else str(row["case"])
        table.add_row(case, row["claim"], *numbers, f"[{colours[row['verdict']]}]{row['verdict']}[/]")
    console.print(table)


if __name__ == "__main__":
    typer.run(main)
