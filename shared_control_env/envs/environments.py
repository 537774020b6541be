"""The environment classes of the scenarios (:mod:`envs.scenarios`), without wrappers."""

from __future__ import annotations

from functools import cache
from typing import Any, ClassVar

from shared_control_env.envs.scenarios import SCENARIOS, Scenario
from shared_control_env.envs.settings import defaults
from shared_control_env.envs.shared_control import SharedControlEnv


class ScenarioEnv(SharedControlEnv):
    """Environment of one scenario. The settings of the scenario are the defaults.

    Attributes:
        scenario: the scenario.
    """

    scenario: ClassVar[Scenario]

    @classmethod
    def default_config(cls) -> dict[str, Any]:
        """All settings, with the values of the scenario."""
        return defaults(cls.scenario.settings)


@cache
def environment_class(name: str) -> type[ScenarioEnv]:
    """Class of the bare environment of a scenario, such as ``TwoLaneEnv`` for ``two_lane``.

    Args:
        name: key of :data:`scenarios.SCENARIOS`.
    """
    scenario = SCENARIOS[name]
    title = "".join(word.capitalize() for word in name.split("_")) + "Env"
    body = {"scenario": scenario, "__doc__": f"{scenario.description}.", "__module__": __name__}
    return type(title, (ScenarioEnv,), body)


def __getattr__(name: str) -> type[ScenarioEnv]:
    """The class of a scenario by its class name; pickle looks classes up in this way."""
    for scenario in SCENARIOS:
        if name.endswith("Env") and environment_class(scenario).__name__ == name:
            return environment_class(scenario)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
