"""Random draws at the start of an episode; the result is settings without any randomness left."""

from __future__ import annotations

from math import exp
from typing import Any

import numpy as np

from shared_control_env.core.faults.kinds import KINDS
from shared_control_env.core.parameters import PERSONS, Limits, PersonParameters
from shared_control_env.envs.degradations import draw_degradation
from shared_control_env.envs.recorded.replay import decided_by, files_in, replay_of, usable
from shared_control_env.envs.settings import CUT_OFF, RandomSettings, Settings, check, plain
from shared_control_env.envs.settings.changes import at
from shared_control_env.envs.settings.checks import RESTING


def is_random(settings: Settings) -> bool:
    """Whether anything is drawn at the start of an episode.

    Args:
        settings: settings of the environment.
    """
    noisy = any(KINDS[fault.kind].draws and fault.seed is None for fault in settings.faults)
    person = settings.has_person and settings.person.seed is None
    return bool(
        settings.recording or settings.randomise or settings.degradations or settings.persons or noisy or person
    )


def draw_episode(settings: Settings, rng: np.random.Generator) -> Settings:
    """Draw the settings of one episode.

    The draws are a recording and its ego, one of ``persons``, the entries of ``randomise`` in their order, one of
    ``degradations``, the seeds of noise, and the seed of the person. If a person drives, the person, the settings that
    concern the driver and the seed of the person come from a separate generator. A seed then gives the same road,
    traffic and degradations for every driver.

    Args:
        settings: settings of the environment.
        rng: generator of the environment; unused if nothing is random.

    Returns:
        Settings with all values drawn. The drawn degradation comes after the faults in ``config["faults"]``.

    Raises:
        ValueError: if a drawn value is outside the range of its setting.
    """
    if not is_random(settings):
        return settings
    config = plain(settings)
    if settings.recording is not None:
        _draw_recording(config, settings, rng)
    own = rng.spawn(1)[0] if settings.has_person else rng
    if settings.persons:
        person = PERSONS[settings.persons[int(own.integers(len(settings.persons)))]]
        config["person"], config["persons"] = {**person._asdict(), "seed": settings.person.seed}, []
    for entry in settings.randomise:
        _draw_setting(config, entry, own if _concerns_driver(entry) else rng)
    if settings.persons and config["person"]["engaged"]:
        attentive = PersonParameters()._asdict()  # what only resting hands wait for does not concern this person
        config["person"].update({name: attentive[name] for name in RESTING})
    drawn: list[dict[str, Any]] = []
    if settings.degradations:
        name = settings.degradations[int(rng.integers(len(settings.degradations)))]
        drawn = draw_degradation(name, Limits(**config["limits"]), rng)
    for fault in config["faults"]:
        if fault["seed"] is None:
            seed = int(rng.integers(2**31))  # drawn for every kind, so that later draws do not depend on the kind
            if KINDS[fault["kind"]].draws:
                fault["seed"] = seed
    if settings.has_person and settings.person.seed is None:
        config["person"]["seed"] = int(own.integers(2**31))
    config["faults"] += drawn
    config["randomise"], config["degradations"] = [], []
    return check(config)


def _draw_recording(config: dict[str, Any], settings: Settings, rng: np.random.Generator) -> None:
    """Draw a recording and its ego, and fill in road, start and body."""
    assert settings.recording is not None
    files = files_in(settings.recording.file)
    file = files[int(rng.integers(len(files)))]
    names = usable(file, settings.duration)
    which = int(rng.integers(max(len(names), 1)))  # drawn for a given ego too, so that later draws do not depend on it
    ego = names[which] if settings.recording.ego is None else settings.recording.ego
    config["recording"] = {"file": str(file), "ego": ego, "drawn": True}
    replay = replay_of(file, ego, 1.0 / settings.simulation_frequency, settings.simulation_steps)
    for section, values in decided_by(replay).items():
        config[section].update(values)


def _concerns_driver(entry: RandomSettings) -> bool:
    return entry.setting.split(".")[0] in ("driver", "driver_lag", "internal_model", "person")


def _draw_setting(config: dict[str, Any], entry: RandomSettings, rng: np.random.Generator) -> None:
    """Draw one setting of a plain dict in place. An integer setting gets an integer, both ends included."""
    *path, last = entry.setting.split(".")
    section = at(config, tuple(path))
    place: Any = int(last) if isinstance(section, list) else last
    if entry.choices:
        section[place] = entry.choices[int(rng.integers(len(entry.choices)))]
        return
    if entry.median is not None and entry.spread is not None:
        deviation = min(max(float(rng.standard_normal()), -CUT_OFF), CUT_OFF)
        section[place] = entry.median * exp(entry.spread * deviation)
        return
    assert entry.low is not None
    assert entry.high is not None  # the check of the settings ensures this
    if isinstance(section[place], int):
        section[place] = int(rng.integers(int(entry.low), int(entry.high), endpoint=True))
    else:
        section[place] = float(rng.uniform(entry.low, entry.high))
