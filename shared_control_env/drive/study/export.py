"""The tables of a study, made anew from the recordings and answers: one row a trial, and one an answer."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pandas as pd

from shared_control_env.drive.study.folder import ABOUT, MOST_ATTEMPTS, PEOPLE
from shared_control_env.evaluation.storage import write_atomically
from shared_control_env.recordings.trial import Trial

TRIALS, ANSWERS = "trials.csv", "answers.csv"
"""Names of the tables."""


def export(path: Path) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Write the tables of a study into its folder.

    Args:
        path: folder of the study.

    Returns:
        The trials, with their metrics; and the answers.
    """
    trials, answers = [], []
    for person in sorted((path / PEOPLE).glob(f"*/{ABOUT}")):
        code, number = person.parent.name, json.loads(person.read_text(encoding="utf-8"))["number"]
        trials += [{"code": code, "number": number, **_row(each)} for each in sorted(person.parent.glob("*.parquet"))]
        for each in sorted(person.parent.glob("answers-*.json")):
            _, condition, questionnaire = each.stem.split("-", 1)[0], *each.stem[8:].rsplit("-", 1)
            values = json.loads(each.read_text(encoding="utf-8"))
            answers += [
                {"code": code, "condition": condition, "questionnaire": questionnaire, "item": item, "value": value}
                for item, value in values.items()
            ]
    tables = pd.DataFrame(trials), pd.DataFrame(answers)
    for name, table in zip((TRIALS, ANSWERS), tables, strict=True):
        if len(table):
            write_atomically(path / name, lambda draft, table=table: table.to_csv(draft, index=False))  # type: ignore[misc]
    return tables


def _row(path: Path) -> dict[str, Any]:
    """The row of a recording."""
    header = Trial.read(path).header
    label, attempt = path.stem.rsplit("_", 1)
    age = header["latency"].get("input_age", {})
    return {
        "file": path.name,
        "condition": header["condition"],
        "drive": label,
        "attempt": int(attempt),
        "valid": header["valid"],
        "left_out": not header["valid"] and int(attempt) >= MOST_ATTEMPTS,
        "pauses": "; ".join(header["pauses"]),
        "simulated": header["simulated"],
        "device": header["device"],
        "input_age_p95": age.get("p95"),
        "flagged": header["latency"]["flagged"],
        "seed": header["seed"],
        **header["choice"],
        **header["result"],
    }
