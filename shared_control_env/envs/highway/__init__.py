"""The parts derived from highway-env: road, vehicles, action and observation types, pictures, and inherited methods.

highway-env imports pandas and pyplot for observations and plots that this package replaces. While it is imported here,
late modules stand in for the two, which halves the time of the import. Nobody else sees the late modules.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import Any


class _Late(ModuleType):
    """A module that is imported when one of its attributes is first asked for."""

    def __getattr__(self, name: str) -> Any:
        return getattr(import_module(self.__name__), name)


def _import_highway_env() -> None:
    late = {name: _Late(name) for name in ("pandas", "matplotlib.pyplot") if name not in sys.modules}
    sys.modules.update(late)
    try:
        import_module("highway_env")
    finally:
        for name in late:
            del sys.modules[name]


_import_highway_env()
