"""Two published studies of silent failures, repeated in simulation with the persons of the benchmark.

``python -m experiments.studies`` writes docs/studies.md and docs/studies.png: simulated beside published numbers, with
intervals, whatever comes out. The publications do not print the road; the roads here are assumed and said.
"""

from __future__ import annotations

from functools import partial
from math import sqrt
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import gymnasium as gym
import numpy as np
import pandas as pd
import typer
from jinja2 import Template
from rich.console import Console
from scipy import stats

from experiments import style
from shared_control_env.core.parameters import MOST_LANES, PERSONS, VehicleParameters
from shared_control_env.evaluation import DRIVERS
from shared_control_env.evaluation.episodes import versions
from shared_control_env.evaluation.progress import progress_bar
from shared_control_env.evaluation.storage import write_atomically

ONSET = 2.0
"""Time at which the automation stops steering [s]."""

FIRST_INPUT = np.radians(0.2)
"""Steering angle u_h,act of the person that counts as the first input [rad]: 3 degrees at the wheel, ratio 16."""

LANE_WIDTH = 3.65
"""Width of the lanes [m]; British motorways. The publications do not print it."""

TO_THE_LINE = 0.5 * (LANE_WIDTH - VehicleParameters().width)
"""Distance from the body of the centred car to the line [m]."""


class Condition(NamedTuple):
    """One condition of a study.

    Attributes:
        study: ``hussain`` or ``paula``.
        person: key of :data:`core.parameters.PERSONS`.
        speed: speed [m/s].
        radius: radius of the curve on which the car no longer steers [m].
        published: published mean of the first steering input after the failure, or its range [s].
    """

    study: str
    person: str
    speed: float
    radius: float
    published: tuple[float, float]

    @property
    def drift(self) -> float:
        """Time from the failure until the body of a car that nobody steers is over the line [s]."""
        return sqrt(2.0 * TO_THE_LINE * self.radius) / self.speed

    @property
    def watched(self) -> float:
        """Time that is simulated after the failure [s]: that of the drift, and time to react after it."""
        return min(self.drift + 8.0, 20.0)


def _hussain(drift: float) -> list[Condition]:
    """Both groups of Hussain et al. on a bend of the motorway from which the car drifts over the line in this time."""
    speed = 31.3  # 70 mph
    radius = (speed * drift) ** 2 / (2.0 * TO_THE_LINE)
    return [
        Condition("hussain", "hands_on", speed, radius, (3.7, 3.7)),
        Condition("hussain", "hands_off", speed, radius, (8.5, 8.5)),
    ]


def _paula(radius: float) -> list[Condition]:
    """Both kinds of resting persons in a curve of a country road as in Paula et al."""
    return [Condition("paula", person, 22.2, radius, (1.18, 1.74)) for person in ("hands_on", "hands_off")]


CONDITIONS = [
    *(condition for drift in (3.0, 6.0, 9.0) for condition in _hussain(drift)),
    *(condition for radius in (200.0, 300.0, 400.0) for condition in _paula(radius)),
]
"""All conditions."""


def settings(condition: Condition) -> dict[str, Any]:
    """Changes to the settings of the motorway: a car that stops steering, alone on the road, without a limiter.

    The road bends to the right, so that the car drifts into the adjacent lane. The cars of the studies did not display
    alpha_a, so the person does not see it.

    Args:
        condition: the condition.
    """
    lead = 0.5 * condition.speed
    duration = ONSET + condition.watched
    person = {**PERSONS[condition.person]._asdict(), "display": 0.0, "seed": None}
    length = min(condition.speed * (duration + 2.0), 1.9 * np.pi * condition.radius)
    return {
        "duration": duration,
        "road": {
            "segments": [{"length": lead}, {"length": length, "curvature": -1.0 / condition.radius}],
            "lane_width": LANE_WIDTH,
            "lanes": MOST_LANES,  # so wide that nobody is off it before acting
        },
        "ego": {"speed": condition.speed},
        "vehicles": [],
        "task": {"target_speed": condition.speed, "time_headway": 0.0},
        "authority": {"law": "none"},
        "degradations": [],
        "faults": [{"kind": "drop_out", "channel": "steering", "onset": ONSET}],
        "internal_model": {"active": True},
        "person": person,
        "randomise": list(DRIVERS["population"].draws),
    }


def simulate(condition: Condition, people: int, seed: int = 0) -> pd.DataFrame:
    """Let a number of persons experience one condition.

    Args:
        condition: the condition.
        people: number of persons.
        seed: seed of the first person.

    Returns:
        One row per person who was at rest when the failure came. ``reaction``: time from the failure to the first
        steering input [s], nan without one; ``crossed``: time from the failure until the body was over the line [s],
        nan if it never was.
    """
    env = gym.make_vec(
        "SharedControl/Motorway-v1",
        num_envs=people,
        driver=True,
        config=settings(condition),
    )
    env.reset(seed=seed)  # Gymnasium counts on from it
    reaction, crossed = np.full(people, np.nan), np.full(people, np.nan)
    running, resting = np.ones(people, dtype=bool), np.ones(people, dtype=bool)
    for _ in range(env.unwrapped.episodes[0].steps):  # type: ignore[attr-defined]
        _, _, terminations, truncations, infos = env.step(None)
        since = infos["t"] - ONSET
        engaged = infos["driver"]["engaged"]
        resting &= ~(engaged & (since < 0.0))
        error = np.abs(infos["z"][:, 1] - infos["y_target"])
        late = running & (since > 0.0)
        acted = late & engaged & np.isnan(reaction) & (np.abs(infos["u_h_act"][:, 1]) > FIRST_INPUT)
        over = late & np.isnan(crossed) & (error > TO_THE_LINE)
        reaction[acted], crossed[over] = since[acted], since[over]
        running &= ~(terminations | truncations)
        if not running.any():
            break
    env.close()
    return pd.DataFrame({"reaction": reaction, "crossed": crossed})[resting]


