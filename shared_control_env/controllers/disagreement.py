"""Allocators that limit the automation where it disagrees: with the driver, or with what the scene explains."""

from __future__ import annotations

from math import exp

import numpy as np

from shared_control_env.controllers.allocators import Allocation
from shared_control_env.controllers.assessor import Assessor
from shared_control_env.controllers.stateless import Stateless
from shared_control_env.core.authority.alerts import ALERTS, NO_ALERT, TACTILE, VISUAL
from shared_control_env.core.authority.barrier import barrier
from shared_control_env.core.parameters import Limits, VehicleParameters

_LIMITS = np.array(list(Limits()))
_CAR = VehicleParameters()


class IntentAuthority(Stateless):
    """Authority by agreement with the driver, after policy blending.

    ``c = 1 - |u_a,f - u_h,des| / bound`` and ``alpha = clip((c - c_0) / (c_1 - c_0), 0, 1)`` in each channel, with the
    driver's last desired command. The arbitration by a clipped line is that of Dragan & Srinivasa, A policy-blending
    formalism for shared control, International Journal of Robotics Research 32(7), 2013; the agreement is ours. A
    driver whose hands rest goes along with the automation, so that agreement then means nothing.

    Args:
        none: c_0, agreement at or below which the automation has no authority, range [0, c_1) [-]; ours.
        full: c_1, agreement from which it has full authority, range (c_0, 1] [-]; ours.

    Raises:
        ValueError: unless 0 <= none < full <= 1.
    """

    def __init__(self, none: float = 0.8, full: float = 0.95) -> None:
        if not 0.0 <= none < full <= 1.0:
            raise ValueError(f"none = {none!r} and full = {full!r} must satisfy 0 <= none < full <= 1")
        self.none, self.full = none, full

    def allocate(self, scene: np.ndarray, signals: np.ndarray) -> np.ndarray:
        """Authorities over both channels, shape (2,) [-].

        Args:
            scene: record of :data:`core.records.SCENE`; not used.
            signals: record of :data:`core.records.SIGNALS`; ``u_a_f`` and the last ``u_h_des`` are used.
        """
        agreement = 1.0 - np.abs(signals["u_a_f"] - signals["u_h_des"]) / _LIMITS
        return np.clip((agreement - self.none) / (self.full - self.none), 0.0, 1.0)


USUAL = np.array([0.2, 0.003])
"""Usual size of the residual without a fault, acceleration and steering [m/s^2, rad].

Root mean square in the ten drawn scenarios with seeds 0 to 9 without a fault, rounded up: 0.18 and 0.0026. The gains of
:class:`ResidualAuthority` are the least-squares fit to the same episodes.
"""


class ResidualAuthority:
    """Fault detection by a cumulative sum of the disagreement between u_a,f and what the scene explains.

    ::

        u_scene = [g (v_target - v_x),
                   L (0.8 kappa + 0.2 kappa') - k_y (y - y_target) - k_psi psi],  clipped to the limits
        r       = low-pass of u_a,f - u_scene, time constant tau
        S       = min(2 h, max(0, S + (|r| / sigma - allowance) dt))
        alpha   = clip(2 - 2 S / h, 0, 1)     in each channel

    The driver is called by sight where S exceeds h / 2, and by touch where it exceeds h, in either channel. It needs no
    u_a,des. CUSUM: Page, Continuous inspection schemes, Biometrika 41, 1954.

    Args:
        threshold: h [s]; range (0, inf). The default gives one false alarm or fewer in an hour of the drawn scenarios.
        allowance: multiple of the usual residual that does not add up, range [0, inf) [-].
        time_constant: tau, range (0, inf) [s]; ours.

    Raises:
        ValueError: for a value out of its range.
    """

    SPEED, PREVIEW, LATERAL, HEADING = 0.65, 0.2, 0.136, 0.62
    """g [1/s], share of the curvature kappa' some steps ahead [-], k_y [rad/m] and k_psi [-]; fitted."""

    AHEAD = 9
    """Number of time steps to the curvature ahead."""

    def __init__(self, threshold: float = 1.0, allowance: float = 6.0, time_constant: float = 0.1) -> None:
        for name, value, least in (
            ("threshold", threshold, 0.0),
            ("allowance", allowance, -1e-300),
            ("time_constant", time_constant, 0.0),
        ):
            if not least < value < np.inf:
                raise ValueError(f"{name} = {value!r} must be finite and {'above' if least == 0.0 else 'at least'} 0")
        self.threshold, self.allowance, self.time_constant = threshold, allowance, time_constant
        self.reset()

    def reset(self, seed: int | None = None) -> None:
        """Begin an episode without suspicion.

        Args:
            seed: not used.
        """
        self.sums, self._residual = np.zeros(2), np.zeros(2)
        self._t: float | None = None

    def explained(self, scene: np.ndarray) -> np.ndarray:
        """The command that the scene explains, ``[a, delta]`` [m/s^2, rad], shape (2,).

        Args:
            scene: record of :data:`core.records.SCENE`.
        """
        z, curvature = scene["z"], scene["kappa"]
        kappa = (1.0 - self.PREVIEW) * float(curvature[0]) + self.PREVIEW * float(curvature[self.AHEAD])
        a = self.SPEED * (float(scene["v_target"]) - z[3])
        delta = (_CAR.l_f + _CAR.l_r) * kappa - self.LATERAL * (z[1] - scene["y_target"]) - self.HEADING * z[2]
        return np.clip([a, delta], -_LIMITS, _LIMITS)

    def allocate(self, scene: np.ndarray, signals: np.ndarray) -> Allocation:
        """Authorities over both channels, and the alert.

        Args:
            scene: record of :data:`core.records.SCENE`.
            signals: record of :data:`core.records.SIGNALS`; ``u_a_f`` is used.
        """
        t = float(scene["t"])
        dt = 0.0 if self._t is None else t - self._t
        self._t = t
        fresh = 1.0 - exp(-dt / self.time_constant)
        self._residual += fresh * (signals["u_a_f"] - self.explained(scene) - self._residual)
        grown = self.sums + (np.abs(self._residual) / USUAL - self.allowance) * dt
        self.sums = np.clip(grown, 0.0, 2.0 * self.threshold)
        worst = self.sums.max()
        alert = TACTILE if worst > self.threshold else VISUAL if worst > 0.5 * self.threshold else NO_ALERT
        return Allocation(np.clip(2.0 - 2.0 * self.sums / self.threshold, 0.0, 1.0), ALERTS[alert])


class Guardian(ResidualAuthority):
    """Barrier functions limit what acts; a cumulative sum notices what is missing, and calls the driver; ours.

    Each of the two does what the other cannot: a limiter cannot supply a command that is lost, and an alarm comes too
    late for a command that runs away. The authority of each channel is that of :mod:`core.authority.barrier`, the alert
    that of :class:`ResidualAuthority`. The arguments are those of :class:`ResidualAuthority`.
    """

    needs_assess = True

    def allocate(self, scene: np.ndarray, signals: np.ndarray, assess: Assessor) -> Allocation:  # type: ignore[override]
        """Authorities over both channels, and the alert.

        Args:
            scene: record of :data:`core.records.SCENE`.
            signals: record of :data:`core.records.SIGNALS`; ``u_a_f`` is used.
            assess: the environment's present step.
        """
        over_a, over_delta, _ = assess.decide(barrier)
        return Allocation((over_a, over_delta), super().allocate(scene, signals).alert)
