"""The folder that stores the results of one benchmark: complete files, written by one run at a time."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

import pandas as pd
from filelock import FileLock, Timeout

MANIFEST = "benchmark.json"
"""File that describes the benchmark of the results in a folder."""

TABLE, REPORT, MARGINS = "episodes.parquet", "report.html", ("margins.csv", "margins.json")
"""Files with the table of all episodes, with the report on them, and with the margins of a controllability study."""

BATCHES = "episodes"
"""Folder with the files of the batches."""

IDENTITY = ["scenario", "degradation", "driver", "authority", "seed"]
"""Columns that identify an episode."""

FORMAT = "shared_control_env benchmark 2"
"""Entry of a manifest that identifies the folder and its layout."""

MAY_GROW = ("drivers", "authorities")
"""Parts of the manifest in which a later run may add or replace entries. All other parts must be equal."""

_LOCK = ".lock"
_DRAFT = ".draft-"
_BATCH = re.compile(r"(([0-9a-f]{8})-([0-9a-f]{8})-([0-9a-f]{8})-[0-9a-f]{16})-([0-9a-f]{16})\.parquet")
"""Name of the file of a batch: digests of the benchmark, driver, authority and batch, then of the file's content."""


def digest(content: bytes | str, length: int = 16) -> str:
    """The first hexadecimal digits of the SHA-256 of bytes or of a text.

    Args:
        content: bytes or text.
        length: number of digits.
    """
    return sha256(content.encode() if isinstance(content, str) else content).hexdigest()[:length]


def write_atomically(path: Path, write: Callable[[Path], object]) -> None:
    """Let ``write`` fill a file beside the path, then move the file to the path.

    A killed process, a full disk or a power cut leaves no incomplete file at the path.

    Args:
        path: path of the file; its folder is made.
        write: function that is called with the path to fill.

    Raises:
        OSError: if the file cannot be written; an earlier file at the path is kept.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f"{_DRAFT}{path.name}")
    try:
        write(draft)
        _flush(draft)
        draft.replace(path)
    except BaseException:
        draft.unlink(missing_ok=True)
        raise
    _flush(path.parent)


def _flush(path: Path) -> None:
    """Flush a file or folder to the disk, if the system supports this."""
    if path.is_dir() and os.name == "nt":  # Windows cannot open folders
        return
    handle = os.open(path, os.O_RDONLY if os.name != "nt" else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


class ResultsFolder:
    """Results of one benchmark, one file per batch. The folder is locked for this run until :meth:`close`.

    Args:
        path: path of the folder. It is made if needed; results of the same benchmark are resumed.
        manifest: description of the benchmark: suite, seeds, config, versions, and each driver and authority by name.
        fresh: remove all earlier results from the folder; files that are not results are kept.

    Attributes:
        path: path of the folder.
        manifest: description of the benchmark.
        notices: messages about the state of the folder, one line each.

    Raises:
        ValueError: if the folder holds other files; if it holds results of another benchmark (the message names the
            difference); if another run writes there; or if the folder cannot be written to.
    """

    def __init__(self, path: Path, manifest: Mapping[str, Any], fresh: bool = False) -> None:
        self.path, self.notices = path, list[str]()
        wanted: dict[str, Any] = {"format": FORMAT, **json.loads(json.dumps(manifest))}  # in the form read from JSON
        self._lock = FileLock(path / _LOCK)
        try:
            if path.exists() and not path.is_dir():
                raise ValueError(f"{path} is a file; choose a folder for the results")
            if path.exists() and _entries(path):
                read_manifest(path)  # raises before a lock file is put into a foreign folder
            path.mkdir(parents=True, exist_ok=True)
            self._lock.acquire(timeout=0)
        except Timeout:
            raise ValueError(f"{path}: another run is writing there; wait for it, or choose another folder") from None
        except OSError as error:
            raise ValueError(f"{path} cannot be written to: {error.strerror or error}") from None
        try:
            there = read_manifest(path) if _entries(path) else None
            if there is not None and fresh:
                self._remove_results()
            elif there is not None:
                wanted = self._joined(there, wanted)
            self.manifest = wanted
            text = json.dumps(wanted, indent=1)
            write_atomically(path / MANIFEST, lambda draft: draft.write_text(text, encoding="utf-8"))
            fixed = {part: value for part, value in wanted.items() if part not in MAY_GROW}
            self._benchmark = digest(json.dumps(fixed, sort_keys=True), 8)
            self._files = self._whole_files()
        except BaseException as error:
            self.close()
            if isinstance(error, OSError):
                raise ValueError(f"{path} cannot be written to: {error.strerror or error}") from None
            raise

    def close(self) -> None:
        """Release the folder, so that other runs can write to it."""
        self._lock.release()

    def _joined(self, there: Mapping[str, Any], wanted: Mapping[str, Any]) -> dict[str, Any]:
        """The manifest with the additions of this run."""
        for part in {**there, **wanted}:
            value = wanted.get(part)
            if part not in MAY_GROW and there.get(part) != value:
                raise ValueError(
                    f"{self.path} holds results with {part} = {there.get(part)!r}, not {value!r}; they are not mixed: "
                    "choose another folder, or replace them (--fresh)"
                )
        for part in MAY_GROW:
            changed = [
                name
                for name, entry in wanted[part].items()
                if _identity(there[part].get(name, entry)) != _identity(entry)
            ]
            if changed:
                self.notices.append(
                    f"changed since the last run in {self.path}, of the {part}: {', '.join(changed)}; their episodes "
                    "are run again, and the old ones left out of the table (their files stay)"
                )
        return {**wanted, **{part: {**there[part], **wanted[part]} for part in MAY_GROW}}

    def _remove_results(self) -> None:
        """Remove the files that a benchmark wrote, and no others."""
        for name in (MANIFEST, TABLE, REPORT, *MARGINS):
            (self.path / name).unlink(missing_ok=True)
        for path in (self.path / BATCHES).glob("*.parquet"):
            if _BATCH.fullmatch(path.name):
                path.unlink()

    def _whole_files(self) -> dict[str, Path]:
        """Files of this benchmark's batches by their keys. Damaged files are removed; foreign files are reported."""
        files, foreign, damaged = {}, [], 0
        for folder in (self.path, self.path / BATCHES):
            for draft in folder.glob(f"{_DRAFT}*"):  # left by a run that was killed
                if _is_own_draft(draft.name):
                    draft.unlink()
        for path in sorted((self.path / BATCHES).glob("*")):
            match = _BATCH.fullmatch(path.name)
            if match is None or match[2] != self._benchmark:
                foreign.append(path.name)
            elif digest(path.read_bytes()) != match[5]:
                path.unlink()
                damaged += 1
            else:
                files[match[1]] = path
        place = self.path / BATCHES
        if foreign:
            self.notices.append(f"left out, being no results of this benchmark: {', '.join(foreign)} in {place}")
        if damaged:
            self.notices.append(f"{damaged} damaged file(s) in {place}: their episodes are run again")
        return files

    def _key(self, driver: str, authority: str, batch: str) -> str:
        whose = (
            _digest_of(self.manifest[part], name) for part, name in zip(MAY_GROW, (driver, authority), strict=True)
        )
        return "-".join([self._benchmark, *whose, digest(batch)])

    def rows(self, driver: str, authority: str, batch: str) -> list[dict[str, Any]] | None:
        """Rows of a batch, one per episode; None if they are not stored.

        Args:
            driver, authority: names of driver and authority.
            batch: text that identifies the episodes of the batch.
        """
        path = self._files.get(self._key(driver, authority, batch))
        return None if path is None else pd.read_parquet(path).to_dict("records")  # type: ignore[return-value]

    def add(self, driver: str, authority: str, batch: str, rows: Sequence[Mapping[str, Any]]) -> None:
        """Store the rows of a batch.

        Args:
            driver, authority: names of driver and authority.
            batch: text that identifies the episodes of the batch.
            rows: rows of the table, one per episode.
        """
        content, key = pd.DataFrame(rows).to_parquet(), self._key(driver, authority, batch)
        path = self.path / BATCHES / f"{key}-{digest(content)}.parquet"
        write_atomically(path, lambda draft: draft.write_bytes(content))
        self._files[key] = path

    def table(self) -> pd.DataFrame:
        """All stored episodes of the present versions of drivers and authorities, sorted by :data:`IDENTITY`."""
        drivers, authorities = (
            {_digest_of(self.manifest[part], name) for name in self.manifest[part]} for part in MAY_GROW
        )
        parts = []
        for key, path in self._files.items():
            _, driver, authority, _ = key.split("-")
            if driver in drivers and authority in authorities:
                parts.append(pd.read_parquet(path))
        return sorted_table(pd.concat(parts)) if parts else pd.DataFrame(columns=IDENTITY)


