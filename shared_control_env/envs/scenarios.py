"""The environments of the registered scenarios (:mod:`envs.cases`)."""

from __future__ import annotations

from typing import Any, ClassVar

from shared_control_env.envs import cases
from shared_control_env.envs.cases import CASES, Case
from shared_control_env.envs.settings import merge
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

    case = cases.TWO_LANE


class CurveEnv(ScenarioEnv):
    """Case 2: following a vehicle round a curve of 60 m radius; the acceleration degrades."""

    case = cases.CURVE


class LaneKeepingEnv(ScenarioEnv):
    """Straight road, two lanes: keep the lane behind a slower vehicle, with others beside."""

    case = cases.LANE_KEEPING


class BendEnv(ScenarioEnv):
    """A curve to either side, free road."""

    case = cases.BEND


class SCurveEnv(ScenarioEnv):
    """Two arcs one after the other, free road."""

    case = cases.S_CURVE


class LaneChangeEnv(ScenarioEnv):
    """Change to the left lane past a slower vehicle, in traffic."""

    case = cases.LANE_CHANGE


class CutInEnv(ScenarioEnv):
    """A vehicle from the left lane cuts in."""

    case = cases.CUT_IN


class LeadBrakingEnv(ScenarioEnv):
    """The vehicle ahead brakes to a stop."""

    case = cases.LEAD_BRAKING


class DenseTrafficEnv(ScenarioEnv):
    """Eight vehicles that follow one another and the ego."""

    case = cases.DENSE_TRAFFIC


class CurveWithLeadEnv(ScenarioEnv):
    """A curve to either side behind a vehicle."""

    case = cases.CURVE_WITH_LEAD


_CLASSES: tuple[type[ScenarioEnv], ...] = (
    *(TwoLaneEnv, CurveEnv, LaneKeepingEnv, BendEnv, SCurveEnv, LaneChangeEnv, CutInEnv, LeadBrakingEnv),
    *(DenseTrafficEnv, CurveWithLeadEnv),
)


def scenario(name: str) -> type[ScenarioEnv]:
    """Class of the bare environment of a scenario, by its key in :data:`cases.CASES`."""
    return next(each for each in _CLASSES if each.case is CASES[name])
