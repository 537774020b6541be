"""Questionnaires: workload (NASA-TLX) and acceptance (Van der Laan)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple


class Item(NamedTuple):
    """An item of a questionnaire.

    Attributes:
        name: name in the answers.
        question: the question.
        low, high: words at the left and at the right end.
        least, step: value at the left end, and from one answer to the next.
        steps: number of possible answers.
    """

    name: str
    question: str
    low: str
    high: str
    least: float
    step: float
    steps: int

    def allows(self, value: float) -> bool:
        """Whether a value is a possible answer.

        Args:
            value: the value.
        """
        return value in [self.least + i * self.step for i in range(self.steps)]


class Questionnaire(NamedTuple):
    """A questionnaire.

    Attributes:
        title: what the person reads.
        items: its items.
        scores: scores by name, as functions of the answers.
    """

    title: str
    items: tuple[Item, ...]
    scores: Mapping[str, Callable[[Mapping[str, float]], float]]


def _scale(name: str, question: str, low: str = "very low", high: str = "very high") -> Item:
    return Item(name, question, low, high, 0.0, 5.0, 21)


_TLX = (
    _scale("mental", "Mental demand: how much did you have to think, look and decide?"),
    _scale("physical", "Physical demand: how much did you have to move and hold?"),
    _scale("temporal", "Temporal demand: how hurried was the pace?"),
    _scale("performance", "Performance: how well did you do what you were asked to?", "perfect", "failure"),
    _scale("effort", "Effort: how hard did you have to work for that?"),
    _scale("frustration", "Frustration: how insecure, irritated or stressed were you?"),
)

_PAIRS = (
    *(("useful", "useless"), ("pleasant", "unpleasant"), ("bad", "good"), ("nice", "annoying")),
    *(("effective", "superfluous"), ("irritating", "likeable"), ("assisting", "worthless")),
    *(("undesirable", "desirable"), ("raising alertness", "sleep-inducing")),
)
_MIRRORED = (2, 5, 7)
"""Items whose good end is at the right."""


def _pair(i: int) -> Item:
    low, high = _PAIRS[i]
    sign = 1.0 if i in _MIRRORED else -1.0
    return Item(f"item_{i + 1}", "I find the automation ..." if i == 0 else "", low, high, -2.0 * sign, sign, 5)


def _mean(*names: str) -> Callable[[Mapping[str, float]], float]:
    return lambda answers: sum(answers[name] for name in names) / len(names)


QUESTIONNAIRES: dict[str, Questionnaire] = {
    "nasa_tlx": Questionnaire("How demanding was that?", _TLX, {"raw_tlx": _mean(*(item.name for item in _TLX))}),
    "van_der_laan": Questionnaire(
        "What do you think of the automation?",
        tuple(_pair(i) for i in range(len(_PAIRS))),
        {
            "usefulness": _mean(*(f"item_{i}" for i in (1, 3, 5, 7, 9))),
            "satisfaction": _mean(*(f"item_{i}" for i in (2, 4, 6, 8))),
        },
    ),
}
"""Questionnaires by name.

``nasa_tlx``: Hart & Staveland (1988), six scales from 0 to 100 in steps of 5; the score is their mean (raw TLX).
``van_der_laan``: Van der Laan, Heino & de Waard (Transportation Research C 5(1), 1997), nine items from -2 to 2;
usefulness and satisfaction are the means of the odd and of the even items.
"""


def checked(name: str, answers: Mapping[str, float]) -> dict[str, float]:
    """Check the answers to a questionnaire, and add its scores.

    Args:
        name: key of :data:`QUESTIONNAIRES`.
        answers: answers by item.

    Raises:
        ValueError: if an item is missing, unknown, or has another value than its scale allows.
    """
    items = {item.name: item for item in QUESTIONNAIRES[name].items}
    if set(answers) != set(items):
        wrong = sorted(set(answers) ^ set(items))
        raise ValueError(f"{name}: the answers must be to {', '.join(items)}; missing or unknown: {', '.join(wrong)}")
    for key, value in answers.items():
        if not items[key].allows(value):
            raise ValueError(f"{name}: {key} = {value:g} is no answer of its scale")
    scores = {score: measure(answers) for score, measure in QUESTIONNAIRES[name].scores.items()}
    return {**answers, **scores}
