"""The folder that a benchmark's results grow in: whole files only, and of one benchmark only."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

MANIFEST = "benchmark.json"
"""What the results in a folder are of."""

TABLE, REPORT = "episodes.parquet", "report.html"
"""All episodes in one table, and the report on them."""

IDENTITY = ["scenario", "degradation", "driver", "authority", "seed"]
"""Columns that name an episode."""

MAY_GROW = ("drivers", "authorities")
"""Parts of the manifest that a later run may add to; all others must be the same."""


def write_atomically(path: Path, write: Callable[[Path], object]) -> None:
    """Let ``write`` fill a file beside the path, then move it there: a kill or a full disk leaves no half a file.

    Args:
        path: of the file; its folder is made.
        write: given the path to fill.

    Raises:
        OSError: where it cannot be written; what was there before is still there.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f".draft-{path.name}")
    try:
        write(draft)
        draft.replace(path)
    except BaseException:
        draft.unlink(missing_ok=True)
        raise


class ResultsFolder:
    """Results of one benchmark, a file a batch.

    Args:
        path: the folder; made, or resumed where it holds results of the same benchmark.
        manifest: what the benchmark is: suite, drivers, authorities, seeds, config and versions.
        fresh: replace results of another benchmark.

    Raises:
        ValueError: if the folder holds something else, naming what differs.
    """

    def __init__(self, path: Path, manifest: Mapping[str, Any], fresh: bool = False) -> None:
        self.path = path
        wanted: dict[str, Any] = json.loads(json.dumps(manifest))  # as it will be read again
        if path.exists() and any(path.iterdir()):
            there = self._manifest_there()
            if fresh:
                shutil.rmtree(path)
            else:
                self._check_same(there, wanted)
                for part in MAY_GROW:
                    wanted[part] = list(dict.fromkeys([*there[part], *wanted[part]]))
        text = json.dumps(wanted, indent=1)
        write_atomically(path / MANIFEST, lambda draft: draft.write_text(text))

    def _manifest_there(self) -> dict[str, Any]:
        try:
            return json.loads((self.path / MANIFEST).read_text())
        except (OSError, ValueError):
            raise ValueError(
                f"{self.path} holds files that are no results of a benchmark; choose another folder"
            ) from None

    def _check_same(self, there: Mapping[str, Any], manifest: Mapping[str, Any]) -> None:
        for part, wanted in manifest.items():
            if part not in MAY_GROW and there.get(part) != wanted:
                raise ValueError(
                    f"{self.path} holds results with {part} = {there.get(part)!r}, not {wanted!r}; they are not mixed: "
                    "choose another folder, or have them replaced (--fresh)"
                )

    def has(self, name: str) -> bool:
        """Whether a batch is there."""
        return self._file(name).is_file()

    def add(self, name: str, rows: Sequence[Mapping[str, Any]]) -> None:
        """Keep a batch's rows."""
        write_atomically(self._file(name), pd.DataFrame(rows).to_parquet)

    def table(self) -> pd.DataFrame:
        """All episodes so far, one row each, in the order of their names."""
        parts = [pd.read_parquet(path) for path in sorted((self.path / "episodes").glob("*.parquet"))]
        return sorted_table(pd.concat(parts)) if parts else pd.DataFrame(columns=IDENTITY)

    def _file(self, name: str) -> Path:
        return self.path / "episodes" / f"{name}.parquet"


def sorted_table(table: pd.DataFrame) -> pd.DataFrame:
    """Episodes in the order of their names, however they came in."""
    return table.sort_values(IDENTITY, ignore_index=True)
