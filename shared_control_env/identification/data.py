"""The steps of a person's drives that an identification uses, and the drives that it refuses."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from shared_control_env.drive.devices import KEYBOARD
from shared_control_env.recordings.trial import Trial, trials_in

CHANNELS = ("acceleration", "steering")
"""Channels of a command; the index of a channel is its column."""

FEWEST = 4
"""Smallest number of trials of a person: intervals come from the spread between trials."""

LEAST = 1e-4
"""Smallest root mean square of the input, as a share of its limit, from which an arm can be identified [-]."""


class Drives(NamedTuple):
    """Drives of one person, padded to the longest with steps that do not count.

    Attributes:
        code: code of the person.
        names: names of the recordings, n of them.
        v: input u_h,des - u_a,act, shape (n, T) [rad or m/s^2].
        y: output u_h,act, shape (n, T) [rad or m/s^2].
        outside: what does not depend on the person: the fault and the target position, shape (n, T, 2).
        lengths: number of steps of each drive, shape (n,).
        counts: whether a step counts: it is there, and the command is not at its limit, shape (n, T).
        dt: time step [s].
        simulated: name of the driver that simulated the person; empty for a real one.
        notes: what was left out, and what to be careful about, in words.
    """

    code: str
    names: tuple[str, ...]
    v: np.ndarray
    y: np.ndarray
    outside: np.ndarray
    lengths: np.ndarray
    counts: np.ndarray
    dt: float
    simulated: str
    notes: tuple[str, ...]

    def part(self, rows: np.ndarray) -> Drives:
        """Some of the drives.

        Args:
            rows: indices of the drives, or a mask.
        """
        names = tuple(np.array(self.names)[rows])
        return self._replace(
            names=names,
            v=self.v[rows],
            y=self.y[rows],
            outside=self.outside[rows],
            lengths=self.lengths[rows],
            counts=self.counts[rows],
        )


def read_people(place: Path, channel: str = "steering", condition: str = "") -> tuple[dict[str, Drives], list[str]]:
    """Read the recordings in a folder, person by person.

    Args:
        place: folder of recordings, such as that of a study; or one recording.
        channel: ``steering`` or ``acceleration``.
        condition: name of the condition; empty for all.

    Returns:
        Drives by person; and in words what was refused.

    Raises:
        ValueError: if nothing is left, with the reasons.
    """
    found: dict[str, list[tuple[str, Trial]]] = defaultdict(list)
    refused: dict[str, list[str]] = defaultdict(list)
    for path in trials_in(place):
        trial = Trial.read(path)
        header = trial.header
        code = header.get("code") or path.parent.name
        reason = _why_not(trial, condition)
        if reason:
            refused[f"{code}: {reason}"].append(path.name)
        else:
            found[code].append((path.name, trial))
    told = [
        f"{reason} ({len(names)}: {', '.join(names[:3])}{', ...' if len(names) > 3 else ''})"
        for reason, names in refused.items()
    ]
    people = {}
    for code, trials in found.items():
        if len(trials) < FEWEST:
            told.append(f"{code}: {len(trials)} usable trials; at least {FEWEST} are needed")
            continue
        drives = _stacked(code, trials, CHANNELS.index(channel))
        limit = trials[0][1].header["environment"][("a_max", "delta_max")[CHANNELS.index(channel)]]
        moved = float(np.sqrt(np.mean(drives.v[drives.counts] ** 2))) if drives.counts.any() else 0.0
        if moved < LEAST * limit:
            told.append(
                f"{code}: what was wanted beside the automation hardly moves ({channel}, rms {moved:.2g}); "
                "no arm can be told from that: choose conditions in which the automation is limited or fails"
            )
            continue
        people[code] = drives
    if not people:
        raise ValueError(f"{place}: no person is left to identify: {'; '.join(told) or 'no trials'}")
    return people, told


def _why_not(trial: Trial, condition: str) -> str:
    """Why a recording is not used; empty if it is."""
    header = trial.header
    if header.get("device") == KEYBOARD:
        return "driven by keyboard, whose keys are no arm: its rates are ours, not the person's"
    if not header["valid"]:
        return "invalid: paused or interrupted"
    if header.get("condition") == "practice":
        return "practice"
    if condition and header.get("condition") != condition:
        return f"not of the condition {condition!r}"
    return ""


def _stacked(code: str, trials: Sequence[tuple[str, Trial]], channel: int) -> Drives:
    n, longest = len(trials), max(len(trial) for _, trial in trials)
    v, y, outside = np.zeros((n, longest)), np.zeros((n, longest)), np.zeros((n, longest, 2))
    counts = np.zeros((n, longest), dtype=bool)
    rates = {trial.dt for _, trial in trials}
    if len(rates) > 1:
        raise ValueError(f"{code}: the trials have time steps of {sorted(rates)} s; identify them apart")
    for i, (_, trial) in enumerate(trials):
        T, columns = len(trial), trial.columns
        limit = trial.header["environment"][("a_max", "delta_max")[channel]]
        v[i, :T] = columns["wanted"][:, channel] - columns["u_a_act"][:, channel]
        y[i, :T] = columns["u_h_act"][:, channel]
        outside[i, :T, 0], outside[i, :T, 1] = columns["fault"][:, channel], columns["y_target"]
        wanted, sent = np.abs(columns["wanted"][:, channel]), np.abs(y[i, :T])
        counts[i, :T] = (wanted < 0.999 * limit) & (sent < 0.999 * limit)
    notes = []
    saturated = sum(len(trial) for _, trial in trials) - int(counts.sum())
    if saturated:
        notes.append(f"{saturated} steps at a limit do not count")
    flagged = [name for name, trial in trials if trial.header["latency"]["flagged"]]
    if flagged:
        notes.append(f"{len(flagged)} trials with an input age above 40 ms (95th percentile) are used")
    names = tuple(name for name, _ in trials)
    simulated = {trial.header.get("simulated", "") for _, trial in trials}
    lengths = np.array([len(trial) for _, trial in trials])
    return Drives(code, names, v, y, outside, lengths, counts, rates.pop(), ", ".join(sorted(simulated)), tuple(notes))
