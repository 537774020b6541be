"""The registered scenarios as settings: the paper's two cases, and ten scenarios drawn within ranges."""

from __future__ import annotations

from typing import Any, NamedTuple

import gymnasium as gym

from shared_control_env.nearest import check_new_name


class Scenario(NamedTuple):
    """A registered scenario.

    Attributes:
        id: Gymnasium id.
        description: description in one line.
        settings: changes to the default settings.
    """

    id: str
    description: str
    settings: dict[str, Any]


def _draw(setting: str, low: float, high: float) -> dict[str, Any]:
    return {"setting": setting, "low": low, "high": high}


def _choose(setting: str, *choices: float) -> dict[str, Any]:
    return {"setting": setting, "choices": list(choices)}


DRAWN_V1 = (
    *("bias_ramp", "step_bias", "loss_of_effectiveness", "stuck", "rate_limit", "saturation", "delay"),
    *("white_noise", "coloured_noise", "oscillation", "drop_out", "intermittent", "sign_error"),
    *("lane_offset", "missed_lead", "complete_failure"),
)
"""Degradations that the drawn scenarios of version 1 draw from. Degradations added to the library are not included."""

ON_THE_ROAD: dict[str, Any] = {
    "degradations": list(DRAWN_V1),
    "vehicle": {"tyre": "fiala"},
    "task": {"time_headway": 1.2},
}
"""Settings that all drawn scenarios share: degradations, tyres that slide, and a time headway that is kept.

1.2 s lies between the smallest time headway of ISO 15622 (0.8 s) and the 1.5 s of highway-env's drivers.
"""

_CURVATURES = [sign / radius for radius in (60.0, 80.0, 120.0, 200.0) for sign in (1.0, -1.0)]
"""Curvatures of the drawn curves, to the left and to the right [1/m]."""

_BEND_ROAD = {"segments": [{"length": 25.0, "curvature": 0.0}, {"length": 250.0, "curvature": 1.0 / 60.0}]}
"""A straight segment, then an arc whose curvature is drawn."""

TWO_LANE = Scenario(
    id="SharedControl/TwoLane-v1",
    description="Case 1: straight, two lanes, following a slower vehicle at 12 m/s; steering drifts off by 0.3 rad",
    settings={
        "vehicles": [
            {"lane": 0, "position": 38.0, "speed": 12.0},  # preceding
            {"lane": 1, "position": 30.0, "speed": 15.0},  # leader
            {"lane": 1, "position": -5.0, "speed": 12.0},  # follower
        ],
        # delta_f = delta_des + 0.3 (k - 10) / 20 for 10 <= k <= 30, then + 0.3.
        "faults": [{"channel": "steering", "onset": 0.5, "ramp": 1.0, "size": 0.3}],
    },
)
"""Case 1 (Section VI-B, Table VI): lane keeping behind a slower vehicle on a straight road; the steering degrades."""

CURVE = Scenario(
    id="SharedControl/Curve-v1",
    description="Case 2: curve of 60 m radius behind a vehicle at 12 m/s; acceleration drifts off by 3 m/s^2",
    settings={
        "road": {"segments": [{"length": 300.0, "curvature": 1.0 / 60.0}]},
        "ego": {"speed": 12.0},
        "vehicles": [{"lane": 0, "position": 15.0, "speed": 12.0}],
        # a_f = a_des + 3 (k - 5) / 5 for 5 < k <= 10, then + 3.
        "faults": [{"channel": "acceleration", "onset": 0.25, "ramp": 0.25, "size": 3.0}],
        "screen_height": 632,
    },
)
"""Case 2 (Section VI-C): following a vehicle round a curve of 60 m radius; the acceleration degrades."""

