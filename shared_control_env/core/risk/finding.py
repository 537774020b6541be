"""The safe area C of a scene (Table I): triangulation around the vehicles, then search, in preallocated scratch."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from shared_control_env.core.compile.calls import Interface
from shared_control_env.core.compile.jit import jit_inlined
from shared_control_env.core.parameters import Parameters
from shared_control_env.core.records import Scene, record_dtype
from shared_control_env.core.risk import triangulation
from shared_control_env.core.risk.corridor import Scratch, new_scratch, search_triangles
from shared_control_env.core.risk.safe_area import is_whole, whole_region
from shared_control_env.core.risk.triangulation import MAX_HOLES, MAX_TRIANGLES

_SEARCH = np.dtype(
    [(name, array.dtype, array.shape) for name, array in new_scratch(MAX_TRIANGLES)._asdict().items()], align=True
)
"""Structured type with the arrays of :class:`corridor.Scratch`."""


class Finding:
    """Scratch memory for finding one scene's safe area.

    Attributes:
        triangles: scratch and result of the triangulation.
        search: arrays of :class:`corridor.Scratch`.
        corners: corners of the vehicles in the driving region, (s, d) [m].
    """

    triangles: triangulation.Workspace
    search: Annotated[Scratch, _SEARCH]
    corners: Annotated[np.ndarray, (MAX_HOLES, 4, 2)]


FINDING = record_dtype(Finding)


def triangulate(scene: Scene, count: int, work: Finding) -> int:
    """Triangulate the driving region of a scene by :func:`triangulation.triangulate`.

    Args:
        scene: record of :data:`records.SCENE`.
        count: number of vehicles in the region; ``work.corners`` holds their corners.
        work: record of :data:`FINDING`; the triangles are written to ``work.triangles``.

    Returns:
        Number of triangles; 0 if the triangulation fails, so that the area counts as blocked.
    """
    return max(0, triangulation.triangulate(scene.region, work.corners, count, work.triangles))


def search(scene: Scene, p: Parameters, n: int, work: Finding) -> None:
    """Find the safe area from the first n triangles of ``work.triangles`` by :func:`corridor.search_triangles`.

    Args:
        scene: record of :data:`records.SCENE`; its safe area is written.
        p: parameters.
        n: number of triangles.
        work: record of :data:`FINDING`.
    """
    triangles, w = work.triangles.triangles[:n], work.search
    scratch = Scratch(w.neighbours, w.distance, w.at, w.parent, w.entry, w.done, w.sequence, w.stack, w.ring)
    search_triangles(triangles, scene.region[0], scene.region[1], scene.z[1], p.vehicle.width, scratch, scene.area)


TRIANGULATE = Interface(int, Scene, int, Finding)
"""``triangulate(scene, count, work) -> n``, compiled separately from the loop."""

SEARCH = Interface(None, Scene, Parameters, int, Finding)
"""``search(scene, p, n, work)``, compiled separately from the loop."""

_triangulate, _search = TRIANGULATE.call, SEARCH.call


@jit_inlined
def find_area(count: int, scene: Scene, p: Parameters, triangulate_at: int, search_at: int, work: Finding) -> None:
    """Find the safe area of a scene, which excludes the vehicles in the driving region.

    Args:
        count: number of vehicles in the region, at most MAX_HOLES; ``work.corners`` holds their corners.
        scene: record of :data:`records.SCENE`; its safe area is written.
        p: parameters.
        triangulate_at, search_at: addresses of the compiled functions.
        work: record of :data:`FINDING`.
    """
    if is_whole(count, scene.region, p.vehicle.width):
        whole_region(scene.region, scene.area)
        return
    n = _triangulate(triangulate_at, scene, count, work)
    _search(search_at, scene, p, n, work)
