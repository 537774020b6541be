"""Random configurations over the whole schema of settings: valid values, ends of the ranges, and wrong values."""

from __future__ import annotations

from collections.abc import Callable
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin

import numpy as np
from pydantic import BaseModel

from shared_control_env.envs.settings import Settings
from shared_control_env.envs.settings.checks import bounds_of

WRONG: tuple[Any, ...] = (
    None,
    "text",
    True,
    [],
    {},
    -1,
    2.5,
    1e300,
    float("nan"),
    float("inf"),
    10**30,
    [1, 2],
    object(),
)
"""Values that are wrong for almost every setting."""

NUMPY: tuple[Callable[[float], Any], ...] = (
    np.float64,
    np.float32,
    lambda x: np.array(x),
    lambda x: np.int64(round(x)),
)
"""Conversions of a number to other numeric types."""


def random_config(rng: np.random.Generator, wrong: float = 0.02) -> dict[str, Any]:
    """Changes to a few settings of any section.

    Args:
        rng: random generator.
        wrong: probability that a value is one of :data:`WRONG` [-].
    """
    names = list(Settings.model_fields)
    chosen = rng.choice(len(names), size=int(rng.integers(1, 6)), replace=False)
    config = {names[i]: _value(Settings.model_fields[names[i]], rng, wrong, partial=True) for i in chosen}
    if rng.random() < wrong:
        config["".join(rng.permutation(list(names[0])))] = 1
    return config


def _value(field: Any, rng: np.random.Generator, wrong: float, partial: bool = False) -> Any:
    """A value for a field; for a whole section, a random subset of its fields if ``partial``."""
    if rng.random() < wrong:
        return WRONG[int(rng.integers(len(WRONG)))]
    bounds = {name: value for each in field.metadata for name, value in bounds_of(each)}
    return _of_type(field.annotation, bounds, rng, wrong, partial)


def _of_type(kind: Any, bounds: dict[str, Any], rng: np.random.Generator, wrong: float, partial: bool) -> Any:
    origin, arguments = get_origin(kind), get_args(kind)
    if origin in (Union, UnionType):
        return (
            None if NoneType in arguments and rng.random() < 0.3 else _of_type(arguments[0], bounds, rng, wrong, False)
        )
    if origin is Literal:
        return arguments[int(rng.integers(len(arguments)))]
    if origin is list:
        return [_of_type(arguments[0], {}, rng, wrong, False) for _ in range(int(rng.integers(0, 4)))]
    if origin is not None:  # Annotated
        inner = {name: value for each in arguments[1:] for name, value in bounds_of(each)}
        return _of_type(arguments[0], {**bounds, **inner}, rng, wrong, partial)
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        fields = kind.model_fields
        kept = [name for name in fields if fields[name].is_required() or rng.random() < (0.3 if partial else 0.5)]
        return {name: _value(fields[name], rng, wrong, partial) for name in kept}
    if kind is bool:
        return bool(rng.integers(2))
    if kind is str:
        texts = ("ego.speed", "vehicles.0.position", "task.target_speed", "road.lanes", "duration", "nothing")
        return texts[int(rng.integers(len(texts)))]
    return _number(bounds, rng, whole=kind is int)


def _number(bounds: dict[str, Any], rng: np.random.Generator, whole: bool) -> Any:
    """A number of any numeric type: mostly of moderate size, sometimes at an end or anywhere in its range."""
    low, high = bounds.get("ge", bounds.get("gt", -20.0)), bounds.get("le", bounds.get("lt", 20.0))
    kind = rng.random()
    if kind < 0.1:
        value = float(low)
    elif kind < 0.2:
        value = float(high)
    elif kind < 0.5 and low >= 0.0:
        value = float(np.exp(rng.uniform(np.log(max(low, 1e-9)), np.log(max(high, 2e-9)))))
    else:
        value = float(rng.uniform(max(low, -20.0), min(max(high, low), max(low, 0.0) + 20.0)))
    if whole:
        return round(value) if rng.random() < 0.9 else float(round(value))
    return NUMPY[int(rng.integers(len(NUMPY)))](value) if rng.random() < 0.1 and abs(value) < 1e15 else value
