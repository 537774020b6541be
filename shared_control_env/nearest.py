"""The nearest valid name, for error messages about invalid names."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def nearest(name: object, valid: Iterable[object]) -> str | None:
    """The valid name that a misspelt name most probably means; None if no name is near.

    A name is near if three quarters of the letters agree (:meth:`difflib.SequenceMatcher.ratio`), if all letters but
    one agree in a short word, or if the same letters stand in another order. Case, spaces, hyphens and underscores do
    not count.

    Args:
        name: the name as given.
        valid: the valid names.
    """
    spellings = {_plain(each): str(each) for each in valid}
    text = _plain(name)
    near = difflib.get_close_matches(text, spellings, n=1, cutoff=0.75)
    if not near:
        near = [each for each in spellings if len(each) == len(text) > 1 and _is_slip(text, each)]
    return spellings[near[0]] if near else None


def hint(name: object, valid: Iterable[object]) -> str:
    """Half a sentence for an error message: the nearest name if there is one, otherwise all valid names.

    Args:
        name: the name as given.
        valid: the valid names.
    """
    names = [str(each) for each in valid]
    near = nearest(name, names)
    return f"did you mean {near!r}?" if near else f"valid are {', '.join(sorted(names))}" if names else "there is none"


def _is_slip(text: str, other: str) -> bool:
    """Whether two words of equal length differ in one letter, or only in the order of their letters."""
    return sum(a != b for a, b in zip(text, other, strict=True)) == 1 or sorted(text) == sorted(other)


def _plain(name: object) -> str:
    return str(name).lower().translate(str.maketrans("", "", " -_"))


def check_new_name(what: str, name: object, table: Iterable[object]) -> None:
    """Raise ValueError unless a name is a text that a table does not hold yet.

    Args:
        what: kind of thing that is named, for the message.
        name: as given.
        table: names that are taken.
    """
    if not isinstance(name, str) or not name:
        raise ValueError(f"{what}: its name = {name!r} must be a text that is not empty")
    if name in table:
        raise ValueError(f"{what} {name!r} is there already")
