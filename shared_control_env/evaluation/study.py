"""What a controllability study runs: its curves, its episodes, and the checks of what a user asks for."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import inf
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from shared_control_env.core.faults.kinds import CHANNELS, KINDS
from shared_control_env.envs.scenarios import SCENARIOS
from shared_control_env.envs.settings import as_plain
from shared_control_env.evaluation.catalogue import (
    SUITES,
    Authorities,
    AuthorityEntry,
    DriverEntry,
    Drivers,
    choose,
    chosen_authorities,
    chosen_drivers,
)
from shared_control_env.evaluation.episodes import LARGEST_BATCH, EpisodeBatch, Fault
from shared_control_env.evaluation.margins import Outcomes
from shared_control_env.evaluation.sampling import COARSE
from shared_control_env.evaluation.severity import DURATION, SIZE, Axis, axis_of, checked_severity
from shared_control_env.nearest import hint

KEEPS = {
    "lane": "no collision, on the road, and the body in the lane to keep from the onset on",
    "road": "no collision, and on the road",
    "collision": "no collision",
}
"""What counts as controlled."""


class Cell(NamedTuple):
    """One curve.

    Attributes:
        axis: index of the axis of severity.
        driver, authority: names.
    """

    axis: int
    driver: str
    authority: str


class Study(NamedTuple):
    """What a study runs and asks.

    Attributes:
        axes: axes of severity.
        scenarios: keys of :data:`envs.scenarios.SCENARIOS`; episode j runs in scenario j modulo their number.
        drivers, authorities: entries by name.
        keep: key of :data:`KEEPS`.
        at: severity on each axis at which the class is asked for; NaN for none.
        budget: largest number of episodes.
        width: wanted width of the interval of s_90, as a share of the largest severity [-].
        config: changes to the settings of all scenarios.
        first_seed: seed of the first episode of each scenario.
    """

    axes: tuple[Axis, ...]
    scenarios: tuple[str, ...]
    drivers: Mapping[str, DriverEntry]
    authorities: Mapping[str, AuthorityEntry]
    keep: str
    at: tuple[float, ...]
    budget: int
    width: float
    config: Mapping[str, Any]
    first_seed: int

    @property
    def cells(self) -> list[Cell]:
        """All curves, in the order of the tables."""
        return [
            Cell(i, driver, authority)
            for driver in self.drivers
            for i in range(len(self.axes))
            for authority in self.authorities
        ]

    def episode(self, cell: Cell, severity: float, j: int) -> Episode:
        """Episode j of a curve at a severity.

        Args:
            cell: the curve.
            severity: severity in the axis's unit; 0 for no fault.
            j: number of the episode; all curves have the same scenario, seed and person for it.
        """
        scenario, seed = self.scenarios[j % len(self.scenarios)], self.first_seed + j // len(self.scenarios)
        fault: Fault = self.axes[cell.axis].fault(severity, seed) if severity > 0.0 else "none"
        return Episode(scenario, cell.driver, cell.authority, fault, seed)


class Episode(NamedTuple):
    """What identifies an episode of a study.

    Attributes:
        scenario, driver, authority: names.
        fault: fault of the episode.
        seed: its seed.
    """

    scenario: str
    driver: str
    authority: str
    fault: Fault
    seed: int


class Controllability(NamedTuple):
    """Result of a study.

    Attributes:
        margins: one row per curve: driver, authority, kind, channel, what the severity is and its unit, s_99, s_90 and
            s_50 with their intervals, share and class at the severity asked for, dips, effort.
        ranking: one row per driver, baseline and authority: geometric mean over the axes of s_90 against the
            baseline's, for all kinds, for those of commission and of omission, and what it costs, with intervals.
        points: one row per curve and severity: number of episodes, share controlled and its Wilson interval.
        fitted: one row per curve: the fitted curve and its band.
        episodes: one row per episode, as of :func:`runner.evaluate`.
    """

    margins: pd.DataFrame
    ranking: pd.DataFrame
    points: pd.DataFrame
    fitted: pd.DataFrame
    episodes: pd.DataFrame


def planned_study(
    kinds: str | Iterable[str],
    authority: Authorities,
    driver: Drivers,
    channel: str,
    scenarios: str | Iterable[str],
    keep: str,
    at: float | Mapping[str, float] | None,
    last: bool,
    budget: int,
    width: float,
    seed: int,
    config: Mapping[str, Any],
) -> Study:
    """A study with all its arguments checked; the arguments are those of :func:`controllability`.

    Raises:
        ValueError: as for :func:`controllability`.
    """
    if channel not in CHANNELS:
        raise ValueError(f"channel = {channel!r}; {hint(channel, CHANNELS)}")
    if not isinstance(keep, str) or keep not in KEEPS:
        raise ValueError(f"keep = {keep!r}; {hint(keep, KEEPS)}")
    axes = list(_chosen_axes(kinds, channel))
    asked = _asked(axes, at)
    pairs = [(_with_level(axis, s), s) for axis, s in zip(axes, asked, strict=True)]
    if last:
        graded = [(axis, s) for axis, s in pairs if axis.over == SIZE]
        if any(np.isnan(s) for _, s in graded):
            raise ValueError("last = True needs at, a severity for each kind whose size is graded")
        pairs += [(axis_of(axis.kind, axis.channel, DURATION, s), np.nan) for axis, s in graded]
    where = list(SUITES["full"].scenarios) if scenarios == "all" else list(choose("scenario", scenarios, SCENARIOS))
    for name, value in (("budget", budget), ("seed", seed)):
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            raise ValueError(f"{name} = {value!r} must be an integer of at least 0")
    if isinstance(width, bool) or not isinstance(width, int | float) or not 0.0 < width < inf:
        raise ValueError(f"width = {width!r} must be a number above 0: a share of the largest severity")
    study = Study(
        tuple(axis for axis, _ in pairs),
        tuple(dict.fromkeys(where)),
        chosen_drivers(driver),
        chosen_authorities(authority),
        keep,
        tuple(s for _, s in pairs),
        budget,
        float(width),
        as_plain(config),
        seed,
    )
    least = len(episodes_of(study, coarse(study)))
    if budget < least:
        raise ValueError(
            f"budget = {budget} episodes is too small: {len(study.cells)} curves with {COARSE} episodes at each "
            f"severity of the coarse grid need {least}"
        )
    return study


def _chosen_axes(kinds: str | Iterable[str], channel: str) -> dict[Axis, None]:
    """Axes of the kinds that a user names, each once."""
    if kinds == "all":
        return {
            axis_of(name, channel): None
            for name, kind in KINDS.items()
            if name != "none" and not kind.recorded and channel in kind.channels
        }
    if isinstance(kinds, str):
        kinds = [kinds]
    if not isinstance(kinds, Iterable) or isinstance(kinds, bytes):
        raise ValueError(f"kinds = {kinds!r} must be a name, several, or all")
    axes: dict[Axis, None] = {}
    for name in kinds:
        kind, _, own = str(name).partition(":")
        axes[axis_of(kind, own or channel)] = None
    if not axes:
        raise ValueError("kinds is empty; it must name at least one kind of degradation, or be all")
    return axes


def _asked(axes: Sequence[Axis], at: float | Mapping[str, float] | None) -> list[float]:
    """Severity on each axis at which the class is asked for; NaN for none."""
    if at is None:
        return [np.nan if axis.library is None else min(axis.library, axis.largest) for axis in axes]
    if isinstance(at, Mapping):
        names = [axis.kind for axis in axes]
        for name in at:
            if name not in names:
                raise ValueError(f"at: {name!r} is not among the kinds; {hint(str(name), names)}")
        given = {name: at[name] for name in at}
    else:
        if len({axis.unit for axis in axes}) > 1:
            raise ValueError(
                f"at = {at!r} is one number, but the kinds have the units "
                f"{', '.join(sorted({axis.unit for axis in axes}))}; give one for each kind"
            )
        given = {axis.kind: at for axis in axes}
    return [
        checked_severity(given[axis.kind], f"at for {axis.kind!r}", axis.largest, axis.unit)
        if axis.kind in given
        else np.nan
        for axis in axes
    ]


def _with_level(axis: Axis, severity: float) -> Axis:
    """The axis with a further severity in its grid."""
    return axis if np.isnan(severity) else axis._replace(grid=tuple(sorted({*axis.grid, severity})))


Plan = dict[Cell, dict[float, int]]
"""Number of episodes that each curve should have at each severity."""


def coarse(study: Study) -> Plan:
    """The plan that every study begins with.

    Args:
        study: the study.
    """
    return {cell: dict.fromkeys(study.axes[cell.axis].grid, COARSE) for cell in study.cells}


def episodes_of(study: Study, plan: Plan) -> dict[Episode, None]:
    """All episodes of a plan, each once, in a fixed order.

    Args:
        study: the study.
        plan: the plan.
    """
    return dict.fromkeys(
        study.episode(cell, severity, j)
        for cell, levels in plan.items()
        for severity, n in sorted(levels.items())
        for j in range(n)
    )


def batches_of(study: Study, episodes: Iterable[Episode]) -> Iterator[EpisodeBatch]:
    """Divide episodes into batches, in a fixed order.

    Args:
        study: the study.
        episodes: the episodes.
    """
    groups: dict[tuple[str, str, str], list[tuple[Fault, int]]] = {}
    for each in episodes:
        groups.setdefault((each.driver, each.scenario, each.authority), []).append((each.fault, each.seed))
    for (driver, scenario, authority), part in groups.items():
        for i in range(0, len(part), LARGEST_BATCH):
            yield EpisodeBatch(
                scenario,
                (driver, study.drivers[driver]),
                (authority, study.authorities[authority]),
                tuple(part[i : i + LARGEST_BATCH]),
                study.config,
                twins=False,
            )


def outcomes_of(
    study: Study, cell: Cell, levels: Mapping[float, int], rows: Mapping[Episode, Mapping[str, Any]]
) -> Outcomes:
    """Outcomes of one curve.

    Args:
        study: the study.
        cell: the curve.
        levels: number of episodes at each severity.
        rows: rows of the episodes.
    """
    severities = sorted(levels)
    controlled = np.full((max(levels.values()), len(severities)), np.nan)
    for column, severity in enumerate(severities):
        for j in range(levels[severity]):
            controlled[j, column] = is_controlled(rows[study.episode(cell, severity, j)], study.keep)
    return Outcomes(np.array(severities), controlled)


def is_controlled(row: Mapping[str, Any], keep: str) -> bool:
    """Whether an episode counts as controlled.

    Args:
        row: row of the episode.
        keep: key of :data:`KEEPS`.
    """
    if keep == "lane":
        return row["controlled"] == 1.0
    return row["collisions"] == 0.0 if keep == "collision" else not row["terminated"]
