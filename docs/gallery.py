"""Videos and lists of the gallery pages, made from the tables of the package."""

from __future__ import annotations

import inspect
import json
import re
import shutil
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from importlib import import_module
from multiprocessing import get_context
from os import cpu_count
from pathlib import Path
from typing import Any, NamedTuple

from shared_control_env.core.faults.kinds import KINDS
from shared_control_env.envs.degradations import DEGRADATIONS
from shared_control_env.envs.scenarios import SCENARIOS
from shared_control_env.evaluation.catalogue import AUTHORITIES, DRIVERS
from shared_control_env.evaluation.episodes import versions
from shared_control_env.evaluation.replay import record, replay_episode

DRIVER, AUTHORITY, SEED = "internal_model", "proportional", 3
"""What drives in every video."""

SECONDS, EVERY = 4.0, 2
"""Duration of an episode [s], and steps per frame."""

VIEW = {"screen_width": 1000, "screen_height": 360, "scaling": 8.0}
"""Settings of the pictures."""

MADE = "made.json"
"""File that says what the videos were made with."""


class Clip(NamedTuple):
    """A video.

    Attributes:
        name: name of the file without its extension.
        scenario: key of :data:`SCENARIOS`.
        degradation: key of :data:`DEGRADATIONS`; None for the scenario's own.
    """

    name: str
    scenario: str
    degradation: str | None


def clips() -> list[Clip]:
    """All videos: each scenario with its own fault or without one, and each degradation on a straight road."""
    scenarios = [
        Clip(f"scenario-{name}", name, "none" if "degradations" in entry.settings else None)
        for name, entry in SCENARIOS.items()
    ]
    faults = [name for name, entry in DEGRADATIONS.items() if entry is not None]
    return scenarios + [Clip(f"degradation-{name}", "lane_keeping", name) for name in faults]


def make(folder: Path) -> None:
    """Make all videos that are not there yet.

    Args:
        folder: where they are kept; those of other versions are removed.
    """
    about = json.dumps([versions(), DRIVER, AUTHORITY, SEED, VIEW, EVERY, [list(clip) for clip in clips()]])
    if folder.exists() and (not (folder / MADE).is_file() or (folder / MADE).read_text() != about):
        shutil.rmtree(folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / MADE).write_text(about)
    missing = [clip for clip in clips() if not (folder / f"{clip.name}.mp4").is_file()]
    if not missing:
        return
    _draw(missing[0], folder)  # which compiles, once
    with ProcessPoolExecutor(cpu_count() or 1, mp_context=get_context("spawn")) as pool:
        list(pool.map(_draw, missing[1:], [folder] * (len(missing) - 1)))


def _draw(clip: Clip, folder: Path) -> None:
    frames: list[Any] = []
    entries = (DRIVER, DRIVERS[DRIVER]), (AUTHORITY, AUTHORITIES[AUTHORITY])
    duration = {} if clip.scenario == "recorded" else {"duration": SECONDS}
    replay_episode(clip.scenario, *entries, clip.degradation, SEED, frames, {**VIEW, **duration})
    draft = folder / f"{clip.name}.draft.mp4"
    record(
        [frame[: frame.shape[0] // 2 * 2, : frame.shape[1] // 2 * 2] for frame in frames[::EVERY]], draft, 20 // EVERY
    )
    draft.rename(folder / f"{clip.name}.mp4")


def video(name: str) -> str:
    """A video as HTML, which stops and goes on when it is clicked.

    Args:
        name: name of the file without its extension.
    """
    click = "this.paused ? this.play() : this.pause()"
    return f'<video src="{name}.mp4" style="width: 100%" autoplay muted loop playsinline onclick="{click}"></video>'


def scenarios() -> str:
    """All scenarios with id, description, draws and video, in Markdown."""
    parts = []
    for name, entry in SCENARIOS.items():
        draws = [_draw_in_words(draw) for draw in entry.settings.get("randomise", [])]
        drawn = f"Drawn in each episode: {'; '.join(draws)}.\n\n" if draws else ""
        parts.append(f"## `{entry.id}`\n\n{_sentence(entry.description)}\n\n{drawn}{video(f'scenario-{name}')}\n")
    return "\n".join(parts)


def authorities() -> str:
    """All authorities with their law, and what the documentation of their allocator says, in Markdown."""
    parts = []
    for name, entry in AUTHORITIES.items():
        maker: Any = entry.make.func if isinstance(entry.make, partial) else entry.make
        text = _told(maker)
        for name_of_module in re.findall(r":mod:`core\.(authority\.\w+)`", text):
            module = import_module(f"shared_control_env.core.{name_of_module}")
            own = [each for each in vars(module).values() if getattr(each, "__module__", None) == module.__name__]
            with_equations = [_told(each) for each in own if "::" in (inspect.getdoc(each) or "")]
            text = "\n\n".join([text, inspect.getdoc(module) or "", *with_equations])
        about = f"{_sentence(entry.description)} Law `{entry.law}`, `{maker.__module__}.{maker.__qualname__}`."
        parts.append(f"### `{name}`\n\n{about}\n\n```text\n{text}\n```\n")
    return "\n".join(parts)


def _told(thing: Any) -> str:
    """The documentation of a class or function, without its arguments."""
    return re.split(r"\n(?:Args|Attributes|Raises|Returns):", inspect.getdoc(thing) or "")[0].strip()


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}."


def _draw_in_words(draw: dict[str, Any]) -> str:
    if "choices" in draw:
        return f"`{draw['setting']}` one of {', '.join(f'{value:.3g}' for value in draw['choices'])}"
    return f"`{draw['setting']}` {draw['low']:.3g} to {draw['high']:.3g}"


def degradations() -> str:
    """All degradations with what they do, their ranges and a video, in Markdown."""
    parts = []
    for name, entry in DEGRADATIONS.items():
        if entry is None:
            continue
        unit = "share of the limit" if entry.of_limit else KINDS[entry.kind].unit
        onset, size = entry.onset, entry.size
        text = f"Kind `{entry.kind}`, on {', '.join(entry.channels)}; onset {onset[0]:g} to {onset[1]:g} s."
        text += f" Size {size[0]:g} to {size[1]:g} ({unit})." if size else ""
        shown = video(f"degradation-{name}")
        parts.append(f"## `{name}`\n\n{_sentence(entry.description)} {text}\n\n{shown}\n")
    return "\n".join(parts)
