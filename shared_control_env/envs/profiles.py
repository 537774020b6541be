"""Recorded faults: a profile over time in a file, as a degradation."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from shared_control_env.envs.tables import numbers, read_table, version_of

COLUMNS = ("t", "value")
"""Columns of a file: time since the onset of the fault [s], and value [m/s^2 or rad]."""

LARGEST = 100_000_000
"""Largest size of a file [bytes]."""

_KEPT: dict[tuple[Path, int, int, float], np.ndarray] = {}
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
    return _read(*version_of(Path(file).expanduser()))


@lru_cache(maxsize=256)
def _read(path: Path, changed: int, size: int) -> Profile:
    table = read_table(path, COLUMNS, LARGEST)
    t, value = (numbers(path, table, name) for name in COLUMNS)
    if len(t) < 2:
        raise ValueError(f"{path} has {len(t)} rows; a profile needs at least two")
    for name, column in zip(COLUMNS, (t, value), strict=True):
        if not np.isfinite(column).all():
            row = int(np.flatnonzero(~np.isfinite(column))[0])
            raise ValueError(f"{path}: {name} is not finite in row {row + 1}")
    if (np.diff(t) <= 0.0).any():
        row = int(np.flatnonzero(np.diff(t) <= 0.0)[0])
        raise ValueError(f"{path}: t does not increase after row {row + 1} ({t[row]:g}, then {t[row + 1]:g})")
    return Profile(t - t[0], value)


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
    key = *version_of(Path(file).expanduser().resolve()), dt
    if key not in _KEPT:
        profile = read_profile(file)
        n = int(np.ceil(profile.t[-1] / dt - 1e-9)) + 1
        _KEPT[key] = np.interp(np.arange(n) * dt, profile.t, profile.value)
    return _KEPT[key]
