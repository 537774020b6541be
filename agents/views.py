"""What policies see of a step, beside the environment's own observation; the fault is in none of it.

A driver has hands on the wheel and a foot on the pedal: it feels what the automation does there, which is the input of
the paper's Eq. 16 too. Without it a driver who compensates well could not tell what it compensates: with K_h = 1 the
car does in the long run what the driver wants, whatever the automation does. A driver sees how the vehicle ahead
grows, too, which tells people when to brake and how hard (D. N. Lee, "A theory of visual control of braking based on
information about time-to-collision", Perception 5, 1976, 437-459); the distance alone hardly changes in the last metres
before standstill. An allocator has the car's sensors, and knows what the automation is about to do.
"""

from __future__ import annotations

import numpy as np

from shared_control_env.core.feedback.observation import DRIVER_V0
from shared_control_env.core.parameters import TRAFFIC_BODY, Limits, VehicleParameters
from shared_control_env.core.records import NEAR_D, NEAR_S, NEAR_SPEED, PRESENT

_LIMITS = Limits()

FEATURES = DRIVER_V0.features
"""Name and scale of every entry of the environment's observation."""

_PRESENT = DRIVER_V0.place_of("preceding present [-]")
_DISTANCE = DRIVER_V0.place_of("preceding distance along the road [m]")
_SPEED = DRIVER_V0.place_of("preceding speed minus the ego's [m/s]")

_BODIES = 0.5 * (VehicleParameters().length + TRAFFIC_BODY[0])
"""What the distance of the centres has to be less for the gap [m]."""

_FAR = FEATURES[_DISTANCE][1] - _BODIES
"""Largest gap that the observation tells from others [m]."""

_NEAR = 0.1
"""Gaps below count as this [m]."""

DRIVER_FEATURES: tuple[tuple[str, float], ...] = (
    *FEATURES,
    ("automation's acceleration as felt [m/s^2]", _LIMITS.a_max),
    ("automation's steering as felt [rad]", _LIMITS.delta_max),
    ("gap to the preceding vehicle, ln(1 + gap / 1 m) [-]", float(np.log1p(_FAR))),
    ("inverse time to collision with it [1/s]", 1.0),
    ("deceleration that avoids the collision [m/s^2]", _LIMITS.a_max),
)
"""Name and scale of every entry: the environment's observation, what is felt, and what is seen of the one ahead."""

ALLOCATOR_FEATURES: tuple[tuple[str, float], ...] = (
    *FEATURES[: DRIVER_V0.place_of("curvature 10 m ahead [1/m]")],  # the ego's motion, and the curvature where it is
    ("automation's last actual acceleration [m/s^2]", _LIMITS.a_max),
    ("automation's last actual steering [rad]", _LIMITS.delta_max),
    ("automation's degraded acceleration u_a,f [m/s^2]", _LIMITS.a_max),
    ("automation's degraded steering u_a,f [rad]", _LIMITS.delta_max),
    ("predicted lateral error [m]", 4.0),
    ("longitudinal risk r_x [-]", 1.0),
    ("lateral risk r_y [-]", 1.0),
    *(each for each in FEATURES if each[0].startswith(("follower", "leader", "preceding"))),
)
"""Name and scale of every entry: the entry is the feature divided by its scale, clipped to [-1, 1]."""

FEATURES_OF = {"driver": DRIVER_FEATURES, "allocator": ALLOCATOR_FEATURES}
"""What a policy of each task sees."""

DEAD_ZONE = 0.06
"""A driver's policy that asks for less than this share of the limits leaves wheel and pedal alone."""

_OWN_SCALES = np.array([scale for _, scale in DRIVER_FEATURES[len(FEATURES) :]])
_SCALES = np.array([scale for _, scale in ALLOCATOR_FEATURES])


