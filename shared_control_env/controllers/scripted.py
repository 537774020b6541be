"""Drivers that follow rules, and the ways in which people fall short of them."""

from __future__ import annotations

from math import atan2, exp, inf

import numpy as np

from shared_control_env.controllers.lead import lead_of
from shared_control_env.core.world.traffic import idm_acceleration


class ScriptedDriver:
    """Steers by Stanley's law and keeps speed and distance by the Intelligent Driver Model.

    ``delta = L kappa - psi - atan(k y / (v + v_0))`` at the centre of mass, with the road's curvature fed forward
    (Hoffmann et al., Autonomous Automobile Trajectory Tracking for Off-Road Driving, ACC 2007); the acceleration is
    :func:`core.world.traffic.idm_acceleration` towards the target speed, which is that of a slower vehicle ahead.

    Args:
        gain: k, lateral gain [1/s].
        softening: v_0, keeps the law mild at low speed [m/s].
        speed_gain: acceleration for each m/s of speed error, at most that of the model's following [1/s].
        wheelbase: L [m].
    """

    def __init__(
        self, gain: float = 1.0, softening: float = 5.0, speed_gain: float = 0.5, wheelbase: float = 2.26
    ) -> None:
        self.gain, self.softening = gain, softening
        self.speed_gain, self.wheelbase = speed_gain, wheelbase

    def reset(self, seed: int | None = None) -> None:
        """Nothing is remembered and nothing drawn."""

    def act(self, observation: np.ndarray, scene: np.ndarray) -> np.ndarray:
        """Desired acceleration and steering, shape (2,)."""
        _, y, psi, v, _, _ = scene["z"].tolist()
        error = y - float(scene["y_target"])
        steering = self.wheelbase * float(scene["kappa"][0]) - psi - atan2(self.gain * error, v + self.softening)
        acceleration = self.speed_gain * (float(scene["v_target"]) - v)
        gap, v_lead = lead_of(scene)
        if gap < inf:
            acceleration = min(acceleration, idm_acceleration(max(v, 0.0), inf, gap, v_lead))
        return np.array([acceleration, steering])


class DistractedDriver:
    """Lets go until the authority on display has fallen for a while; then attention comes back little by little.

    Hands that rest on the wheel follow it: u_h,des is the automation's command that is felt there. From
    ``reaction`` seconds after the displayed authority first fell under ``notice`` on, awareness is
    ``w = 1 - exp(-t / recovery)`` and the command is w times the attentive driver's and 1 - w times the felt one.

    Args:
        notice: authority under which the display catches the eye [-].
        reaction: time until then [s]; take-over times of 1 to 3 s are usual (Eriksson & Stanton, Takeover Time in
            Highly Automated Vehicles, Human Factors 2017, report 1.9 to 25.7 s).
        recovery: time constant of awareness [s].
        dt: time step [s].
    """

    def __init__(self, notice: float = 0.9, reaction: float = 1.0, recovery: float = 0.7, dt: float = 0.05) -> None:
        self.notice, self.reaction, self.recovery, self.dt = notice, reaction, recovery, dt
        self._attentive = ScriptedDriver()
        self.reset()

    def reset(self, seed: int | None = None) -> None:
        """Begin an episode, distracted."""
        self._since = -inf

    def act(self, observation: np.ndarray, scene: np.ndarray) -> np.ndarray:
        """Desired acceleration and steering, shape (2,)."""
        t = float(scene["t"])
        if self._since == -inf and scene["displayed"] < self.notice:
            self._since = t
        awake = t - self._since - self.reaction if self._since > -inf else 0.0
        w = 1.0 - exp(-max(awake, 0.0) / self.recovery)
        return w * self._attentive.act(observation, scene) + (1.0 - w) * scene["felt"]


class OverreactingDriver:
    """Does what the scripted driver does, several times as hard.

    Args:
        excess: factor on its command [-].
    """

    def __init__(self, excess: float = 2.5) -> None:
        self.excess = excess
        self._calm = ScriptedDriver()

    def reset(self, seed: int | None = None) -> None:
        """Nothing is remembered and nothing drawn."""

    def act(self, observation: np.ndarray, scene: np.ndarray) -> np.ndarray:
        """Desired acceleration and steering, shape (2,)."""
        return self.excess * self._calm.act(observation, scene)


class FightingDriver:
    """Pushes against whatever the automation does differently from what this driver wants.

    ``u_h,des = u + stubbornness (u - u_felt)`` with the scripted driver's u.

    Args:
        stubbornness: how hard [-].
    """

    def __init__(self, stubbornness: float = 1.0) -> None:
        self.stubbornness = stubbornness
        self._wish = ScriptedDriver()

    def reset(self, seed: int | None = None) -> None:
        """Nothing is remembered and nothing drawn."""

    def act(self, observation: np.ndarray, scene: np.ndarray) -> np.ndarray:
        """Desired acceleration and steering, shape (2,)."""
        wish = self._wish.act(observation, scene)
        return wish + self.stubbornness * (wish - scene["felt"])
