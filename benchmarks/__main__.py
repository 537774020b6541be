"""Print every benchmark as one table."""

from __future__ import annotations

import platform
from importlib.metadata import version
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from benchmarks import controllers, environments, startup
from benchmarks.timing import Timing


def main(repeats: Annotated[int, typer.Option(min=3, help="Repeats of every timing.")] = 15) -> None:
    """Measure on this machine, now; ratios are of the same run."""
    console = Console(width=118)
    rows: list[tuple[str, str, str, str]] = []

    def report(what: str, measured: str, ratio: str, target: str) -> None:
        rows.append((what, measured, ratio, target))
        console.print(f"measured: {what}")

    peer = environments.highway(repeats)
    report("highway-env, 4 vehicles, a step", str(peer), "1 x", "")
    limited = environments.limited(repeats)
    report("TwoLane-v0, limiter, random driver, a step", str(limited), _times(peer, limited), "10 x highway-env")
    closed = environments.closed_loop(repeats)
    report("TwoLane-v0, limiter and OSQP driver, a step", str(closed), _times(peer, closed), "5 x highway-env")

    found = controllers.scenes(400)
    ours, slsqp, gaps = controllers.automation(found, repeats)
    report("SLSQP on the automation's compiled cost", str(slsqp), "1 x", "")
    report("automation, 2 Gauss-Newton iterations", str(ours), _times(slsqp, ours), "50 x SLSQP")
    report("its cost gap, 95th percentile, cold", f"{gaps.cold:.1e}", "", "1e-2")
    report("its cost gap, 95th percentile, warm", f"{gaps.warm:.1e}", "", "1e-4")
    driver = controllers.osqp_driver(3)
    report("OSQP driver, condensing included, a call", str(driver), "", "400 us, median")
    after, whole = startup.first_step(min(repeats, 5))
    report("first step after the import, warm caches", f"{after.median:.2f} s", "", "3 s")
    report("import and first step, warm caches", f"{whole.median:.2f} s", "", "")

    packages = ", ".join(f"{name} {version(name)}" for name in ("highway-env", "gymnasium", "numpy", "numba", "osqp"))
    table = Table("what", "median (10th to 90th percentile)", "ratio", "target", title="Speed, measured in one run")
    for row in rows:
        table.add_row(*row)
    console.print(table)
    console.print(f"Python {platform.python_version()}, {packages}; {repeats} repeats, seed 0.")


def _times(slow: Timing, fast: Timing) -> str:
    return f"{slow.median / fast.median:.1f} x"


typer.run(main)
