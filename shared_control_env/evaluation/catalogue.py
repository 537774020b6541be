"""What the benchmark knows by name: drivers, authorities and suites. All of them can be given by users too."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any, NamedTuple, TypeVar

from shared_control_env.controllers.allocators import (
    Allocator,
    FixedAuthority,
    HardTakeover,
    LinearAuthority,
    SoftmaxAuthority,
    TimeBasedAuthority,
)
from shared_control_env.controllers.driver import Driver
from shared_control_env.controllers.scripted import (
    DistractedDriver,
    FightingDriver,
    OverreactingDriver,
    ScriptedDriver,
)
from shared_control_env.core.parameters import IDENTIFIED_DRIVERS
from shared_control_env.envs.cases import CASES
from shared_control_env.envs.degradations import DEGRADATIONS

T = TypeVar("T")


class DriverEntry(NamedTuple):
    """A driver of the benchmark.

    Attributes:
        description: in a line.
        make: makes one for each environment; None for the paper's predictive driver, which the kernel runs.
        config: changes to the environment's settings, such as the lag.
    """

    description: str
    make: Callable[[], Driver] | None = None
    config: Mapping[str, Any] = {}


class AuthorityEntry(NamedTuple):
    """An authority of the benchmark: what decides alpha_a, and the law that applies it.

    Attributes:
        description: in a line.
        law: one of :data:`core.authority.LAWS`.
        make: makes one for each environment; None for the paper's fuzzy inference, which the kernel runs.
    """

    description: str
    law: str
    make: Callable[[], Allocator] | None = None


class Suite(NamedTuple):
    """Scenarios and degradations that are crossed.

    Attributes:
        description: in a line.
        scenarios: keys of :data:`envs.cases.CASES`.
        degradations: keys of :data:`envs.degradations.DEGRADATIONS`; None for the one that the scenario has.
    """

    description: str
    scenarios: tuple[str, ...]
    degradations: tuple[str | None, ...]


def _lag(name: str) -> dict[str, Any]:
    return {"driver_lag": IDENTIFIED_DRIVERS[name]._asdict()}


DRIVERS: dict[str, DriverEntry] = {
    "mpc": DriverEntry("predictive driver, lag as in the paper's cases (K_h = 1, T_h = 0.2 s)"),
    "mpc_average": DriverEntry("predictive driver, average of the five identified lags", config=_lag("average")),
    **{
        f"mpc_{i}": DriverEntry(f"predictive driver, lag of identified driver {i}", config=_lag(f"driver_{i}"))
        for i in range(1, 6)
    },
    "scripted": DriverEntry("Stanley's law, speed and distance by the Intelligent Driver Model", ScriptedDriver),
    "distracted": DriverEntry("lets go until 1 s after the authority falls, then recovers", DistractedDriver),
    "over_reacting": DriverEntry("the scripted driver, 2.5 times as hard", OverreactingDriver),
    "fighting": DriverEntry("pushes against what the automation does differently", FightingDriver),
    "none": DriverEntry("nobody at the wheel", config={"driver_lag": {"K_h": 0.0}}),
}
"""Drivers by name."""

AUTHORITIES: dict[str, AuthorityEntry] = {
    "paper": AuthorityEntry("fuzzy inference, Eq. 10", "paper"),
    "proportional": AuthorityEntry("fuzzy inference, alpha_a u_a,f", "proportional"),
    "none": AuthorityEntry("no limit: u_a,f drives", "none"),
    "driver_only": AuthorityEntry("no automation", "driver_only"),
    "fixed": AuthorityEntry("alpha_a = 0.5, alpha_a u_a,f", "proportional", partial(FixedAuthority, 0.5)),
    "linear": AuthorityEntry("1 - the larger risk, alpha_a u_a,f", "proportional", LinearAuthority),
    "softmax": AuthorityEntry("softmax of the risk, alpha_a u_a,f", "proportional", SoftmaxAuthority),
    "takeover": AuthorityEntry("all or nothing with hysteresis, alpha_a u_a,f", "proportional", HardTakeover),
    "time_based": AuthorityEntry("by TTC and time to lane crossing, alpha_a u_a,f", "proportional", TimeBasedAuthority),
}
"""Authorities by name."""

SUITES: dict[str, Suite] = {
    "paper": Suite("the paper's two cases with their own faults", ("two_lane", "curve"), (None,)),
    "full": Suite("eight drawn scenarios x every degradation and none", tuple(CASES)[2:], tuple(DEGRADATIONS)),
}
"""Suites by name."""


def choose(what: str, given: str | Iterable[str] | Mapping[str, Any], known: Mapping[str, T]) -> dict[str, Any]:
    """Entries by name: of those known, or a user's own as they are given.

    Args:
        what: word for messages, such as ``driver``.
        given: a name, several, or a mapping of names to entries.
        known: the catalogue.

    Raises:
        ValueError: for an unknown name, listing the valid ones and the nearest.
    """
    if isinstance(given, Mapping):
        return dict(given)
    names = [given] if isinstance(given, str) else list(given)
    for name in names:
        if name not in known:
            near = difflib.get_close_matches(str(name), known, n=1, cutoff=0.4)
            hint = f"did you mean {near[0]!r}? " if near else ""
            raise ValueError(f"{what} = {name!r} is not known; {hint}valid are {', '.join(known)}")
    return {name: known[name] for name in names}
