"""What the page draws: the road once, and a frame for each time step."""

from __future__ import annotations

from math import ceil
from typing import Any

import numpy as np

from shared_control_env.core.records import BODY_LENGTH, BODY_WIDTH, HEADING, SPEED, YAW_RATE, X, Y
from shared_control_env.core.world.replay import AWAY
from shared_control_env.core.world.road import RIGHT, point_at
from shared_control_env.drive.session import Drive
from shared_control_env.envs.settings.checks import LEAD_IN

SPACING = 2.0
"""Distance between the points of the road's line [m]."""

FASTEST = 45.0
"""Speed that the drawn length of a road allows for [m/s]."""

AHEAD = 300.0
"""Length of road that is drawn beyond the distance of an episode [m]."""

SHOWN = ("authority", "risk", "fault", "commands")
"""What a condition may show to the person, beside speed and position."""


def road_of(drive: Drive) -> dict[str, Any]:
    """The road as a line of poses, with its lanes.

    Args:
        drive: the drive.
    """
    env, settings = drive.env, drive.settings
    reach = min(env.parameters["task"]["road_end"], FASTEST * settings.duration) + AHEAD
    n = ceil((reach + LEAD_IN) / SPACING)
    line = [point_at(env.line, -LEAD_IN + SPACING * i, 0.0) for i in range(n + 1)]
    return {
        "line": np.round(line, 4).tolist(),
        "start": -LEAD_IN,
        "spacing": SPACING,
        "low": float(env.line[0, RIGHT]),
        "lanes": settings.road.lanes,
        "lane_width": settings.road.lane_width,
        "body": [settings.vehicle.length, settings.vehicle.width],
        "duration": settings.duration,
        "dt": drive.dt,
        "limits": [drive.limits.a_max, drive.limits.delta_max],
    }


def frame_of(drive: Drive, shown: tuple[str, ...]) -> dict[str, Any]:
    """The present scene, and what the gauges show.

    Args:
        drive: the drive.
        shown: what the condition shows, of :data:`SHOWN`.
    """
    env, info = drive.env, drive.info
    scene = env.scene
    x, y, psi, speed, _, yaw_rate = scene["state"].tolist()
    frame: dict[str, Any] = {
        "t": round(float(scene["t"]), 3),
        "k": int(scene["k"]),
        "ego": _rounded((x, y, psi, speed, yaw_rate)),
        "s": round(float(scene["z"][0]), 2),
        "d": round(float(scene["z"][1]), 3),
        "y_target": round(float(scene["y_target"]), 2),
        "v_target": round(float(scene["v_target"]), 2),
        "others": [
            _rounded(row[[X, Y, HEADING, SPEED, YAW_RATE, BODY_LENGTH, BODY_WIDTH]].tolist())
            for row in env.traffic
            if row[X] != AWAY
        ],
        "wheel": _rounded(info["u_h_act"][0].tolist()),
        "crashed": bool(info["crashed"][0]),
        "on_road": bool(info["on_road"][0]),
    }
    if "authority" in shown:
        frame["alpha"], frame["alert"] = _rounded(info["alpha"][0].tolist()), int(info["alert"][0])
    if "risk" in shown:
        frame["risk"] = _rounded((float(info["r_x"][0]), float(info["r_y"][0])))
    if "fault" in shown:
        frame["fault"] = bool(info["fault_active"][0])
    if "commands" in shown:
        frame["automation"], frame["command"] = _rounded(info["u_a_act"][0].tolist()), _rounded(info["u"][0].tolist())
    return frame


def _rounded(values: Any) -> list[float]:
    return [round(value, 4) for value in values]
