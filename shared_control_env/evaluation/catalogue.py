"""The catalogue of drivers, authorities and suites that the benchmark knows by name. Users can also pass their own."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any, NamedTuple, TypeAlias, TypeVar

from shared_control_env.controllers.allocators import (
    Allocator,
    FixedAuthority,
    FuzzyAuthority,
    HardTakeover,
    LinearAuthority,
    SoftmaxAuthority,
    TimeBasedAuthority,
)
from shared_control_env.controllers.automation import Planner
from shared_control_env.controllers.disagreement import Guardian, IntentAuthority, ResidualAuthority
from shared_control_env.controllers.driver import Driver, check_reset
from shared_control_env.controllers.safety import BarrierAuthority, PredictiveFilter, SafeHIL
from shared_control_env.controllers.scripted import (
    DistractedDriver,
    FightingDriver,
    OverreactingDriver,
    ScriptedDriver,
)
from shared_control_env.core.authority.laws import LAWS
from shared_control_env.core.parameters import IDENTIFIED_DRIVERS, PERSONS, PersonParameters, fitted_arms
from shared_control_env.envs.degradations import DEGRADATIONS
from shared_control_env.envs.scenarios import DRAWN_V1, SCENARIOS
from shared_control_env.envs.settings import as_plain
from shared_control_env.learned.shipped import learned_allocator, learned_driver
from shared_control_env.nearest import hint, nearest

T = TypeVar("T")

Drivers: TypeAlias = "str | Iterable[str] | Mapping[str, DriverEntry | Callable[[], Driver]]"
Authorities: TypeAlias = "str | Iterable[str] | Mapping[str, AuthorityEntry | Callable[[], Allocator]]"


class DriverEntry(NamedTuple):
    """A driver of the benchmark.

    Attributes:
        description: description in one line.
        make: makes a driver for each environment; None for the paper's predictive driver, which the kernel runs.
        config: changes to the environment's settings that belong to the driver, such as the lag.
        fingerprint: text that distinguishes this driver from others of the same name; None to compute a digest from
            its code and arguments.
        draws: settings of the driver that are drawn for every episode, in addition to those that the scenario draws;
            entries of ``config["randomise"]``.
    """

    description: str
    make: Callable[[], Driver] | None = None
    config: Mapping[str, Any] = {}
    fingerprint: str | None = None
    draws: tuple[Mapping[str, Any], ...] = ()


class AuthorityEntry(NamedTuple):
    """An authority of the benchmark: the allocator that decides alpha_a, and the law that applies alpha_a.

    Attributes:
        description: description in one line.
        law: name of the law, one of :data:`core.authority.laws.LAWS`.
        make: makes an allocator for each environment, by default the paper's. The kernel runs one with ``compiled``.
        fingerprint: text that distinguishes this authority from others of the same name; None to compute a digest from
            its code and arguments.
    """

    description: str
    law: str
    make: Callable[[], Allocator] = FuzzyAuthority
    fingerprint: str | None = None


class Suite(NamedTuple):
    """Scenarios and degradations. The benchmark runs every combination of the two.

    Attributes:
        description: description in one line.
        scenarios: keys of :data:`envs.scenarios.SCENARIOS`.
        degradations: keys of :data:`envs.degradations.DEGRADATIONS`; None for the degradation of the scenario itself.
    """

    description: str
    scenarios: tuple[str, ...]
    degradations: tuple[str | None, ...]


def _lag(name: str) -> dict[str, Any]:
    lag = IDENTIFIED_DRIVERS[name]
    return {"driver_lag": {"K_h": lag.K_h, "T_h": lag.T_h}}


ARMS = tuple(
    {"setting": f"driver_lag.{field}", "median": median, "spread": spread}
    for field, (median, spread) in zip(("K_h", "T_h"), fitted_arms(), strict=True)
)
"""Draws of an arm around the five that the paper identified."""


def _person(name: str, description: str) -> DriverEntry:
    """Entry for a person of :data:`core.parameters.PERSONS`. The arm is drawn around the five of the paper."""
    person, default = PERSONS[name]._asdict(), PersonParameters()._asdict()
    differing = {field: value for field, value in person.items() if value != default[field]}
    return DriverEntry(description, config={"internal_model": {"active": True}, "person": differing}, draws=ARMS)


DRIVERS: dict[str, DriverEntry] = {
    "mpc": DriverEntry("predictive driver, lag as in the paper's cases (K_h = 1, T_h = 0.2 s)"),
    "mpc_average": DriverEntry("predictive driver, average of the five identified lags", config=_lag("average")),
    **{
        f"mpc_{i}": DriverEntry(f"predictive driver, lag of identified driver {i}", config=_lag(f"driver_{i}"))
        for i in range(1, 6)
    },
    "internal_model": DriverEntry(
        "predictive driver who knows its own lag and feels the automation", config={"internal_model": {"active": True}}
    ),
    "attentive": _person(
        "attentive", "person who drives all the time: late eyes, noise, an arm around the paper's five"
    ),
    "hands_on": _person("hands_on", "person with hands at rest on the wheel, who notices, and acts a while later"),
    "hands_off": _person("hands_off", "person without hands on the wheel, who feels little and takes longer"),
    "population": DriverEntry(
        "one of these three in each episode, with a delay of perception of 0.15 to 0.25 s",
        config={"internal_model": {"active": True}, "persons": list(PERSONS)},
        draws=(*ARMS, {"setting": "person.delay", "low": 0.15, "high": 0.25}),
    ),
    "scripted": DriverEntry("Stanley's law, speed and distance by the Intelligent Driver Model", ScriptedDriver),
    "distracted": DriverEntry("lets go until 1 s after the authority falls, then recovers", DistractedDriver),
    "over_reacting": DriverEntry("the scripted driver, 2.5 times as hard", OverreactingDriver),
    "fighting": DriverEntry("pushes against what the automation does differently", FightingDriver),
    "learned": DriverEntry("trained driver that comes with the package", learned_driver),
    "none": DriverEntry("nobody at the wheel", config={"driver_lag": {"K_h": 0.0}}),
}
"""Drivers by name."""

AUTHORITIES: dict[str, AuthorityEntry] = {
    "paper": AuthorityEntry("fuzzy inference, Eq. 10", "paper", FuzzyAuthority),
    "proportional": AuthorityEntry("fuzzy inference, alpha_a u_a,f", "proportional", FuzzyAuthority),
    "none": AuthorityEntry("no limiter and no display: u_a,f drives", "none", partial(FixedAuthority, 1.0)),
    "display": AuthorityEntry("fuzzy inference displayed to the driver, but no limit", "none", FuzzyAuthority),
    "driver_only": AuthorityEntry("no automation", "driver_only", partial(FixedAuthority, 0.0)),
    "fixed": AuthorityEntry("alpha_a = 0.5, alpha_a u_a,f", "proportional", partial(FixedAuthority, 0.5)),
    "linear": AuthorityEntry("1 - the larger risk, alpha_a u_a,f", "proportional", LinearAuthority),
    "softmax": AuthorityEntry("softmax of the risk, alpha_a u_a,f", "proportional", SoftmaxAuthority),
    "takeover": AuthorityEntry("all or nothing with hysteresis, alpha_a u_a,f", "proportional", HardTakeover),
    "time_based": AuthorityEntry("by TTC and time to lane crossing, alpha_a u_a,f", "proportional", TimeBasedAuthority),
    "safehil": AuthorityEntry("by the growth of risk under either command", "proportional", SafeHIL),
    "safehil_growing": AuthorityEntry(
        "safehil, where only a growing risk counts", "proportional", partial(SafeHIL, growing=True)
    ),
    "barrier": AuthorityEntry("as much of each channel as barrier functions allow", "proportional", BarrierAuthority),
    "predictive_filter": AuthorityEntry("as much as leaves a simulated way back", "proportional", PredictiveFilter),
    "guardian": AuthorityEntry("barrier, with the alerts of residual", "proportional", Guardian),
    "learned": AuthorityEntry("trained beside the population, alpha_a u_a,f", "proportional", learned_allocator),
    "intent": AuthorityEntry("agreement with what the driver wants, by channel", "proportional", IntentAuthority),
    "residual": AuthorityEntry(
        "CUSUM of what the scene does not explain, by channel, with alerts", "proportional", ResidualAuthority
    ),
}
"""Authorities by name."""

SUITES: dict[str, Suite] = {
    "paper": Suite("the paper's two cases with their own faults", ("two_lane", "curve"), (None,)),
    "full": Suite(
        "ten drawn scenarios x every degradation and none",
        (
            *("lane_keeping", "bend", "s_curve", "lane_change", "cut_in"),
            *("lead_braking", "dense_traffic", "curve_with_lead", "wet_road", "motorway"),
        ),
        ("none", *DRAWN_V1),
    ),
    "recorded": Suite("recorded traffic x every degradation and none", ("recorded",), ("none", *DRAWN_V1)),
}
"""Suites by name."""


def choose(what: str, given: str | Iterable[str] | Mapping[str, Any], known: Mapping[str, T]) -> dict[str, Any]:
    """Choose entries by name: entries of the catalogue, or a user's own entries as given.

    Args:
        what: word for error messages, such as ``driver``.
        given: a name, several names, ``all``, or a mapping of names to entries.
        known: the catalogue.

    Raises:
        ValueError: for an unknown name, with the nearest and all valid names; for no name; or for a value that is no
            name.
    """
    if isinstance(given, str) and given == "all":
        return dict(known)
    if not isinstance(given, Iterable):
        raise ValueError(f"{what} = {given!r} must be a name, several, or a mapping of names to what makes one")
    names = [given] if isinstance(given, str) else list(given)
    if not names:
        raise ValueError(f"{what} = {given!r} names nothing; valid are {', '.join(known)}")
    for name in names:
        if not isinstance(name, str) or not name or not _is_text(name):
            raise ValueError(f"{what} = {name!r} must be a name, a text that is not empty")
        if not isinstance(given, Mapping) and name not in known:
            near = nearest(name, known)
            suggestion = f"did you mean {near!r}? " if near else ""
            raise ValueError(f"{what} = {name!r} is not known; {suggestion}valid are {', '.join(known)}")
    return dict(given) if isinstance(given, Mapping) else {name: known[name] for name in names}


def choose_one(what: str, name: Any, known: Mapping[str, T]) -> T:
    """The entry for one name.

    Args:
        what: word for error messages, such as ``driver``.
        name: the name.
        known: entries by name.

    Raises:
        ValueError: for an unknown name, with the nearest valid name.
    """
    if not isinstance(name, str) or name == "all":
        raise ValueError(f"{what} = {name!r} must be one name; valid are {', '.join(known)}")
    return next(iter(choose(what, name, known).values()))


def chosen_drivers(given: Drivers) -> dict[str, DriverEntry]:
    """Choose drivers by name. Each driver is made once to check that it implements the interface.

    Args:
        given: a name, several names, ``all``, or a mapping of names to entries or to makers of drivers.

    Returns:
        Driver entries by name.

    Raises:
        ValueError: as for :func:`choose`; or if an entry does not make a driver.
    """
    entries = {}
    for name, entry in choose("driver", given, DRIVERS).items():
        made = (
            entry if isinstance(entry, DriverEntry) else DriverEntry("given by the user", _given("driver", name, entry))
        )
        if not isinstance(made.config, Mapping) or "randomise" in made.config:
            raise ValueError(
                f"driver {name!r} has config = {made.config!r}; it must be a dict, and what is drawn in draws"
            )
        draws = made.draws if isinstance(made.draws, list | tuple) else (None,)
        if not all(isinstance(draw, Mapping) and isinstance(draw.get("setting"), str) for draw in draws):
            raise ValueError(f"driver {name!r} has draws = {made.draws!r}, which must be dicts with a 'setting' each")
        if made.make is not None:
            driver = _check_maker(f"driver {name!r}", made.make, Driver, "reset(seed) and act(observation, scene)")
            check_reset(driver, f"driver {name!r}")
        entries[name] = made._replace(config=as_plain(made.config), draws=tuple(as_plain(draws)))
    return entries


def chosen_authorities(given: Authorities) -> dict[str, AuthorityEntry]:
    """Choose authorities by name. Each allocator is made once to check that it implements the interface.

    Args:
        given: a name, several names, ``all``, or a mapping of names to entries or to makers of allocators.

    Returns:
        Authority entries by name.

    Raises:
        ValueError: as for :func:`choose`; if an entry does not make an allocator; or for an unknown law.
    """
    entries = {}
    for name, entry in choose("authority", given, AUTHORITIES).items():
        made = (
            entry if isinstance(entry, AuthorityEntry) else AuthorityEntry("given by the user", "proportional", entry)
        )
        if made.law not in LAWS:
            raise ValueError(f"authority {name!r} has law = {made.law!r}; {hint(made.law, LAWS)}")
        label = f"authority {name!r}"
        check_reset(_check_maker(label, made.make, Allocator, "reset(seed) and allocate(scene, signals)"), label)
        entries[name] = made
    return entries


def _is_text(name: str) -> bool:
    """Whether a name can be encoded; unpaired surrogates cannot."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True


