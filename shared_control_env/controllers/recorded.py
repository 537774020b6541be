"""Drivers that replay recordings, and recordings of drivers."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from shared_control_env.controllers.driver import Driver
from shared_control_env.controllers.stateless import Stateless

COLUMNS = "t,a,delta"
"""Header of a recording: time [s], desired acceleration [m/s^2] and front steering angle [rad]."""


class RecordedDriver(Stateless):
    """Replays recorded commands at their times in the episode, interpolated linearly and held beyond both ends.

    The commands depend on time only, not on the road. A recording therefore suits the episode in which it was made, or
    a task such as a prescribed manoeuvre.

    Args:
        samples: rows ``t, a, delta`` [s, m/s^2, rad], at least one, with increasing t, shape (T, 3).

    Raises:
        ValueError: if the samples have another shape or are not finite, or if their time does not increase.
    """

    def __init__(self, samples: np.ndarray) -> None:
        samples = np.asarray(samples, dtype=float)
        if samples.ndim != 2 or samples.shape[1] != 3 or len(samples) == 0:
            raise ValueError(f"samples has the shape {samples.shape}; it must be (T, 3) with columns {COLUMNS}")
        if not np.isfinite(samples).all():
            raise ValueError(f"samples has a value that is not finite in row {_first(~np.isfinite(samples).all(1))}")
        if (np.diff(samples[:, 0]) <= 0.0).any():
            raise ValueError(f"samples' time does not rise after row {_first(np.diff(samples[:, 0]) <= 0.0)}")
        self._samples = samples

    @staticmethod
    def read(path: Path | str) -> np.ndarray:
        """Read the samples in a CSV file with the header :data:`COLUMNS`.

        Args:
            path: the file.

        Raises:
            ValueError: if the header differs, or if the file holds anything other than numbers.
        """
        with Path(path).open() as file:
            header = file.readline().strip()
        if header != COLUMNS:
            raise ValueError(f"{path} begins with {header!r}; a recording begins with {COLUMNS!r}")
        return np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)

    def act(self, observation: np.ndarray, scene: np.ndarray) -> np.ndarray:
        """Recorded command at the scene's time [m/s^2, rad], shape (2,).

        Args:
            observation: the environment's observation; not used.
            scene: record of :data:`core.records.SCENE`; the time ``t`` is used.
        """
        t = float(scene["t"])
        return np.array([np.interp(t, self._samples[:, 0], self._samples[:, i]) for i in (1, 2)])


class RecordingDriver:
    """Records the commands of a driver; the recording holds the last episode.

    Args:
        driver: the driver to record.

    Attributes:
        driver: the driver to record.
    """

    def __init__(self, driver: Driver) -> None:
        self.driver = driver
        self._rows: list[tuple[float, float, float]] = []

    def reset(self, seed: int | None = None) -> None:
        """Begin a new recording.

        Args:
            seed: seed for the driver.
        """
        self._rows.clear()
        self.driver.reset(seed)

    def act(self, observation: np.ndarray, scene: np.ndarray) -> np.ndarray:
        """Record and return the driver's command.

        Args:
            observation: the environment's observation, shape (n,).
            scene: record of :data:`core.records.SCENE`.
        """
        a, delta = command = self.driver.act(observation, scene)
        self._rows.append((float(scene["t"]), float(a), float(delta)))
        return command

    def save(self, path: Path | str) -> None:
        """Write a CSV file that :meth:`RecordedDriver.read` reads back bit for bit.

        Args:
            path: the file.

        Raises:
            FileExistsError: if the file already exists.
        """
        with Path(path).open("x") as file:
            np.savetxt(
                file, np.array(self._rows).reshape(-1, 3), delimiter=",", header=COLUMNS, comments="", fmt="%.17g"
            )


def _first(wrong: np.ndarray) -> int:
    return int(np.flatnonzero(wrong)[0])