LANE_KEEPING = Scenario(
    id="SharedControl/LaneKeeping-v1",
    description="straight, two lanes: keep the lane behind a slower vehicle, with others beside",
    settings={
        "vehicles": [
            {"lane": 0, "position": 45.0, "speed": 12.0},
            {"lane": 1, "position": 30.0, "speed": 15.0},
            {"lane": 1, "position": -15.0, "speed": 13.0},
        ],
        **ON_THE_ROAD,
        "randomise": [
            _draw("ego.speed", 12.0, 18.0),
            _draw("ego.lateral_offset", -0.3, 0.3),
            _draw("task.target_speed", 12.0, 18.0),
            _draw("vehicles.0.position", 30.0, 60.0),
            _draw("vehicles.0.speed", 9.0, 14.0),
            _draw("vehicles.1.position", 15.0, 45.0),
            _draw("vehicles.1.speed", 13.0, 18.0),
            _draw("vehicles.2.position", -25.0, -10.0),
            _draw("vehicles.2.speed", 11.0, 15.0),
        ],
    },
)

BEND = Scenario(
    id="SharedControl/Bend-v1",
    description="a curve of 60 to 200 m radius to either side, free road",
    settings={
        "road": _BEND_ROAD,
        "ego": {"speed": 12.0},
        **ON_THE_ROAD,
        "screen_height": 632,
        "randomise": [
            _choose("road.segments.1.curvature", *_CURVATURES),
            _draw("ego.speed", 9.0, 13.0),
            _draw("ego.lateral_offset", -0.3, 0.3),
            _draw("task.target_speed", 9.0, 13.0),
        ],
    },
)

S_CURVE = Scenario(
    id="SharedControl/SCurve-v1",
    description="an S-curve, two arcs of 60 to 200 m radius, free road",
    settings={
        "road": {
            "segments": [
                {"length": 25.0, "curvature": 0.0},
                {"length": 50.0, "curvature": 1.0 / 60.0},
                {"length": 50.0, "curvature": -1.0 / 60.0},
                {"length": 400.0, "curvature": 0.0},
            ]
        },
        "ego": {"speed": 12.0},
        **ON_THE_ROAD,
        "screen_height": 632,
        "randomise": [
            _draw("road.segments.1.curvature", 1.0 / 200.0, 1.0 / 60.0),
            _draw("road.segments.2.curvature", -1.0 / 60.0, -1.0 / 200.0),
            _draw("ego.speed", 9.0, 13.0),
            _draw("ego.lateral_offset", -0.3, 0.3),
            _draw("task.target_speed", 9.0, 13.0),
        ],
    },
)

LANE_CHANGE = Scenario(
    id="SharedControl/LaneChange-v1",
    description="change to the left lane past a slower vehicle; both lanes are the driving region",
    settings={
        "lane_change": {"onset": 1.5, "duration": 4.0, "lane": 1},
        "vehicles": [
            {"lane": 0, "position": 40.0, "speed": 10.0},
            {"lane": 1, "position": 45.0, "speed": 15.0},
            {"lane": 1, "position": -20.0, "speed": 13.0},
        ],
        **ON_THE_ROAD,
        "randomise": [
            _draw("lane_change.onset", 1.0, 2.0),
            _draw("lane_change.duration", 3.5, 5.0),
            _draw("ego.speed", 13.0, 16.0),
            _draw("vehicles.0.position", 35.0, 50.0),
            _draw("vehicles.0.speed", 9.0, 12.0),
            _draw("vehicles.1.position", 35.0, 60.0),
            _draw("vehicles.1.speed", 14.0, 17.0),
            _draw("vehicles.2.position", -30.0, -15.0),
            _draw("vehicles.2.speed", 11.0, 14.0),
        ],
    },
)

CUT_IN = Scenario(
    id="SharedControl/CutIn-v1",
    description="a vehicle from the left lane cuts in before the ego",
    settings={
        "vehicles": [
            {
                "lane": 1,
                "position": 16.0,
                "speed": 13.0,
                "lane_change": {"onset": 2.0, "duration": 3.0, "lane": 0},
            },
            {"lane": 0, "position": 60.0, "speed": 13.0},
        ],
        **ON_THE_ROAD,
        "randomise": [
            _draw("ego.speed", 13.0, 15.0),
            _draw("vehicles.0.position", 14.0, 20.0),
            _draw("vehicles.0.speed", 12.0, 14.0),
            _draw("vehicles.0.lane_change.onset", 1.0, 2.5),
            _draw("vehicles.0.lane_change.duration", 2.0, 3.5),
            _draw("vehicles.1.position", 50.0, 80.0),
        ],
    },
)

