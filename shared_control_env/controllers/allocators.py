"""Allocators of the automation's authority alpha_a: the common interface, and allocators for comparison."""

from __future__ import annotations

from math import exp, inf
from typing import Any, Protocol, runtime_checkable

import numpy as np

from shared_control_env.controllers.arrays import as_numbers
from shared_control_env.controllers.lead import lead_of
from shared_control_env.controllers.stateless import Stateless
from shared_control_env.core.authority import allocators as compiled_allocators
from shared_control_env.core.authority.fuzzy import OPERATORS, authority
from shared_control_env.nearest import hint


@runtime_checkable
class Allocator(Protocol):
    """Anything that decides how much authority the automation has.

    An allocator that the kernel also runs has an attribute ``compiled``. It is a function of scene, signals and
    parameters that numba compiles (:data:`core.authority.allocators.ALLOCATE`), and it returns the same value as
    ``allocate``.
    """

    def reset(self, seed: int | None = None) -> None:
        """Begin an episode.

        Args:
            seed: seed for allocators that draw random numbers.
        """
        ...

    def allocate(self, scene: np.ndarray, signals: np.ndarray) -> float:
        """Decide on alpha_a for one step.

        Args:
            scene: what the sensors give, a record of :data:`core.records.SCENE`.
            signals: signals of the same step, a record of :data:`core.records.SIGNALS`: the automation's degraded
                command ``u_a_f``, the predicted position under that command (``prediction_road``), and its risks
                ``r_x`` and ``r_y``.

        Returns:
            alpha_a, finite; the caller clips it to [0, 1].
        """
        ...


def checked_authority(alpha_a: Any, who: str = "allocator") -> float:
    """Check the value that an allocator's ``allocate`` returned, and convert it to a float.

    An array with one number is accepted, such as a policy's prediction.

    Args:
        alpha_a: the authority [-].
        who: name of the allocator for the error message.

    Raises:
        ValueError: if the value is not one finite number.
    """
    array = as_numbers(alpha_a)
    if array.size != 1 or not np.isfinite(array).all():
        raise ValueError(f"{who}: allocate() gave {alpha_a!r}; it must return one finite number alpha_a in [0, 1]")
    return array.item()


class FuzzyAuthority(Stateless):
    """The paper's fuzzy inference, ``alpha_a = FIS(r_x, r_y)`` (Eq. 9).

    Args:
        operators: name of the fuzzy operators, one of :data:`core.authority.fuzzy.OPERATORS`.

    Attributes:
        operators: name of the fuzzy operators.
        compiled: the allocator for the kernel.
    """

    def __init__(self, operators: str = "product-sum") -> None:
        if operators not in OPERATORS:
            raise ValueError(f"operators = {operators!r}; {hint(operators, OPERATORS)}")
        self.operators = operators
        self.compiled = compiled_allocators.FUZZY[operators]

    def allocate(self, scene: np.ndarray, signals: np.ndarray) -> float:
        """alpha_a of one step.

        Args:
            scene: record of :data:`core.records.SCENE`; not used.
            signals: record of :data:`core.records.SIGNALS`; the risks ``r_x`` and ``r_y`` are used.
        """
        return authority(float(signals["r_x"]), float(signals["r_y"]), OPERATORS.index(self.operators))


class FixedAuthority(Stateless):
    """A constant authority.

    Args:
        alpha: the authority [-].
    """

    def __init__(self, alpha: float = 0.5) -> None:
        self.alpha = alpha

    def allocate(self, scene: np.ndarray, signals: np.ndarray) -> float:
        """The constant authority.

        Args:
            scene: record of :data:`core.records.SCENE`; not used.
            signals: record of :data:`core.records.SIGNALS`; not used.
        """
        return self.alpha


def _risk(signals: np.ndarray) -> float:
    """The larger of the two risks."""
    return max(float(signals["r_x"]), float(signals["r_y"]))


class LinearAuthority(Stateless):
    """Authority that falls linearly with the larger risk, ``alpha_a = 1 - max(r_x, r_y)``."""

    def allocate(self, scene: np.ndarray, signals: np.ndarray) -> float:
        """alpha_a of one step.

        Args:
            scene: record of :data:`core.records.SCENE`; not used.
            signals: record of :data:`core.records.SIGNALS`; the risks ``r_x`` and ``r_y`` are used.
        """
        return 1.0 - _risk(signals)


