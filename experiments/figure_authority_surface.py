"""Figure 7: the authority alpha_a as a function of both risks."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from experiments import style
from shared_control_env.core.authority.fuzzy import OPERATORS, authority


def draw(path: Path) -> None:
    """Draw one panel for each choice of the operators.

    Args:
        path: file of the picture.
    """
    risks = np.linspace(0.0, 1.0, 101)
    with style.figure(path, 1, 2, (10.0, 4.0)) as (fig, axes):
        for axis, (code, name) in zip(axes[0], enumerate(OPERATORS), strict=True):
            surface = np.array([[authority(r_x, r_y, code) for r_x in risks] for r_y in risks])
            filled = axis.contourf(risks, risks, surface, levels=np.linspace(0.0, 1.0, 21), cmap="viridis")
            rise = max(np.diff(surface, axis=0).max(), np.diff(surface, axis=1).max(), 0.0)
            axis.set(
                title=f"{name}: largest rise along growing risk {rise:.1e}",
                xlabel="longitudinal risk $r_x$",
                ylabel="lateral risk $r_y$",
            )
        fig.colorbar(filled, ax=axes, label=r"$\alpha_a$")
