"""Allocators of the automation's authority alpha_a: the common interface, and allocators for comparison."""

from __future__ import annotations

from collections.abc import Callable
from math import exp, inf
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from shared_control_env.controllers.arrays import as_numbers
from shared_control_env.controllers.lead import lead_of
from shared_control_env.controllers.stateless import Stateless
from shared_control_env.core.authority import allocators as compiled_allocators
from shared_control_env.core.authority.alerts import ALERTS, NO_ALERT
from shared_control_env.core.authority.allocators import FUZZY
from shared_control_env.core.authority.fuzzy import OPERATORS, authority
from shared_control_env.nearest import hint


class Allocation(NamedTuple):
    """What an allocator decides, if it is more than one number.

    Attributes:
        alpha: authority of the automation [-], or one for each channel, acceleration and steering, shape (2,).
        alert: what the driver is told, one of :data:`core.authority.alerts.ALERTS`.
    """

    alpha: Any
    alert: str = "none"


@runtime_checkable
class Allocator(Protocol):
    """Anything that decides how much authority the automation has.

    Three attributes are optional:

    - ``compiled``: a function that numba compiles (:data:`core.authority.allocators.ALLOCATE`), and that returns the
      same as ``allocate``. The kernel runs it.
    - ``needs_u_a_des = True``: the allocator sees u_a,des, the command without the fault. It is hidden otherwise, since
      a limiter behind the fault does not know it.
    - ``needs_assess = True``: ``allocate`` gets a third argument, an
      :class:`~shared_control_env.controllers.assessor.Assessor`.
    """

    def reset(self, seed: int | None = None) -> None:
        """Begin an episode.

        Args:
            seed: seed for allocators that draw random numbers.
        """
        ...

    @property
    def allocate(self) -> Callable[..., Any]:
        """A method ``allocate(scene, signals)`` that decides on the authority of one step.

        Args:
            scene: what the sensors give, a record of :data:`core.records.SCENE`.
            signals: signals of the same step, a record of :data:`core.records.SIGNALS`: the automation's degraded
                command ``u_a_f``, the predicted position under that command (``prediction_road``), its risks ``r_x``
                and ``r_y``, and the driver's present actual command ``u_h_act``. ``u_h_des``, ``u_a_act``, ``u`` and
                ``alpha`` are those of the previous step. ``fault`` and ``misperception`` are NaN, and so is
                ``u_a_des`` unless the allocator needs it.

        Returns:
            alpha_a; or one authority for each channel, ``[over acceleration, over steering]``; or an
            :class:`Allocation`. Numbers must be finite; the caller clips them to [0, 1].
        """
        ...


def checked_allocation(decided: Any, who: str = "allocator") -> tuple[np.ndarray, int]:
    """Check what an allocator's ``allocate`` returned, and convert it to one authority for each channel.

    An array with one number is accepted, such as a policy's prediction.

    Args:
        decided: what was returned.
        who: name of the allocator for the error message.

    Returns:
        Authorities over acceleration and steering [-], shape (2,); index of the alert.

    Raises:
        ValueError: if the value is not one finite number, two, or an :class:`Allocation` with a known alert.
    """
    alpha, alert = decided if isinstance(decided, Allocation) else (decided, ALERTS[NO_ALERT])
    array = as_numbers(alpha)
    if array.size not in (1, 2) or not np.isfinite(array).all():
        raise ValueError(
            f"{who}: allocate() gave {alpha!r}; it must return one finite number alpha_a in [0, 1], one for each "
            "channel, or an Allocation"
        )
    if alert not in ALERTS:
        raise ValueError(f"{who}: allocate() gave the alert {alert!r}; {hint(alert, ALERTS)}")
    return np.broadcast_to(array.reshape(-1), (2,)), ALERTS.index(alert)


def decide(
    allocator: Allocator, scene: np.ndarray, signals: np.ndarray, assess: Any, who: str
) -> tuple[np.ndarray, int]:
    """Let an allocator decide, with the third argument if it needs it.

    Args:
        allocator: the allocator.
        scene, signals: as in :meth:`Allocator.allocate`.
        assess: the :class:`~shared_control_env.controllers.assessor.Assessor` of the environment; None for an allocator
            that asks nothing.
        who: name of the allocator for error messages.

    Returns:
        As :func:`checked_allocation`.
    """
    more = () if assess is None else (assess,)
    return checked_allocation(allocator.allocate(scene, signals, *more), who)


def asks(allocator: Allocator) -> bool:
    """Whether an allocator asks for the risks of commands.

    Args:
        allocator: the allocator.
    """
    return bool(getattr(allocator, "needs_assess", False))


def hide(signals: np.ndarray, allocator: Allocator) -> None:
    """Replace by NaN what an allocator must not know.

    Args:
        signals: copies of records of :data:`core.records.SIGNALS`, any shape; changed.
        allocator: the allocator.
    """
    signals["fault"] = signals["misperception"] = np.nan
    if not getattr(allocator, "needs_u_a_des", False):
        signals["u_a_des"] = np.nan


def in_kernel(allocator: Any) -> Any:
    """The function of an allocator that the kernel can run; None if it has none.

    Args:
        allocator: an allocator.
    """
    compiled = getattr(allocator, "compiled", None)
    return compiled if callable(compiled) else None


class FuzzyAuthority(Stateless):
    """The paper's fuzzy inference, ``alpha_a = FIS(r_x, r_y)`` (Eq. 9).

    Args:
        operators: name of the fuzzy operators, one of :data:`core.authority.fuzzy.OPERATORS`; None for those of the
            environment's settings.

    Attributes:
        operators: name of the fuzzy operators, or None.
        compiled: the allocator for the kernel.
    """

    def __init__(self, operators: str | None = None) -> None:
        if operators is not None and operators not in OPERATORS:
            raise ValueError(f"operators = {operators!r}; {hint(operators, OPERATORS)}, or None")
        self.operators = operators
        self._index = OPERATORS.index(OPERATORS[0] if operators is None else operators)
        self.compiled = compiled_allocators.fuzzy_authority if operators is None else FUZZY[operators]

    def allocate(self, scene: np.ndarray, signals: np.ndarray) -> float:
        """alpha_a of one step; without a choice of operators, by the default ones.

        Args:
            scene: record of :data:`core.records.SCENE`; not used.
            signals: record of :data:`core.records.SIGNALS`; the risks ``r_x`` and ``r_y`` are used.
        """
        return authority(float(signals["r_x"]), float(signals["r_y"]), self._index)


class FixedAuthority(Stateless):
    """A constant authority. The kernel runs it for 0 and 1.

    Args:
        alpha: the authority in [0, 1] [-].

    Attributes:
        alpha: the authority [-].
        compiled: the allocator for the kernel; None if the kernel does not run it.

    Raises:
        ValueError: if the authority is not in [0, 1].
    """

    def __init__(self, alpha: float = 0.5) -> None:
        if not 0.0 <= alpha <= 1.0:
            raise ValueError(f"alpha = {alpha!r} must be in [0, 1]")
        self.alpha = alpha
        constants = {0.0: compiled_allocators.no_authority, 1.0: compiled_allocators.full_authority}
        self.compiled = constants.get(float(alpha))

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
