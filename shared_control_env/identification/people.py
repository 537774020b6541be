"""Identification of all people in a folder: the table beside the paper's Table IV, and what stands behind it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

from shared_control_env.identification.data import read_people
from shared_control_env.identification.person import Person, identify_person
from shared_control_env.identification.report import write_report

TABLE, REPORT = "drivers.csv", "report.html"
"""Files of an identification."""


def identify(
    place: Path,
    out: Path | None = None,
    channel: str = "steering",
    condition: str = "",
    progress: Callable[[int, int], None] | None = None,
) -> tuple[pd.DataFrame, list[str]]:
    """Identify K_h and T_h of every person whose recordings are in a folder.

    Args:
        place: folder of recordings, such as that of a study.
        out: folder of table and report; None to write none.
        channel: ``steering`` or ``acceleration``.
        condition: name of the condition; empty for all but practice.
        progress: called with the number of people done and of all.

    Returns:
        One row per person and method; and in words what was refused.

    Raises:
        ValueError: if no person is left, with the reasons; or if ``out`` holds a report already.
    """
    if out is not None and any((out / name).exists() for name in (TABLE, REPORT)):
        raise ValueError(f"{out} holds an identification already; choose another folder (--out), or remove it")
    everyone, refused = read_people(place, channel, condition)
    people = {}
    for i, (code, drives) in enumerate(everyone.items()):
        if progress is not None:
            progress(i, len(everyone))
        people[code] = identify_person(drives)
    if progress is not None:
        progress(len(everyone), len(everyone))
    table = table_of(people)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        write_report(people, table, refused, channel, place, out / REPORT)
        table.to_csv(out / TABLE, index=False)
    return table, refused


def table_of(people: dict[str, Person]) -> pd.DataFrame:
    """The estimates as a table, one row per person and method.

    Args:
        people: what was identified, by code.
    """
    rows = []
    for code, person in people.items():
        for estimate in (person.estimate, person.delayed, person.cross_check):
            row = {
                "person": code,
                "simulated": person.drives.simulated,
                "trials": len(person.drives.names),
                "method": estimate.method,
                "found": estimate.found,
            }
            for name in ("K_h", "T_h", "delay", "rho", "offset"):
                value = getattr(estimate, name)
                row |= {name: value.value, f"{name}_low": value.low, f"{name}_high": value.high}
            first = estimate is person.estimate
            row |= {name: value if first else np.nan for name, value in person.diagnostics._asdict().items()}
            rows.append(row)
    return pd.DataFrame(rows)