LEAD_BRAKING = Scenario(
    id="SharedControl/LeadBraking-v1",
    description="the vehicle ahead brakes hard, to a stop",
    settings={
        "ego": {"speed": 14.0},
        "vehicles": [
            {"lane": 0, "position": 30.0, "speed": 14.0, "brake": {"onset": 2.5, "deceleration": 4.5}},
            {"lane": 1, "position": -15.0, "speed": 14.0},
        ],
        **ON_THE_ROAD,
        "randomise": [
            _draw("ego.speed", 13.0, 15.0),
            _draw("vehicles.0.position", 25.0, 40.0),
            _draw("vehicles.0.speed", 13.0, 15.0),
            _draw("vehicles.0.brake.onset", 1.5, 3.5),
            _draw("vehicles.0.brake.deceleration", 3.0, 6.0),
            _draw("vehicles.1.position", -25.0, -10.0),
        ],
    },
)

_DENSE = [(0, 22.0), (0, 44.0), (0, 66.0), (0, -20.0), (1, 8.0), (1, 30.0), (1, 52.0), (1, -14.0)]
"""Lane and nominal position [m] of each vehicle of dense traffic; positions are drawn within 4 m of these."""

DENSE_TRAFFIC = Scenario(
    id="SharedControl/DenseTraffic-v1",
    description="eight vehicles that follow one another and the ego by the Intelligent Driver Model",
    settings={
        "ego": {"speed": 10.0},
        "vehicles": [
            {"lane": lane, "position": position, "speed": 10.0, "behaviour": "idm", "desired_speed": 13.0}
            for lane, position in _DENSE
        ],
        **ON_THE_ROAD,
        "randomise": [
            _draw("ego.speed", 9.0, 11.0),
            *(
                entry
                for i, (_, position) in enumerate(_DENSE)
                for entry in (
                    _draw(f"vehicles.{i}.position", position - 4.0, position + 4.0),
                    _draw(f"vehicles.{i}.speed", 8.0, 12.0),
                    _draw(f"vehicles.{i}.desired_speed", 9.0, 15.0),
                )
            ),
        ],
    },
)

CURVE_WITH_LEAD = Scenario(
    id="SharedControl/CurveWithLead-v1",
    description="a curve of 60 to 200 m radius to either side behind a vehicle that follows the road at 9 to 12 m/s",
    settings={
        "road": _BEND_ROAD,
        "ego": {"speed": 12.0},
        "vehicles": [{"lane": 0, "position": 20.0, "speed": 11.0}],
        **ON_THE_ROAD,
        "screen_height": 632,
        "randomise": [
            _choose("road.segments.1.curvature", *_CURVATURES),
            _draw("ego.speed", 10.0, 13.0),
            _draw("vehicles.0.position", 15.0, 25.0),
            _draw("vehicles.0.speed", 9.0, 12.0),
        ],
    },
)

WET_ROAD = Scenario(
    id="SharedControl/WetRoad-v1",
    description="a wet curve of 60 to 200 m radius to either side (friction 0.5), behind a vehicle at 8 to 11 m/s",
    settings={
        **ON_THE_ROAD,
        "road": _BEND_ROAD,
        "ego": {"speed": 11.0},
        "vehicle": {**ON_THE_ROAD["vehicle"], "mu": 0.5},
        "vehicles": [{"lane": 0, "position": 25.0, "speed": 10.0}],
        "screen_height": 632,
        "randomise": [
            _choose("road.segments.1.curvature", *_CURVATURES),
            _draw("ego.speed", 9.0, 12.0),
            _draw("ego.lateral_offset", -0.3, 0.3),
            _draw("task.target_speed", 9.0, 12.0),
            _draw("vehicles.0.position", 20.0, 40.0),
            _draw("vehicles.0.speed", 8.0, 11.0),
        ],
    },
)

