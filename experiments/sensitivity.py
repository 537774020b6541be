"""Sensitivity of both cases of the paper to parameters that the paper does not give, and to the driver.

``python -m experiments.sensitivity`` varies one parameter at a time and writes a table and a picture.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import pandas as pd
import typer
from rich.console import Console

from experiments import style
from shared_control_env.controllers.stateless import Stateless
from shared_control_env.core.authority import fuzzy
from shared_control_env.core.parameters import (
    PERSONS,
    DriverLagParameters,
    PersonParameters,
    PredictiveParameters,
    TaskParameters,
    VehicleParameters,
)
from shared_control_env.evaluation import DRIVERS, AuthorityEntry, evaluate
from shared_control_env.evaluation.progress import progress_bar
from shared_control_env.evaluation.storage import write_atomically

LAWS = ("paper", "proportional")
SHOWN = {"two_lane": "lateral_max", "curve": "min_gap"}
"""Metric in each case's picture; the table has all metrics."""

BASE = "base"
"""Name of the variation that varies nothing."""

PEOPLE = range(40)
"""Seeds of the persons; a person's numbers are means over them."""

NUMBERS_OF_THE_PERSON = [name for name in PersonParameters._fields if name not in ("active", "engaged", "seed")]
"""Fields of :class:`core.parameters.PersonParameters` that are varied."""

METRICS = ("lateral_max", "min_gap", "authority_min", "driver_effort", "conflict")
"""Metrics of the table."""


class WarpedFuzzyAuthority(Stateless):
    """The fuzzy inference with moved breakpoints of the membership functions of its inputs.

    The inner breakpoints move from (1/4, 1/2, 3/4) to these values to the power of 1/g.

    Args:
        exponent: g; above 1 the same risk counts as smaller [-].

    Attributes:
        exponent: g [-].
    """

    def __init__(self, exponent: float) -> None:
        self.exponent = exponent

    def allocate(self, scene: np.ndarray, signals: np.ndarray) -> float:
        """alpha_a of one step.

        Args:
            scene: record of :data:`core.records.SCENE`; not used.
            signals: record of :data:`core.records.SIGNALS`; the risks ``r_x`` and ``r_y`` are used.
        """
        r_x, r_y = (float(signals[name]) ** self.exponent for name in ("r_x", "r_y"))
        return fuzzy.authority(r_x, r_y, 0)


class Variation(NamedTuple):
    """One changed parameter.

    Attributes:
        parameter: name of the parameter, and whether ``value`` is a factor or a value.
        value: the factor or the value.
        config: changes to the settings.
        exponent: exponent of the risks, for a change of the membership breakpoints [-].
        person: the person at the wheel; None for the paper's driver.
    """

    parameter: str
    value: float
    config: Mapping[str, Any]
    exponent: float = 1.0
    person: PersonParameters | None = None


def variations() -> list[Variation]:
    """The base setting, and every parameter below and above its base value."""
    vehicle, weights, lag = VehicleParameters(), PredictiveParameters(), DriverLagParameters()
    found = [Variation(BASE, 1.0, {})]
    for factor in (0.85, 1.2, 1.5):
        stiffness = {"C_f": vehicle.C_f * factor, "C_r": vehicle.C_r * factor}
        found.append(Variation("cornering stiffness, factor", factor, {"vehicle": stiffness}))
    for name in ("W", "H", "N", "Q_a", "Q_delta", "R"):
        for factor in (0.5, 2.0):
            changed = {name: getattr(weights, name) * factor}
            both = {"automation": changed} if name == "R" else {"automation": changed, "driver": changed}
            found.append(Variation(f"MPC weight {name}, factor", factor, both))  # the driver's cost has no R
    for exponent in (0.7, 1.4):
        found.append(Variation("membership breakpoints, exponent", exponent, {}, exponent))
    for gain in (0.8, 1.2):
        found.append(Variation("K_h, value", lag.K_h * gain, {"driver_lag": {"K_h": lag.K_h * gain}}))
    for constant in (0.1, 0.3):
        found.append(Variation("T_h, value [s]", constant, {"driver_lag": {"T_h": constant}}))
    for horizon in (0.6 * TaskParameters().tau_p, 1.0):
        found.append(Variation("tau_p, value [s]", horizon, {"task": {"tau_p": horizon}}))
    for mu in (0.3, 0.5, 0.9):
        found.append(Variation("brush tyres, friction", mu, {"vehicle": {"tyre": "fiala", "mu": mu}}))
    for delay in (0.1, 0.2):
        found.append(Variation("steering actuator, lag [s]", delay, {"actuator": {"steering_lag": delay}}))
    return found


def variations_of_the_person() -> list[Variation]:
    """The person ``hands_on``, and every number of that person at half and at twice the preset's value."""
    person = PERSONS["hands_on"]
    found = [Variation(BASE, 1.0, {}, person=person)]
    for name in NUMBERS_OF_THE_PERSON:
        for factor in (0.5, 2.0):
            changed = person._replace(**{name: getattr(person, name) * factor})
            found.append(Variation(f"{name}, factor", factor, {}, person=changed))
    return found


