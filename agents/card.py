"""The card of a policy, written when the policy is trained; :mod:`shared_control_env.learned.card` checks it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.metadata import version
from typing import Any

from agents.tasks import training_config
from shared_control_env.evaluation.episodes import versions
from shared_control_env.learned.history import HISTORY
from shared_control_env.learned.views import DEAD_ZONE, FEATURES_OF


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
    return {
        "algorithm": algorithm,
        "environments": list(ids),
        "task": task,
        "seed": seed,
        "history": HISTORY,
        "dead_zone": DEAD_ZONE,
        "hyperparameters": dict(hyperparameters),
        "config": {id: training_config(id, task) for id in ids},
        "features": [name for name, _ in FEATURES_OF[task]],
        "versions": ", ".join([versions(), *(f"{name} {version(name)}" for name in libraries)]),
    }
