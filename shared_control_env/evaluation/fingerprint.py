"""What a driver or an allocator of a user's is, as a digest: results of another one of the same name are not mixed."""

from __future__ import annotations

import builtins
import pickle
from collections.abc import Callable, Iterator
from functools import partial
from hashlib import sha256
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np


def fingerprint(make: Callable[..., Any]) -> str:
    """Digest of what makes a driver or an allocator.

    It is made of the code of its class, of what this uses of the same module, and of its arguments. Comments and layout
    do not count; what is read from files at run time is not seen.

    Args:
        make: a class, a function, or a :class:`functools.partial` of one.

    Raises:
        ValueError: if it holds something whose content cannot be told.
    """
    return sha256("\n".join(_parts(make, "", set())).encode()).hexdigest()[:16]


def _parts(value: Any, module: str, seen: set[int]) -> Iterator[str]:
    """Texts that say what a value is; of functions and classes of other modules, their names alone."""
    if id(value) in seen:
        return
    if isinstance(value, bool | int | float | complex | str | bytes | None | type(Ellipsis)):
        yield repr(value)
        return
    seen.add(id(value))
    if isinstance(value, np.ndarray):
        yield f"{value.dtype} {value.shape} {sha256(np.ascontiguousarray(value).tobytes()).hexdigest()}"
    elif isinstance(value, ModuleType):
        yield value.__name__
    elif isinstance(value, partial):
        yield from _parts((value.func, value.args, value.keywords), module, seen)
    elif isinstance(value, CodeType):
        yield from _of_code(value)
    elif hasattr(value, "py_func"):  # compiled by numba
        yield from _parts(value.py_func, module, seen)
    elif isinstance(value, MethodType):
        yield from _parts((value.__func__, value.__self__), module, seen)
    elif isinstance(value, type):
        yield from _of_class(value, module, seen)
    elif isinstance(value, FunctionType):
        yield from _of_function(value, module, seen)
    elif isinstance(value, staticmethod | classmethod):
        yield from _parts(value.__func__, module, seen)
    elif isinstance(value, property):
        yield from _parts((value.fget, value.fset), module, seen)
    elif isinstance(value, dict):
        for key in sorted(value, key=str):
            yield str(key)
            yield from _parts(value[key], module, seen)
    elif isinstance(value, list | tuple):
        yield type(value).__name__
        for item in value:
            yield from _parts(item, module, seen)
    elif isinstance(value, set | frozenset):
        yield from sorted(map(repr, value))
    elif hasattr(value, "__dict__") and type(value).__module__ != builtins.__name__:
        yield from _of_class(type(value), module, seen)
        yield from _parts(vars(value), module, seen)
    else:
        yield _pickled(value)


def _of_class(kind: type, module: str, seen: set[int]) -> Iterator[str]:
    yield f"{kind.__module__}.{kind.__qualname__}"
    if module and kind.__module__ != module:
        return
    for base in kind.__mro__[:-1]:
        if base.__module__ not in (kind.__module__, builtins.__name__):
            yield f"{base.__module__}.{base.__qualname__}"
            continue
        for name in sorted(vars(base)):
            if name not in (
                "__dict__",
                "__weakref__",
                "__doc__",
                "__module__",
                "__firstlineno__",
                "__static_attributes__",
            ):
                yield name
                yield from _parts(vars(base)[name], kind.__module__, seen)


def _of_function(function: FunctionType, module: str, seen: set[int]) -> Iterator[str]:
    yield f"{function.__module__}.{function.__qualname__}"
    if module and function.__module__ != module:
        return
    yield from _of_code(function.__code__)
    yield from _parts((function.__defaults__, function.__kwdefaults__), function.__module__, seen)
    for cell in function.__closure__ or ():
        yield from _parts(cell.cell_contents, function.__module__, seen)
    for name in function.__code__.co_names:
        if name in function.__globals__:
            yield name
            yield from _parts(function.__globals__[name], function.__module__, seen)


def _of_code(code: CodeType) -> Iterator[str]:
    yield f"{code.co_code.hex()} {code.co_names} {code.co_varnames}"
    constants = code.co_consts[1:] if code.co_consts and isinstance(code.co_consts[0], str) else code.co_consts
    for constant in constants:  # without the docstring
        if isinstance(constant, CodeType):
            yield from _of_code(constant)
        else:
            yield repr(constant)


def _pickled(value: Any) -> str:
    try:
        return sha256(pickle.dumps(value, protocol=5)).hexdigest()
    except Exception as error:  # whatever an object's own pickling raises
        raise ValueError(
            f"it cannot be told what {value!r} is ({error}); give a fingerprint: DriverEntry(..., fingerprint='...')"
        ) from None
