"""What is identified of one person."""

from __future__ import annotations

from typing import NamedTuple

from shared_control_env.identification.data import Drives
from shared_control_env.identification.diagnostics import Diagnostics, diagnose
from shared_control_env.identification.estimate import Estimate, box_jenkins, instrumental


class Person(NamedTuple):
    """What was identified of a person.

    Attributes:
        drives: the drives.
        estimate: output error with AR(1) remnant, without a delay.
        delayed: the same with a delay.
        cross_check: instrumental variables.
        diagnostics: quality of the estimate.
    """

    drives: Drives
    estimate: Estimate
    delayed: Estimate
    cross_check: Estimate
    diagnostics: Diagnostics


def identify_person(drives: Drives) -> Person:
    """Identify the arm of a person by all methods, and judge the result.

    Args:
        drives: the drives.
    """
    estimate = box_jenkins(drives)
    delayed, cross_check = box_jenkins(drives, delay=True), instrumental(drives)
    return Person(drives, estimate, delayed, cross_check, diagnose(drives, estimate))
