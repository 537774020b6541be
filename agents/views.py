"""What policies see of a step, beside the environment's own observation; the fault is in none of it.

A driver has hands on the wheel and a foot on the pedal: it feels what the automation does there, which is the input of
the paper's Eq. 16 too. Without it a driver who compensates well could not tell what it compensates: with K_h = 1 the
car does in the long run what the driver wants, whatever the automation does. An allocator has the car's sensors, and
knows what the automation is about to do.
"""

from __future__ import annotations

import numpy as np

from shared_control_env.core.observation import FEATURES
from shared_control_env.core.parameters import Limits
from shared_control_env.core.records import NEAR_D, NEAR_S, NEAR_SPEED, PRESENT

_LIMITS = Limits()

DRIVER_FEATURES: tuple[tuple[str, float], ...] = (
    *FEATURES,
    ("automation's acceleration as felt [m/s^2]", _LIMITS.a_max),
    ("automation's steering as felt [rad]", _LIMITS.delta_max),
)
"""Name and scale of every entry: the environment's observation, and what is felt."""

ALLOCATOR_FEATURES: tuple[tuple[str, float], ...] = (
    *FEATURES[:7],  # the ego's motion, and the curvature where it is
    ("automation's last actual acceleration [m/s^2]", _LIMITS.a_max),
    ("automation's last actual steering [rad]", _LIMITS.delta_max),
    ("automation's degraded acceleration u_a,f [m/s^2]", _LIMITS.a_max),
    ("automation's degraded steering u_a,f [rad]", _LIMITS.delta_max),
    ("predicted lateral error [m]", 4.0),
    ("longitudinal risk r_x [-]", 1.0),
    ("lateral risk r_y [-]", 1.0),
    *FEATURES[10:22],  # the follower, the leader and the preceding vehicle
)
"""Name and scale of every entry: the entry is the feature divided by its scale, clipped to [-1, 1]."""

FEATURES_OF = {"driver": DRIVER_FEATURES, "allocator": ALLOCATOR_FEATURES}
"""What a policy of each task sees."""

_SCALES = np.array([scale for _, scale in ALLOCATOR_FEATURES])


def driver_view(observations: np.ndarray, felt: np.ndarray) -> np.ndarray:
    """:data:`DRIVER_FEATURES` over their scales.

    Args:
        observations: of the environment, shape (..., 25).
        felt: u_a,act of the step before, a scene's ``felt`` [m/s^2, rad], shape (..., 2).

    Returns:
        float32, shape (..., 27).
    """
    scaled = felt / np.array([_LIMITS.a_max, _LIMITS.delta_max])
    return np.concatenate([observations, np.clip(scaled, -1.0, 1.0)], axis=-1, dtype=np.float32)


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


def authority(action: np.ndarray) -> np.ndarray:
    """alpha_a in [0, 1] of an allocator's action in [-1, 1]: a policy that knows nothing yet begins in the middle."""
    return 0.5 * (action + 1.0)
