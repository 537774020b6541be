"""A common interface to all drivers: predictive, scripted, recorded and trained, by name or by file."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from shared_control_env.controllers.allocators import Allocator
from shared_control_env.controllers.driver import Driver
from shared_control_env.controllers.recorded import RecordedDriver
from shared_control_env.evaluation.catalogue import AUTHORITIES, DRIVERS, AuthorityEntry, DriverEntry, choose_one
from shared_control_env.learned.card import is_direct
from shared_control_env.learned.policy import LearnedAllocator, LearnedDriver, Policy
from shared_control_env.learned.shipped import shipped
from shared_control_env.recordings.trial import Trial

T = TypeVar("T")


def _policy(path: Path) -> Callable[[], Driver]:
    return partial(LearnedDriver, Policy.load(path))


def _model(path: Path) -> Callable[[], Driver]:
    """Read a model of Stable-Baselines3: pickled code, which runs as it is read."""
    from agents.model_driver import ModelDriver  # needs Stable-Baselines3

    return partial(ModelDriver, ModelDriver.read(path))


def _recording(path: Path) -> Callable[[], Driver]:
    return partial(RecordedDriver, RecordedDriver.read(path))


def _drive(path: Path) -> Callable[[], Driver]:
    """A person's drive: u_h,act over time, for a slot that is direct."""
    trial = Trial.read(path)
    return partial(RecordedDriver, np.column_stack([trial.columns["t"], trial.columns["command"]]))


def _allocator(path: Path) -> Callable[[], Allocator]:
    return partial(LearnedAllocator, Policy.load(path))


READERS: dict[str, Callable[[Path], Callable[[], Driver]]] = {
    ".npz": _policy,
    ".zip": _model,
    ".csv": _recording,
    ".parquet": _drive,
}
"""Reader of a driver for each file extension."""


def _read(what: str, path: Path, read: Callable[[Path], Callable[[], T]]) -> Callable[[], T]:
    """Return a function that makes the driver or allocator of a file; one trial call refuses unsuitable files here."""
    if not path.is_file():
        raise ValueError(f"{what} = {str(path)!r}: there is no such file")
    try:
        make = read(path)
        make()
    except ValueError as error:
        raise ValueError(f"{what} = {str(path)!r}: {error}") from None
    return make


def _digest(path: Path) -> str:
    """Digest that distinguishes a file from other files of the same name."""
    return sha256(path.read_bytes()).hexdigest()[:16]


def driver_entry(source: str, trusted: bool = False) -> DriverEntry:
    """A driver for :func:`shared_control_env.evaluation.evaluate`; its ``make`` is for ``DriverModel``.

    Args:
        source: a name in the benchmark's catalogue, such as ``mpc``; the name of a policy that ships with the package,
            such as ``driver-0``; or a file: a policy (``.npz``), a model of Stable-Baselines3 (``.zip``), or a
            recording of commands (``.csv``) or of a person's drive (``.parquet``).
        trusted: whether a model may be read. A model holds pickled code, which can do anything as it is read. The
            other files hold only numbers.

    Raises:
        ValueError: for an unknown name (the message gives the nearest one), for a file that is none of these, or for a
            model that is not trusted.
    """
    path = shipped("driver").get(source, Path(source).expanduser())
    if path.suffix == ".zip" and path.is_file() and not trusted:
        raise ValueError(
            f"driver = {str(path)!r} holds pickled code, which runs as it is read; if you trust its source, pass "
            "trusted=True (--trusted). Policies of agents.train (.npz) hold only numbers."
        )
    if path.suffix in READERS:
        make = _read("driver", path, READERS[path.suffix])
        direct = path.suffix == ".parquet" or (path.suffix == ".npz" and is_direct(Policy.load(path).card))
        config = {"driver_lag": {"direct": True}} if direct else {}
        mark = _digest(path) if path.suffix == ".zip" else None
        return DriverEntry(f"of {path.name}", make, config, fingerprint=mark)
    known: dict[str, Any] = {**DRIVERS, **dict.fromkeys(shipped("driver"))}
    return choose_one("driver", source, known)


def authority_entry(source: str) -> AuthorityEntry:
    """An authority for :func:`shared_control_env.evaluation.evaluate`; its ``make`` is for ``AuthorityLimiter``.

    Args:
        source: a name in the benchmark's catalogue, such as ``proportional``; the name of a policy that ships with the
            package, such as ``allocator-0``; or a file of a policy (``.npz``).

    Raises:
        ValueError: for an unknown name (the message gives the nearest one), or for a file that is not a policy.
    """
    path = shipped("allocator").get(source, Path(source).expanduser())
    if path.suffix == ".npz":
        make = _read("authority", path, _allocator)
        return AuthorityEntry(f"of {path.name}", "proportional", make)
    known: dict[str, Any] = {**AUTHORITIES, **dict.fromkeys(shipped("allocator"))}
    return choose_one("authority", source, known)
