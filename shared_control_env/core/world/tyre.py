"""Lateral force of one tyre: the interface between the car and the road.

Eq. 11 has linear tyres, ``F = -C slip``, for which the implicit step has a closed form (:mod:`core.world.vehicle`).
Other tyres are functions of the slip; every step takes their secant at the present slip as stiffness. ``fiala`` is the
brush model. :func:`add_tyre` adds a tyre from outside the package. Such tyres act on the simulated car and on the
prediction of the risk assessment; the controllers assume linear tyres.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from shared_control_env.core.compile.calls import Interface
from shared_control_env.nearest import check_new_name

FORCE = Interface((float, float), float, float, float, float)
"""``force(slip, C, mu, F_z) -> force, slope``.

``slip``: slip angle of Eq. 11 [rad]; ``C``: cornering stiffness at zero slip [N/rad]; ``mu``: friction coefficient that
the lateral force can use [-]; ``F_z``: vertical load of the tyre [N]. ``force``: lateral force [N], opposed to the
slip; ``slope``: derivative of the force with respect to the slip [N/rad], -C at zero slip.
"""


def fiala(slip: float, C: float, mu: float, F_z: float) -> tuple[float, float]:
    """Lateral force of the brush model with one friction coefficient.

    ::

        F = -C slip (1 - q + q^2 / 3)   with q = C |slip| / (3 mu F_z),   where q < 1
        F = -mu F_z sign(slip)          where the whole contact patch slides, q >= 1

    The model is that of Fiala (Seitenkraefte am rollenden Luftreifen, VDI-Zeitschrift 96, 1954) as in Pacejka, Tire and
    Vehicle Dynamics, Section 3.2. The models' tan(alpha) is read as the slip of Eq. 11, a ratio of velocities.

    Args:
        slip, C, mu, F_z: as in :data:`FORCE`.

    Returns:
        Force [N] and its derivative with respect to the slip [N/rad].
    """
    limit = mu * F_z
    q = C * abs(slip) / (3.0 * limit)
    if q >= 1.0:
        return (-limit if slip > 0.0 else limit), 0.0
    return -C * slip * (1.0 - q + q * q / 3.0), -C * (1.0 - q) * (1.0 - q)


TYRES: dict[str, Callable[..., Any] | None] = {"linear": None, "fiala": fiala}
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