def measure(variation: Variation) -> pd.DataFrame:
    """Run both cases under both laws; with a person once for each of :data:`PEOPLE`.

    Args:
        variation: the changed parameter.

    Returns:
        One row for each case and law, the mean over the persons.
    """
    authorities = {law: AuthorityEntry(law, law, partial(WarpedFuzzyAuthority, variation.exponent)) for law in LAWS}
    driver, seeds, who = DRIVERS["mpc"], range(1), "mpc"
    if variation.person is not None:
        fields = {name: value for name, value in variation.person._asdict().items() if name != "seed"}
        driver = DRIVERS["hands_on"]._replace(config={**DRIVERS["hands_on"].config, "person": fields})
        seeds, who = PEOPLE, "hands_on"
    table = evaluate({who: driver}, authorities, "paper", config=variation.config, seeds=seeds)
    columns = [*METRICS, "terminated"]
    means = table.groupby(["scenario", "authority"], sort=False)[columns].mean().reset_index()
    return means.assign(driver=who, parameter=variation.parameter, value=variation.value)[
        ["driver", "parameter", "value", "scenario", "authority", *columns]
    ]


def draw(table: pd.DataFrame, path: Path) -> None:
    """Draw the range of each case's metric over every parameter, around the base setting.

    Args:
        table: results of :func:`measure` for all variations of one driver.
        path: file of the picture.
    """
    with style.figure(path, 2, 2, (12.0, 9.0)) as (fig, axes):
        for column, law in enumerate(LAWS):
            for axis, (case, metric) in zip(axes[:, column], SHOWN.items(), strict=True):
                base, ranges = deviations(table, case, law)
                low, high = ranges["low"], ranges["high"]
                axis.barh(ranges.index, high - low, left=low, color=style.LAW_COLOURS[law])
                axis.axvline(base, color="black", lw=1)
                axis.invert_yaxis()
                margin = max(0.05 * float(high.max() - low.min()), 0.05)
                axis.set_xlim(float(low.min()) - margin, float(high.max()) + margin)
                axis.set(title=f"{case}, law {law}", xlabel=f"{metric} [m]")
        fig.suptitle("Range when one parameter is varied; the line is the base setting")


def deviations(table: pd.DataFrame, case: str, law: str) -> tuple[float, pd.DataFrame]:
    """The base value of a case's metric, and its lowest and highest value over the variations of every parameter.

    Args:
        table: results of :func:`measure` for all variations of one driver.
        case: key of :data:`SHOWN`.
        law: one of :data:`LAWS`.

    Returns:
        The base value, and a table with the columns ``low`` and ``high``.
    """
    part = table[(table["authority"] == law) & (table["scenario"] == case)].round({SHOWN[case]: 6})
    is_base = part["parameter"] == BASE
    base = float(part.loc[is_base, SHOWN[case]].iloc[0])
    groups = part[~is_base].groupby("parameter", sort=False)[SHOWN[case]]
    return base, pd.DataFrame({"low": groups.min().clip(upper=base), "high": groups.max().clip(lower=base)})


def as_markdown(table: pd.DataFrame) -> str:
    """The table in Markdown.

    Args:
        table: results of :func:`measure` for all variations.
    """
    head = "| " + " | ".join(table.columns) + " |\n|" + " --- |" * len(table.columns) + "\n"
    rows = [
        "| " + " | ".join(f"{cell:.3g}" if isinstance(cell, float) else str(cell) for cell in row) + " |"
        for row in table.itertuples(index=False)
    ]
    return head + "\n".join(rows) + "\n"


def main(out: Annotated[Path, typer.Option(help="Folder of the results.")] = Path("results/sensitivity")) -> None:
    """Vary every parameter; writes sensitivity.csv, sensitivity.md and a picture for each driver."""
    console = Console()
    with progress_bar(console) as bar:
        both = [*variations(), *variations_of_the_person()]
        parts = [measure(variation) for variation in bar.track(both, description="variations")]
    table = pd.concat(parts, ignore_index=True)
    write_atomically(out / "sensitivity.csv", partial(table.to_csv, index=False))
    write_atomically(out / "sensitivity.md", lambda path: path.write_text(as_markdown(table)))
    for driver, part in table.groupby("driver", sort=False):
        write_atomically(out / f"sensitivity_{driver}.png", partial(draw, part))
        for law in LAWS:
            for case, metric in SHOWN.items():
                base, ranges = deviations(part, case, law)
                width = ranges["high"] - ranges["low"]
                console.print(
                    f"{driver}, {case}, law {law}: {metric} = {base:.3g} m; most sensitive to {width.idxmax()} "
                    f"({width.max():.2g} m)"
                )
    console.print(f"Results are in {out}.")


if __name__ == "__main__":
    typer.run(main)
