"""Cost of a step against the work: environments, vehicles and stages; writes docs/speed.md and a picture.

``python -m benchmarks.cost`` measures on this machine, now.
"""

from __future__ import annotations

import platform
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any, NamedTuple

import gymnasium as gym
import matplotlib.pyplot as plt
import numpy as np
import typer
from jinja2 import Template
from rich.console import Console

from benchmarks.timing import Timing
from benchmarks.vectors import block
from shared_control_env.core.risk.triangulation import MAX_HOLES
from shared_control_env.evaluation.progress import progress_bar

ID = "SharedControl/TwoLane-v1"
N = 512
"""Number of environments where that is not what varies."""

STEPS = 400
"""Number of steps of one environment in a timing."""

SIZES = tuple(4**i for i in range(8))
VEHICLES = (0, 1, 2, 4, 8, 12, 16, 20)
STAGES = (5, 10, 15, 20, 25, 30)
DRIVERS = {"nobody": False, "driver in the kernel": True}


class Curve(NamedTuple):
    """Time of an environment's step over one kind of work.

    Attributes:
        title: what varies.
        values: its values.
        times: time of a step, by driver; fewer than the values where the kernel takes no more vehicles.
    """

    title: str
    values: Sequence[int]
    times: dict[str, list[Timing]]