class Outcome(NamedTuple):
    """Numbers of one condition, each with the ends of its 95 % interval.

    Attributes:
        condition: the condition.
        people: number of persons.
        acting: number of persons who acted at all.
        reaction: mean time to the first steering input of those who acted [s], by bootstrap over persons.
        acted: share of the persons who acted before the body was over the line [-], Wilson's interval.
        kept: share of the persons whose body was never over the line [-], Wilson's interval.
    """

    condition: Condition
    people: int
    acting: int
    reaction: tuple[float, float, float]
    acted: tuple[float, float, float]
    kept: tuple[float, float, float]


def summarise(condition: Condition, table: pd.DataFrame) -> Outcome:
    """Means and shares of one condition.

    Args:
        condition: the condition.
        table: result of :func:`simulate`.
    """
    before = table["reaction"].notna() & ~(table["crossed"] < table["reaction"])
    reactions = table["reaction"].dropna().to_numpy()
    kept = table["crossed"].isna()
    return Outcome(condition, len(table), len(reactions), _mean(reactions), _share(before), _share(kept))


def _mean(values: np.ndarray) -> tuple[float, float, float]:
    """Mean and the ends of its interval; nan where fewer than two persons acted."""
    if len(values) < 2:
        return np.nan, np.nan, np.nan
    ends = stats.bootstrap((values,), np.mean, rng=np.random.default_rng(0)).confidence_interval
    return float(values.mean()), float(ends.low), float(ends.high)


def _share(which: pd.Series) -> tuple[float, float, float]:
    """Share of the persons and the ends of its interval."""
    test = stats.binomtest(int(which.sum()), len(which))
    ends = test.proportion_ci(method="wilson")
    return float(test.statistic), float(ends.low), float(ends.high)


def draw(tables: list[pd.DataFrame], path: Path) -> None:
    """Draw the times to the first steering input as distributions, one panel per study, with the published times.

    Args:
        tables: results of :func:`simulate`.
        path: file of the picture.
    """
    with style.figure(path, 1, 2, (11.0, 3.8)) as (_, axes):
        for axis, study in zip(axes[0], ("hussain", "paula"), strict=True):
            shown = [pair for pair in zip(CONDITIONS, tables, strict=True) if pair[0].study == study]
            radii = sorted({condition.radius for condition, _ in shown})
            for condition, table in shown:
                times = np.sort(table["reaction"].dropna())
                colour = style.ACTUAL if condition.person == "hands_on" else style.DESIRED
                rank = radii.index(condition.radius)
                label = f"{condition.person}, radius {condition.radius:,.0f} m"
                axis.plot(
                    times, np.arange(1, len(times) + 1) / len(table), ("-", "--", ":")[rank], color=colour, label=label
                )
                low, high = condition.published
                if rank == 0 and low == high:
                    axis.axvline(low, color=colour, lw=3, alpha=0.25, label=f"{condition.person}, published mean")
                elif rank == 0 and condition.person == "hands_on":
                    axis.axvspan(low, high, color="0.5", alpha=0.25, label="published range")
            axis.set(title={"hussain": "Hussain et al., motorway", "paula": "Paula et al., curve"}[study])
            axis.set(xlabel="time from the failure to the first steering input [s]", ylabel="share of the persons [-]")
            axis.legend(fontsize=7)


def page(outcomes: list[Outcome], people: int) -> str:
    """The page in Markdown.

    Args:
        outcomes: numbers of all conditions.
        people: number of persons who took part in each.
    """
    template = Template(Path(__file__).with_suffix(".md.j2").read_text(), keep_trailing_newline=True)
    studies = {name: [each for each in outcomes if each.condition.study == name] for name in ("hussain", "paula")}
    return template.render(
        studies=studies,
        people=people,
        late=sum(each.reaction[1] > each.condition.published[1] for each in outcomes),
        early=sum(each.reaction[2] < each.condition.published[0] for each in outcomes),
        total=len(outcomes),
        first_input=round(float(np.degrees(FIRST_INPUT)), 2),
        lane_width=LANE_WIDTH,
        to_the_line=round(TO_THE_LINE, 3),
        seconds=lambda value: "nobody" if np.isnan(value[0]) else "{:.1f} ({:.1f} to {:.1f})".format(*value),
        percent=lambda value: "{:.0f} ({:.0f} to {:.0f})".format(*(100.0 * each for each in value)),
        versions=versions(),
    )


def main(
    out: Annotated[Path, typer.Option(help="Folder of the page and the picture.")] = Path("docs"),
    people: Annotated[int, typer.Option(min=2, help="Persons in every condition.")] = 200,
) -> None:
    """Repeat both studies; writes studies.md and studies.png."""
    console = Console()
    with progress_bar(console) as bar:
        tables = [simulate(condition, people) for condition in bar.track(CONDITIONS, description="conditions")]
    outcomes = [summarise(condition, table) for condition, table in zip(CONDITIONS, tables, strict=True)]
    write_atomically(out / "studies.png", partial(draw, tables))
    write_atomically(out / "studies.md", lambda path: path.write_text(page(outcomes, people)))
    console.print(f"The page and the picture are in {out}.")


if __name__ == "__main__":
    typer.run(main)
