"""Lateral force of one tyre: the seam between the car and the road.

Eq. 11 has linear tyres, ``F = -C slip``, whose implicit step is closed (:mod:`core.world.vehicle`). Other tyres are
functions of the slip angle, linearised in every step about the present slip. :func:`add_tyre` adds one from outside the
package; it drives the car, and the controllers go on to believe in linear ones.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from shared_control_env.core.compile.calls import Interface

FORCE = Interface((float, float), float, float, float, float)
"""``force(slip, C, mu, F_z) -> force, slope``.

``slip``: slip angle [rad]; ``C``: cornering stiffness at zero slip [N/rad]; ``mu``: friction [-]; ``F_z``: load of the
tyre [N]. ``force``: lateral force [N], against the slip; ``slope``: its derivative by the slip [N/rad], -C at zero.
"""

TYRES: dict[str, Callable[..., Any] | None] = {"linear": None}
"""Tyres by name; None for the linear ones, which need no function."""


def add_tyre(name: str, force: Callable[..., Any]) -> None:
    """Add a tyre, which settings may select from then on.

    Args:
        name: in ``config["vehicle"]["tyre"]``.
        force: compiled as :data:`FORCE`.

    Raises:
        ValueError: if the name is taken, or numba cannot compile it.
    """
    if name in TYRES:
        raise ValueError(f"tyre {name!r} is there already")
    FORCE.address(force)
    TYRES[name] = force


def address_of(name: str) -> int:
    """Where a tyre's compiled force is; 0 for the linear one.

    Args:
        name: key of :data:`TYRES`.
    """
    force = TYRES[name]
    return 0 if force is None else FORCE.address(force)