def traffic(count: int) -> dict[str, Any]:
    """Settings with a number of vehicles that follow one another in two lanes.

    Args:
        count: number of vehicles.
    """
    places = [(i % 2, 25.0 + 20.0 * (i // 2)) for i in range(count)]
    vehicles = [{"lane": lane, "position": s, "speed": 12.0, "behaviour": "idm"} for lane, s in places]
    return {"vehicles": vehicles}


def horizon(stages: int) -> dict[str, Any]:
    """Settings with a prediction horizon of both controllers.

    Args:
        stages: number of stages, H_p.
    """
    return {"automation": {"H_p": stages}, "driver": {"H_p": stages}}


WORK: dict[str, tuple[Sequence[int], Callable[[int], tuple[int, dict[str, Any]]]]] = {
    "environments N": (SIZES, lambda value: (value, {})),
    "other vehicles": (VEHICLES, lambda value: (N, traffic(value))),
    "stages of the horizon H_p": (STAGES, lambda value: (N, horizon(value))),
}
"""Values, and number of environments and settings for each, by what varies."""


def single(config: dict[str, Any]) -> Callable[[], float]:
    """A timed block of steps of one environment.

    Args:
        config: its settings.
    """
    env = gym.make(ID, config=config)
    env.reset(seed=0)
    action = np.zeros(2, dtype=np.float32)

    def run() -> float:
        begin = perf_counter()
        for _ in range(STEPS):
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()
        return (perf_counter() - begin) / STEPS

    run()
    return run


def measure(repeats: int, console: Console) -> list[Curve]:
    """Time all curves on one core; a round times every point of a curve once.

    Args:
        repeats: number of rounds.
        console: where the progress is shown.
    """
    curves = []
    with progress_bar(console) as bar:
        running = bar.add_task("curves", total=len(WORK) * len(DRIVERS) + 1)
        for title, (values, of) in WORK.items():
            fitting = [value for value in values if values is not VEHICLES or value <= MAX_HOLES]
            times = {}
            for name, driver in DRIVERS.items():
                blocks = [
                    block(ID, n, 1, driver, config, iterations=None, commands=0.0) for n, config in map(of, fitting)
                ]
                times[name] = _rounds(blocks, repeats)
                bar.advance(running)
            if values is VEHICLES:
                times["one environment, nobody"] = _rounds([single(traffic(value)) for value in values], repeats)
                bar.advance(running)
            curves.append(Curve(title, values, times))
    return curves


def _rounds(blocks: Sequence[Callable[[], float]], repeats: int) -> list[Timing]:
    return [Timing.of(column) for column in np.array([[run() for run in blocks] for _ in range(repeats)]).T]


def draw(curves: Sequence[Curve], path: Path) -> None:
    """Draw the curves side by side.

    Args:
        curves: result of :func:`measure`.
        path: PNG file.
    """
    figure, axes = plt.subplots(1, len(curves), figsize=(11.0, 3.4), layout="constrained")
    for axis, curve in zip(axes, curves, strict=True):
        for name, times in curve.times.items():
            median = np.array([[t.median, t.low, t.high] for t in times]).T * 1e6
            axis.plot(curve.values[: len(times)], median[0], "o-", ms=3.5, label=name)
            axis.fill_between(curve.values[: len(times)], median[1], median[2], alpha=0.2)
        axis.set(xlabel=curve.title)
        axis.grid(alpha=0.3)
    axes[0].set(xscale="log", ylabel="one environment's step [µs]", yscale="log")
    axes[1].set(yscale="log")
    axes[2].set(ylim=(0.0, None))
    axes[1].legend()
    figure.savefig(path, dpi=120)
    plt.close(figure)


def table(curve: Curve) -> str:
    """A curve as rows of a Markdown table.

    Args:
        curve: the curve.
    """
    lines = [
        f"| {curve.title} | {' | '.join(f'{name} [µs]' for name in curve.times)} |",
        "| --- |" + " --- |" * len(curve.times),
    ]
    for i, value in enumerate(curve.values):
        cells = (_cell(times[i]) if i < len(times) else "" for times in curve.times.values())
        lines.append(f"| {value:,} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _cell(timing: Timing) -> str:
    return f"{timing.median * 1e6:.2f} ({timing.low * 1e6:.2f} to {timing.high * 1e6:.2f})"


def per_unit(curve: Curve, name: str, first: int = 0, last: int | None = None) -> str:
    """Additional time for one more unit of work between two points of a curve, in words [us].

    Args:
        curve: the curve.
        name: driver.
        first, last: indices of the points; the last is that of the curve unless it is given.
    """
    times, values = [timing.median for timing in curve.times[name]], curve.values
    end = len(times) - 1 if last is None else last
    return f"{(times[end] - times[first]) / (values[end] - values[first]) * 1e6:.2f}"


def main(
    repeats: Annotated[int, typer.Option(min=3, help="Rounds.")] = 9,
    out: Annotated[Path, typer.Option(help="Folder of the page and the picture, which are replaced.")] = Path("docs"),
) -> None:
    """Measure the cost of a step against the work, and write speed.md and speed.png."""
    curves = measure(repeats, Console())
    draw(curves, out / "speed.png")
    sizes, vehicles, stages = curves
    env: Any = gym.make_vec(ID, num_envs=64).unwrapped
    best = int(np.argmin([t.median for t in sizes.times["nobody"]]))
    packages = ", ".join(f"{name} {version(name)}" for name in ("gymnasium", "numpy", "numba"))
    text = Template(Path(__file__).with_suffix(".md.j2").read_text(), keep_trailing_newline=True).render(
        tables=[table(curve) for curve in curves],
        n=N,
        repeats=repeats,
        alone=f"{sizes.times['nobody'][0].median * 1e6:.0f}",
        best=f"{sizes.values[best]:,}",
        best_time=f"{sizes.times['nobody'][best].median * 1e6:.2f}",
        slower=sizes.times["nobody"][-1].low > sizes.times["nobody"][best].high,
        largest=f"{sizes.values[-1]:,}",
        largest_time=f"{sizes.times['nobody'][-1].median * 1e6:.2f}",
        size=f"{env.bytes_per_environment:,}",
        megabytes=f"{env.bytes_per_environment * sizes.values[-1] / 1e6:.0f}",
        largest_vehicle=VEHICLES[-1],
        most=MAX_HOLES,
        vehicle=per_unit(vehicles, "nobody"),
        lone=per_unit(vehicles, "one environment, nobody", last=VEHICLES.index(MAX_HOLES)),
        beyond=per_unit(vehicles, "one environment, nobody", first=VEHICLES.index(MAX_HOLES) + 1),
        stage=per_unit(stages, "nobody"),
        both=per_unit(stages, "driver in the kernel"),
        versions=f"Python {platform.python_version()}, {packages}",
    )
    (out / "speed.md").write_text(text)


if __name__ == "__main__":
    typer.run(main)
