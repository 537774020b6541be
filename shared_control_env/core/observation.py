"""What a driver can perceive, as a bounded vector."""

from __future__ import annotations

from math import pi

import numpy as np

from shared_control_env.core.jit import jit
from shared_control_env.core.parameters import Parameters
from shared_control_env.core.records import NEAR_D, NEAR_S, NEAR_SPEED, PRESENT, Record
from shared_control_env.core.road import curvature_at

PREVIEW = np.array([0.0, 10.0, 20.0, 40.0])
"""Distances ahead at which the road's curvature is seen [m]."""

FEATURES: tuple[tuple[str, float], ...] = (
    ("lateral error y - y_target [m]", 4.0),
    ("heading relative to the road [rad]", pi / 4),
    ("longitudinal speed v_x [m/s]", 40.0),
    ("lateral speed v_y [m/s]", 5.0),
    ("yaw rate r [rad/s]", 1.0),
    ("speed error v_x - v_target [m/s]", 20.0),
    ("curvature at the ego [1/m]", 0.05),
    ("curvature 10 m ahead [1/m]", 0.05),
    ("curvature 20 m ahead [1/m]", 0.05),
    ("curvature 40 m ahead [1/m]", 0.05),
    *(
        (f"{name} {feature}", scale)
        for name in ("follower", "leader", "preceding")
        for feature, scale in (
            ("present [-]", 1.0),
            ("distance along the road [m]", 100.0),
            ("distance across the road [m]", 8.0),
            ("speed minus the ego's [m/s]", 20.0),
        )
    ),
    ("own last acceleration command / a_max [-]", 1.0),
    ("own last steering command / delta_max [-]", 1.0),
    ("alpha_a as displayed [-]", 1.0),
)
"""Name and scale of every entry: the entry is the feature divided by its scale, clipped to [-1, 1]."""

_SCALES = np.array([scale for _, scale in FEATURES])


@jit
def observe(scene: Record, memory: Record, line: np.ndarray, p: Parameters, out: np.ndarray) -> None:
    """Write the observation of a scene: :data:`FEATURES` over their scales, clipped.

    The fault, the automation's command and its risk are not in it.

    Args:
        scene: record of :data:`records.SCENE`.
        memory: record of :data:`records.MEMORY`: the driver's last command, and alpha_a.
        line: reference line.
        p: parameters.
        out: written, float32, shape (25,).
    """
    z = scene.z
    out[0], out[1], out[2], out[3], out[4] = z[1] - scene.y_target, z[2], z[3], z[4], z[5]
    out[5] = z[3] - scene.v_target
    n = 6
    for i in range(PREVIEW.shape[0]):
        out[n] = curvature_at(line, z[0] + PREVIEW[i], 0.0)
        n += 1
    for i in range(3):
        near = scene.neighbours[i]
        if near[PRESENT] > 0.0:
            out[n], out[n + 1], out[n + 2] = 1.0, near[NEAR_S] - z[0], near[NEAR_D] - z[1]
            out[n + 3] = near[NEAR_SPEED] - z[3]
        else:
            out[n], out[n + 1], out[n + 2], out[n + 3] = 0.0, 0.0, 0.0, 0.0
        n += 4
    out[n] = memory.u_h_des[0] / p.limits.a_max
    out[n + 1] = memory.u_h_des[1] / p.limits.delta_max
    out[n + 2] = memory.alpha_a
    for i in range(out.shape[0]):
        out[i] = min(max(out[i] / _SCALES[i], -1.0), 1.0)
