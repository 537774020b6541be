"""Figure 6: membership functions of the two risks and of the authority."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from experiments import style
from shared_control_env.core.authority.fuzzy import AUTHORITY_TERMS, membership

PANELS = (
    ("(a) lateral risk $r_y$", ("VS", "S", "M", "B", "VB")),
    ("(b) longitudinal risk $r_x$", ("VS", "S", "M", "L", "VL")),
    (r"(c) authority $\alpha_a$ before rescaling", AUTHORITY_TERMS),
)


def draw(path: Path) -> None:
    """Draw three panels, one for each variable.

    Args:
        path: file of the picture.
    """
    values = np.linspace(0.0, 1.0, 401)
    with style.figure(path, 1, 3, (12.0, 2.8)) as (_, axes):
        for axis, (title, terms) in zip(axes[0], PANELS, strict=True):
            for i, term in enumerate(terms):
                axis.plot(values, [membership(value, i, len(terms)) for value in values], label=term)
            axis.set(title=title, ylim=(0.0, 1.25), ylabel="degree [-]")
            axis.legend(ncols=len(terms), fontsize=6, loc="upper center", columnspacing=0.8, handlelength=1.0)
