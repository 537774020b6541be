"""The check of a policy's card: whether the policy fits the present tasks, observations and environments."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from shared_control_env.learned.history import HISTORY
from shared_control_env.learned.views import DEAD_ZONE, FEATURES_OF
from shared_control_env.registration import ENVIRONMENTS


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
    if task == "driver" and card["dead_zone"] != DEAD_ZONE:
        raise ValueError(f"{path} was trained with a dead zone of {card['dead_zone']}; now it is {DEAD_ZONE}")
    for id in card["environments"]:
        if id not in ENVIRONMENTS:
            name = id.rsplit("-v", 1)[0]
            now = [other for other in ENVIRONMENTS if other.rsplit("-v", 1)[0] == name] or list(ENVIRONMENTS)
            raise ValueError(f"{path} was trained in {id}, which is not registered; registered: {', '.join(now)}")
