"""The nearest valid name, for the messages about names that are not valid."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def nearest(name: object, valid: Iterable[object]) -> str | None:
    """The valid name that a misspelt one most probably means; None where none is near.

    Three quarters of the letters must agree (:meth:`difflib.SequenceMatcher.ratio`), or all but one in a short word, or
    the same letters stand in another order. Case, spaces, hyphens and underscores do not count.

    Args:
        name: as it was given.
        valid: the names that there are.
    """
    spellings = {_plain(each): str(each) for each in valid}
    text = _plain(name)
    near = difflib.get_close_matches(text, spellings, n=1, cutoff=0.75)
    if not near:
        near = [each for each in spellings if len(each) == len(text) > 1 and _is_slip(text, each)]
    return spellings[near[0]] if near else None


def hint(name: object, valid: Iterable[object]) -> str:
    """Half a sentence for a message: the nearest name where there is one, else all of them."""
    names = [str(each) for each in valid]
    near = nearest(name, names)
    return f"did you mean {near!r}?" if near else f"valid are {', '.join(sorted(names))}" if names else "there is none"


def _is_slip(text: str, other: str) -> bool:
    """Whether words of one length differ in one letter, or in the order of their letters."""
    return sum(a != b for a, b in zip(text, other, strict=True)) == 1 or sorted(text) == sorted(other)


def _plain(name: object) -> str:
    return str(name).lower().translate(str.maketrans("", "", " -_"))
