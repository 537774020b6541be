"""One episode of the benchmark in the single environment: to see it, and to hold the kernel's rows against it."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import Any

import gymnasium as gym
import numpy as np

from shared_control_env.envs.scenarios import scenario as scenario_class
from shared_control_env.evaluation.catalogue import AuthorityEntry, DriverEntry
from shared_control_env.evaluation.episodes import Batch, Recorder, settings_of
from shared_control_env.evaluation.metrics import measure_all
from shared_control_env.wrappers import AuthorityLimiter, DriverModel


def make_single(batch: Batch, degradation: str | None, render_mode: str | None = None) -> gym.Env:
    """The single environment of a batch's episode, with its driver and its authority.

    The kernel's predictive driver is solved by OSQP here, to its tolerance of 1e-5.
    """
    make_driver, make_allocator = batch.driver[1].make, batch.authority[1].make
    config = settings_of(batch, degradation)
    env: gym.Env = scenario_class(batch.scenario)(config, render_mode=render_mode)
    env = AuthorityLimiter(env, make_allocator() if make_allocator else None)
    return DriverModel(env, make_driver() if make_driver else None)


def replay_episode(
    scenario: str,
    driver: tuple[str, DriverEntry],
    authority: tuple[str, AuthorityEntry],
    degradation: str | None,
    seed: int,
    frames: list[np.ndarray] | None = None,
) -> dict[str, float]:
    """Run one episode.

    Args:
        scenario, driver, authority, degradation, seed: as in the benchmark's table; no degradation for the
            scenario's own.
        frames: pictures of every step are appended, where a list is given.

    Returns:
        Its metrics.
    """
    batch = Batch(scenario, driver, authority, ((degradation, seed),), {})
    env = make_single(batch, degradation, None if frames is None else "rgb_array")
    begin = perf_counter()
    env.reset(seed=seed)
    settings = env.unwrapped.episode  # type: ignore[attr-defined]
    recorder, going = Recorder(settings.steps, 1), True
    k = 0
    while going:
        if frames is not None:
            frames.append(env.render())  # type: ignore[arg-type]
        _, _, terminated, truncated, info = env.step(0)
        going = recorder.note(k, _batched(info), np.array([terminated or truncated]))
        k += 1
    env.close()
    return measure_all(recorder.trajectory(0, settings, perf_counter() - begin))


def _batched(info: dict[str, Any]) -> dict[str, Any]:
    """The info of one environment in the form of many."""
    return {k: _batched(v) if isinstance(v, dict) else np.asarray(v)[None] for k, v in info.items()}


def record(frames: list[np.ndarray], path: Path, fps: int = 20) -> None:
    """Write frames as an MP4 at the speed of the drive."""
    from moviepy import ImageSequenceClip

    path.parent.mkdir(parents=True, exist_ok=True)
    ImageSequenceClip(frames, fps=fps).write_videofile(str(path), logger=None)
