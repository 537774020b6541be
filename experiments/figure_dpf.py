"""Figure 5: the dynamic potential field over distance and relative speed, and the resulting risk."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from experiments import style
from experiments.case_runs import PRESETS
from shared_control_env.core.parameters import LongitudinalRiskParameters
from shared_control_env.core.risk.longitudinal import dynamic_field, pair_risk, safe_distance

V_OBSTACLE = 12.0
"""Speed of the obstacle, equal to that of the preceding vehicle in Case 1 [m/s]."""


def draw(path: Path) -> None:
    """Draw the field U^d and the ratio of Eq. 7 for each preset.

    Args:
        path: file of the picture.
    """
    distances = np.linspace(-30.0, 30.0, 201)
    speeds = np.linspace(-5.0, 5.0, 101)
    with style.figure(path, 2, 2, (11.0, 7.0)) as (fig, axes):
        for row, preset in zip(axes, PRESETS, strict=True):
            p = LongitudinalRiskParameters(graded=preset == "graded")
            field = np.array(
                [
                    [dynamic_field(dv, dx, safe_distance(V_OBSTACLE + dv, V_OBSTACLE, p), p) for dx in distances]
                    for dv in speeds
                ]
            )
            risk = np.array([[pair_risk(V_OBSTACLE + dv, V_OBSTACLE, dx, p) for dx in distances] for dv in speeds])
            for axis, values, name in ((row[0], field, "field $U^d$"), (row[1], risk, "risk of the pair")):
                mesh = axis.pcolormesh(distances, speeds, values, shading="auto", cmap="magma_r")
                fig.colorbar(mesh, ax=axis)
                axis.set(
                    title=f"{name}, preset {preset}",
                    xlabel=r"$\Delta x$ [m], obstacle ahead > 0",
                    ylabel=r"$\Delta v$ [m/s], ego faster > 0",
                )
