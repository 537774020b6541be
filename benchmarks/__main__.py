"""Print every benchmark as one table."""

from __future__ import annotations

import platform
from collections.abc import Callable
from importlib.metadata import version
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from benchmarks import allocators, controllers, environments, scenarios, startup, suite, vectors
from benchmarks.timing import Timing
from shared_control_env.registration import ENVIRONMENTS


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
    report("TwoLane-v1, limiter, random driver, a step", str(limited), _times(peer, limited), "10 x highway-env")
    closed = environments.closed_loop(repeats)
    report("TwoLane-v1, limiter and OSQP driver, a step", str(closed), _times(peer, closed), "5 x highway-env")

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

    _vectors(report, peer, limited, repeats)
    _scenarios(report, max(3, repeats // 3))
    _allocators(report, max(3, repeats // 3))
    seconds = Timing.of(suite.seconds_for(10_000, max(3, repeats // 5)))
    spread = f"{seconds.median:.0f} s ({seconds.low:.0f} to {seconds.high:.0f})"
    report("10,000 episodes of 10 s of the full suite, all cores", spread, "", "300 s")
    report("vector env, import to first step, cold", f"{startup.vector_start(cold=True):.1f} s", "", "30 s")
    with_driver = startup.vector_start(cold=True, driver=True)
    report("vector env with the driver, import to first step, cold", f"{with_driver:.1f} s", "", "30 s")
    report("vector env, import to first step, warm", f"{startup.vector_start(cold=False):.2f} s", "", "2 s")

    packages = ", ".join(f"{name} {version(name)}" for name in ("highway-env", "gymnasium", "numpy", "numba", "osqp"))
    table = Table("what", "median (10th to 90th percentile)", "ratio", "target", title="Speed, measured in one run")
    for row in rows:
        table.add_row(*row)
    console.print(table)
    console.print(f"Python {platform.python_version()}, {packages}; {repeats} repeats, seed 0.")


def _allocators(report: Callable[..., None], repeats: int) -> None:
    """Rows of the allocators: a step of the kernel against that with the fuzzy inference, or a call from Python."""
    found = list(allocators.costs(repeats))
    fuzzy = next(cost.kernel for cost in found if cost.name == "proportional")
    for cost in found:
        if cost.kernel is not None and fuzzy is not None:
            ratio = f"{cost.kernel.median / fuzzy.median:.2f} x the fuzzy inference's"
            report(f"kernel, N = {allocators.N}, 1 core: {cost.name}", str(cost.kernel), ratio, "")
        else:
            report(f"in Python: {cost.name}, a decision", str(cost.call), "", "")


def _vectors(report: Callable[..., None], peer: Timing, single: Timing, repeats: int) -> None:
    """Rows of the vectorised environment."""
    processes = vectors.highway_processes(max(3, repeats // 3))
    report("highway-env in processes, a step", str(processes), _times(peer, processes), "")
    metadrive = vectors.metadrive(max(3, repeats // 3))
    if metadrive is not None:
        report("MetaDrive, a step", str(metadrive), _times(peer, metadrive), "")
    for driver, target in ((False, "100,000 steps/s a core"), (True, "80,000 steps/s a core")):
        who = "driver in the kernel" if driver else "random driver"
        for n in vectors.SIZES:
            one, every, ratio = vectors.kernel(n, driver, repeats)
            rate = f"{_times(single, one)} single, {1.0 / one.median:,.0f}/s"
            report(f"kernel, N = {n}, {who}, 1 core", str(one), rate, target if n == 1024 else "")
            if every is not None:
                rate = f"{ratio:.2f} x one core, {1.0 / every.median:,.0f}/s"
                report(
                    f"kernel, N = {n}, {who}, all cores", str(every), rate, "1.9 x on two cores" if n == 1024 else ""
                )
    for what, (config, base, target) in vectors.VARIANTS.items():
        timing, speed = vectors.variant(config, base, repeats)
        report(f"kernel, N = 256, driver, 1 core: {what}", str(timing), f"{speed:.2f} x", target)
    report("memory of an environment", f"{vectors.bytes_per_environment():,} B", "", "4,096 B")


def _scenarios(report: Callable[..., None], repeats: int) -> None:
    """Rows of every scenario with every driver, and of what its time goes into."""
    rows = scenarios.speeds(repeats)
    for row in rows:
        target = f"{scenarios.TARGET} x" if row.driver == "nobody" else ""
        name = row.id.removeprefix("SharedControl/")
        report(
            f"kernel, N = {scenarios.N}, 1 core: {name}, {row.driver}",
            str(row.timing),
            f"{row.speed:.2f} x TwoLane, nobody; {1.0 / row.timing.median:,.0f}/s",
            target,
        )
    for driver in scenarios.DRIVERS:
        report(f"geometric mean over scenarios, {driver}", "", f"{scenarios.mean_speed(rows, driver):.2f} x", "")
    for id in ENVIRONMENTS:
        both = vectors.kernel(4096, False, max(3, repeats // 5), id).ratio
        name = id.removeprefix("SharedControl/")
        report(f"kernel, N = 4096, all cores: {name}, nobody", "", f"{both:.2f} x one core", "1.9 x on two cores")
        for part, timing in scenarios.shares(id, max(3, repeats // 3)).items():
            report(f"part of {name}: {part}", str(timing), "", "")


def _times(slow: Timing, fast: Timing) -> str:
    return f"{slow.median / fast.median:.1f} x"


if __name__ == "__main__":
    typer.run(main)
