"""Risk assessment of the degraded automation (Section III): prediction, then lateral and longitudinal risk."""

from __future__ import annotations

from math import cos

import numpy as np

from shared_control_env.core.compile.calls import MATRIX, Interface
from shared_control_env.core.compile.jit import jit_inlined
from shared_control_env.core.parameters import Parameters
from shared_control_env.core.records import (
    ACCELERATION,
    HEADING,
    NEAR_ROW,
    PRECEDING,
    PRESENT,
    SPEED,
    YAW_RATE,
    Scene,
    Signals,
    X,
    Y,
)
from shared_control_env.core.risk.lateral import lateral_risk
from shared_control_env.core.risk.longitudinal import longitudinal_risk
from shared_control_env.core.risk.prediction import ctra
from shared_control_env.core.world.motion import Motion
from shared_control_env.core.world.road import locate
from shared_control_env.core.world.vehicle import V_X, R, plant_step, transmitted


@jit_inlined
def predict_ego(
    scene: Scene, u_f: np.ndarray, tau: float, line: np.ndarray, p: Parameters, signals: Signals, work: Motion
) -> None:
    """Predict the ego state xi(k + tau) under the degraded command (Eq. 1).

    The prediction starts from the present pose and speed. Its yaw rate is that of the dynamic model after one step
    under u_a,f, integrated as the plant is: one implicit step of the controllers has a yaw rate 14 to 24 % lower, so
    that alpha_a would oscillate. Lag and rate limit of the actuators are unknown to the assessment.

    Readings of "in the road frame" on a curve: the tangent frame at the ego, or the curvilinear frame. The tangent
    departs from the road by x^2 / 2R (0.3 m in Case 2), which would itself count as risk. The prediction therefore
    runs in the Cartesian frame, and its end point is then located on the road.

    Args:
        scene: record of :data:`records.SCENE`.
        u_f: degraded command ``[a, delta]`` [m/s^2, rad], shape (2,).
        tau: prediction horizon [s].
        line: reference line, shape (m, 12).
        p: parameters.
        signals: record of :data:`records.SIGNALS`; ``prediction`` and ``prediction_road`` are written.
        work: scratch of the vehicle's motion.
    """
    state = scene.state
    xi = signals.prediction
    for i in range(6):
        xi[i] = state[i]
    plant_step(xi, u_f[0], u_f[1], p.task.dt, p.model)
    xi[0], xi[1], xi[2], xi[3], xi[4], xi[5] = ctra(
        state[0], state[1], state[2], state[V_X], transmitted(u_f[0], p.model), xi[R], tau
    )
    s, d, _, _ = locate(line, xi[0], xi[1])
    signals.prediction_road[0], signals.prediction_road[1] = s, d


@jit_inlined
def predict_neighbours(scene: Scene, traffic: np.ndarray, line: np.ndarray, tau: float, predicted: np.ndarray) -> None:
    """Predict the three neighbours by Eq. 1 under their present acceleration and yaw rate.

    Their speed is the component along the road, as everywhere in the scene. The row of an absent neighbour is zero.

    Args:
        scene: record of :data:`records.SCENE`.
        traffic: other vehicles, shape (n, 8).
        line: reference line, shape (m, 12).
        tau: prediction horizon [s].
        predicted: rows ``[1 if present, s, v]`` [-, m, m/s], written, shape (3, 3).
    """
    for i in range(3):
        predicted[i, 0] = scene.neighbours[i, PRESENT]
        predicted[i, 1] = predicted[i, 2] = 0.0
        if scene.neighbours[i, PRESENT] > 0.0:
            o = traffic[int(scene.neighbours[i, NEAR_ROW])]
            x, y, psi, v, _, _ = ctra(o[X], o[Y], o[HEADING], o[SPEED], o[ACCELERATION], o[YAW_RATE], tau)
            s, _, psi_road, _ = locate(line, x, y)
            predicted[i, 1], predicted[i, 2] = s, v * cos(psi - psi_road)


def assess(
    tau: float, scene: Scene, traffic: np.ndarray, line: np.ndarray, p: Parameters, signals: Signals, work: Motion
) -> None:
    """Compute both risks that arise if the degraded command ``signals.u_a_f`` drives the car (Eq. 1-8).

    Args:
        tau: prediction horizon [s]; the paper's is ``p.task.tau_p``.
        scene: record of :data:`records.SCENE` with the safe area.
        traffic: other vehicles, shape (n, 8).
        line: reference line, shape (m, 12).
        p: parameters.
        signals: record of :data:`records.SIGNALS`; ``prediction``, ``prediction_road``, ``predicted_neighbours``,
            ``r_x`` and ``r_y`` are written.
        work: scratch of the vehicle's motion.
    """
    predict_ego(scene, signals.u_a_f, tau, line, p, signals, work)
    predict_neighbours(scene, traffic, line, tau, signals.predicted_neighbours)
    if p.authority.shared:  # the assessment has the automation's errors of perception
        signals.prediction_road[1] += signals.misperception[0]
        if signals.misperception[1] > 0.0:
            signals.predicted_neighbours[PRECEDING, 0] = 0.0
    s, d = signals.prediction_road[0], signals.prediction_road[1]
    signals.r_y = lateral_risk(scene.area, s, d, p.lateral)
    signals.r_x = longitudinal_risk(
        s, signals.prediction[3], signals.predicted_neighbours, p.vehicle.length, scene.change_weight, p.longitudinal
    )


ASSESS = Interface(None, float, Scene, MATRIX, MATRIX, Parameters, Signals, Motion)
"""``assess(tau, scene, traffic, line, p, signals, work)``, compiled apart from the loop."""
