"""Hyperparameters of training, from ``hyperparameters.toml``."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any


def hyperparameters(algorithm: str, ids: Sequence[str]) -> dict[str, Any]:
    """Hyperparameters of an algorithm; those specific to a set of environments take precedence.

    Args:
        algorithm: name of the algorithm, such as ``ppo``.
        ids: ids of the environments.
    """
    tables = tomllib.loads(Path(__file__).with_suffix(".toml").read_text())
    return {**tables[algorithm], **tables.get(f"{algorithm}:{','.join(ids)}", {})}
