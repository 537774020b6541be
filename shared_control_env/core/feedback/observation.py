"""Observations: what a driver can perceive, as a bounded vector, in named and versioned specifications.

The settings select one specification. :func:`add_observation` adds a specification from outside the package.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, pi
from typing import Any, NamedTuple

import numpy as np

from shared_control_env.core.compile.calls import MATRIX, SINGLES, Interface
from shared_control_env.core.compile.jit import jit
from shared_control_env.core.parameters import Parameters
from shared_control_env.core.records import MEMORY, NEAR_D, NEAR_S, NEAR_SPEED, PRESENT, SCENE, Memory, Scene, pack
from shared_control_env.core.world.road import curvature_at
from shared_control_env.nearest import check_new_name, hint

PREVIEW = np.array([0.0, 10.0, 20.0, 40.0])
"""Distances ahead at which the observation contains the road's curvature [m]."""

WRITE = Interface(None, Scene, Memory, MATRIX, Parameters, SINGLES)
"""``write(scene, memory, line, p, out)``: write the features of an observation, in their units, to out, shape (n,)."""

_write = WRITE.call


class Observation(NamedTuple):
    """Specification of an observation. A specification never changes: a changed one gets a new name.

    Attributes:
        name: name in the settings, version included.
        features: name and scale of every entry; the entry is the feature divided by its scale, clipped to [-1, 1].
        write: function that writes the features in their units, compiled with the signature :data:`WRITE`.
    """

    name: str
    features: tuple[tuple[str, float], ...]
    write: Callable[..., None]

    @property
    def size(self) -> int:
        """Number of entries of the observation."""
        return len(self.features)

    @property
    def scales(self) -> np.ndarray:
        """Scale of every entry, in the unit of the feature, shape (n,)."""
        return np.array([scale for _, scale in self.features])

    def place_of(self, feature: str) -> int:
        """Index of a feature in the observation.

        Args:
            feature: name of the feature.

        Raises:
            ValueError: if the observation has no feature of this name.
        """
        names = [name for name, _ in self.features]
        if feature not in names:
            raise ValueError(f"observation {self.name!r} has no feature {feature!r}; {hint(feature, names)}")
        return names.index(feature)


_DRIVER_V0 = (
    ("lateral error y - y_target [m]", 4.0),
    ("heading relative to the road [rad]", pi / 4),
    ("longitudinal speed v_x [m/s]", 40.0),
    ("lateral speed v_y [m/s]", 5.0),
    ("yaw rate r [rad/s]", 1.0),
    ("speed error v_x - v_target [m/s]", 20.0),
    ("curvature at the ego [1/m]", 0.05),
    ("curvature 10 m ahead [1/m]", 0.05),
    ("curvature 20 m ahead [1/m]", 0.05),
    ("curvature 40 m ahead [1/m]", 0.05),
    *(
        (f"{name} {feature}", scale)
        for name in ("follower", "leader", "preceding")
        for feature, scale in (
            ("present [-]", 1.0),
            ("distance along the road [m]", 100.0),
            ("distance across the road [m]", 8.0),
            ("speed minus the ego's [m/s]", 20.0),
        )
    ),
    ("own last acceleration command / a_max [-]", 1.0),
    ("own last steering command / delta_max [-]", 1.0),
    ("alpha_a as displayed [-]", 1.0),
)


