"""Scenes for tests, made without an environment."""

from __future__ import annotations

import numpy as np

from shared_control_env.core.parameters import Parameters
from shared_control_env.core.records import SCENE, pack
from shared_control_env.core.risk.triangulation import triangulate_any
from shared_control_env.core.world.road import reference_line
from tests import compiled

STRAIGHT = reference_line([(1000.0, 0.0)], lead_in=50.0)
NO_HOLES = np.empty((0, 4, 2))
NO_TRAFFIC = np.empty((0, 8))


def traffic(*rows: tuple[float, float, float]) -> np.ndarray:
    """Vehicles ``(x, y, speed)`` along x."""
    return np.array([[x, y, 0.0, v, 0.0, 0.0, 5.0, 2.0] for x, y, v in rows]).reshape(-1, 8)


def scene_of(
    state: np.ndarray,
    parameters: np.ndarray | None = None,
    others: np.ndarray = NO_TRAFFIC,
    line: np.ndarray = STRAIGHT,
    k: int = 0,
) -> np.ndarray:
    """Perceived scene with its safe area found."""
    parameters = pack(Parameters()) if parameters is None else parameters
    scene = np.zeros((), SCENE)
    corners = np.zeros((len(others), 4, 2))
    count = compiled.sense(k, state, others, line, parameters, scene, corners)
    compiled.search(triangulate_any(scene["region"], corners[:count]), parameters, scene)
    return scene


def random_state(rng: np.random.Generator) -> np.ndarray:
    """An ego state in or near its lane, from a crawl to 30 m/s."""
    return np.array(
        [
            0.0,
            rng.uniform(-1.8, 1.8),
            rng.uniform(-0.06, 0.06),
            rng.uniform(1.0, 30.0),
            rng.uniform(-0.3, 0.3),
            rng.uniform(-0.15, 0.15),
        ]
    )
