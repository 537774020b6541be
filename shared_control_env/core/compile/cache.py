"""Numba's disk cache, kept apart for every state of the sources, and never in the way.

Numba compares only a function's own file with its cache, yet the machine code holds what the function calls in other
files too. So the digest of all compiled sources is part of the cache's path: a process that still runs older sources
writes to another folder. A cache that is damaged or cannot be written costs time and one line on stderr, no more.
"""

from __future__ import annotations

import os
import pickle
import shutil
import sys
from collections.abc import Callable
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    IndexDataCacheFile,
    InTreeCacheLocator,
    NullCache,
    UserProvidedCacheLocator,
    UserWideCacheLocator,
)

_PACKAGE = Path(__file__).parent.parent.parent

COMPILED = ("core", "controllers", "vector")
"""Rooms of the package that hold compiled functions; all their sources count, however deep they lie."""

KEPT = 8
"""States of the sources whose compiled forms are kept, the last used ones."""


def _digest_of_sources() -> str:
    paths = sorted(path for folder in COMPILED for path in (_PACKAGE / folder).rglob("*.py"))
    return sha256(b"".join(path.read_bytes() for path in paths)).hexdigest()


FOLDER = f"shared_control_env-{_digest_of_sources()[:20]}"
"""Name of the cache's folder: of the sources as they were when this process imported them."""


@cache
def say_once(text: str) -> None:
    """Print a line on stderr, if there is one, the first time that it is asked for."""
    if sys.stderr is not None:
        print(f"shared_control_env: {text}", file=sys.stderr, flush=True)


def _say_uncached(reason: object) -> None:
    say_once(
        f"compiled functions cannot be kept ({reason}), so that every start compiles them anew; "
        "set NUMBA_CACHE_DIR to a folder that can be written to."
    )


@cache
def _tidy(path: Path) -> None:
    """Mark a cache folder as used now; of those beside it remove all but the last used ones."""
    try:
        os.utime(path)
        folders = sorted(path.parent.glob("shared_control_env-*"), key=lambda folder: folder.stat().st_mtime)
        for folder in folders[:-KEPT]:
            shutil.rmtree(folder, ignore_errors=True)
    except OSError:  # of another user, or removed by another process
        return


def _apart(locator: Any) -> Any:
    """One of numba's locators with the sources' folder below its own."""

    def get_cache_path(self: Any) -> str:
        return os.path.join(locator.get_cache_path(self), FOLDER)

    return type(locator.__name__, (locator,), {"get_cache_path": get_cache_path})


class _Implementation(CompileResultCacheImpl):
    _locator_classes = [_apart(each) for each in (UserProvidedCacheLocator, InTreeCacheLocator, UserWideCacheLocator)]


class _CheckedFile(IndexDataCacheFile):
    """Files that begin with their digest: damaged machine code would be a wrong equation, or a crash."""

    def _save_data(self, name: str, data: Any) -> None:
        content = self._dump(data)
        super()._save_data(name, (sha256(content).digest(), content))

    def _load_data(self, name: str) -> Any:
        digest, content = super()._load_data(name)
        if sha256(content).digest() != digest:
            raise ValueError(f"{name} is damaged")
        return pickle.loads(content)


class _Cache(FunctionCache):
    """Cache of one function."""

    _impl_class = _Implementation

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._cache_file = _CheckedFile(
            self._cache_path, self._impl.filename_base, self._impl.locator.get_source_stamp()
        )
        _tidy(Path(self._cache_path))

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """The compiled function, or None where there is none that can be read."""
        try:
            return super().load_overload(signature, target_context)
        except Exception as error:  # whatever unpickling a damaged file raises
            say_once(
                f"the cache in {self._cache_path} is damaged ({type(error).__name__}); what is needed is compiled anew."
            )
            try:
                self.flush()
            except OSError as error:
                _say_uncached(error)
            return None

    def save_overload(self, signature: Any, data: Any) -> None:
        """Keep a compiled function, if the disk takes it."""
        try:
            super().save_overload(signature, data)
        except OSError as error:
            _say_uncached(error)


def cache_of(function: Callable[..., Any]) -> Any:
    """A cache for what a function is compiled to; one that keeps nothing where no folder can be written to."""
    try:
        return _Cache(function)
    except (RuntimeError, OSError) as error:
        _say_uncached("no folder for them can be written to" if isinstance(error, RuntimeError) else error)
        return NullCache()


def no_cache() -> Any:
    """For what is not of this package, whose changes nobody follows: it is compiled at every start."""
    return NullCache()
