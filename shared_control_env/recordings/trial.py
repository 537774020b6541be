"""A recorded drive: one Parquet file with a row for each time step, and a header in JSON."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from shared_control_env.evaluation.storage import write_atomically

FORMAT = "shared_control_env drive 1"
"""Entry ``format`` of the header."""

KEY = b"shared_control_env"
"""Key of the header in the file's metadata."""

SUFFIX = ".parquet"


@dataclass(frozen=True)
class Trial:
    """A recorded drive of T time steps.

    Attributes:
        header: versions, environment, seed, device, calibration, latency and whether the trial is valid.
        columns: arrays of T rows by name: all of ``info`` (``automation.status`` for nested ones), ``observation``
            before the step, ``reward``, ``terminated``, ``truncated``; of the device, ``raw`` readings and the
            ``command`` that they make [m/s^2, rad]; of the rig, ``lateness``, ``input_age`` and ``round_trip`` [s]; and
            ``wanted``, u_h,des of the predictive driver [m/s^2, rad].
    """

    header: dict[str, Any]
    columns: dict[str, np.ndarray]

    def __len__(self) -> int:
        """Number of time steps."""
        return len(next(iter(self.columns.values()), ()))

    @property
    def dt(self) -> float:
        """Time step [s]."""
        return 1.0 / self.header["environment"]["policy_frequency"]

    @property
    def inputs(self) -> np.ndarray:
        """The person's actual command u_h,act, shape (T, 2) [m/s^2, rad]."""
        return self.columns["u_h_act"]

    def write(self, path: Path) -> None:
        """Write the file; it is whole, or it is not there.

        Args:
            path: path of the file.

        Raises:
            FileExistsError: if the file exists.
        """
        if path.exists():
            raise FileExistsError(f"{path} exists already; no recording is overwritten")
        arrays = {name: _to_arrow(values) for name, values in self.columns.items()}
        schema = pa.schema(
            [
                pa.field(name, array.type, metadata={"shape": json.dumps(self.columns[name].shape[1:])})
                for name, array in arrays.items()
            ],
            metadata={KEY: json.dumps(self.header)},
        )
        table = pa.table(list(arrays.values()), schema=schema)
        write_atomically(path, lambda draft: pq.write_table(table, draft, write_page_checksum=True))

    @classmethod
    def read(cls, path: Path) -> Trial:
        """Read a file.

        Args:
            path: path of the file.

        Raises:
            ValueError: if the file is no recording of a drive, or damaged.
        """
        try:
            table = pq.read_table(path, page_checksum_verification=True)
            metadata = table.schema.metadata or {}
            header = json.loads(metadata[KEY])
            columns = {
                field.name: _from_arrow(table[field.name], json.loads(field.metadata[b"shape"]))
                for field in table.schema
            }
        except FileNotFoundError:
            raise ValueError(f"{path}: there is no such file") from None
        except (OSError, KeyError, TypeError, ValueError, pa.ArrowException) as error:
            raise ValueError(f"{path} is no recording of a drive, or damaged: {_first_line(error)}") from None
        if not isinstance(header, dict) or header.get("format") != FORMAT:
            raise ValueError(f"{path} is no recording of the format {FORMAT!r}")
        return cls(header, columns)


def trials_in(place: Path) -> list[Path]:
    """Paths of the recordings in a folder and the folders below it, sorted; of a file, the file itself.

    Args:
        place: the folder or file.

    Raises:
        ValueError: if there is no such place, or if it holds no recording.
    """
    if not place.exists():
        raise ValueError(f"{place}: there is no such folder or file")
    if place.is_file():
        return [place]
    found = sorted(path for path in place.rglob(f"*{SUFFIX}") if _is_recording(path))
    if not found:
        raise ValueError(f"{place} holds no recordings (*{SUFFIX})")
    return found


def flat(values: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Names and values of nested dicts, such as ``automation.status``.

    Args:
        values: the nested dict.
        prefix: what goes before each name.
    """
    for name, value in values.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def _is_recording(path: Path) -> bool:
    """Whether a file has the header of a recording; a damaged file counts, so that reading it says so."""
    try:
        return KEY in (pq.read_schema(path).metadata or {})
    except (OSError, pa.ArrowException):
        return True


def _to_arrow(values: np.ndarray) -> Any:
    if values.ndim == 1:
        return pa.array(values)
    size = int(np.prod(values.shape[1:]))
    return pa.FixedSizeListArray.from_arrays(pa.array(np.ascontiguousarray(values).ravel()), size)


def _from_arrow(column: Any, shape: list[int]) -> np.ndarray:
    if not shape:
        return column.to_numpy()
    flat_values = column.combine_chunks().flatten().to_numpy(zero_copy_only=False)
    return flat_values.reshape(len(column), *shape)


def _first_line(error: Exception) -> str:
    return str(error).split("\n")[0] or type(error).__name__
