"""Drivers from recordings, and recordings of drivers."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from shared_control_env.controllers.driver import Driver

COLUMNS = "t,a,delta"
"""Header of a recording: time [s], desired acceleration [m/s^2] and front steering angle [rad]."""


class RecordedDriver:
    """Gives the commands of a recording at the time of the episode, linear between its samples, held beyond its ends.

    It follows the clock and not the road: it fits the episode it was recorded in, or a task such as a given manoeuvre.

    Args:
        samples: rows ``t, a, delta``, at least one, t rising, shape (T, 3) [s, m/s^2, rad].

    Raises:
        ValueError: for samples of another shape, that are not finite, or whose time does not rise.
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
        """The samples in a CSV file with the header :data:`COLUMNS`.

        Raises:
            ValueError: if the header is another, or it holds something else than numbers.
        """
        with Path(path).open() as file:
            header = file.readline().strip()
        if header != COLUMNS:
            raise ValueError(f"{path} begins with {header!r}; a recording begins with {COLUMNS!r}")
        return np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)

    def reset(self, seed: int | None = None) -> None:
        """Nothing is remembered."""

    def act(self, observation: np.ndarray, scene: np.ndarray) -> np.ndarray:
        """Recorded command at the scene's time, shape (2,)."""
        t = float(scene["t"])
        return np.array([np.interp(t, self._samples[:, 0], self._samples[:, i]) for i in (1, 2)])


class RecordingDriver:
    """Keeps what a driver commands, the last episode's.

    Args:
        driver: who drives.
    """

    def __init__(self, driver: Driver) -> None:
        self.driver = driver
        self._rows: list[tuple[float, float, float]] = []

    def reset(self, seed: int | None = None) -> None:
        """Begin a new recording."""
        self._rows.clear()
        self.driver.reset(seed)

    def act(self, observation: np.ndarray, scene: np.ndarray) -> np.ndarray:
        """The driver's command, kept."""
        a, delta = command = self.driver.act(observation, scene)
        self._rows.append((float(scene["t"]), float(a), float(delta)))
        return command

    def save(self, path: Path | str) -> None:
        """Write a CSV file that :meth:`RecordedDriver.read` reads, to the bit.

        Raises:
            FileExistsError: if there is such a file already.
        """
        with Path(path).open("x") as file:
            np.savetxt(
                file, np.array(self._rows).reshape(-1, 3), delimiter=",", header=COLUMNS, comments="", fmt="%.17g"
            )


def _first(wrong: np.ndarray) -> int:
    return int(np.flatnonzero(wrong)[0])
