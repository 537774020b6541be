"""Reader of CommonRoad scenarios (format 2020a, XML): lanelets, dynamic obstacles and planning problems."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import numpy as np

from shared_control_env.envs.recorded.recording import Lane, Recording, Start, Track, check

LARGEST = 50_000_000
"""Largest size of a file [bytes]."""

DEEPEST = 30
"""Largest depth of nested elements; the format has about ten."""

VERSIONS = ("2020a", "2018b")
"""Versions of the format whose lanelets, obstacles and planning problems are read."""


def read_commonroad(path: Path) -> Recording:
    """Read a scenario.

    Of the file are read: lanelets with their borders, neighbours in the same direction, successors and predecessors;
    dynamic obstacles with a rectangular shape and a trajectory; and the initial states of planning problems. Traffic
    signs, lights, static obstacles and goals are left aside.

    Args:
        path: XML file.

    Raises:
        ValueError: for a file that is none, or that is wrong in itself, naming file and element.
    """
    root = _parsed(path)
    version = root.get("commonRoadVersion")
    if root.tag != "commonRoad" or version not in VERSIONS:
        raise ValueError(f"{path} is no CommonRoad scenario of the version {' or '.join(VERSIONS)} but {version!r}")
    dt = _number(root.get("timeStepSize"), f"{path}: timeStepSize")
    if not 0.001 <= dt <= 1.0:
        raise ValueError(f"{path}: timeStepSize = {dt:g} s must lie in [0.001, 1]")
    recording = Recording(
        str(path),
        {_id(each, path): _lane(each, f"{path}: lanelet {_id(each, path)}") for each in root.findall("lanelet")},
        {
            _id(each, path): _track(each, dt, f"{path}: dynamicObstacle {_id(each, path)}")
            for each in root.findall("dynamicObstacle")
        },
        {
            _id(each, path): _start(each, dt, f"{path}: planningProblem {_id(each, path)}")
            for each in root.findall("planningProblem")
        },
    )
    check(recording)
    return recording


def _parsed(path: Path) -> Any:
    """The root element, without entities, document types or deep nesting, which nothing needs here."""
    try:
        size = path.stat().st_size
        if size > LARGEST:
            raise ValueError(f"{path} has {size} bytes; at most {LARGEST} are read")
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise ValueError(f"{path} is no text in UTF-8") from None
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {error.strerror or error}") from None
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ValueError(f"{path} declares a document type or entities, which are not read")
    parser: Any = ElementTree.XMLPullParser(["start", "end"])
    depth = 0
    root = None
    try:
        parser.feed(text)
        parser.close()
        for event, element in parser.read_events():
            root = element if root is None else root
            depth += 1 if event == "start" else -1
            if depth > DEEPEST:
                raise ValueError(f"{path} nests elements more than {DEEPEST} deep")
    except ElementTree.ParseError as error:
        raise ValueError(f"{path} is no whole XML file: {error}") from None
    if root is None:
        raise ValueError(f"{path} is no whole XML file: it is empty")
    return root


def _id(element: Any, path: Path) -> str:
    name = element.get("id")
    if not name:
        raise ValueError(f"{path}: a {element.tag} has no id")
    return str(name)


def _lane(element: Any, label: str) -> Lane:
    def neighbour(tag: str) -> str | None:
        found = element.find(tag)
        return found.get("ref") if found is not None and found.get("drivingDir") == "same" else None

    def refs(tag: str) -> tuple[str, ...]:
        return tuple(str(each.get("ref")) for each in element.findall(tag))

    left, right = (_border(element, tag, label) for tag in ("leftBound", "rightBound"))
    neighbours = neighbour("adjacentLeft"), neighbour("adjacentRight")
    return Lane(left, right, *neighbours, refs("successor"), refs("predecessor"))


def _border(element: Any, tag: str, label: str) -> np.ndarray:
    points = element.findall(f"{tag}/point")
    return np.array([[_value(p, axis, f"{label}: {tag}") for axis in ("x", "y")] for p in points]).reshape(-1, 2)


def _track(element: Any, dt: float, label: str) -> Track:
    rectangle = element.find("shape/rectangle")
    if rectangle is None:
        raise ValueError(f"{label} has no rectangular shape; other shapes are not read")
    states = [*element.findall("initialState"), *element.findall("trajectory/state")]
    rows = [_state(state, f"{label}, state {i}") for i, state in enumerate(states)]
    t, x, y, heading = np.array(rows).reshape(-1, 4).T
    length, width = (_value(rectangle, name, f"{label}: shape") for name in ("length", "width"))
    return Track(length, width, t * dt, x, y, heading)


def _state(element: Any, label: str) -> tuple[float, float, float, float]:
    """Time step, position and heading."""
    position = [_value(element, f"position/point/{axis}", label) for axis in ("x", "y")]
    return _value(element, "time/exact", label), position[0], position[1], _value(element, "orientation/exact", label)


def _start(element: Any, dt: float, label: str) -> Start:
    initial = element.find("initialState")
    if initial is None:
        raise ValueError(f"{label} has no initialState")
    t, x, y, heading = _state(initial, label)
    return Start(t * dt, x, y, heading, _value(initial, "velocity/exact", label))


def _value(element: Any, path: str, label: str) -> float:
    return _number(element.findtext(path), f"{label}: {path}")


def _number(text: str | None, label: str) -> float:
    if text is None:
        raise ValueError(f"{label} is missing")
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{label} = {text!r} is no number") from None
