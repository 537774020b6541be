"""Numba's disk cache, with a separate folder for every state of the sources.

Numba checks only whether a function's own file has changed. The machine code, however, also contains functions from
other files. The digest of the core's sources is therefore part of the path of the cache. A process that still runs
older sources writes to another folder. A cache that is damaged or cannot be written only costs time and produces one
line on stderr.
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

_CORE = Path(__file__).parent.parent
"""Folder of the compiled functions; the digest covers all its sources, nested folders included."""

KEPT = 8
"""Number of states of the sources whose compiled functions are kept: the most recently used ones."""


def _digest_of_sources() -> str:
    return sha256(b"".join(path.read_bytes() for path in sorted(_CORE.rglob("*.py")))).hexdigest()


FOLDER = f"shared_control_env-{_digest_of_sources()[:20]}"
"""Name of the cache folder; it belongs to the sources as they were when this process imported them."""


@cache
def say_once(text: str) -> None:
    """Print a line on stderr, only once per process, and only if the process has a stderr.

    Args:
        text: text of the line, without the name of the package.
    """
    if sys.stderr is not None:
        print(f"shared_control_env: {text}", file=sys.stderr, flush=True)


def _say_uncached(reason: object) -> None:
    say_once(
        f"compiled functions cannot be kept ({reason}), so every start compiles them again; "
        "set NUMBA_CACHE_DIR to a folder that can be written to."
    )


@cache
def _tidy(path: Path) -> None:
    """Mark a cache folder as used now, and remove all but the most recently used of the folders beside it."""
    try:
        os.utime(path)
        folders = sorted(path.parent.glob("shared_control_env-*"), key=lambda folder: folder.stat().st_mtime)
        for folder in folders[:-KEPT]:
            shutil.rmtree(folder, ignore_errors=True)
    except OSError:  # the folder belongs to another user, or another process has removed it
        return


def _apart(locator: Any) -> Any:
    """Derive a locator from one of numba's; the new one uses a subfolder for the present sources."""

    def get_cache_path(self: Any) -> str:
        return os.path.join(locator.get_cache_path(self), FOLDER)

    return type(locator.__name__, (locator,), {"get_cache_path": get_cache_path})


class _Implementation(CompileResultCacheImpl):
    _locator_classes = [_apart(each) for each in (UserProvidedCacheLocator, InTreeCacheLocator, UserWideCacheLocator)]


class _CheckedFile(IndexDataCacheFile):
    """Cache files that begin with their digest, since damaged machine code would give wrong results or a crash."""

    def _save_data(self, name: str, data: Any) -> None:
        content = self._dump(data)
        super()._save_data(name, (sha256(content).digest(), content))

    def _load_data(self, name: str) -> Any:
        digest, content = super()._load_data(name)
        if sha256(content).digest() != digest:
            raise ValueError(f"{name} is damaged")
        return pickle.loads(content)


class _Cache(FunctionCache):
    """Disk cache of one function."""

    _impl_class = _Implementation

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._cache_file = _CheckedFile(
            self._cache_path, self._impl.filename_base, self._impl.locator.get_source_stamp()
        )
        _tidy(Path(self._cache_path))

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """Return the compiled function, or None if the cache has none that can be read.

        Args:
            signature: numba signature of the compiled function.
            target_context: numba's target context.
        """
        try:
            return super().load_overload(signature, target_context)
        except Exception as error:  # unpickling a damaged file may raise any exception
            say_once(
                f"the cache in {self._cache_path} is damaged ({type(error).__name__}); it is compiled again as needed."
            )
            try:
                self.flush()
            except OSError as error:
                _say_uncached(error)
            return None

    def save_overload(self, signature: Any, data: Any) -> None:
        """Store a compiled function, if the disk can be written to.

        Args:
            signature: numba signature of the compiled function.
            data: numba's result of the compilation.
        """
        try:
            super().save_overload(signature, data)
        except OSError as error:
            _say_uncached(error)


def cache_of(function: Callable[..., Any]) -> Any:
    """Disk cache for the compiled forms of a function; a cache that stores nothing if no folder can be written to.

    Args:
        function: Python function of this package.
    """
    try:
        return _Cache(function)
    except (RuntimeError, OSError) as error:
        _say_uncached("no folder for them can be written to" if isinstance(error, RuntimeError) else error)
        return NullCache()
