"""Allocators of the automation's authority alpha_a: the interface that any has, and those to compare with."""

from __future__ import annotations

from math import exp, inf
from typing import Any, Protocol, runtime_checkable

import numpy as np

from shared_control_env.controllers.arrays import as_numbers
from shared_control_env.controllers.lead import lead_of
from shared_control_env.core.authority import allocators as compiled_allocators
from shared_control_env.core.authority.fuzzy import OPERATORS, authority
from shared_control_env.nearest import hint


@runtime_checkable
class Allocator(Protocol):
    """Anything that decides how much authority the automation has.

    One that the kernel runs too has an attribute ``compiled``: a function of scene, signals and parameters that numba
    compiles (:data:`core.authority.allocators.ALLOCATE`), and that gives what ``allocate`` gives.
    """

    def reset(self, seed: int | None = None) -> None:
        """Begin an episode.

        Args:
            seed: for allocators that draw random numbers.
        """
        ...

    def allocate(self, scene: np.ndarray, signals: np.ndarray) -> float:
        """Decide on alpha_a of one step.

        Args:
            scene: what the sensors give, a record of :data:`core.records.SCENE`.
            signals: of the same step, a record of :data:`core.records.SIGNALS`: the automation's degraded command
                ``u_a_f``, where it would lead (``prediction_road``), and its risks ``r_x`` and ``r_y``.

        Returns:
            alpha_a, finite; clipped to [0, 1] by the caller.
        """
        ...


def checked_authority(alpha_a: Any, who: str = "allocator") -> float:
    """What an allocator's ``allocate`` gave as a number; an array of one number is one, as a policy's prediction.

    Args:
        alpha_a: the authority.
        who: for the message.

    Raises:
        ValueError: if it is not one finite number.
    """
    array = as_numbers(alpha_a)
    if array.size != 1 or not np.isfinite(array).all():
        raise ValueError(f"{who}: allocate() gave {alpha_a!r}; it must give one finite number alpha_a in [0, 1]")
    return array.item()


class FuzzyAuthority:
    """The paper's fuzzy inference, ``alpha_a = FIS(r_x, r_y)`` (Eq. 9).

    Args:
        operators: of :data:`core.authority.fuzzy.OPERATORS`.

    Attributes:
        compiled: for the kernel.
    """

    def __init__(self, operators: str = "product-sum") -> None:
        if operators not in OPERATORS:
            raise ValueError(f"operators = {operators!r}; {hint(operators, OPERATORS)}")
        self.operators = operators
        self.compiled = compiled_allocators.FUZZY[operators]

    def reset(self, seed: int | None = None) -> None:
        """Nothing is remembered."""

    def allocate(self, scene: np.ndarray, signals: np.ndarray) -> float:
        """alpha_a of one step."""
        return authority(float(signals["r_x"]), float(signals["r_y"]), OPERATORS.index(self.operators))


class FixedAuthority:
    """The same authority always.

    Args:
        alpha: the authority [-].
    """

    def __init__(self, alpha: float = 0.5) -> None:
        self.alpha = alpha

    def reset(self, seed: int | None = None) -> None:
        """Nothing is remembered."""

    def allocate(self, scene: np.ndarray, signals: np.ndarray) -> float:
        """The authority."""
        return self.alpha


def _risk(signals: np.ndarray) -> float:
    """The larger of both risks."""
    return max(float(signals["r_x"]), float(signals["r_y"]))


class LinearAuthority:
    """``alpha_a = 1 - max(r_x, r_y)``."""

    def reset(self, seed: int | None = None) -> None:
        """Nothing is remembered."""

    def allocate(self, scene: np.ndarray, signals: np.ndarray) -> float:
        """alpha_a of one step."""
        return 1.0 - _risk(signals)


class SoftmaxAuthority:
    """Softmax of the automation's risk r against an accepted one: ``alpha_a = e^(-r/T) / (e^(-r/T) + e^(-r_0/T))``.

    Args:
        accepted: r_0, the risk at which both have equal authority [-].
        temperature: T, how sharp the choice is [-].
    """

    def __init__(self, accepted: float = 0.5, temperature: float = 0.1) -> None:
        self.accepted, self.temperature = accepted, temperature

    def reset(self, seed: int | None = None) -> None:
        """Nothing is remembered."""

    def allocate(self, scene: np.ndarray, signals: np.ndarray) -> float:
        """alpha_a of one step."""
        return 1.0 / (1.0 + exp((_risk(signals) - self.accepted) / self.temperature))


class HardTakeover:
    """All or nothing with hysteresis: the driver has it from a high risk on, until it has been low for a while.

    Args:
        high: risk that takes the authority away [-].
        low: risk that may give it back [-].
        hold: how long it has to be lower [s].
    """

    def __init__(self, high: float = 0.6, low: float = 0.2, hold: float = 1.0) -> None:
        self.high, self.low, self.hold = high, low, hold
        self.reset()

    def reset(self, seed: int | None = None) -> None:
        """Begin an episode with the automation in charge."""
        self._taken, self._quiet_since = False, inf

    def allocate(self, scene: np.ndarray, signals: np.ndarray) -> float:
        """alpha_a of one step, 0 or 1."""
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


class TimeBasedAuthority:
    """Authority by the time that is left: to the vehicle ahead, and to the edge of the lane.

    ``alpha_a = (T - T_low) / (T_high - T_low)`` in [0, 1] with T the smaller of the time to collision and the time to
    lane crossing (Godthelp et al., The Development of a Time Based Approach..., Human Factors 1984). The rates
    are those that the degraded command leads to within the prediction's horizon.

    Args:
        low: T at which the driver is alone [s].
        high: T from which on the automation has all [s].
        horizon: of the prediction, ``task.tau_p`` [s].
        lane_width: [m].
    """

    def __init__(self, low: float = 0.5, high: float = 2.0, horizon: float = 0.5, lane_width: float = 4.0) -> None:
        self.low, self.high, self.horizon, self.lane_width = low, high, horizon, lane_width

    def reset(self, seed: int | None = None) -> None:
        """Nothing is remembered."""

    def allocate(self, scene: np.ndarray, signals: np.ndarray) -> float:
        """alpha_a of one step."""
        left = min(self.time_to_collision(scene, signals), self.time_to_lane_crossing(scene, signals))
        return min(max((left - self.low) / (self.high - self.low), 0.0), 1.0)

    def time_to_collision(self, scene: np.ndarray, signals: np.ndarray) -> float:
        """Time to collision with the vehicle ahead at the predicted speed [s]; infinite unless closing."""
        gap, v_lead = lead_of(scene)
        closing = float(signals["prediction"][3]) - v_lead
        return max(gap, 0.0) / closing if closing > 0.0 else inf

    def time_to_lane_crossing(self, scene: np.ndarray, signals: np.ndarray) -> float:
        """Time until the centre is on the lane's edge at the predicted lateral speed [s]."""
        offset = float(scene["z"][1] - scene["y_target"])
        rate = (float(signals["prediction_road"][1]) - float(scene["z"][1])) / self.horizon
        if rate == 0.0:
            return inf
        edge = 0.5 * self.lane_width if rate > 0.0 else -0.5 * self.lane_width
        return max((edge - offset) / rate, 0.0)
