"""The message of a command that was interrupted and can be resumed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import typer


@contextmanager
def resumable(folder: Path) -> Iterator[None]:
    """End a command if it is interrupted, with a message that states where the finished part is stored.

    Args:
        folder: folder of the results.

    Raises:
        typer.Exit: if interrupted, with exit status 130 as in shells.
    """
    try:
        yield
    except KeyboardInterrupt:
        typer.echo(f"Stopped; what was done until then is kept in {folder}. The same command goes on.")
        raise typer.Exit(130) from None
