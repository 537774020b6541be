"""The environments of the registered scenarios (:mod:`envs.cases`)."""

from __future__ import annotations

from typing import Any, ClassVar

from shared_control_env.envs.cases import CASES, CURVE, TWO_LANE, Case
from shared_control_env.envs.config import merge
from shared_control_env.envs.shared_control import SharedControlEnv


class ScenarioEnv(SharedControlEnv):
    """Environment of one scenario: its settings are the defaults.

    Attributes:
        case: the scenario.
    """

    case: ClassVar[Case]

    @classmethod
    def default_config(cls) -> dict[str, Any]:
        """Settings of the scenario."""
        return merge(super().default_config(), cls.case.settings)


class TwoLaneEnv(ScenarioEnv):
    """Case 1: lane keeping behind a slower vehicle on a straight two-lane road; the steering degrades."""

    case = TWO_LANE


class CurveEnv(ScenarioEnv):
    """Case 2: following a vehicle round a curve of 60 m radius; the acceleration degrades."""

    case = CURVE


def scenario(name: str) -> type[ScenarioEnv]:
    """Class of the bare environment of a scenario, by its key in :data:`cases.CASES`."""
    written_out = {"two_lane": TwoLaneEnv, "curve": CurveEnv}
    return written_out.get(name) or type(f"{name}_env", (ScenarioEnv,), {"case": CASES[name]})
