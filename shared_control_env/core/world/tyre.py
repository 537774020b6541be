"""Lateral force of one tyre: the interface between the car and the road.

Eq. 11 has linear tyres, ``F = -C slip``, for which the implicit step has a closed form (:mod:`core.world.vehicle`).
Other tyres are functions of the slip angle; every step linearises them about the present slip angle. :func:`add_tyre`
adds a tyre from outside the package. Such a tyre acts on the simulated car only: the controllers still assume linear
tyres.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from shared_control_env.core.compile.calls import Interface
from shared_control_env.nearest import check_new_name

FORCE = Interface((float, float), float, float, float, float)
"""``force(slip, C, mu, F_z) -> force, slope``.

``slip``: slip angle [rad]; ``C``: cornering stiffness at zero slip [N/rad]; ``mu``: friction coefficient [-]; ``F_z``:
vertical load of the tyre [N]. ``force``: lateral force [N], opposed to the slip; ``slope``: derivative of the force
with respect to the slip angle [N/rad], -C at zero slip.
"""

TYRES: dict[str, Callable[..., Any] | None] = {"linear": None}
"""Tyre forces by name; None for the linear tyre, which needs no function."""

STANDARD = tuple(TYRES)
"""Names of the tyres that belong to the package; tyres added later follow them in :data:`TYRES`."""


def add_tyre(name: str, force: Callable[..., Any]) -> None:
    """Add a tyre. Settings can then select it by its name.

    Args:
        name: name of the tyre in ``config["vehicle"]["tyre"]``.
        force: function of the lateral force with the signature :data:`FORCE`; it is compiled here.

    Raises:
        ValueError: if the name is taken, or if numba cannot compile the function.
    """
    check_new_name("tyre", name, TYRES)
    FORCE.address(force)
    TYRES[name] = force


def address_of(name: str) -> int:
    """Address of a tyre's compiled force; 0 for the linear tyre.

    Args:
        name: name of the tyre in :data:`TYRES`.
    """
    force = TYRES[name]
    return 0 if force is None else FORCE.address(force)
