"""One MP4 a case, through Gymnasium's RecordVideo."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

from gymnasium.wrappers import RecordVideo

from experiments.case_runs import SEED, Run, make


def record(run: Run, path: Path, progress: Callable[[], None]) -> None:
    """Record one episode at the speed of the drive.

    Args:
        run: which.
        path: of the MP4; it appears when it is whole.
        progress: called after every step.
    """
    with tempfile.TemporaryDirectory() as folder:
        video_folder = Path(folder) / "video"
        env = RecordVideo(make(run, render_mode="rgb_array"), str(video_folder), episode_trigger=lambda _: True)
        env.reset(seed=SEED)
        done = False
        while not done:
            _, _, terminated, truncated, _ = env.step(0)
            done = terminated or truncated
            progress()
        env.close()
        (recorded,) = video_folder.glob("*.mp4")
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.move(recorded, path)
