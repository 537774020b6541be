"""Reader of a table of tracks, to which other recordings can be brought by their own tools.

Two files: ``NAME.tracks.csv`` (or ``.parquet``) with the columns ``id, t, x, y, heading, length, width``
[-, s, m, m, rad, m, m], one row for each vehicle and time; and ``NAME.lanes.csv`` with ``lane, side, x, y``, the border
points of each lane in driving direction, ``side`` being ``left`` or ``right``. Lanes are numbered from the rightmost,
which is 0, to the left.
"""

from __future__ import annotations

import csv
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from shared_control_env.envs.recorded.recording import Lane, Recording, Track, check

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
    found: dict[str, list[list[float]]] = defaultdict(list)
    for i, row in enumerate(_rows(path, COLUMNS)):
        found[str(row["id"])].append([_number(row[name], f"{path}: {name} in row {i + 1}") for name in COLUMNS[1:]])
    tracks = {}
    for name, rows in found.items():
        t, x, y, heading, length, width = np.array(rows).T
        if np.ptp(length) > 0.0 or np.ptp(width) > 0.0:
            raise ValueError(f"{path}: vehicle {name} changes its length or width")
        tracks[name] = Track(float(length[0]), float(width[0]), t, x, y, heading)
    recording = Recording(str(path), _lanes(lanes), tracks)
    check(recording)
    return recording


def _lanes(path: Path) -> dict[str, Lane]:
    borders: dict[int, dict[str, list[list[float]]]] = defaultdict(lambda: {"left": [], "right": []})
    for i, row in enumerate(_rows(path, ("lane", "side", "x", "y"))):
        label = f"{path}: row {i + 1}"
        number = _number(row["lane"], f"{label}: lane")
        if row["side"] not in ("left", "right") or number != int(number):
            raise ValueError(f"{label}: lane must be a whole number, and side left or right")
        borders[int(number)][row["side"]].append([_number(row[axis], f"{label}: {axis}") for axis in ("x", "y")])
    numbers = sorted(borders)
    if numbers != list(range(len(numbers))):
        raise ValueError(f"{path}: the lanes are {numbers}; they must be numbered from 0, the rightmost, on")
    return {
        str(number): Lane(
            np.array(borders[number]["left"]).reshape(-1, 2),
            np.array(borders[number]["right"]).reshape(-1, 2),
            str(number + 1) if number + 1 in borders else None,
            str(number - 1) if number > 0 else None,
        )
        for number in numbers
    }


def _rows(path: Path, columns: tuple[str, ...]) -> Iterator[dict[str, Any]]:
    """Rows of a table."""
    try:
        size = path.stat().st_size
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {error.strerror or error}") from None
    if size > LARGEST:
        raise ValueError(f"{path} has {size} bytes; at most {LARGEST} are read")
    if path.suffix == ".parquet":
        yield from _parquet(path, columns)
        return
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = csv.DictReader(file)
            _check_columns(path, rows.fieldnames or (), columns)
            yield from rows
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path} is no CSV file: {error}") from None


def _parquet(path: Path, columns: tuple[str, ...]) -> Iterator[dict[str, Any]]:
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        raise ValueError(f'{path}: Parquet needs the extra "benchmark"; a CSV file does not') from None
    try:
        table = pq.read_table(path)
    except (OSError, pa.ArrowException) as error:
        raise ValueError(f"{path} is no Parquet file: {str(error).splitlines()[0]}") from None
    _check_columns(path, table.column_names, columns)
    yield from table.select(list(columns)).to_pylist()


def _check_columns(path: Path, present: Any, columns: tuple[str, ...]) -> None:
    missing = [name for name in columns if name not in present]
    if missing:
        raise ValueError(f"{path} has no column {', '.join(missing)}; it needs {', '.join(columns)}")


def _number(value: Any, label: str) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        raise ValueError(f"{label} = {value!r} is no number") from None
