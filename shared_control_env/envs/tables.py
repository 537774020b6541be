"""Reader of the tables that a user gives: CSV, or Parquet."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np


def version_of(path: Path) -> tuple[Path, int, int]:
    """A file as it is now: path, time of its last change and size. What is read from it can be kept by these.

    Args:
        path: the file.

    Raises:
        ValueError: if there is no such file.
    """
    try:
        stat = path.stat()
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {error.strerror or error}") from None
    if not path.is_file():
        raise ValueError(f"{path} is no file")
    return path, stat.st_mtime_ns, stat.st_size


def read_table(path: Path, columns: Sequence[str], largest: int) -> dict[str, list[Any]]:
    """Columns of a table; other columns are left aside.

    Args:
        path: a CSV file with a header, or a Parquet file (``.parquet``).
        columns: names of the columns.
        largest: largest size of the file [bytes].

    Raises:
        ValueError: if the file cannot be read, is too large, or lacks a column; the message names file and column.
    """
    _, _, size = version_of(path)
    if size > largest:
        raise ValueError(f"{path} has {size} bytes; at most {largest} are read")
    return (_parquet if path.suffix == ".parquet" else _csv)(path, columns)


def _csv(path: Path, columns: Sequence[str]) -> dict[str, list[Any]]:
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = csv.DictReader(file)
            _check_columns(path, rows.fieldnames or (), columns)
            found: dict[str, list[Any]] = {name: [] for name in columns}
            for row in rows:
                for name in columns:
                    found[name].append(row[name])
            return found
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path} is no CSV file: {error}") from None


def _parquet(path: Path, columns: Sequence[str]) -> dict[str, list[Any]]:
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
    return {name: table[name].to_pylist() for name in columns}


def _check_columns(path: Path, present: Iterable[str], columns: Sequence[str]) -> None:
    missing = [name for name in columns if name not in set(present)]
    if missing:
        raise ValueError(f"{path} has no column {', '.join(missing)}; it needs {', '.join(columns)}")


def numbers(path: Path, table: dict[str, list[Any]], name: str) -> np.ndarray:
    """A column as numbers, shape (n,).

    Args:
        path: the file, for the error message.
        table: columns by name.
        name: name of the column.

    Raises:
        ValueError: if an entry is no number; the message names file, column and row.
    """
    values = np.empty(len(table[name]))
    for i, value in enumerate(table[name]):
        try:
            values[i] = float(value)
        except (TypeError, ValueError):
            raise ValueError(f"{path}: {name} = {value!r} in row {i + 1} is no number") from None
    return values