def _given(what: str, name: str, make: Any) -> Any:
    """The maker that a user gives for a name; raises ValueError for None."""
    if make is None:
        raise ValueError(f"{what} {name!r} is None; it must make a {what} for each episode, such as its class")
    return make


def _check_maker(label: str, make: Any, kind: Any, methods: str) -> Any:
    """Return what ``make`` makes; raise ValueError unless it is an object with the interface ``kind``."""
    if not callable(make):
        raise ValueError(
            f"{label} is {make!r}; it must be what makes one for each episode, such as a class, not one itself"
        )
    try:
        made = make()
    except Exception as error:
        raise ValueError(f"{label}: {make!r}() gave an error, {type(error).__name__}: {error}") from error
    if isinstance(made, type) or not isinstance(made, kind):
        raise ValueError(f"{label}: {make!r} makes {made!r}, which is no object with {methods}")
    return made


def checked_automation(make: Any) -> None:
    """Check that a user's argument makes an automation, or is None.

    Args:
        make: maker of an automation, such as a class; or None.

    Raises:
        ValueError: if ``make`` does not make an automation.
    """
    if make is not None:
        _check_maker("automation", make, Planner, "reset() and act(scene)")


def chosen_suite(suite: str | Suite) -> Suite:
    """Choose a suite by name, or check a user's own suite.

    Args:
        suite: name of a suite, or a suite.

    Raises:
        ValueError: for an unknown suite, scenario or degradation, with the nearest valid name; or for an empty suite.
    """
    if not isinstance(suite, Suite):
        return choose_one("suite", suite, SUITES)
    for part in (suite.scenarios, suite.degradations):
        if not isinstance(part, list | tuple) or not part:
            raise ValueError(f"the suite's {part!r} must be a tuple of names, not empty; degradations may hold None")
    choose("scenario", suite.scenarios, SCENARIOS)
    named = [name for name in suite.degradations if name is not None]
    if named:
        choose("degradation", named, DEGRADATIONS)
    unique: Any = dict.fromkeys
    return suite._replace(scenarios=tuple(unique(suite.scenarios)), degradations=tuple(unique(suite.degradations)))
