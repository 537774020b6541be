"""One MP4 for each case of the paper."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from experiments.case_runs import SEED, Run, make
from shared_control_env.evaluation.replay import record as write


def record(run: Run, path: Path, progress: Callable[[], None]) -> None:
    """Record one episode at the speed of the drive.

    Args:
        run: which case, law and preset.
        path: of the MP4.
        progress: called after every step.
    """
    env = make(run, render_mode="rgb_array")
    env.reset(seed=SEED)
    frames: list[Any] = [env.render()]
    done = False
    while not done:
        _, _, terminated, truncated, _ = env.step(0)
        frames.append(env.render())
        done = terminated or truncated
        progress()
    fps = env.metadata["render_fps"]
    env.close()
    write(frames, path, fps)
