"""``controllability``: how much of a fault a driver and an authority still control, as curves, margins and a ranking.

The question of ISO 26262-3: of all drivers, which share controls the fault? A study runs episodes at several
severities of each kind of fault, more of them where a curve crosses 0.99, 0.9 or 0.5, and reports the margins
(:mod:`margins`). All authorities meet the same episodes and the same persons.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from shared_control_env.evaluation.catalogue import Authorities, Drivers
from shared_control_env.evaluation.episodes import Fault
from shared_control_env.evaluation.margins import (
    COVERAGE,
    Curves,
    Margin,
    Outcomes,
    fit_curves,
    margin_of,
    resampled_weights,
    wilson,
)
from shared_control_env.evaluation.ranking import RANKED, rank
from shared_control_env.evaluation.runner import (
    check_options,
    check_settings,
    checked_changes,
    described_entries,
    run_batches,
)
from shared_control_env.evaluation.sampling import PROBABILITIES, is_settled, wanted
from shared_control_env.evaluation.severity import COMMISSION
from shared_control_env.evaluation.storage import MARGINS, REPORT, TABLE, ResultsFolder, sorted_table, write_atomically
from shared_control_env.evaluation.study import (
    Cell,
    Controllability,
    Episode,
    Plan,
    Study,
    batches_of,
    coarse,
    episodes_of,
    outcomes_of,
    planned_study,
)

CLASSES = ((0.99, "C1"), (0.9, "C2"), (0.0, "C3"))
"""Classes of controllability of ISO 26262-3 and the smallest share of drivers of each."""

ROUNDS = 6
"""Largest number of rounds of a study, the coarse grid included."""


def controllability(
    kinds: str | Iterable[str] = "all",
    authority: Authorities = "all",
    driver: Drivers = "population",
    *,
    channel: str = "steering",
    scenarios: str | Iterable[str] = "all",
    keep: str = "lane",
    at: float | Mapping[str, float] | None = None,
    last: bool = False,
    budget: int = 20_000,
    width: float = 0.1,
    seed: int = 0,
    config: Mapping[str, Any] | None = None,
    out: Path | str | None = None,
    fresh: bool = False,
    jobs: int = 1,
    engine: str = "local",
    progress: Callable[[int, int], None] | None = None,
) -> pd.DataFrame:
    """Margins of every authority with every driver, for each kind of fault; see :func:`study_controllability`.

    Args:
        kinds: kinds of degradation, keys of :data:`core.faults.kinds.KINDS`; ``all`` for those of the channel. A kind
            may name its own channel, as in ``bias:acceleration``.
        authority: as for :func:`runner.evaluate`.
        driver: as for :func:`runner.evaluate`.
        channel: ``steering``, ``acceleration`` or ``both``.
        scenarios: names of scenarios; ``all`` for those of the suite ``full``.
        keep: what counts as controlled: ``lane``, ``road`` or ``collision``, see :data:`KEEPS`.
        at: severity at which the class is asked for, in the kind's unit, or one for each kind; None for the largest
            that the library of degradations draws.
        last: whether to ask, too, how long a fault of that severity may last (the fault-tolerant time).
        budget: largest number of episodes.
        width: wanted width of the intervals of s_90, as a share of the largest severity [-].
        seed: seed of the first episode of each scenario.
        config: changes to the settings of all scenarios.
        out, fresh, jobs, engine, progress: as for :func:`runner.evaluate`. The folder also gets ``margins.csv``,
            ``margins.json`` and ``report.html``.

    Returns:
        One row per curve, see :class:`Controllability`.

    Raises:
        ValueError: for unknown names; for severities outside of physics; for a budget below that of the coarse grid; or
            as for :func:`runner.evaluate`.
    """
    study = planned_study(
        kinds, authority, driver, channel, scenarios, keep, at, last, budget, width, seed, checked_changes(config)
    )
    return study_controllability(study, out, fresh, jobs, engine, progress).margins


def study_controllability(
    study: Study,
    out: Path | str | None = None,
    fresh: bool = False,
    jobs: int = 1,
    engine: str = "local",
    progress: Callable[[int, int], None] | None = None,
) -> Controllability:
    """Run a study: a coarse grid, then rounds that put episodes where they tell most, until the budget is spent.

    What a round runs depends only on the outcomes of the rounds before, so the result is the same for any number of
    processes, and an interrupted study goes on where it was.

    Args:
        study: the study.
        out, fresh, jobs, engine, progress: as for :func:`controllability`.

    Raises:
        ValueError: as for :func:`controllability`.
    """
    check_options(jobs, engine, fresh)
    check_settings(list(batches_of(study, episodes_of(study, coarse(study)))))
    folder = None if out is None else ResultsFolder(Path(out).expanduser(), _manifest(study), fresh)
    try:
        rows: dict[Episode, dict[str, Any]] = {}
        plan = coarse(study)
        for turn in range(ROUNDS):
            if turn > 0:
                plan = _refined(study, plan, rows)
            missing = [each for each in episodes_of(study, plan) if each not in rows]
            if not missing:
                break
            for batch, found in run_batches(list(batches_of(study, missing)), folder, jobs, engine):
                for (fault, seed), row in zip(batch.episodes, found, strict=True):
                    rows[Episode(batch.scenario, batch.driver[0], batch.authority[0], fault, seed)] = row
                if progress:
                    progress(len(rows), study.budget)
        result = _evaluated(study, plan, rows)
        if folder is not None:
            _write(study, result, folder)
    finally:
        if folder is not None:
            folder.close()
    return result


def _manifest(study: Study) -> dict[str, Any]:
    """Description of a study for its folder."""
    return {
        **described_entries(study.drivers, study.authorities),
        "study": "controllability",
        "axes": [axis._asdict() for axis in study.axes],
        "scenarios": study.scenarios,
        "keep": study.keep,
        "at": [None if np.isnan(s) else s for s in study.at],
        "budget": study.budget,
        "width": study.width,
        "first_seed": study.first_seed,
        "config": study.config,
    }


def _refined(study: Study, plan: Plan, rows: Mapping[Episode, Mapping[str, Any]]) -> Plan:
    """The plan of the next round: what the widest curves wish for, within the budget."""
    wishes: list[tuple[float, Cell, dict[float, int]]] = []
    for cell, levels in plan.items():
        outcomes = outcomes_of(study, cell, levels, rows)
        weights = resampled_weights(len(outcomes.controlled), np.random.default_rng(0), 100)
        curves = fit_curves(outcomes, weights)
        margin = margin_of(outcomes, curves, RANKED)
        largest = float(outcomes.severities[-1])
        if not is_settled(margin.low, margin.high, largest, study.width):
            ends = np.clip([margin.low, margin.high], 0.0, largest)
            wishes.append((float(ends[1] - ends[0]) / largest, cell, wanted(outcomes, curves, study.at[cell.axis])))
    wishes.sort(key=lambda wish: -wish[0])
    refined = {cell: dict(levels) for cell, levels in plan.items()}
    left = study.budget - len(rows)
    for _, cell, levels in wishes:
        more = {s: n for s, n in levels.items() if n > refined[cell].get(s, 0)}
        cost = sum(n - refined[cell].get(s, 0) for s, n in more.items())
        if cost <= left:
            refined[cell].update(more)
            left -= cost
    return refined


def _evaluated(study: Study, plan: Plan, rows: Mapping[Episode, Mapping[str, Any]]) -> Controllability:
    """Tables of a study from its rows."""
    longest = max(n for levels in plan.values() for n in levels.values())
    weights = resampled_weights(longest, np.random.default_rng(0))
    outcomes = {cell: outcomes_of(study, cell, levels, rows) for cell, levels in plan.items()}
    curves = {cell: fit_curves(each, weights) for cell, each in outcomes.items()}
    return Controllability(
        pd.DataFrame([_margin_row(study, cell, outcomes[cell], curves[cell]) for cell in plan]),
        rank(study, outcomes, curves, weights, rows),
        pd.DataFrame([row for cell in plan for row in _point_rows(study, cell, outcomes[cell])]),
        pd.DataFrame([_fitted_row(study, cell, curves[cell]) for cell in plan]),
        pd.DataFrame([{**row, "severity": _severity_of(key.fault)} for key, row in rows.items()]),
    )


def _severity_of(fault: Fault) -> float:
    return 0.0 if isinstance(fault, str) or fault is None else fault.severity


def _named(study: Study, cell: Cell) -> dict[str, Any]:
    """Columns that identify a curve."""
    axis = study.axes[cell.axis]
    return {
        "driver": cell.driver,
        "authority": cell.authority,
        "fault": axis.name,
        "kind": axis.kind,
        "channel": axis.channel,
        "over": axis.over,
        "meaning": axis.meaning,
        "unit": axis.unit,
        "largest": axis.largest,
        "commission": axis.kind in COMMISSION,
    }


def _margin_row(study: Study, cell: Cell, outcomes: Outcomes, curves: Curves) -> dict[str, Any]:
    row = _named(study, cell)
    for q in PROBABILITIES:
        name = f"s_{100 * q:.0f}"
        row[name], row[f"{name}_low"], row[f"{name}_high"] = margin_of(outcomes, curves, q)
    at = study.at[cell.axis]
    row["at"] = at
    row["share"] = row["share_low"] = row["share_high"] = np.nan
    row["class"] = ""
    if not np.isnan(at):
        place = int(np.flatnonzero(outcomes.severities == at)[0])
        kept, tried = outcomes.kept[place], outcomes.tried[place]
        row["share"] = kept / tried
        row["share_low"], row["share_high"] = wilson(kept, tried)
        row["class"] = class_of(row["share"])
        row["class_low"], row["class_high"] = class_of(row["share_high"]), class_of(row["share_low"])
    row["dips"] = "; ".join(
        f"{dip.severity:.3g} {row['unit']}: {100.0 * dip.share:.0f} %, though {100.0 * dip.later_share:.0f} % at "
        f"{dip.later:.3g} {row['unit']} (p = {dip.p:.1g})"
        for dip in curves.dips
    )
    row["logistic"], row["episodes"] = curves.logistic, int(outcomes.tried.sum())
    margin = Margin(row["s_90"], row["s_90_low"], row["s_90_high"])
    row["settled"] = is_settled(margin.low, margin.high, row["largest"], study.width)
    return row


def class_of(share: float) -> str:
    """Class of controllability of ISO 26262-3 of a share of drivers.

    Args:
        share: share of the drivers that control the fault [-].
    """
    return next(name for least, name in CLASSES if share >= least)


def _point_rows(study: Study, cell: Cell, outcomes: Outcomes) -> Iterator[dict[str, Any]]:
    for severity, kept, tried in zip(outcomes.severities, outcomes.kept, outcomes.tried, strict=True):
        low, high = wilson(kept, tried)
        yield {
            **_named(study, cell),
            "severity": float(severity),
            "episodes": int(tried),
            "share": kept / tried,
            "share_low": low,
            "share_high": high,
        }


def _fitted_row(study: Study, cell: Cell, curves: Curves) -> dict[str, Any]:
    low = np.quantile(curves.worse[1:], 0.5 - 0.5 * COVERAGE, axis=0)
    high = np.quantile(curves.better[1:], 0.5 + 0.5 * COVERAGE, axis=0)
    return {
        "driver": cell.driver,
        "authority": cell.authority,
        "fault": study.axes[cell.axis].name,
        "curve": curves.values[0],
        "low": low,
        "high": high,
    }


def _write(study: Study, result: Controllability, folder: ResultsFolder) -> None:
    """Write the tables and the report of a study into its folder."""
    from shared_control_env.evaluation.controllability_report import write_report  # whose plots take time to import

    table, text = MARGINS
    tables = {"margins": result.margins, "ranking": result.ranking, "points": result.points}
    content = {**folder.manifest, **{name: json.loads(each.to_json(orient="records")) for name, each in tables.items()}}
    write_atomically(folder.path / TABLE, sorted_table(result.episodes).to_parquet)
    write_atomically(folder.path / table, lambda draft: result.margins.to_csv(draft, index=False))
    write_atomically(folder.path / text, lambda draft: draft.write_text(json.dumps(content, indent=1)))
    write_report(study, result, folder.path / REPORT, folder)