def driver_view(observations: np.ndarray, felt: np.ndarray) -> np.ndarray:
    """:data:`DRIVER_FEATURES` over their scales.

    ::

        gap             = s_p - s - 5 m, bumper to bumper; 0.1 m at least, and the farthest one without a vehicle
        1 / TTC         = -(v_p - v) / gap
        a that avoids   = max(0, v - v_p)^2 / (2 gap), if the one ahead keeps its speed

    Args:
        observations: of the environment, of :data:`DRIVER_V0`, shape (..., n).
        felt: u_a,act of the step before, a scene's ``felt`` [m/s^2, rad], shape (..., 2).

    Returns:
        float32, shape (..., n + 5).
    """
    present = observations[..., _PRESENT] > 0.0
    gap = FEATURES[_DISTANCE][1] * observations[..., _DISTANCE] - _BODIES
    gap = np.where(present, np.maximum(gap, _NEAR), _FAR)
    closing = np.where(present, -FEATURES[_SPEED][1] * observations[..., _SPEED], 0.0)
    needed = np.maximum(closing, 0.0) ** 2 / (2.0 * gap)
    own = np.stack([felt[..., 0], felt[..., 1], np.log1p(gap), closing / gap, needed], axis=-1)
    return np.concatenate([observations, np.clip(own / _OWN_SCALES, -1.0, 1.0)], axis=-1, dtype=np.float32)


def allocator_view(scenes: np.ndarray, signals: np.ndarray) -> np.ndarray:
    """:data:`ALLOCATOR_FEATURES` over their scales; the fault is not in them.

    Args:
        scenes: records of :data:`core.records.SCENE`, any shape.
        signals: planned signals of the same step, records of :data:`core.records.SIGNALS`, same shape.

    Returns:
        float32, that shape with 26 entries each.
    """
    z, near = scenes["z"], scenes["neighbours"]
    present = near[..., PRESENT]
    ahead = np.stack(
        [
            present,
            present * (near[..., NEAR_S] - z[..., 0, None]),
            present * (near[..., NEAR_D] - z[..., 1, None]),
            present * (near[..., NEAR_SPEED] - z[..., 3, None]),
        ],
        axis=-1,
    )
    own = [
        z[..., 1] - scenes["y_target"],
        *(z[..., i] for i in range(2, 6)),
        z[..., 3] - scenes["v_target"],
        scenes["kappa"][..., 0],
        scenes["felt"][..., 0],
        scenes["felt"][..., 1],
        signals["u_a_f"][..., 0],
        signals["u_a_f"][..., 1],
        signals["prediction_road"][..., 1] - scenes["y_target"],
        signals["r_x"],
        signals["r_y"],
    ]
    features = np.concatenate([np.stack(own, axis=-1), ahead.reshape(*z.shape[:-1], -1)], axis=-1)
    return np.clip(features / _SCALES, -1.0, 1.0).astype(np.float32)


def view(task: str, observations: np.ndarray, scenes: np.ndarray, signals: np.ndarray) -> np.ndarray:
    """What a policy of a task sees; arguments as in :func:`driver_view` and :func:`allocator_view`."""
    if task == "driver":
        return driver_view(observations, scenes["felt"])
    return allocator_view(scenes, signals)


def command(action: np.ndarray) -> np.ndarray:
    """The driver's command over its limits of a policy's action in [-1, 1]: hands that ask for little rest.

    ``sign(a) max(0, |a| - d) / (1 - d)`` with the dead zone d: a network is never quite at zero, and would trouble a
    sound automation all the time.
    """
    return np.sign(action) * np.maximum(np.abs(action) - DEAD_ZONE, 0.0) / (1.0 - DEAD_ZONE)


def authority(action: np.ndarray) -> np.ndarray:
    """alpha_a in [0, 1] of an allocator's action in [-1, 1]: a policy that knows nothing yet begins in the middle."""
    return 0.5 * (action + 1.0)


ACTION_OF = {"driver": command, "allocator": authority}
"""What fills a task's slot of the environment's action, of a policy's action."""
