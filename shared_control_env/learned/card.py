"""The card of a policy: how it was trained, and the check whether it fits the present tasks and environments."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from shared_control_env.learned.history import HISTORY
from shared_control_env.learned.views import FEATURES_OF
from shared_control_env.registration import ENVIRONMENTS


def new_card(
    algorithm: str,
    task: str,
    seed: int,
    hyperparameters: Mapping[str, Any],
    config: Mapping[str, Mapping[str, Any]],
    dead_zone: float,
    versions: str,
) -> dict[str, Any]:
    """The card of a training.

    Args:
        algorithm: name of the algorithm.
        task: key of :data:`shared_control_env.learned.views.FEATURES_OF`.
        seed: seed of all random numbers.
        hyperparameters: hyperparameters of the algorithm.
        config: changes to the settings of each environment, by its id.
        dead_zone: dead zone of a driver's policy [-].
        versions: versions of the libraries.
    """
    return {
        "algorithm": algorithm,
        "environments": list(config),
        "task": task,
        "seed": seed,
        "history": HISTORY,
        "dead_zone": dead_zone,
        "hyperparameters": dict(hyperparameters),
        "config": dict(config),
        "features": [name for name, _ in FEATURES_OF[task]],
        "versions": versions,
    }


def check_goes_on(folder: Path, stored: Mapping[str, Any] | None, card: Mapping[str, Any], what: str) -> None:
    """Check that a folder can take a training: it is empty, or holds the same one, unfinished.

    Args:
        folder: the folder.
        stored: card of what the folder holds; None if it holds no such thing.
        card: card of the training.
        what: word for it in the error messages, such as ``training``.

    Raises:
        ValueError: if the folder holds something else; the message names the difference.
    """
    if stored is None:
        if folder.exists() and any(folder.iterdir()):
            raise ValueError(f"{folder} holds files that are no {what}; choose another --out")
        return
    for name, wanted in json.loads(json.dumps(card)).items():  # as a stored card comes back
        if stored.get(name) != wanted:
            raise ValueError(
                f"{folder} holds a {what} with {name} = {stored.get(name)!r}, not {wanted!r}; choose another --out"
            )


def is_direct(card: Mapping[str, Any]) -> bool:
    """Whether a policy's command is u_h,act itself, past the lag of Eq. 16: it was cloned from a person with an arm.

    Args:
        card: card of the policy.
    """
    return any(config.get("driver_lag", {}).get("direct", False) for config in card.get("config", {}).values())


def check_card(path: Path, card: Mapping[str, Any]) -> None:
    """Check that a policy fits the current tasks, observations and environments.

    Args:
        path: file that the card was read from, for the error messages.
        card: card of the training, as :mod:`agents.card` writes it.

    Raises:
        ValueError: if the task, the observations, the actions or the versions of the environments differ; the message
            names the difference. Also if the card lacks one of these entries.
    """
    if not isinstance(card, Mapping):
        raise ValueError(f"{path} holds no card of a training: {card!r}")
    missing = sorted({"task", "features", "history", "dead_zone", "environments"} - set(card))
    if missing:
        raise ValueError(f"{path} is no policy of this version of agents.train: its card lacks {', '.join(missing)}")
    task, features = card["task"], card["features"]
    for name in ("features", "environments"):
        if not isinstance(card[name], list) or not all(isinstance(each, str) for each in card[name]):
            raise ValueError(f"{path}: {name} = {card[name]!r} in its card must be a list of names")
    if not isinstance(task, str) or task not in FEATURES_OF:
        raise ValueError(f"{path} was trained for the task {task!r}; the known tasks are {', '.join(FEATURES_OF)}")
    known = [name for name, _ in FEATURES_OF[task]]
    if features != known:
        changed = sorted(set(features) ^ set(known)) or "their order"
        raise ValueError(f"{path} was trained on other observations; they differ in {changed}")
    if card["history"] != HISTORY:
        raise ValueError(f"{path} was trained on a history of {card['history']} observations; it is now {HISTORY}")
    zone = card["dead_zone"]
    if isinstance(zone, bool) or not isinstance(zone, int | float) or not 0.0 <= zone < 1.0:
        raise ValueError(f"{path}: dead_zone = {zone!r} in its card must be a number in [0, 1)")
    for id in card["environments"]:
        if id not in ENVIRONMENTS:
            name = id.rsplit("-v", 1)[0]
            now = [other for other in ENVIRONMENTS if other.rsplit("-v", 1)[0] == name] or list(ENVIRONMENTS)
            raise ValueError(f"{path} was trained in {id}, which is not registered; registered: {', '.join(now)}")
