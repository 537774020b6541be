"""The folder of a study: what each person has done so far is what lies in it, so that it can go on at any moment."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

from shared_control_env.drive.folders import RecordingsFolder, locked
from shared_control_env.drive.study.order import order_of
from shared_control_env.drive.study.plan import Condition, Drives, Plan
from shared_control_env.evaluation.storage import write_atomically
from shared_control_env.recordings.trial import Trial

PLAN, PEOPLE, ABOUT, CONSENT, DEVICE = "plan.json", "people", "about.json", "consent.json", "device.json"
"""Files of a study and of a person, and the folder of the people."""

MOST_ATTEMPTS = 5
"""Attempts at one trial after which it is left out; the export names it."""

_CODE = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,19}")


class Drive(NamedTuple):
    """The next drive of a person.

    Attributes:
        label: name of the file without suffix and attempt: ``practice-1``, or condition and repetition.
        what: what is driven.
        seed: seed of the episode.
        condition: the condition; None for practice.
        number, of: number of the drive among the trials or practice drives, from 1, and how many there are.
    """

    label: str
    what: Drives
    seed: int
    condition: Condition | None
    number: int
    of: int


class Questions(NamedTuple):
    """The next questionnaire of a person.

    Attributes:
        name: name of the questionnaire.
        condition: the condition that it is about.
    """

    name: str
    condition: Condition


class StudyFolder:
    """The folder of one study, for one person at a time.

    Args:
        path: folder of the study; it is made if needed.
        plan: the plan; that of an earlier run must be the same.
        code: code of the person; empty for the next free one.
        simulated: what simulates the person; empty for a real one.

    Attributes:
        plan: the plan.
        simulated: what simulates the person; empty for a real one.
        code: code of the person.
        number: number of the person in the order of enrolment, from 0.
        order: the conditions in this person's order.
        recordings: folder of this person's recordings.

    Raises:
        ValueError: if the folder belongs to another plan, is in use, or cannot be written to; or for a code that is
            none.
    """

    def __init__(self, path: Path, plan: Plan, code: str = "", simulated: str = "") -> None:
        self.plan, self._path, self.simulated = plan, path, simulated
        people = path / PEOPLE
        self._kept = ExitStack()
        self._kept.enter_context(locked(path))
        try:
            self._check_plan()
            enrolled = self.enrolled()
            self.code = code or _free(enrolled)
            if not _CODE.fullmatch(self.code):
                raise ValueError(f"code = {code!r} must be at most 20 letters, digits, - and _; no name of a person")
            self.recordings = RecordingsFolder(people / self.code)
            if self.code not in enrolled:
                now = time.strftime("%Y-%m-%d %H:%M:%S")
                self._write(ABOUT, {"number": len(enrolled), "enrolled": now, "simulated": simulated})
            about = self._read(ABOUT)
            if about["simulated"] != simulated:
                kinds = (kind or "a real person" for kind in (about["simulated"], simulated))
                raise ValueError("{} is {}, not {}; two are not mixed under one code".format(self.code, *kinds))
            self.number = about["number"]
            self.order = [plan.conditions[i] for i in order_of(self.number, len(plan.conditions), plan.seed)]
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Release the folder."""
        self._kept.close()

    def _check_plan(self) -> None:
        mine = self.plan.model_dump(mode="json")
        path = self._path / PLAN
        if not path.exists():
            _create(path, mine)
            return
        there = json.loads(path.read_text(encoding="utf-8"))
        changed = [name for name in mine if there.get(name) != mine[name]]
        if changed:
            raise ValueError(
                f"{self._path} holds a study whose plan differs in {', '.join(changed)}; the two are not mixed: choose "
                "another folder"
            )

    def enrolled(self) -> list[str]:
        """Codes of the people, in the order of enrolment."""
        found = [(json.loads(path.read_text())["number"], path.parent.name) for path in self._each(ABOUT)]
        return [code for _, code in sorted(found)]

    def _each(self, name: str) -> list[Path]:
        return list((self._path / PEOPLE).glob(f"*/{name}"))

    @property
    def consent(self) -> bool | None:
        """Whether the person agreed; None if that is not known yet."""
        return self._read(CONSENT)["agreed"] if self._has(CONSENT) else None

    @property
    def device(self) -> dict[str, Any] | None:
        """Device and calibration of the person; None if they are not known yet."""
        return self._read(DEVICE) if self._has(DEVICE) else None

    def next(self) -> Drive | Questions | None:
        """What the person does next, after consent and device; None when all is done."""
        practice = self._next_practice()
        if practice is not None:
            return practice
        number, total = 0, self.plan.repetitions * len(self.order)
        for condition in self.order:
            for repetition in range(self.plan.repetitions):
                number += 1
                label = f"{condition.name}-{repetition + 1}"
                if not self._is_over(label):
                    return Drive(label, condition, self.plan.seed_of(repetition), condition, number, total)
            for name in self.plan.questionnaires:
                if not self._has(_answers(condition, name)):
                    return Questions(name, condition)
        return None

    def _next_practice(self) -> Drive | None:
        practice = self.plan.practice
        if practice is None:
            return None
        for i in range(practice.most):
            done = self._attempts(f"practice-{i + 1}")
            if not done:
                return Drive(f"practice-{i + 1}", practice, self.plan.practice_seed(i), None, i + 1, practice.most)
            if self.is_good(Trial.read(done[-1])):
                return None
        return None

    def is_good(self, trial: Trial) -> bool:
        """Whether a practice drive meets the criterion.

        Args:
            trial: its recording.
        """
        practice = self.plan.practice
        value = None if practice is None else trial.header["result"][practice.metric]
        return practice is not None and trial.header["valid"] and value is not None and value < practice.below

    def _attempts(self, label: str) -> list[Path]:
        """Recordings of a drive, in the order of the attempts."""
        found = [self.recordings.path / f"{label}_{i + 1}.parquet" for i in range(MOST_ATTEMPTS + 1)]
        return [path for path in found if path.exists()]

    def _is_over(self, label: str) -> bool:
        attempts = self._attempts(label)
        return len(attempts) >= MOST_ATTEMPTS or any(Trial.read(path).header["valid"] for path in attempts[-1:])

    def add(self, drive: Drive, trial: Trial) -> Path:
        """Write the recording of a drive.

        Args:
            drive: the drive.
            trial: its recording.

        Returns:
            Path of the file.
        """
        attempt = len(self._attempts(drive.label)) + 1
        path = self.recordings.path / f"{drive.label}_{attempt}.parquet"
        trial.write(path)
        return path

    def agree(self, agreed: bool) -> None:
        """Write whether the person agrees.

        Args:
            agreed: whether the person agrees.
        """
        self._write(CONSENT, {"agreed": agreed, "text": self.plan.consent, "at": time.strftime("%Y-%m-%d %H:%M:%S")})

    def choose_device(self, device: Mapping[str, Any]) -> None:
        """Write which device the person uses.

        Args:
            device: device and calibration.
        """
        self._write(DEVICE, device)

    def answer(self, questions: Questions, answers: Mapping[str, float]) -> None:
        """Write the answers to a questionnaire.

        Args:
            questions: the questionnaire.
            answers: checked answers, with scores.
        """
        self._write(_answers(questions.condition, questions.name), answers)

    def _has(self, name: str) -> bool:
        return (self.recordings.path / name).exists()

    def _read(self, name: str) -> dict[str, Any]:
        read: dict[str, Any] = json.loads((self.recordings.path / name).read_text(encoding="utf-8"))
        return read

    def _write(self, name: str, content: Mapping[str, Any]) -> None:
        _create(self.recordings.path / name, content)


def _create(path: Path, content: Mapping[str, Any]) -> None:
    """Write a JSON file that does not exist yet."""
    if path.exists():
        raise FileExistsError(f"{path} exists already; nothing is overwritten")
    text = json.dumps(content, indent=1)
    write_atomically(path, lambda draft: draft.write_text(text, encoding="utf-8"))


def _answers(condition: Condition, name: str) -> str:
    return f"answers-{condition.name}-{name}.json"


def _free(enrolled: list[str]) -> str:
    """The first of P01, P02, ... that no one has."""
    i = 1
    while f"P{i:02d}" in enrolled:
        i += 1
    return f"P{i:02d}"
