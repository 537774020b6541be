"""One face for all drivers: predictive, scripted, recorded and trained, by name or by file."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TypeVar

from agents.policy import LearnedAllocator, LearnedDriver, Policy
from agents.recorded import RecordedDriver
from shared_control_env.controllers.allocators import Allocator
from shared_control_env.controllers.driver import Driver
from shared_control_env.evaluation.catalogue import AUTHORITIES, DRIVERS, AuthorityEntry, DriverEntry, choose

T = TypeVar("T")

POLICIES = Path(__file__).parent / "policies"
"""Trained policies that ship, with their model card."""


def _policy(path: Path) -> Callable[[], Driver]:
    return partial(LearnedDriver, Policy.load(path))


def _model(path: Path) -> Callable[[], Driver]:
    from agents.model_driver import ModelDriver  # which needs Stable-Baselines3

    return partial(ModelDriver, ModelDriver.read(path))


def _recording(path: Path) -> Callable[[], Driver]:
    return partial(RecordedDriver, RecordedDriver.read(path))


def _allocator(path: Path) -> Callable[[], Allocator]:
    return partial(LearnedAllocator, Policy.load(path))


READERS: dict[str, Callable[[Path], Callable[[], Driver]]] = {".npz": _policy, ".zip": _model, ".csv": _recording}
"""How drivers are read, by the ending of the file."""


def _read(what: str, path: Path, read: Callable[[Path], Callable[[], T]]) -> Callable[[], T]:
    """What makes the driver or allocator of a file; one is made at once, so that what does not fit is refused here."""
    if not path.is_file():
        raise ValueError(f"{what} = {str(path)!r}: there is no such file")
    try:
        make = read(path)
        make()
    except ValueError as error:
        raise ValueError(f"{what} = {str(path)!r}: {error}") from None
    return make


def shipped(task: str) -> dict[str, Path]:
    """Policies that ship, by name.

    Args:
        task: key of :data:`agents.tasks.TASKS`.
    """
    return {path.stem: path for path in sorted(POLICIES.glob(f"{task}-*.npz"))}


def driver_entry(source: str) -> DriverEntry:
    """A driver for :func:`shared_control_env.evaluation.evaluate`; its ``make`` is for ``DriverModel``.

    Args:
        source: name of the benchmark's catalogue, such as ``mpc``; of a policy that ships, such as ``driver-0``; or a
            file: a policy (``.npz``), a model of Stable-Baselines3 (``.zip``), or a recording (``.csv``).

    Raises:
        ValueError: for an unknown name, with the nearest, or a file that is none of these.
    """
    path = shipped("driver").get(source, Path(source))
    if path.suffix in READERS:
        return DriverEntry(f"of {path.name}", _read("driver", path, READERS[path.suffix]))
    return choose("driver", source, {**DRIVERS, **dict.fromkeys(shipped("driver"))})[source]


def authority_entry(source: str) -> AuthorityEntry:
    """An authority for :func:`shared_control_env.evaluation.evaluate`; its ``make`` is for ``AuthorityLimiter``.

    Args:
        source: name of the benchmark's catalogue, such as ``proportional``; of a policy that ships, such as
            ``allocator-0``; or a file of a policy (``.npz``).

    Raises:
        ValueError: for an unknown name, with the nearest, or a file that is no policy.
    """
    path = shipped("allocator").get(source, Path(source))
    if path.suffix == ".npz":
        return AuthorityEntry(f"of {path.name}", "proportional", _read("authority", path, _allocator))
    return choose("authority", source, {**AUTHORITIES, **dict.fromkeys(shipped("allocator"))})[source]
