"""Reader of a table of tracks, to which other recordings can be brought by their own tools.

Two files: ``NAME.tracks.csv`` (or ``.parquet``) with the columns ``id, t, x, y, heading, length, width``
[-, s, m, m, rad, m, m], one row for each vehicle and time; and ``NAME.lanes.csv`` with ``lane, side, x, y``, the border
points of each lane in driving direction, ``side`` being ``left`` or ``right``. Lanes are numbered from the rightmost,
which is 0, to the left.
"""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

import numpy as np

from shared_control_env.envs.recorded.recording import Lane, Recording, Track, check
from shared_control_env.envs.tables import numbers, read_table

TRACKS, LANES = (".tracks.csv", ".tracks.parquet"), ".lanes.csv"
"""Ends of the names of the two files."""

COLUMNS = ("id", "t", "x", "y", "heading", "length", "width")
"""Columns of the table of tracks."""

LARGEST = 500_000_000
"""Largest size of a file [bytes]."""


def read_tracks(path: Path) -> Recording:
    """Read a table of tracks and the table of lanes beside it.

    Args:
        path: the table of tracks.

    Raises:
        ValueError: for a file that is none, or that is wrong in itself, naming file and element.
    """
    end = next(end for end in TRACKS if path.name.endswith(end))
    lanes = path.with_name(path.name.removesuffix(end) + LANES)
    table = read_table(path, COLUMNS, LARGEST)
    columns = np.array([numbers(path, table, name) for name in COLUMNS[1:]])
    rows: dict[str, list[int]] = defaultdict(list)
    for i, name in enumerate(table["id"]):
        rows[str(name)].append(i)
    tracks = {}
    for name, own in rows.items():
        t, x, y, heading, length, width = columns[:, own]
        if np.ptp(length) > 0.0 or np.ptp(width) > 0.0:
            raise ValueError(f"{path}: vehicle {name} changes its length or width")
        tracks[name] = Track(float(length[0]), float(width[0]), t, x, y, heading)
    recording = Recording(str(path), _lanes(lanes), tracks)
    check(recording)
    return recording


def _lanes(path: Path) -> dict[str, Lane]:
    table = read_table(path, ("lane", "side", "x", "y"), LARGEST)
    lane, x, y = (numbers(path, table, name) for name in ("lane", "x", "y"))
    borders: dict[int, dict[str, list[list[float]]]] = defaultdict(lambda: {"left": [], "right": []})
    for i, side in enumerate(table["side"]):
        if side not in ("left", "right") or not lane[i].is_integer():
            raise ValueError(f"{path}: row {i + 1}: lane must be a whole number, and side left or right")
        borders[int(lane[i])][side].append([x[i], y[i]])
    found = sorted(borders)
    if found != list(range(len(found))):
        raise ValueError(f"{path}: the lanes are {found}; they must be numbered from 0, the rightmost, on")
    return {
        str(number): Lane(
            np.array(borders[number]["left"]).reshape(-1, 2),
            np.array(borders[number]["right"]).reshape(-1, 2),
            str(number + 1) if number + 1 in borders else None,
            str(number - 1) if number > 0 else None,
        )
        for number in found
    }