def _write_driver_v0(scene: Scene, memory: Memory, line: np.ndarray, p: Parameters, out: np.ndarray) -> None:
    """Write the driver's view. It does not contain the fault, the automation's command or the risk."""
    z = scene.z
    out[0], out[1], out[2], out[3], out[4] = z[1] - scene.y_target, z[2], z[3], z[4], z[5]
    out[5] = z[3] - scene.v_target
    n = 6
    for i in range(PREVIEW.shape[0]):
        out[n] = curvature_at(line, z[0] + PREVIEW[i], 0.0)
        n += 1
    for i in range(3):
        near = scene.neighbours[i]
        if near[PRESENT] > 0.0:
            out[n], out[n + 1], out[n + 2] = 1.0, near[NEAR_S] - z[0], near[NEAR_D] - z[1]
            out[n + 3] = near[NEAR_SPEED] - z[3]
        else:
            out[n], out[n + 1], out[n + 2], out[n + 3] = 0.0, 0.0, 0.0, 0.0
        n += 4
    out[n] = memory.u_h_des[0] / p.limits.a_max
    out[n + 1] = memory.u_h_des[1] / p.limits.delta_max
    out[n + 2] = scene.displayed


DRIVER_V0 = Observation("driver-v0", _DRIVER_V0, _write_driver_v0)
"""The driver's view; the default observation of every environment."""

OBSERVATIONS: dict[str, Observation] = {DRIVER_V0.name: DRIVER_V0}
"""All observations by name."""

STANDARD = tuple(OBSERVATIONS)
"""Names of the observations that belong to the package; those added later follow them in :data:`OBSERVATIONS`."""


def add_observation(observation: Observation) -> None:
    """Add an observation. Settings can then select it by its name.

    Args:
        observation: specification whose name includes its version; its function is compiled here.

    Raises:
        ValueError: if the name is taken, or if numba cannot compile the function.
    """
    check_new_name("observation", observation.name, OBSERVATIONS)
    features: tuple[Any, ...] = observation.features or (None,)
    for feature in features:
        pair = isinstance(feature, tuple | list) and len(feature) == 2
        if not pair or not isinstance(feature[1], int | float) or not 0.0 < feature[1] < inf:
            raise ValueError(f"observation {observation.name!r} has feature = {feature!r}, not a name and a scale > 0")
    _check_writes(observation)
    OBSERVATIONS[observation.name] = observation


def _check_writes(observation: Observation) -> None:
    """Raise ValueError if an observation writes more entries than it has features; that would be another's memory."""
    size = observation.size
    out = np.full(size + 1000, np.nan, dtype=np.float32)
    scene, memory = np.zeros((), SCENE), np.zeros((), MEMORY)
    line, parameters = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 100.0]]), pack(Parameters())
    write_features(WRITE.address(observation.write), scene, memory, line, parameters, out)
    beyond = np.flatnonzero(~np.isnan(out[size:]))
    if len(beyond):
        raise ValueError(
            f"observation {observation.name!r} writes entry {size + beyond[0]}, but it has {size} features"
        )


@jit
def write_features(address: int, scene: Any, memory: Any, line: np.ndarray, parameters: Any, out: np.ndarray) -> None:
    """Write the features of an observation in their units; records come as 0-d arrays.

    Args:
        address: address of the observation's compiled function.
        scene: record of :data:`records.SCENE`.
        memory: record of :data:`records.MEMORY`.
        line: reference line, shape (m, 12).
        parameters: record of :class:`core.parameters.Parameters`.
        out: written, float32, at least as many entries as features.
    """
    _write(address, scene[()], memory[()], line, parameters[()], out)


@jit
def observe(
    address: int, scales: np.ndarray, scene: Scene, memory: Memory, line: np.ndarray, p: Parameters, out: np.ndarray
) -> None:
    """Write the observation of a scene: the features divided by their scales, clipped to [-1, 1].

    Args:
        address: address of the observation's compiled function.
        scales: scales of the features, in the units of the features, shape (n,).
        scene: record of :data:`records.SCENE`.
        memory: record of :data:`records.MEMORY`, which holds the driver's last command.
        line: reference line, shape (m, 12).
        p: parameters.
        out: observation [-], written, float32, shape (n,).
    """
    for i in range(out.shape[0]):
        out[i] = 0.0  # for what the observation leaves out
    _write(address, scene, memory, line, p, out)
    for i in range(out.shape[0]):
        out[i] = min(max(out[i] / scales[i], -1.0), 1.0)
