"""Minari datasets of recorded drives and of demonstrations, for learning from them.

``infos`` of every episode hold what a learned driver sees beside the observation, and what it is to imitate:
``felt`` is u_a,act of the step before [m/s^2, rad], shape (T + 1, 2); ``wanted`` is the command that the driver wanted,
as a share of the limits [-], shape (T, 2). The action is the one that was executed, which noise may have disturbed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from shared_control_env.evaluation.catalogue import AUTHORITIES
from shared_control_env.recordings.samples import import_minari
from shared_control_env.recordings.trial import Trial

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
    buffers = [_buffer(i, trial) for i, (_, trial) in enumerate(trials)]
    dataset = write_dataset(dataset_id, buffers, env, {}, **about)
    env.close()
    return dataset


def _buffer(i: int, trial: Trial) -> Any:
    """Episode i of a dataset, of a recorded drive."""
    from minari.data_collector import EpisodeBuffer

    actions = actions_of(trial)
    observations = np.vstack([trial.columns["observation"], [trial.header["last_observation"]]])
    return EpisodeBuffer(
        id=i,
        seed=trial.header["seed"],
        observations=observations.astype(np.float32),
        actions=actions,
        rewards=trial.columns["reward"].tolist(),
        terminations=trial.columns["terminated"].tolist(),
        truncations=trial.columns["truncated"].tolist(),
        infos={
            "felt": np.vstack([np.zeros(2), trial.columns["u_a_act"]]).astype(np.float32),
            "wanted": actions["driver"] if isinstance(actions, dict) else actions,
        },
    )


class Demonstration:
    """An episode of a simulated driver, step by step.

    Args:
        seed: seed of the episode.
        observation: first observation.
    """

    def __init__(self, seed: int | None, observation: np.ndarray) -> None:
        self._seed = seed
        self._observations, self._felt = [observation], [np.zeros(2)]
        self._wanted: list[np.ndarray] = []
        self._actions: list[np.ndarray] = []
        self._results: list[tuple[float, bool, bool]] = []

    def __len__(self) -> int:
        """Number of steps."""
        return len(self._results)

    def add(self, wanted: np.ndarray, action: np.ndarray, result: tuple[Any, Any, bool, bool, dict[str, Any]]) -> None:
        """Add one step.

        Args:
            wanted: the driver's command as a share of the limits, shape (2,).
            action: the executed action, shape (2,).
            result: what ``step`` returned.
        """
        observation, reward, terminated, truncated, info = result
        self._wanted.append(wanted)
        self._actions.append(action)
        self._observations.append(observation)
        self._felt.append(info["u_a_act"])
        self._results.append((float(reward), terminated, truncated))

    def buffer(self, i: int) -> Any:
        """Episode i of a dataset.

        Args:
            i: number of the episode.
        """
        from minari.data_collector import EpisodeBuffer

        rewards, terminations, truncations = map(list, zip(*self._results, strict=True))
        return EpisodeBuffer(
            id=i,
            seed=self._seed,
            observations=np.array(self._observations, dtype=np.float32),
            actions=np.array(self._actions, dtype=np.float32),
            rewards=rewards,
            terminations=terminations,
            truncations=truncations,
            infos={
                "felt": np.array(self._felt, dtype=np.float32),
                "wanted": np.array(self._wanted, dtype=np.float32),
            },
        )


def check_new(dataset_id: str) -> None:
    """Check that a dataset can be made under a name.

    Args:
        dataset_id: the name.

    Raises:
        ImportError: without Minari (extra ``minari``).
        ValueError: if the name is none, or taken.
    """
    import_minari()
    from minari.dataset.minari_dataset import parse_dataset_id
    from minari.storage.datasets_root_dir import get_dataset_path

    parse_dataset_id(dataset_id)
    path = get_dataset_path(dataset_id)
    if path.exists():
        raise ValueError(f"dataset = {dataset_id!r} exists already ({path}); no dataset is overwritten")


def write_dataset(
    dataset_id: str, buffers: Sequence[Any], env: gym.Env, metadata: Mapping[str, Any], **about: Any
) -> Any:
    """Make a Minari dataset of episodes.

    Args:
        dataset_id: name of the dataset.
        buffers: the episodes, Minari's ``EpisodeBuffer``.
        env: environment that they are of.
        metadata: further entries of the dataset's metadata.
        about: further arguments of ``minari.create_dataset_from_buffers``, such as ``author``.

    Returns:
        The dataset.
    """
    minari = import_minari()

    check_new(dataset_id)
    dataset = minari.create_dataset_from_buffers(
        dataset_id,
        buffer=list(buffers),
        env=env.spec,
        observation_space=env.observation_space,
        action_space=env.action_space,
        **about,
    )
    dataset.storage.update_metadata(dict(metadata))
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
