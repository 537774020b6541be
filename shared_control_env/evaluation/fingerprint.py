"""Digests of what users define, so that results of different definitions with one name are not mixed."""

from __future__ import annotations

import pickle
import sys
import sysconfig
from collections.abc import Iterator
from functools import partial
from hashlib import sha256
from pathlib import Path
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

import shared_control_env
from shared_control_env.controllers.arrays import as_array
from shared_control_env.evaluation.storage import digest

_INSTALLED = [
    *(Path(sysconfig.get_path(name)).resolve() for name in ("stdlib", "platstdlib", "purelib", "platlib")),
    Path(shared_control_env.__file__).resolve().parent,  # the versions already contain a digest of its sources
]
"""Folders of code that does not change between runs, or whose changes are recorded elsewhere."""

_NOT_CODE = ("__dict__", "__weakref__", "__doc__", "__module__", "__firstlineno__", "__static_attributes__")


def fingerprint(value: Any) -> str:
    """Digest of what a user gives: a maker of drivers, allocators or automations, or an addition to a table.

    The digest covers the code of functions and classes, everything that the code uses from the user's own modules, the
    arguments, and the content of all other objects. Comments and layout do not affect it. Data that is read from files
    at run time is not covered.

    Args:
        value: a class, a function, a :class:`functools.partial` of one, or an entry of a table.

    Raises:
        ValueError: if it holds an object whose content cannot be read.
    """
    return digest("\n".join(_parts(value, {})))


def _is_own(module: str) -> bool:
    """Whether a module is the user's own. Its code enters the digest; for an installed module the name is enough."""
    if module == "builtins":
        return False
    file = getattr(sys.modules.get(module), "__file__", None)
    return file is None or not any(folder in Path(file).resolve().parents for folder in _INSTALLED)


def _parts(value: Any, seen: dict[int, Any]) -> Iterator[str]:
    """Texts that describe a value. ``seen`` keeps the objects alive, because the id of a deleted object is reused."""
    if isinstance(value, bool | int | float | complex | str | bytes | None | type(Ellipsis)):
        yield repr(value)
        return
    if id(value) in seen:
        yield "seen"
        return
    seen[id(value)] = value
    if isinstance(value, np.ndarray) or hasattr(value, "detach"):
        array = np.ascontiguousarray(as_array(value))
        yield f"{array.dtype} {array.shape} {_pickled(array) if array.dtype.hasobject else _digest(array.tobytes())}"
    elif isinstance(value, ModuleType):
        yield value.__name__
    elif isinstance(value, CodeType):
        yield from _of_code(value)
    elif hasattr(value, "py_func"):  # compiled by numba
        yield from _parts(value.py_func, seen)
    elif isinstance(value, partial):
        yield from _each((value.func, value.args, value.keywords), seen)
    elif isinstance(value, MethodType):
        yield from _each((value.__func__, value.__self__), seen)
    elif isinstance(value, type):
        yield from _of_class(value, seen)
    elif isinstance(value, FunctionType):
        yield from _of_function(value, seen)
    elif isinstance(value, staticmethod | classmethod):
        yield from _parts(value.__func__, seen)
    elif isinstance(value, property):
        yield from _each((value.fget, value.fset), seen)
    elif isinstance(value, dict):
        for key in sorted(value, key=repr):
            yield repr(key)
            yield from _parts(value[key], seen)
    elif isinstance(value, list | tuple):
        yield type(value).__name__
        yield from _each(value, seen)
    elif isinstance(value, set | frozenset):
        yield from sorted(map(repr, value))
    elif _is_own(type(value).__module__) and hasattr(value, "__dict__"):
        yield from _of_class(type(value), seen)
        yield from _parts(vars(value), seen)
    else:
        yield _pickled(value)


def _each(values: Any, seen: dict[int, Any]) -> Iterator[str]:
    for value in values:
        yield from _parts(value, seen)


def _of_class(kind: type, seen: dict[int, Any]) -> Iterator[str]:
    yield f"{kind.__module__}.{kind.__qualname__}"
    if not _is_own(kind.__module__):
        return
    for name in sorted(vars(kind)):
        if name not in _NOT_CODE:
            yield name
            yield from _parts(vars(kind)[name], seen)
    yield from _each(kind.__bases__, seen)


def _of_function(function: FunctionType, seen: dict[int, Any]) -> Iterator[str]:
    yield f"{function.__module__}.{function.__qualname__}"
    if not _is_own(function.__module__):
        return
    yield from _of_code(function.__code__)
    yield from _each((*(function.__defaults__ or ()), function.__kwdefaults__), seen)
    for cell in function.__closure__ or ():
        try:
            content = cell.cell_contents
        except ValueError:  # not assigned yet
            content = None
        yield from _parts(content, seen)
    for name in _names(function.__code__):
        if name in function.__globals__:
            yield name
            yield from _parts(function.__globals__[name], seen)


def _names(code: CodeType) -> list[str]:
    """Names that code looks up, those in inner functions and comprehensions included."""
    inner = [name for constant in code.co_consts if isinstance(constant, CodeType) for name in _names(constant)]
    return [*code.co_names, *inner]


def _of_code(code: CodeType) -> Iterator[str]:
    yield f"{code.co_code.hex()} {code.co_names} {code.co_varnames}"
    constants = code.co_consts[1:] if code.co_consts and isinstance(code.co_consts[0], str) else code.co_consts
    for constant in constants:  # the docstring is left out
        if isinstance(constant, CodeType):
            yield from _of_code(constant)
        else:
            yield " ".join(sorted(map(repr, constant))) if isinstance(constant, frozenset) else repr(constant)


def _digest(content: bytes) -> str:
    return sha256(content).hexdigest()


def _pickled(value: Any) -> str:
    try:
        return _digest(pickle.dumps(value, protocol=5))
    except Exception as error:  # pickling code of a user's object may raise anything
        raise ValueError(
            f"cannot read the content of {value!r} ({error}); give a fingerprint: "
            "DriverEntry(..., fingerprint='...'), or define it without such an object"
        ) from None
