"""Folders of recordings: nothing in them is overwritten, and one program writes at a time."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from shared_control_env.evaluation.storage import write_atomically
from shared_control_env.recordings.trial import SUFFIX, Trial

MARKER = ".running.json"
"""File that says which drive is running; one that is found at the start was lost."""


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep a folder for this program.

    Args:
        folder: the folder, which is made.

    Raises:
        ValueError: if another program has it, or if it cannot be written to.
    """
    lock = FileLock(folder / ".lock")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock.acquire(timeout=0)
    except Timeout:
        raise ValueError(f"{folder}: another run is writing there; end it first, or choose another folder") from None
    except OSError as error:
        raise ValueError(f"{folder} cannot be written to: {error.strerror or error}") from None
    try:
        yield
    finally:
        lock.release()


class RecordingsFolder:
    """The folder of the recordings: nothing in it is overwritten, and nothing is written elsewhere.

    Args:
        path: path of the folder, which is made.

    Attributes:
        path: path of the folder.
        lost: what was running when the last program ended, in words; empty if nothing was.

    Raises:
        ValueError: if the folder cannot be written to.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.lost = path, ""
        try:
            path.mkdir(parents=True, exist_ok=True)
            marker = path / MARKER
            if marker.exists():
                self.lost = _told(marker)
                marker.unlink()
            write_atomically(path / ".writable", lambda draft: draft.touch())
            (path / ".writable").unlink()
        except OSError as error:
            raise ValueError(f"{path} cannot be written to: {error.strerror or error}") from None

    def mark(self, what: str) -> None:
        """Note that a drive begins.

        Args:
            what: the drive in words.
        """
        text = json.dumps({"what": what, "began": time.strftime("%Y-%m-%d %H:%M:%S")})
        write_atomically(self.path / MARKER, lambda draft: draft.write_text(text, encoding="utf-8"))

    def unmark(self) -> bool:
        """Note that no drive is running.

        Returns:
            Whether one was.
        """
        running = (self.path / MARKER).exists()
        (self.path / MARKER).unlink(missing_ok=True)
        return running

    def add(self, name: str, trial: Trial) -> Path:
        """Write a recording under a name that is free.

        Args:
            name: wanted name without suffix; a number follows if it is taken.
            trial: the recording.

        Returns:
            Path of the file.
        """
        path, i = self.path / f"{name}{SUFFIX}", 1
        while path.exists():
            i += 1
            path = self.path / f"{name}-{i}{SUFFIX}"
        trial.write(path)
        return path

    def find(self, name: str) -> Path:
        """Path of a recording in this folder.

        Args:
            name: name of the file.

        Raises:
            ValueError: for a name of anything else.
        """
        if Path(name).name != name or not (self.path / name).is_file():
            raise ValueError(f"{name!r} is no recording in {self.path}")
        return self.path / name

    def names(self) -> list[str]:
        """Names of the recordings, the latest first."""
        found = [path for path in self.path.glob(f"*{SUFFIX}") if not path.name.startswith(".")]
        return [path.name for path in sorted(found, key=lambda path: path.stat().st_mtime, reverse=True)]


def _told(marker: Path) -> str:
    """What a marker says."""
    try:
        content: Mapping[str, Any] = json.loads(marker.read_text(encoding="utf-8"))
        return f"{content['what']}, begun {content['began']}, was interrupted; its recording is lost"
    except (OSError, ValueError, KeyError, TypeError):
        return "a drive was interrupted; its recording is lost"