def _identity(entry: Mapping[str, Any]) -> dict[str, Any]:
    """The identity of an entry: everything except its origin."""
    return {name: value for name, value in entry.items() if name != "origin"}


def _digest_of(entries: Mapping[str, Any], name: str) -> str:
    return digest(json.dumps([name, _identity(entries[name])], sort_keys=True), 8)


def _entries(path: Path) -> list[str]:
    """Names of the files in a folder, without the lock file and drafts of an aborted run."""
    return [entry.name for entry in path.iterdir() if entry.name != _LOCK and not _is_own_draft(entry.name)]


def _is_own_draft(name: str) -> bool:
    """Whether a file is an incomplete draft that :func:`write_atomically` left in a results folder."""
    written = name.removeprefix(_DRAFT)
    return written != name and (written in (MANIFEST, TABLE, REPORT, *MARGINS) or _BATCH.fullmatch(written) is not None)


def read_manifest(path: Path) -> dict[str, Any]:
    """Read the description of the benchmark whose results a folder holds.

    Args:
        path: path of the folder.

    Raises:
        ValueError: if the folder holds no results of a benchmark, or results with the layout of another version.
    """
    if not path.exists():
        raise ValueError(f"{path}: there is no such folder")
    try:
        manifest = json.loads((path / MANIFEST).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        manifest = None
    whole = isinstance(manifest, dict) and manifest.get("format") == FORMAT
    if not whole or not all(isinstance(manifest.get(part), dict) for part in MAY_GROW):
        raise ValueError(
            f"{path} holds files that are no results of a benchmark of this version; choose another folder, or remove "
            "its content by hand"
        )
    return manifest


def sorted_table(table: pd.DataFrame) -> pd.DataFrame:
    """Sort a table by the columns that identify an episode.

    Args:
        table: one row per episode.
    """
    return table.sort_values(IDENTITY, ignore_index=True)
