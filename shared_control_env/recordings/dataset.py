"""A Minari dataset from recorded drives, for learning from them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from shared_control_env.evaluation.catalogue import AUTHORITIES
from shared_control_env.recordings.trial import Trial

MODULE = "shared_control_env"
"""Module that readers of a dataset import first: a dataset's specification does not name it."""

FUZZY = ("paper", "proportional", "display")
"""Authorities that the environment's own limiter decides; of the others the authority is a part of the action."""


def to_minari(paths: Sequence[Path], dataset_id: str, with_invalid: bool = False, **about: Any) -> Any:
    """Make a Minari dataset of recorded drives, one episode each.

    ``recover_environment`` makes the environment that was driven (``import shared_control_env`` first). Its slot is
    direct: the action is u_h,act as shares of the limits, in float32. Under an authority that the environment does not
    decide by itself, the action holds both slots. The authority in it is the smaller of both channels', so that drives
    under an allocator that tells the channels apart are not driven again exactly.

    Args:
        paths: the recordings, all of one environment.
        dataset_id: name of the dataset, such as ``shared-control/lane-change-v0``.
        with_invalid: whether drives that were paused are taken too.
        about: further arguments of ``minari.create_dataset_from_buffers``, such as ``author``.

    Returns:
        The dataset.

    Raises:
        ImportError: without Minari (extra ``minari``).
        ValueError: if there is no drive, if one is invalid, or if two are of different environments.
    """
    import minari
    from minari.data_collector import EpisodeBuffer

    trials = [(path, Trial.read(path)) for path in paths]
    if not trials:
        raise ValueError("paths is empty; a dataset needs at least one recording")
    first = trials[0][1]
    for path, trial in trials:
        if _environment(trial) != _environment(first):
            raise ValueError(
                f"{path} is of another environment than {trials[0][0]}: they differ in {_difference(trial, first)}; a "
                "dataset has one environment, so make one dataset of each"
            )
        if not trial.header["valid"] and not with_invalid:
            raise ValueError(f"{path} is invalid ({'; '.join(trial.header['pauses'])}); with_invalid=True takes it too")
    env = make_env(first)
    buffers = [
        EpisodeBuffer(
            id=i,
            seed=trial.header["seed"],
            observations=np.vstack([trial.columns["observation"], [trial.header["last_observation"]]]).astype(
                np.float32
            ),
            actions=actions_of(trial),
            rewards=trial.columns["reward"].tolist(),
            terminations=trial.columns["terminated"].tolist(),
            truncations=trial.columns["truncated"].tolist(),
        )
        for i, (_, trial) in enumerate(trials)
    ]
    dataset = minari.create_dataset_from_buffers(
        dataset_id,
        buffer=buffers,
        env=env.spec,
        observation_space=env.observation_space,
        action_space=env.action_space,
        **about,
    )
    env.close()
    return dataset


def make_env(trial: Trial) -> gym.Env:
    """The environment of a recording, to be reset with the recording's seed.

    Args:
        trial: the recording.
    """
    environment = trial.header["environment"]
    return gym.make(environment["id"], config=environment["config"], limiter=_limited(trial))


def actions_of(trial: Trial) -> Any:
    """Actions of a recording: u_h,act as shares of the limits, and the authority where the environment takes it.

    Args:
        trial: the recording.
    """
    environment = trial.header["environment"]
    limits = np.array([environment["a_max"], environment["delta_max"]])
    driver = (trial.columns["command"] / limits).clip(-1.0, 1.0).astype(np.float32)
    if _limited(trial):
        return driver
    return {"driver": driver, "authority": trial.columns["alpha"].min(axis=1, keepdims=True).astype(np.float32)}


def _limited(trial: Trial) -> bool:
    assert trial.header["choice"]["authority"] in AUTHORITIES
    return trial.header["choice"]["authority"] in FUZZY


def _difference(trial: Trial, other: Trial) -> str:
    """Names of the settings, or of what else, in which two environments differ."""
    one, two = (
        {"id": each[0], "limiter": each[2], **{f"config[{name!r}]": value for name, value in each[1].items()}}
        for each in (_environment(trial), _environment(other))
    )
    return ", ".join(name for name in {**one, **two} if one.get(name) != two.get(name))


def _environment(trial: Trial) -> tuple[Any, ...]:
    environment = trial.header["environment"]
    return environment["id"], environment["config"], _limited(trial)
