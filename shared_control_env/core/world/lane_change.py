"""Time course of a lane change, for the ego's reference and for other vehicles."""

from __future__ import annotations

from shared_control_env.core.compile.jit import jit


@jit
def elapsed_share(t: float, onset: float, duration: float) -> float:
    """Share of the duration of a lane change that has passed, in [0, 1] [-].

    Args:
        t: time [s].
        onset: time at which the lane change begins [s]; infinite for none.
        duration: duration of the lane change [s].
    """
    return min(max((t - onset) / duration, 0.0), 1.0)


@jit
def change_progress(t: float, onset: float, duration: float) -> float:
    """Completed share of a lane change: the minimum-jerk course between two points at rest.

    ``10 tau^3 - 15 tau^4 + 6 tau^5`` with the elapsed share tau (Flash & Hogan, The Coordination of Arm Movements,
    J. Neuroscience 1985, Eq. 3).

    Args:
        t, onset, duration: as in :func:`elapsed_share`.

    Returns:
        Share in [0, 1] [-].
    """
    tau = elapsed_share(t, onset, duration)
    return tau * tau * tau * (10.0 + tau * (6.0 * tau - 15.0))


@jit
def change_weight(t: float, onset: float, duration: float) -> float:
    """Share of Table V's weights of a lane change in Eq. 7; the rest are the weights of lane keeping.

    Readings: the weights jump where the change begins and ends, or pass over smoothly. A jump alone moves alpha_a from
    0.93 to 0.13 within a step. The share therefore rises over the first quarter of the change and falls over the last,
    ``3 x^2 - 2 x^3`` in the share x of the quarter.

    Args:
        t, onset, duration: as in :func:`elapsed_share`.

    Returns:
        Share in [0, 1] [-].
    """
    tau = elapsed_share(t, onset, duration)
    x = min(4.0 * min(tau, 1.0 - tau), 1.0)
    return x * x * (3.0 - 2.0 * x)
