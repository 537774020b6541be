"""Reader of Minari datasets for learners of drivers: what the driver saw, what it wanted, and the rewards."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from shared_control_env.learned.history import of_episode
from shared_control_env.learned.views import driver_view
from shared_control_env.registration import ENVIRONMENTS


class Samples(NamedTuple):
    """Steps of a driver.

    Attributes:
        seen: what a learned driver sees, float32, shape (n, HISTORY * size).
        wanted: the driver's command as a share of the limits, float32, shape (n, 2).
        executed: the command that was executed, float32, shape (n, 2).
        rewards: the environment's rewards, float32, shape (n,).
        ends: whether the episode failed in this step, shape (n,).
        last: whether the episode is over after this step, shape (n,).
    """

    seen: np.ndarray
    wanted: np.ndarray
    executed: np.ndarray
    rewards: np.ndarray
    ends: np.ndarray
    last: np.ndarray


def joined(episodes: Sequence[Samples]) -> Samples:
    """The steps of several episodes.

    Args:
        episodes: the episodes, at least one.
    """
    return Samples(*map(np.concatenate, zip(*episodes, strict=True)))


class Data(NamedTuple):
    """A dataset, as a learner of drivers reads it.

    Attributes:
        id: id of the environment.
        config: changes to the environment's settings.
        about: name, size and origin of the dataset.
        episodes: the steps of each episode.
    """

    id: str
    config: dict[str, Any]
    about: dict[str, Any]
    episodes: list[Samples]


def import_minari() -> Any:
    """Minari, which an extra installs.

    Raises:
        ImportError: without it; the message says what to install.
    """
    try:
        import minari
    except ImportError:
        raise ImportError('datasets need Minari: pip install "shared_control_env[minari]"') from None
    return minari


def samples_of(dataset_id: str) -> Data:
    """Read a Minari dataset of this package.

    Args:
        dataset_id: name of the dataset.

    Raises:
        ImportError: without Minari (extra ``minari``).
        ValueError: if there is no such dataset, or if it is none of this package.
    """
    minari = import_minari()

    try:
        dataset = minari.load_dataset(dataset_id)
    except (FileNotFoundError, ValueError) as error:
        raise ValueError(f"data = {dataset_id!r}: {str(error).splitlines()[0]}") from None
    spec = dataset.env_spec
    if spec is None or spec.id not in ENVIRONMENTS:
        raise ValueError(
            f"data = {dataset_id!r} is of the environment {spec and spec.id}; it must be one of this package"
        )
    episodes = []
    for episode in dataset.iterate_episodes():
        if not {"felt", "wanted"} <= set(episode.infos or {}):
            raise ValueError(f"data = {dataset_id!r}: episode {episode.id} has no infos felt and wanted; make it anew")
        views = driver_view(episode.observations[:-1], episode.infos["felt"][:-1])
        actions = episode.actions["driver"] if isinstance(episode.actions, dict) else episode.actions
        columns = episode.infos["wanted"], actions, episode.rewards
        wanted, executed, rewards = (np.asarray(column, dtype=np.float32) for column in columns)
        ends = np.asarray(episode.terminations, dtype=bool)
        last = np.arange(len(ends)) == len(ends) - 1
        episodes.append(Samples(of_episode(views), wanted, executed, rewards, ends, last))
    kept = {name: value for name, value in dataset.storage.metadata.items() if name in ("driver", "noise", "versions")}
    about = {"id": dataset_id, "episodes": len(episodes), "steps": sum(len(each.wanted) for each in episodes), **kept}
    return Data(spec.id, dict(spec.kwargs.get("config") or {}), about, episodes)