class SoftmaxAuthority(Stateless):
    """Softmax of the automation's risk r against an accepted risk r_0.

    ``alpha_a = e^(-r/T) / (e^(-r/T) + e^(-r_0/T))`` with ``r = max(r_x, r_y)``.

    Args:
        accepted: r_0, the risk at which automation and driver have equal authority [-].
        temperature: T; the smaller T is, the sharper the transition [-].
    """

    def __init__(self, accepted: float = 0.5, temperature: float = 0.1) -> None:
        self.accepted, self.temperature = accepted, temperature

    def allocate(self, scene: np.ndarray, signals: np.ndarray) -> float:
        """alpha_a of one step.

        Args:
            scene: record of :data:`core.records.SCENE`; not used.
            signals: record of :data:`core.records.SIGNALS`; the risks ``r_x`` and ``r_y`` are used.
        """
        return 1.0 / (1.0 + exp((_risk(signals) - self.accepted) / self.temperature))


class HardTakeover:
    """All or nothing with hysteresis.

    The driver takes over when the risk exceeds ``high``. The automation is back in charge after the risk has stayed
    below ``low`` for ``hold`` seconds.

    Args:
        high: risk above which the automation loses its authority [-].
        low: risk below which the automation may regain it [-].
        hold: time for which the risk must stay below ``low`` [s].
    """

    def __init__(self, high: float = 0.6, low: float = 0.2, hold: float = 1.0) -> None:
        self.high, self.low, self.hold = high, low, hold
        self.reset()

    def reset(self, seed: int | None = None) -> None:
        """Begin an episode with the automation in charge.

        Args:
            seed: not used.
        """
        self._taken, self._quiet_since = False, inf

    def allocate(self, scene: np.ndarray, signals: np.ndarray) -> float:
        """alpha_a of one step, 0 or 1.

        Args:
            scene: record of :data:`core.records.SCENE`; the time ``t`` is used.
            signals: record of :data:`core.records.SIGNALS`; the risks ``r_x`` and ``r_y`` are used.
        """
        risk, t = _risk(signals), float(scene["t"])
        if risk > self.high:
            self._taken = True
        if risk >= self.low:
            self._quiet_since = inf
        elif self._quiet_since == inf:
            self._quiet_since = t
        if self._taken and t - self._quiet_since >= self.hold:
            self._taken = False
        return 0.0 if self._taken else 1.0


class TimeBasedAuthority(Stateless):
    """Authority from the time to the vehicle ahead and to the edge of the lane.

    ``alpha_a = (T - T_low) / (T_high - T_low)``, clipped to [0, 1]. T is the smaller of the time to collision and the
    time to lane crossing (Godthelp et al., The Development of a Time Based Approach..., Human Factors 1984). Both use
    the rates that the degraded command leads to within the prediction horizon.

    Args:
        low: T_low, at or below which the driver has all the authority [s].
        high: T_high, at or above which the automation has all the authority [s].
        horizon: prediction horizon, ``task.tau_p`` [s].
        lane_width: width of the lane [m].
    """

    def __init__(self, low: float = 0.5, high: float = 2.0, horizon: float = 0.5, lane_width: float = 4.0) -> None:
        self.low, self.high, self.horizon, self.lane_width = low, high, horizon, lane_width

    def allocate(self, scene: np.ndarray, signals: np.ndarray) -> float:
        """alpha_a of one step.

        Args:
            scene: record of :data:`core.records.SCENE`.
            signals: record of :data:`core.records.SIGNALS`.
        """
        left = min(self.time_to_collision(scene, signals), self.time_to_lane_crossing(scene, signals))
        return min(max((left - self.low) / (self.high - self.low), 0.0), 1.0)

    def time_to_collision(self, scene: np.ndarray, signals: np.ndarray) -> float:
        """Time to collision with the vehicle ahead at the predicted speed [s]; infinite unless the gap closes.

        Args:
            scene: record of :data:`core.records.SCENE`.
            signals: record of :data:`core.records.SIGNALS`; the predicted speed is used.
        """
        gap, v_lead = lead_of(scene)
        closing = float(signals["prediction"][3]) - v_lead
        return max(gap, 0.0) / closing if closing > 0.0 else inf

    def time_to_lane_crossing(self, scene: np.ndarray, signals: np.ndarray) -> float:
        """Time until the vehicle's centre reaches the edge of the lane at the predicted lateral speed [s].

        Args:
            scene: record of :data:`core.records.SCENE`.
            signals: record of :data:`core.records.SIGNALS`; the predicted lateral position is used.
        """
        offset = float(scene["z"][1] - scene["y_target"])
        rate = (float(signals["prediction_road"][1]) - float(scene["z"][1])) / self.horizon
        if rate == 0.0:
            return inf
        edge = 0.5 * self.lane_width if rate > 0.0 else -0.5 * self.lane_width
        return max((edge - offset) / rate, 0.0)
