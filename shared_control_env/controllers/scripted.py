"""Drivers that follow rules, and drivers that deviate from these rules as people do."""

from __future__ import annotations

from math import atan2, exp, inf

import numpy as np

from shared_control_env.controllers.lead import lead_of
from shared_control_env.controllers.stateless import Stateless
from shared_control_env.core.world.traffic import idm_acceleration


class ScriptedDriver(Stateless):
    """Steers by Stanley's law, and keeps speed and distance by the Intelligent Driver Model.

    ``delta = L kappa - psi - atan(k y / (v + v_0))`` at the centre of mass, with the road's curvature as feedforward
    (Hoffmann et al., Autonomous Automobile Trajectory Tracking for Off-Road Driving, ACC 2007). The acceleration is
    proportional to the speed error. The target speed is that of the vehicle ahead if this vehicle is slower. Behind a
    vehicle, the acceleration is at most :func:`core.world.traffic.idm_acceleration`.

    Args:
        gain: k, lateral gain [1/s].
        softening: v_0, which limits the gain at low speed [m/s].
        speed_gain: acceleration per speed error; the car-following model limits the acceleration [1/s].
        wheelbase: L [m].
    """

    def __init__(
        self, gain: float = 1.0, softening: float = 5.0, speed_gain: float = 0.5, wheelbase: float = 2.26
    ) -> None:
        self.gain, self.softening = gain, softening
        self.speed_gain, self.wheelbase = speed_gain, wheelbase

    def act(self, observation: np.ndarray, scene: np.ndarray) -> np.ndarray:
        """Desired acceleration and steering [m/s^2, rad], shape (2,).

        Args:
            observation: the environment's observation; not used.
            scene: record of :data:`core.records.SCENE`.
        """
        _, y, psi, v, _, _ = scene["z"].tolist()
        error = y - float(scene["y_target"])
        steering = self.wheelbase * float(scene["kappa"][0]) - psi - atan2(self.gain * error, v + self.softening)
        acceleration = self.speed_gain * (float(scene["v_target"]) - v)
        gap, v_lead = lead_of(scene)
        if gap < inf:
            acceleration = min(acceleration, idm_acceleration(max(v, 0.0), inf, gap, v_lead))
        return np.array([acceleration, steering])


class DistractedDriver:
    """Driver who is distracted until the displayed authority falls, and who then regains attention gradually.

    The hands of a distracted driver rest on the wheel and follow it: u_h,des is the automation's command that is felt
    there. The reaction time starts when the displayed authority first falls below ``notice``. Awareness is then
    ``w = 1 - exp(-t / recovery)``, with t counted from the end of the reaction time. The command is w times the
    attentive driver's command plus 1 - w times the felt command.

    Args:
        notice: authority below which the display attracts attention [-].
        reaction: time from then until awareness begins to rise [s]; take-over times of 1 to 3 s are usual (Eriksson &
            Stanton, Takeover Time in Highly Automated Vehicles, Human Factors 2017, report 1.9 to 25.7 s).
        recovery: time constant of awareness [s].
    """

    def __init__(self, notice: float = 0.9, reaction: float = 1.0, recovery: float = 0.7) -> None:
        self.notice, self.reaction, self.recovery = notice, reaction, recovery
        self._attentive = ScriptedDriver()
        self.reset()

    def reset(self, seed: int | None = None) -> None:
        """Begin an episode with a distracted driver.

        Args:
            seed: not used.
        """
        self._since = -inf

    def act(self, observation: np.ndarray, scene: np.ndarray) -> np.ndarray:
        """Desired acceleration and steering [m/s^2, rad], shape (2,).

        Args:
            observation: the environment's observation; not used.
            scene: record of :data:`core.records.SCENE`; the displayed authority and the felt command are used too.
        """
        t = float(scene["t"])
        if self._since == -inf and scene["displayed"] < self.notice:
            self._since = t
        awake = t - self._since - self.reaction if self._since > -inf else 0.0
        w = 1.0 - exp(-max(awake, 0.0) / self.recovery)
        return w * self._attentive.act(observation, scene) + (1.0 - w) * scene["felt"]


class OverreactingDriver(Stateless):
    """Driver whose command is a multiple of the scripted driver's command.

    Args:
        excess: factor on the scripted driver's command [-].
    """

    def __init__(self, excess: float = 2.5) -> None:
        self.excess = excess
        self._calm = ScriptedDriver()

    def act(self, observation: np.ndarray, scene: np.ndarray) -> np.ndarray:
        """Desired acceleration and steering [m/s^2, rad], shape (2,).

        Args:
            observation: the environment's observation; not used.
            scene: record of :data:`core.records.SCENE`.
        """
        return self.excess * self._calm.act(observation, scene)


class FightingDriver(Stateless):
    """Driver who opposes the automation wherever its command differs from what the driver wants.

    ``u_h,des = u + stubbornness (u - u_felt)``, where u is the scripted driver's command and u_felt is the
    automation's command that the driver feels.

    Args:
        stubbornness: gain of the opposition [-].
    """

    def __init__(self, stubbornness: float = 1.0) -> None:
        self.stubbornness = stubbornness
        self._wish = ScriptedDriver()

    def act(self, observation: np.ndarray, scene: np.ndarray) -> np.ndarray:
        """Desired acceleration and steering [m/s^2, rad], shape (2,).

        Args:
            observation: the environment's observation; not used.
            scene: record of :data:`core.records.SCENE`; the felt command is used too.
        """
        wish = self._wish.act(observation, scene)
        return wish + self.stubbornness * (wish - scene["felt"])
