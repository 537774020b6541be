"""The course of a lane change, of the ego's reference and of other vehicles."""

from __future__ import annotations

from shared_control_env.core.compile.jit import jit


@jit
def change_progress(t: float, onset: float, duration: float) -> float:
    """Share of a lane change that is done: the minimum-jerk course between two points at rest.

    ``10 tau^3 - 15 tau^4 + 6 tau^5`` with ``tau = (t - onset) / duration`` (Flash & Hogan, The Coordination of Arm
    Movements, J. Neuroscience 1985, Eq. 3).

    Args:
        t: time [s].
        onset: of the change [s]; infinite for none.
        duration: [s].

    Returns:
        Share in [0, 1].
    """
    if t <= onset:
        return 0.0
    tau = min((t - onset) / duration, 1.0)
    return tau * tau * tau * (10.0 + tau * (6.0 * tau - 15.0))
