"""Time course of a lane change, for the ego's reference and for other vehicles."""

from __future__ import annotations

from shared_control_env.core.compile.jit import jit


@jit
def change_progress(t: float, onset: float, duration: float) -> float:
    """Completed share of a lane change: the minimum-jerk course between two points at rest.

    ``10 tau^3 - 15 tau^4 + 6 tau^5`` with ``tau = (t - onset) / duration`` (Flash & Hogan, The Coordination of Arm
    Movements, J. Neuroscience 1985, Eq. 3).

    Args:
        t: time [s].
        onset: time at which the lane change begins [s]; infinite for none.
        duration: duration of the lane change [s].

    Returns:
        Share in [0, 1] [-].
    """
    if t <= onset:
        return 0.0
    tau = min((t - onset) / duration, 1.0)
    return tau * tau * tau * (10.0 + tau * (6.0 * tau - 15.0))
