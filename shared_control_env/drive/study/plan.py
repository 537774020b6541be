"""The plan of a study: what each person drives, in what order, and what is asked. All of it is checked at the start."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal

from annotated_types import Interval, Len, MaxLen
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from shared_control_env.drive.session import BESIDE, Choice
from shared_control_env.drive.study.questionnaires import QUESTIONNAIRES
from shared_control_env.drive.view import SHOWN
from shared_control_env.evaluation.catalogue import DRIVERS
from shared_control_env.evaluation.metrics import METRICS
from shared_control_env.nearest import hint

Text = Annotated[str, MaxLen(10_000)]
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,30}")


class Part(BaseModel):
    """Base of the parts of a plan."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)


class Drives(Part):
    """What is driven, by names of the catalogue, and what the gauges show."""

    scenario: str
    degradation: str = "own"
    authority: str = "proportional"
    law: str = ""
    show: tuple[str, ...] = Field(default=("authority",), strict=False)

    @model_validator(mode="after")
    def _possible(self) -> Drives:
        self.choice(0).batch((BESIDE, DRIVERS[BESIDE]))
        for name in self.show:
            if name not in SHOWN:
                raise ValueError(f"show = {name!r}; {hint(name, SHOWN)}")
        return self

    def choice(self, seed: int) -> Choice:
        """The choice of one trial.

        Args:
            seed: seed of the trial.
        """
        return Choice(self.scenario, self.degradation, self.authority, self.law, seed)


class Condition(Drives):
    """A condition of the study."""

    name: str

    @field_validator("name")
    @classmethod
    def _plain(cls, name: str) -> str:
        if not _NAME.fullmatch(name):
            raise ValueError(
                f"name = {name!r} must be at most 31 letters, digits, - and _, since files are named by it"
            )
        if name.lower() == "practice":
            raise ValueError(f"name = {name!r} is that of the practice drives")
        return name


class Practice(Drives):
    """Practice: drives until a metric is below a bound, or a number of drives is reached."""

    metric: str = "lateral_rms"
    below: float = 0.5
    most: Annotated[int, Interval(ge=1, le=50)] = 5

    @field_validator("metric")
    @classmethod
    def _known(cls, name: str) -> str:
        if name not in METRICS:
            raise ValueError(f"metric = {name!r}; {hint(name, METRICS)}")
        return name


class Plan(Part):
    """The plan of a study.

    Attributes:
        title: title that the person sees.
        consent: what the person agrees to; paragraphs are separated by empty lines.
        instructions: what the person is told before the trials.
        seed: seed of the order of the conditions and of the trials. Repetition r of every condition has the seed
            ``1000 seed + r``, so that conditions are compared on the same episodes.
        repetitions: trials of each condition.
        devices: devices that the person may choose.
        practice: practice before the trials; None for none.
        conditions: the conditions.
        questionnaires: questionnaires after each condition.
    """

    title: Annotated[str, Len(1, 200)]
    consent: Text = "I take part of my own will and may stop at any time. The drives are recorded under a code."
    instructions: Text = "Keep the car in its lane and away from the others. Follow the green marks."
    seed: Annotated[int, Interval(ge=0, le=10**9)] = 0
    repetitions: Annotated[int, Interval(ge=1, le=1000)] = 5
    devices: Annotated[tuple[Literal["keyboard", "gamepad", "wheel"], ...], Field(strict=False), Len(1)] = ("wheel",)
    practice: Practice | None = None
    conditions: Annotated[tuple[Condition, ...], Field(strict=False), Len(1, 20)]
    questionnaires: Annotated[tuple[str, ...], Field(strict=False)] = ()

    @model_validator(mode="after")
    def _whole(self) -> Plan:
        names = [condition.name.lower() for condition in self.conditions]  # some file systems know no capitals
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"conditions: the name {name!r} is given twice")
        for name in self.questionnaires:
            if name not in QUESTIONNAIRES:
                raise ValueError(f"questionnaires = {name!r}; {hint(name, QUESTIONNAIRES)}")
        return self

    def seed_of(self, repetition: int) -> int:
        """Seed of a repetition of any condition.

        Args:
            repetition: number from 0.
        """
        return 1000 * self.seed + repetition

    def practice_seed(self, number: int) -> int:
        """Seed of a practice drive, which no trial has.

        Args:
            number: number from 0.
        """
        return 1000 * self.seed + self.repetitions + number


def read_plan(path: Path) -> Plan:
    """Read and check a plan.

    Args:
        path: TOML file.

    Raises:
        ValueError: with the field, its value and what is allowed.
    """
    try:
        values: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {error.strerror or error}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} is no TOML: {error}") from None
    try:
        return Plan.model_validate(values)
    except ValidationError as error:
        raise ValueError(f"{path}: {_explain(error, values)}") from None


def _explain(error: ValidationError, values: dict[str, Any]) -> str:
    """The first error in words: the field, what is wrong, and the nearest name of an unknown one."""
    first = min(error.errors(include_url=False), key=lambda each: each["type"] != "extra_forbidden")
    where = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in first["loc"]).lstrip(".")
    if first["type"] == "extra_forbidden":
        parts: dict[str, type[Part]] = {"practice": Practice, "conditions": Condition}
        kind = parts[str(first["loc"][0])] if len(first["loc"]) > 1 else Plan
        return f"{where} is no field; {hint(first['loc'][-1], kind.model_fields)}"
    if first["type"] == "missing":
        return f"{where} is missing"
    text = first["msg"].removeprefix("Value error, ")
    return (
        f"{where} = {first['input']!r}: {text}" if first["type"] != "value_error" else f"{where}: {text}".lstrip(": ")
    )
