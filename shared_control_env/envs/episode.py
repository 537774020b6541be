"""Random draws at the start of an episode; the result is settings without any randomness left."""

from __future__ import annotations

from collections.abc import Mapping
from math import exp
from typing import Any, NamedTuple

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
    driver = DriverDraws.of(settings).draw(driver_generator(rng)) if settings.has_person else None
    if driver is not None and settings.persons:
        config["person"], config["persons"] = {**PERSONS[settings.persons[driver.which]]._asdict(), "seed": None}, []
    values = iter(() if driver is None else driver.values)
    for entry in settings.randomise:
        own = driver is not None and concerns_driver(entry)
        path = tuple(entry.setting.split("."))
        value = next(values) if own else draw_value(entry, at(config, path), rng)
        section, last = at(config, path[:-1]), path[-1]
        section[int(last) if isinstance(section, list) else last] = value
    if settings.persons:
        config["person"] = of_person(config["person"])
    drawn: list[dict[str, Any]] = []
    if settings.degradations:
        name = settings.degradations[int(rng.integers(len(settings.degradations)))]
        drawn = draw_degradation(name, Limits(**config["limits"]), rng)
    for fault in config["faults"]:
        if fault["seed"] is None:
            seed = int(rng.integers(2**31))  # drawn for every kind, so that later draws do not depend on the kind
            if KINDS[fault["kind"]].draws:
                fault["seed"] = seed
    if driver is not None:
        config["person"]["seed"] = driver.seed
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


class DriverDraw(NamedTuple):
    """What is drawn for the person at the wheel.

    Attributes:
        which: index in ``persons``; 0 if there is no choice.
        values: values of those entries of ``randomise`` that concern the driver, in their order.
        seed: seed of the person.
    """

    which: int
    values: list[float]
    seed: int


def driver_generator(rng: np.random.Generator) -> np.random.Generator:
    """A separate generator for the person: a seed then gives the same road, traffic and faults for every driver.

    Args:
        rng: generator of the environment, whose own numbers stay the same.
    """
    (own,) = rng.spawn(1)
    return own


class DriverDraws(NamedTuple):
    """What is to be drawn for the person at the wheel, found once.

    Attributes:
        persons: number of persons of whom one is chosen.
        entries: entries of ``randomise`` that concern the driver, each with the setting's value without the draw.
        seed: seed of the person; None to draw it.
    """

    persons: int
    entries: list[tuple[RandomSettings, Any]]
    seed: int | None

    @classmethod
    def of(cls, settings: Settings) -> DriverDraws:
        """What the settings say.

        Args:
            settings: settings of the environment, with a person.
        """
        config = plain(settings)
        mine = [entry for entry in settings.randomise if concerns_driver(entry)]
        entries = [(entry, at(config, tuple(entry.setting.split(".")))) for entry in mine]
        return cls(len(settings.persons), entries, settings.person.seed)

    def draw(self, own: np.random.Generator) -> DriverDraw:
        """Draw the person of an episode.

        Args:
            own: generator of the person.
        """
        which = int(own.integers(self.persons)) if self.persons else 0
        values = [draw_value(entry, present, own) for entry, present in self.entries]
        return DriverDraw(which, values, int(own.integers(2**31)) if self.seed is None else self.seed)


def of_person(person: Mapping[str, Any]) -> dict[str, Any]:
    """Settings of a person without those that do not concern one who drives from the start.

    Args:
        person: settings of the person.
    """
    attentive = PersonParameters()._asdict()
    return {**person, **{name: attentive[name] for name in RESTING if person["engaged"]}}


def concerns_driver(entry: RandomSettings) -> bool:
    """Whether an entry of ``randomise`` draws a setting of the driver.

    Args:
        entry: the entry.
    """
    return entry.setting.split(".")[0] in ("driver", "driver_lag", "internal_model", "person")


def draw_value(entry: RandomSettings, present: Any, rng: np.random.Generator) -> float:
    """Draw the value of a setting. An integer setting gets an integer, both ends included.

    Args:
        entry: entry of ``randomise``.
        present: the setting's value without the draw.
        rng: generator.
    """
    if entry.choices:
        return entry.choices[int(rng.integers(len(entry.choices)))]
    if entry.median is not None and entry.spread is not None:
        deviation = min(max(float(rng.standard_normal()), -CUT_OFF), CUT_OFF)
        return entry.median * exp(entry.spread * deviation)
    assert entry.low is not None
    assert entry.high is not None  # the check of the settings ensures this
    if isinstance(present, int):
        return int(rng.integers(int(entry.low), int(entry.high), endpoint=True))
    return float(rng.uniform(entry.low, entry.high))