MOTORWAY = Scenario(
    id="SharedControl/Motorway-v1",
    description="a motorway at 25 to 33 m/s, curves of 500 to 1500 m radius, behind a vehicle and beside others",
    settings={
        **ON_THE_ROAD,
        "road": {"segments": [{"length": 50.0, "curvature": 0.0}, {"length": 450.0, "curvature": 1.0 / 1000.0}]},
        "ego": {"speed": 29.0},
        "task": {**ON_THE_ROAD["task"], "target_speed": 29.0},
        "vehicles": [
            {"lane": 0, "position": 80.0, "speed": 26.0},
            {"lane": 1, "position": 50.0, "speed": 31.0},
            {"lane": 1, "position": -40.0, "speed": 30.0},
        ],
        "screen_height": 632,
        "randomise": [
            _choose(
                "road.segments.1.curvature", *(sign / r for r in (500.0, 750.0, 1000.0, 1500.0) for sign in (1, -1))
            ),
            _draw("ego.speed", 25.0, 33.0),
            _draw("ego.lateral_offset", -0.3, 0.3),
            _draw("task.target_speed", 25.0, 33.0),
            _draw("vehicles.0.position", 60.0, 110.0),
            _draw("vehicles.0.speed", 24.0, 30.0),
            _draw("vehicles.1.position", 30.0, 80.0),
            _draw("vehicles.1.speed", 28.0, 34.0),
            _draw("vehicles.2.position", -48.0, -25.0),
            _draw("vehicles.2.speed", 26.0, 32.0),
        ],
    },
)

RECORDED = Scenario(
    id="SharedControl/Recorded-v1",
    description="recorded traffic: the ego takes the place of a vehicle of a recording",
    settings={
        **ON_THE_ROAD,
        "recording": {"file": "example", "ego": None, "drawn": False},
        "duration": 8.0,
        "screen_height": 632,
    },
)
"""Traffic of a file, see :mod:`envs.recorded`; by default the small one that comes with the package."""

SCENARIOS: dict[str, Scenario] = {
    "two_lane": TWO_LANE,
    "curve": CURVE,
    "lane_keeping": LANE_KEEPING,
    "bend": BEND,
    "s_curve": S_CURVE,
    "lane_change": LANE_CHANGE,
    "cut_in": CUT_IN,
    "lead_braking": LEAD_BRAKING,
    "dense_traffic": DENSE_TRAFFIC,
    "curve_with_lead": CURVE_WITH_LEAD,
    "wet_road": WET_ROAD,
    "motorway": MOTORWAY,
    "recorded": RECORDED,
}
"""All scenarios by the name that the benchmark and the entry points use."""

STANDARD = tuple(SCENARIOS)
"""Names of the scenarios that the package defines; user-defined scenarios come after them."""


ENTRY = "scenario_"
"""Begins the name of a scenario's entry point, so that it cannot be that of something else in the module."""


def add_scenario(name: str, scenario: Scenario) -> None:
    """Add a scenario: under its name for suites of the benchmark, and under its id with Gymnasium.

    Args:
        name: name for the benchmark, such as ``roundabout``.
        scenario: the scenario; its settings are checked when an environment is made.

    Raises:
        ValueError: if the name or the id is taken.
    """
    from shared_control_env.envs.settings.changes import as_plain  # whose import takes time

    check_new_name("scenario", name, SCENARIOS)
    if not name.isidentifier():
        raise ValueError(f"scenario: its name = {name!r} must be an identifier, such as my_road")
    if scenario.id in gym.registry:
        raise ValueError(f"id {scenario.id!r} is registered already")
    SCENARIOS[name] = scenario._replace(settings=as_plain(scenario.settings))
    try:
        register(name)
    except Exception:
        del SCENARIOS[name]
        raise


def register(name: str) -> None:
    """Register the id of a scenario with Gymnasium.

    The authority limiter is applied, so the action of the registered environment is the driver's command.

    Args:
        name: key of :data:`SCENARIOS`.
    """
    gym.register(
        id=SCENARIOS[name].id,
        entry_point=f"shared_control_env.wrappers.limited:{ENTRY}{name}",
        vector_entry_point=f"shared_control_env.vector.environment:{ENTRY}{name}",
    )
