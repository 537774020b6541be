"""Scripted drivers."""

from __future__ import annotations

from math import atan2

import numpy as np


class StanleyDriver:
    """Steers by Stanley's law and holds the target speed with a proportional pedal.

    ``delta = L kappa - psi - atan(k y / (v + v_0))`` at the centre of mass, with the road's curvature fed forward
    (Hoffmann et al., Autonomous Automobile Trajectory Tracking for Off-Road Driving, ACC 2007).

    Args:
        gain: k, lateral gain [1/s].
        softening: v_0, keeps the law mild at low speed [m/s].
        speed_gain: acceleration for each m/s of speed error [1/s].
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
        _, y, psi, v, _, _ = scene["z"]
        error = y - scene["y_target"]
        steering = self.wheelbase * scene["kappa"][0] - psi - atan2(self.gain * error, v + self.softening)
        return np.array([self.speed_gain * (scene["v_target"] - v), steering])
