"""The road along the ego's lane: a reference line of arcs through the middle of the lane, with its width along it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.interpolate import make_smoothing_spline

from shared_control_env.core.world.road import (
    LEFT,
    LEFT_SLOPE,
    LENGTH,
    RIGHT,
    RIGHT_SLOPE,
    S0,
    WIDTH,
    WIDTH_SLOPE,
    locate,
    reference_line,
)
from shared_control_env.envs.recorded.recording import Recording

SPACING = 5.0
"""Length of an arc [m]."""

FINE = 0.5
"""Distance between the points of the middle line [m]."""

SMOOTHNESS = 30.0
"""Weight of the second derivative of the heading in its smoothing spline [m^4]."""

BEYOND = 150.0
"""Length by which the line goes on straight beyond the recorded lanes, behind and ahead [m]."""


class LaneRoad(NamedTuple):
    """The road along one lane.

    Attributes:
        line: reference line with s = 0 at its beginning, in a frame in which it begins at the origin along x.
        origin: position of the beginning in the recording, shape (2,) [m].
        turn: heading of the line there [rad].
        end: path length at which the recorded lanes end [m].
        lanes: number of lanes side by side.
    """

    line: np.ndarray
    origin: np.ndarray
    turn: float
    end: float
    lanes: int

    def into(self, rows: np.ndarray) -> np.ndarray:
        """Positions and headings of the recording in the frame of the line.

        Args:
            rows: x, y and heading in the first columns, shape (n, m) [m, m, rad]; further columns stay.
        """
        c, s = np.cos(self.turn), np.sin(self.turn)
        moved = rows.copy()
        dx, dy = rows[:, 0] - self.origin[0], rows[:, 1] - self.origin[1]
        moved[:, 0], moved[:, 1], moved[:, 2] = c * dx + s * dy, -s * dx + c * dy, rows[:, 2] - self.turn
        return moved


def road_along(recording: Recording, x: float, y: float) -> LaneRoad:
    """The road along the lane that contains a position, with the lanes that it comes from and leads to.

    Args:
        recording: the recording.
        x, y: the position [m].

    Raises:
        ValueError: if no lane contains the position, or if lanes lead back to themselves.
    """
    chain = chain_of(recording, lane_at(recording, x, y))
    sides = ("left", "right")
    left, right = (_resampled(np.vstack([getattr(recording.lanes[n], side) for n in chain])) for side in sides)
    middle = 0.5 * (_at_shares(left) + _at_shares(right))
    line, origin, turn = _line_through(_resampled(middle))
    length = float(line[-1, S0] + line[-1, LENGTH]) - 2.0 * BEYOND
    rightmost, leftmost = _outermost(recording, chain[0], "right"), _outermost(recording, chain[0], "left")
    made = LaneRoad(line, origin, turn, BEYOND + length, len(rightmost) + len(leftmost) - 1)
    borders = {
        "lane": (left, right),
        "road": tuple(
            _resampled(np.vstack([getattr(recording.lanes[_outermost(recording, n, side)[-1]], side) for n in chain]))
            for side in sides
        ),
    }
    _write_widths(made, borders)
    return made


def most_rows(recording: Recording) -> int:
    """Largest number of rows of a reference line through any lane of a recording.

    Args:
        recording: the recording.
    """
    lengths = []
    for name in recording.lanes:
        chain = [recording.lanes[each] for each in chain_of(recording, name)]
        for borders in ([lane.left for lane in chain], [lane.right for lane in chain]):
            lengths.append(sum(float(np.hypot(*np.diff(border, axis=0).T).sum()) for border in borders))
    return 4 + round(max(lengths) / SPACING)


def lane_at(recording: Recording, x: float, y: float) -> str:
    """The lane that contains a position.

    Args:
        recording: the recording.
        x, y: the position [m].

    Raises:
        ValueError: if there is none.
    """
    from shapely import Point, Polygon

    for name, lane in recording.lanes.items():
        if Polygon(np.vstack([lane.left, lane.right[::-1]])).buffer(0.05).contains(Point(x, y)):
            return name
    raise ValueError(f"{recording.source}: no lane contains the position ({x:.2f}, {y:.2f}) m")


def chain_of(recording: Recording, name: str) -> list[str]:
    """A lane with the lanes that it comes from and leads to, the first of each.

    Args:
        recording: the recording.
        name: the lane.

    Raises:
        ValueError: if they lead back to one of them.
    """
    chain = [name]
    for attribute, end in (("successors", -1), ("predecessors", 0)):
        while more := getattr(recording.lanes[chain[end]], attribute):
            if more[0] in chain:
                raise ValueError(
                    f"{recording.source}: the {attribute} of the lane {name} lead back to the lane {more[0]}"
                )
            chain.insert(len(chain) if end else 0, more[0])
    return chain


def _outermost(recording: Recording, name: str, side: str) -> list[str]:
    """A lane and its neighbours on a side, up to the outermost."""
    chain = [name]
    while (other := getattr(recording.lanes[chain[-1]], f"lane_to_{side}")) is not None:
        chain.append(other)
    return chain


def _resampled(points: np.ndarray) -> np.ndarray:
    """A polyline at equal distances of about FINE, without double points."""
    step = np.hypot(*np.diff(points, axis=0).T)
    points = points[np.concatenate([[True], step > 1e-6])]
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    grid = np.linspace(0.0, along[-1], max(2, round(along[-1] / FINE) + 1))
    return np.stack([np.interp(grid, along, points[:, i]) for i in range(2)], axis=1)


def _at_shares(points: np.ndarray, n: int = 2000) -> np.ndarray:
    """A polyline at n equal shares of its length."""
    shares = np.linspace(0.0, len(points) - 1.0, n)
    return np.stack([np.interp(shares, np.arange(len(points)), points[:, i]) for i in range(2)], axis=1)


def _line_through(middle: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Arcs through a middle line, between straights of the length BEYOND; its beginning, and the heading there."""
    steps = np.diff(middle, axis=0)
    length = np.hypot(*steps.T)
    along = np.concatenate([[0.0], np.cumsum(length)])
    heading = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    total = along[-1]
    n = max(1, round(total / SPACING))
    ends = np.linspace(0.0, total, n + 1)
    places = 0.5 * (along[1:] + along[:-1])
    if len(places) >= 5:
        spline = make_smoothing_spline(places, heading, lam=SMOOTHNESS)
        at_ends = spline(np.clip(ends, places[0], places[-1]))
    else:
        at_ends = np.full(n + 1, heading.mean())
    curvature = np.diff(at_ends) / np.diff(ends)
    segments = [(BEYOND, 0.0), *((total / n, float(k)) for k in curvature), (BEYOND, 0.0)]
    line = reference_line(segments)
    turn = float(at_ends[0])
    origin = middle[0] - BEYOND * np.array([np.cos(turn), np.sin(turn)])
    return line, origin, turn


def _write_widths(road: LaneRoad, borders: dict[str, tuple[np.ndarray, ...]]) -> None:
    """Write the width of the lane and the edges of the road into the rows of the line, as linear along each arc."""
    offsets = {}
    for name, pair in borders.items():
        for side, points in zip(("left", "right"), pair, strict=True):
            moved = road.into(np.column_stack([points, np.zeros(len(points))]))
            s, d = np.array([locate(road.line, px, py)[:2] for px, py in moved[:, :2]]).T
            order = np.argsort(s)
            offsets[name, side] = s[order], d[order]
    begins = road.line[:, S0]
    ends = begins + road.line[:, LENGTH]

    def at(name: str, side: str, where: np.ndarray) -> np.ndarray:
        return np.interp(where, *offsets[name, side])

    for column, slope, value in (
        (WIDTH, WIDTH_SLOPE, lambda s: at("lane", "left", s) - at("lane", "right", s)),
        (RIGHT, RIGHT_SLOPE, lambda s: at("road", "right", s)),
        (LEFT, LEFT_SLOPE, lambda s: at("road", "left", s)),
    ):
        first, last = value(begins), value(ends)
        road.line[:, column], road.line[:, slope] = first, (last - first) / road.line[:, LENGTH]
