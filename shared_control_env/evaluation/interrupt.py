"""What a command that can be stopped says when it is."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import typer


@contextmanager
def resumable(folder: Path) -> Iterator[None]:
    """End the command when it is interrupted, saying where the part that is done can be found.

    Args:
        folder: of the results.

    Raises:
        typer.Exit: when interrupted, with the status 130 that shells give it.
    """
    try:
        yield
    except KeyboardInterrupt:
        typer.echo(f"Stopped; what was done until then is kept in {folder}. The same command goes on.")
        raise typer.Exit(130) from None
