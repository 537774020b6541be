"""What is random about an episode, drawn into settings that say it all."""

from __future__ import annotations

from typing import Any

import numpy as np

from shared_control_env.core.parameters import Limits
from shared_control_env.envs.config import NOISES, RandomSettings, Settings, check, plain
from shared_control_env.envs.degradations import draw_degradation


def is_random(settings: Settings) -> bool:
    """Whether anything is drawn at the start of an episode."""
    noisy = any(fault.kind in NOISES and fault.seed is None for fault in settings.faults)
    return bool(settings.randomise or settings.degradations or noisy)


def draw_episode(settings: Settings, rng: np.random.Generator) -> Settings:
    """Settings of one episode: ``randomise`` drawn in its order, then one of ``degradations``, then seeds of noise.

    Args:
        settings: of the environment.
        rng: the environment's generator; not touched where nothing is random.

    Returns:
        Settings in which nothing is left to draw; the drawn degradation comes after the faults that are given.

    Raises:
        ValueError: if a drawn value is out of its setting's range.
    """
    if not is_random(settings):
        return settings
    config = plain(settings)
    for entry in settings.randomise:
        _assign(config, entry, _value(entry, rng))
    if settings.degradations:
        name = settings.degradations[int(rng.integers(len(settings.degradations)))]
        config["faults"] += draw_degradation(name, Limits(**config["limits"]), rng)
    config["randomise"], config["degradations"] = [], []
    for fault in config["faults"]:
        if fault.get("seed") is None:
            fault["seed"] = int(rng.integers(2**31))
    return check(config)


def _value(entry: RandomSettings, rng: np.random.Generator) -> float:
    if entry.choices is not None:
        return entry.choices[int(rng.integers(len(entry.choices)))]
    assert entry.low is not None
    assert entry.high is not None  # as checked with the settings
    return float(rng.uniform(entry.low, entry.high))


def _assign(config: dict[str, Any], entry: RandomSettings, value: float) -> None:
    """Set the setting that an entry names."""
    *path, last = entry.setting.split(".")
    section: Any = config
    for key in path:
        section = section[int(key)] if isinstance(section, list) else section[key]
    if isinstance(section, list):
        section[int(last)] = value
    else:
        section[last] = value
