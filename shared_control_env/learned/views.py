"""What a policy sees in a step, in addition to the environment's own observation; the fault is never included.

A driver has hands on the wheel and a foot on the pedal, and feels the automation's action there. The same signal is
the input of the paper's Eq. 16. Without it, a driver who compensates well could not tell what is compensated: with
K_h = 1 the car follows the driver's command in the long run, whatever the automation does. A driver also sees how the
image of the vehicle ahead grows. This tells people when to brake and how hard (D. N. Lee, "A theory of visual control
of braking based on information about time-to-collision", Perception 5, 1976, 437-459). The distance alone hardly
changes in the last metres before standstill. An allocator has the car's sensors, and knows the automation's next
command.
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
"""Distance between the centres minus the gap [m]."""

_FAR = FEATURES[_DISTANCE][1] - _BODIES
"""Largest gap that the observation can represent [m]."""

_NEAR = 0.1
"""Lower limit of the gap; smaller gaps count as this one [m]."""

DRIVER_FEATURES: tuple[tuple[str, float], ...] = (
    *FEATURES,
    ("automation's acceleration as felt [m/s^2]", _LIMITS.a_max),
    ("automation's steering as felt [rad]", _LIMITS.delta_max),
    ("gap to the preceding vehicle, ln(1 + gap / 1 m) [-]", float(np.log1p(_FAR))),
    ("inverse time to collision with it [1/s]", 1.0),
    ("deceleration that avoids the collision [m/s^2]", _LIMITS.a_max),
)
"""Name and scale of every entry: the environment's observation, the felt command, and the view of the vehicle ahead."""

ALLOCATOR_FEATURES: tuple[tuple[str, float], ...] = (
    *FEATURES[: DRIVER_V0.place_of("curvature 10 m ahead [1/m]")],  # the ego's motion, and the curvature at the ego
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
"""Dead zone of a driver that learns by reward: smaller actions, as shares of the limits, give a zero command [-]."""

_OWN_SCALES = np.array([scale for _, scale in DRIVER_FEATURES[len(FEATURES) :]])
_SCALES = np.array([scale for _, scale in ALLOCATOR_FEATURES])


def driver_view(observations: np.ndarray, felt: np.ndarray) -> np.ndarray:
    """:data:`DRIVER_FEATURES` divided by their scales.

    ::

        gap             = s_p - s - 5 m, bumper to bumper; at least 0.1 m; the observation's largest without a vehicle
        1 / TTC         = -(v_p - v) / gap
        deceleration    = max(0, v - v_p)^2 / (2 gap), enough if the vehicle ahead keeps its speed

    Args:
        observations: observations of the environment, of :data:`DRIVER_V0`, shape (..., n).
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
    """:data:`ALLOCATOR_FEATURES` divided by their scales; they do not include the fault.

    Args:
        scenes: records of :data:`core.records.SCENE`, any shape.
        signals: planned signals of the same step, records of :data:`core.records.SIGNALS`, same shape.

    Returns:
        float32, the same shape with 26 entries for each record.
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
    """Input of a policy: :func:`driver_view` or :func:`allocator_view`, depending on the task.

    Args:
        task: key of :data:`FEATURES_OF`.
        observations: as in :func:`driver_view`.
        scenes: as in :func:`allocator_view`.
        signals: as in :func:`allocator_view`.
    """
    if task == "driver":
        return driver_view(observations, scenes["felt"])
    return allocator_view(scenes, signals)


def command(action: np.ndarray, dead_zone: float = DEAD_ZONE) -> np.ndarray:
    """The driver's command, divided by its limits, for a policy's action; small actions give zero.

    ``sign(a) max(0, |a| - d) / (1 - d)`` with the dead zone d. The output of a network is never exactly zero, and would
    otherwise disturb a healthy automation all the time.

    Args:
        action: action of the policy in [-1, 1], any shape.
        dead_zone: d, in [0, 1); a policy's card says with which one it was trained.
    """
    return np.sign(action) * np.maximum(np.abs(action) - dead_zone, 0.0) / (1.0 - dead_zone)


def authority(action: np.ndarray) -> np.ndarray:
    """alpha_a in [0, 1] for an allocator's action; an untrained policy therefore begins near 0.5.

    Args:
        action: action of the policy in [-1, 1], any shape.
    """
    return 0.5 * (action + 1.0)


ACTION_OF = {"driver": command, "allocator": authority}
"""Map from a policy's action to the value of the task's slot in the environment's action."""
