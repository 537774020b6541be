"""What a policy was trained as: written when it is trained, compared with what there is when it is read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from agents.history import HISTORY
from agents.tasks import training_config
from agents.views import DEAD_ZONE, FEATURES_OF
from shared_control_env.registration import ENVIRONMENTS


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
        algorithm: its name.
        ids: of the environments.
        task: key of :data:`agents.tasks.TASKS`.
        seed: of everything.
        hyperparameters: of the algorithm.
        libraries: distributions whose versions are kept beside the package's own.
    """
    from shared_control_env.evaluation.episodes import versions  # which needs pandas; a policy that drives does not

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


def check_card(path: Path, card: Mapping[str, Any]) -> None:
    """Compare what a policy was trained for with what there is.

    Args:
        path: where the card was read.
        card: of :func:`card_of`.

    Raises:
        ValueError: if the task, what it sees, how it acts, or the versions of its environments differ, naming what
            does; or if the card lacks one of these.
    """
    if not isinstance(card, Mapping):
        raise ValueError(f"{path} has no card of a training in it: {card!r}")
    missing = sorted({"task", "features", "history", "dead_zone", "environments"} - set(card))
    if missing:
        raise ValueError(f"{path} is no policy of this version of agents.train: its card lacks {', '.join(missing)}")
    task, features = card["task"], card["features"]
    for name in ("features", "environments"):
        if not isinstance(card[name], list) or not all(isinstance(each, str) for each in card[name]):
            raise ValueError(f"{path}: its card's {name} = {card[name]!r} must be a list of names")
    if not isinstance(task, str) or task not in FEATURES_OF:
        raise ValueError(f"{path} was trained for the task {task!r}; known are {', '.join(FEATURES_OF)}")
    known = [name for name, _ in FEATURES_OF[task]]
    if features != known:
        changed = sorted(set(features) ^ set(known)) or "their order"
        raise ValueError(f"{path} was trained on other observations; what differs: {changed}")
    if card["history"] != HISTORY:
        raise ValueError(f"{path} was trained on a history of {card['history']} observations; now it has {HISTORY}")
    if task == "driver" and card["dead_zone"] != DEAD_ZONE:
        raise ValueError(f"{path} was trained with a dead zone of {card['dead_zone']}; now it is {DEAD_ZONE}")
    for id in card["environments"]:
        if id not in ENVIRONMENTS:
            name = id.rsplit("-v", 1)[0]
            now = [other for other in ENVIRONMENTS if other.rsplit("-v", 1)[0] == name] or list(ENVIRONMENTS)
            raise ValueError(f"{path} was trained in {id}, which is not registered; there is {', '.join(now)}")
