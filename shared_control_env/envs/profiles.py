"""Recorded faults: a profile over time in a file, as a degradation."""

from __future__ import annotations

import csv
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

COLUMNS = ("t", "value")
"""Columns of a file: time since the onset of the fault [s], and value [m/s^2 or rad]."""

LARGEST = 100_000_000
"""Largest size of a file [bytes]."""

_KEPT: dict[tuple[str, int, int, float], np.ndarray] = {}
"""Resampled profiles by file, time and size of the file, and time step; compiled code reads them by their address."""


class Profile(NamedTuple):
    """A recorded fault.

    Attributes:
        t: time since the onset, increasing from 0, shape (n,) [s].
        value: values, shape (n,) [m/s^2 or rad].
    """

    t: np.ndarray
    value: np.ndarray


def read_profile(file: str) -> Profile:
    """Read a recorded fault.

    Args:
        file: path of a CSV file with the header ``t,value``, or of a Parquet file with these columns. Other columns
            are left aside. The first time is that of the onset.

    Raises:
        ValueError: if the file cannot be read, lacks a column, has no two rows, has a value that is no finite number,
            or times that do not increase; the message names file and row.
    """
    path = Path(file).expanduser()
    try:
        stat = path.stat()
    except OSError as error:
        raise ValueError(f"{file} cannot be read: {error.strerror or error}") from None
    if stat.st_size > LARGEST:
        raise ValueError(f"{file} has {stat.st_size} bytes; at most {LARGEST} are read")
    return _read(str(path), stat.st_mtime_ns, stat.st_size)


@lru_cache(maxsize=256)
def _read(file: str, changed: int, size: int) -> Profile:
    columns = _parquet(file) if file.endswith(".parquet") else _csv(file)
    t, value = (np.asarray(columns[name], dtype=float) for name in COLUMNS)
    if len(t) < 2:
        raise ValueError(f"{file} has {len(t)} rows; a profile needs at least two")
    for name, column in zip(COLUMNS, (t, value), strict=True):
        if not np.isfinite(column).all():
            row = int(np.flatnonzero(~np.isfinite(column))[0])
            raise ValueError(f"{file}: {name} is not finite in row {row + 1}")
    if (np.diff(t) <= 0.0).any():
        row = int(np.flatnonzero(np.diff(t) <= 0.0)[0])
        raise ValueError(f"{file}: t does not increase after row {row + 1} ({t[row]:g}, then {t[row + 1]:g})")
    return Profile(t - t[0], value)


def _csv(file: str) -> dict[str, list[float]]:
    try:
        with open(file, newline="", encoding="utf-8") as opened:
            rows = csv.DictReader(opened)
            _check_columns(file, rows.fieldnames or ())
            found: dict[str, list[float]] = {name: [] for name in COLUMNS}
            for i, row in enumerate(rows):
                for name in COLUMNS:
                    try:
                        found[name].append(float(row[name]))
                    except (TypeError, ValueError):
                        raise ValueError(f"{file}: {name} = {row[name]!r} in row {i + 1} is no number") from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{file} is no CSV file: {error}") from None
    return found


def _parquet(file: str) -> dict[str, np.ndarray]:
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        raise ValueError(f'{file}: Parquet needs the extra "benchmark"; a CSV file does not') from None
    try:
        table = pq.read_table(file)
        _check_columns(file, table.column_names)
        return {name: table[name].to_numpy().astype(float) for name in COLUMNS}
    except (OSError, TypeError, pa.ArrowException) as error:
        raise ValueError(f"{file} is no Parquet file of numbers: {str(error).splitlines()[0]}") from None


def _check_columns(file: str, present: object) -> None:
    for name in COLUMNS:
        if name not in present:  # type: ignore[operator]
            raise ValueError(f"{file} has no column {name!r}; it needs {' and '.join(COLUMNS)}")


def length_of(file: str) -> float:
    """Length of a profile [s].

    Args:
        file: path of the file.
    """
    return float(read_profile(file).t[-1])


def resampled(file: str, dt: float) -> np.ndarray:
    """A profile at the time steps, interpolated linearly, shape (n,); the last entry is at or after its end.

    The array is kept for as long as the program runs, since compiled code knows its address.

    Args:
        file: path of the file.
        dt: time step [s].
    """
    path = Path(file).expanduser()
    stat = path.stat()
    key = str(path.resolve()), stat.st_mtime_ns, stat.st_size, dt
    if key not in _KEPT:
        profile = read_profile(file)
        n = int(np.ceil(profile.t[-1] / dt - 1e-9)) + 1
        _KEPT[key] = np.interp(np.arange(n) * dt, profile.t, profile.value)
    return _KEPT[key]
