"""The reward: a weighted sum of named terms, each about 1 in size."""

from __future__ import annotations

import numpy as np

from shared_control_env.core.jit import jit, jit_inlined
from shared_control_env.core.parameters import Parameters, RewardParameters
from shared_control_env.core.records import Record

TERMS = RewardParameters._fields
"""Names of the terms, in order."""

COMFORT_JERK = 5.0
"""Jerk that counts 1 [m/s^3]; the limit of ISO 11270 averages to this over half a second."""

COMFORT_LATERAL = 3.0
"""Lateral acceleration that counts 1 [m/s^2]; ISO 11270."""


@jit
def reward_terms(
    previous_s: float,
    scene: Record,
    signals: Record,
    last_a: float,
    failed: bool,
    p: Parameters,
    terms: np.ndarray,
) -> None:
    """Terms of one step.

    ::

        progress = ds / (dt target_speed), clipped to [-1, 1]: along the lane, so neither standing
                   still nor turning in place pays
        lane     = -min(1, ((y - y_target) / (lane_width / 2))^2)
        speed    = -min(1, |v_x - v_target| / target_speed)
        effort   = -((a_h,act / a_max)^2 + (delta_h,act / delta_max)^2)
        comfort  = -min(1, (jerk / 5)^2) / 2 - min(1, (r v_x / 3)^2) / 2
        conflict = -sum max(0, -u_h,act u_a,act) / bound^2: the driver working against the automation
        failure  = -1 on a collision or off the road, else 0

    Args:
        previous_s: path length before the step [m].
        scene: record of :data:`records.SCENE` after the step.
        signals: record of :data:`records.SIGNALS` of the step.
        last_a: acceleration command of the step before [m/s^2].
        failed: whether the step ended in a collision or off the road.
        p: parameters.
        terms: written, unweighted, in the order of :data:`TERMS`, shape (7,).
    """
    task, limits = p.task, p.limits
    u_h, u_a, z = signals.u_h_act, signals.u_a_act, scene.z
    progress = (z[0] - previous_s) / (task.dt * task.target_speed)
    terms[0] = min(max(progress, -1.0), 1.0)
    terms[1] = -min(1.0, (2.0 * (z[1] - scene.y_target) / task.lane_width) ** 2)
    terms[2] = -min(1.0, abs(z[3] - scene.v_target) / task.target_speed)
    terms[3] = -((u_h[0] / limits.a_max) ** 2) - (u_h[1] / limits.delta_max) ** 2
    jerk = (signals.u[0] - last_a) / task.dt
    terms[4] = -0.5 * min(1.0, (jerk / COMFORT_JERK) ** 2)
    terms[4] -= 0.5 * min(1.0, (z[5] * z[3] / COMFORT_LATERAL) ** 2)
    terms[5] = -max(0.0, -u_h[0] * u_a[0]) / limits.a_max**2
    terms[5] -= max(0.0, -u_h[1] * u_a[1]) / limits.delta_max**2
    terms[6] = -1.0 if failed else 0.0


@jit_inlined
def weighted_sum(terms: np.ndarray, weights: RewardParameters) -> float:
    """Reward of a step: the terms times their weights."""
    return (
        weights.progress * terms[0]
        + weights.lane * terms[1]
        + weights.speed * terms[2]
        + weights.effort * terms[3]
        + weights.comfort * terms[4]
        + weights.conflict * terms[5]
        + weights.failure * terms[6]
    )
