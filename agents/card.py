"""The card of a policy that is trained in the environments of :mod:`agents.tasks`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.metadata import version
from typing import Any

from agents.tasks import training_config
from shared_control_env.evaluation.episodes import versions
from shared_control_env.learned.card import new_card
from shared_control_env.learned.views import DEAD_ZONE


def card_of(
    algorithm: str,
    ids: Sequence[str],
    task: str,
    seed: int,
    hyperparameters: Mapping[str, Any],
    libraries: Sequence[str],
) -> dict[str, Any]:
    """The card of a training.

    Args:
        algorithm: name of the algorithm.
        ids: ids of the environments.
        task: key of :data:`agents.tasks.TASKS`.
        seed: seed of all random numbers.
        hyperparameters: hyperparameters of the algorithm.
        libraries: distributions whose versions are stored in addition to the package's own versions.
    """
    return new_card(
        algorithm,
        task,
        seed,
        hyperparameters,
        {id: training_config(id, task) for id in ids},
        DEAD_ZONE,
        versions_with(libraries),
    )


def versions_with(libraries: Sequence[str]) -> str:
    """Versions of the package, of what it needs, and of further libraries.

    Args:
        libraries: names of the distributions.
    """
    return ", ".join([versions(), *(f"{name} {version(name)}" for name in libraries)])
