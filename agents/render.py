"""Videos of one episode with several drivers side by side: ``python -m agents.render``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import pygame
import typer
from rich.console import Console

from agents.drivers import authority_entry, driver_entry
from shared_control_env.envs.degradations import DEGRADATIONS
from shared_control_env.envs.scenarios import SCENARIOS
from shared_control_env.evaluation.catalogue import choose
from shared_control_env.evaluation.progress import progress_bar
from shared_control_env.evaluation.replay import record, replay_episode

TITLE_HEIGHT = 28
"""Height of the line of text above each picture [px]."""


class Drive(NamedTuple):
    """One episode.

    Attributes:
        title: the driver, the authority, and the outcome.
        frames: one picture per step, uint8, shape (height, width, 3).
    """

    title: str
    frames: list[np.ndarray]


def drive(scenario: str, degradation: str, seed: int, driver: str, authority: str, trusted: bool = False) -> Drive:
    """Run one episode.

    Args:
        scenario: key of :data:`envs.scenarios.SCENARIOS`.
        degradation: key of :data:`envs.degradations.DEGRADATIONS`.
        seed: seed of the episode.
        driver: name or file, as :func:`agents.drivers.driver_entry` takes it.
        authority: name or file, as :func:`agents.drivers.authority_entry` takes it.
        trusted: whether a model of Stable-Baselines3 may be read.
    """
    frames: list[np.ndarray] = []
    entries = (driver, driver_entry(driver, trusted)), (authority, authority_entry(authority))
    metrics = replay_episode(scenario, *entries, degradation, seed, frames)
    limiter = "no limit" if authority == "none" else f"authority {authority}"
    outcome = "collision, " * bool(metrics["collisions"]) + "off the road, " * bool(metrics["road_departures"])
    measured = f"lateral RMS {metrics['lateral_rms']:.2f} m, driver's effort {metrics['driver_effort']:.3f}"
    return Drive(f"driver {driver}, {limiter}: {outcome}{measured}", frames)


def side_by_side(drives: Sequence[Drive]) -> list[np.ndarray]:
    """Join the pictures of all episodes at the same time; an episode that has ended shows its last picture.

    Wide pictures are stacked vertically, others are placed in a row.

    Args:
        drives: the episodes, with pictures of equal size.

    Returns:
        Frames of bytes, shape (height, width, 3); height and width are even, as MP4 requires.
    """
    pygame.font.init()
    font = pygame.font.Font(None, 22)
    titles = [_title(font, each.title, each.frames[0].shape[1]) for each in drives]
    height, width, _ = drives[0].frames[0].shape
    axis = 0 if width > height else 1
    steps = max(len(each.frames) for each in drives)
    joined = (
        np.concatenate(
            [
                np.concatenate([title, each.frames[min(k, len(each.frames) - 1)]])
                for title, each in zip(titles, drives, strict=True)
            ],
            axis=axis,
        )
        for k in range(steps)
    )
    return [frame[: frame.shape[0] // 2 * 2, : frame.shape[1] // 2 * 2] for frame in joined]


def _title(font: pygame.font.Font, text: str, width: int) -> np.ndarray:
    """A line of text as a picture, shape (TITLE_HEIGHT, width, 3)."""
    surface = pygame.Surface((width, TITLE_HEIGHT))
    surface.fill((235, 235, 240))
    surface.blit(font.render(text, True, (20, 20, 20)), (14, 6))
    return np.moveaxis(pygame.surfarray.array3d(surface), 0, 1)


def main(
    scenario: Annotated[str, typer.Option(help="Name.")] = "lane_keeping",
    degradation: Annotated[str, typer.Option(help="Name.")] = "delay",
    seed: Annotated[int, typer.Option(min=0, help="Of the episode.")] = 1_000_000,
    drivers: Annotated[str, typer.Option(help="driver:authority, several separated by commas.")] = (
        "mpc:proportional,driver-0:proportional,mpc:none"
    ),
    out: Annotated[Path | None, typer.Option(help="MP4; by default under results/videos.")] = None,
    trusted: Annotated[bool, typer.Option(help="Read models (.zip), whose code runs as they are read.")] = False,
) -> None:
    """Write an MP4 of the same episode with the predictive driver, a trained one, and without a limit."""
    console = Console()
    path = out or Path("results/videos") / f"{scenario}-{degradation}-{seed}.mp4"
    if path.suffix != ".mp4":
        raise typer.BadParameter(f"out = {path} must end with .mp4")
    pairs = [pair.strip().partition(":") for pair in drivers.split(",")]
    try:
        choose("scenario", scenario, SCENARIOS)
        choose("degradation", degradation, DEGRADATIONS)
        if path.exists():
            raise ValueError(f"{path} already exists; remove it, or choose another --out")
        drives = []
        with progress_bar(console) as bar:
            running = bar.add_task("episodes", total=len(pairs))
            for driver, _, authority in pairs:
                drives.append(drive(scenario, degradation, seed, driver, authority or "proportional", trusted))
                console.print(drives[-1].title)
                bar.advance(running)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None
    record(side_by_side(drives), path)
    console.print(f"The video is {path}.")


if __name__ == "__main__":
    typer.run(main)
