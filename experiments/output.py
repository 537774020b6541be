"""Files that appear whole or not at all."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path


def write_atomically(path: Path, write: Callable[[Path], object]) -> None:
    """Let ``write`` fill a file beside the path, then move it there: a kill leaves no half-written file.

    Args:
        path: of the file; its folder is made.
        write: given the path to fill.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f".draft-{path.name}")
    write(draft)
    draft.replace(path)
