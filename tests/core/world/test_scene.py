"""What is perceived of poses and speeds, against positions and lanes that are known."""

import numpy as np
import pytest

from shared_control_env.core.parameters import Parameters, TaskParameters
from shared_control_env.core.records import (
    FOLLOWER,
    LEADER,
    NEAR_D,
    NEAR_ROW,
    NEAR_S,
    NEAR_SPEED,
    PRECEDING,
    PRESENT,
    SCENE,
    pack,
)
from shared_control_env.core.world.road import point_at, reference_line
from tests.compiled import sense

BEND = reference_line([(20.0, 0.0), (100.0, 0.02), (100.0, -0.01)], lead_in=50.0)
SPEED = 12.0


def row(line, s, d, speed, heading=0.0):
    x, y, psi = point_at(line, s, d)
    return [x, y, psi + heading, speed, 0.0, 0.0, 5.0, 2.0]


def seen(line=BEND, s=30.0, d=0.3, heading=0.05, others=(), k=0, **task):
    x, y, psi = point_at(line, s, d)
    state = np.array([x, y, psi + heading, SPEED, 0.2, 0.1])
    traffic = np.array([row(line, *other) for other in others]).reshape(-1, 8)
    scene, corners = np.zeros((), SCENE), np.zeros((8, 4, 2))
    parameters = pack(Parameters(task=TaskParameters(**task)))
    count = sense(k, state, traffic, line, parameters, scene, corners)
    return scene, corners[:count]


def test_the_road_frame():
    scene, _ = seen()
    np.testing.assert_allclose(scene["z"], [30.0, 0.3, 0.05, SPEED, 0.2, 0.1], atol=1e-9)
    assert scene["state"][3] == SPEED


def test_the_curvature_is_that_of_the_stages_ahead():
    scene, _ = seen(s=15.0)
    stations = 15.0 + 0.05 * SPEED * np.arange(10)
    np.testing.assert_array_equal(scene["kappa"][:10], np.where(stations < 20.0, 0.0, 0.02))


def test_each_neighbour_is_the_nearest_in_its_lane():
    others = [
        (70.0, 0.1, 9.0),
        (50.0, -0.2, 10.0),
        (20.0, 0.0, 8.0),
        (45.0, 4.1, 13.0),
        (24.0, 3.9, 11.0),
        (5.0, 4.0, 7.0),
        (35.0, 9.0, 6.0),
    ]
    scene, _ = seen(others=others)
    near = scene["neighbours"]
    assert (near[:, PRESENT] == 1.0).all()
    for which, index in ((PRECEDING, 1), (LEADER, 3), (FOLLOWER, 4)):
        s, d, speed = others[index]
        np.testing.assert_allclose(near[which, [NEAR_S, NEAR_D, NEAR_SPEED, NEAR_ROW]], [s, d, speed, index], atol=1e-9)


def test_the_speed_of_a_neighbour_is_that_along_the_road():
    scene, _ = seen(others=[(50.0, 0.0, 10.0, 0.3)])
    assert scene["neighbours"][PRECEDING, NEAR_SPEED] == pytest.approx(10.0 * np.cos(0.3))


def test_behind_nobody_the_target_speed_is_the_tasks_and_the_region_reaches_the_look_ahead():
    scene, corners = seen(target_speed=14.0)
    assert scene["v_target"] == 14.0
    np.testing.assert_allclose(scene["region"], [30.0, 90.0, -2.0, 2.0], atol=1e-9)
    assert len(corners) == 0


def test_behind_a_slower_vehicle_the_region_ends_before_its_rear():
    scene, _ = seen(others=[(55.0, 0.0, 9.0)], target_speed=14.0)
    assert scene["v_target"] == pytest.approx(9.0)
    assert scene["region"][1] == pytest.approx(55.0 - 2.5 - 2.0)
    assert scene["bodies"] == 5.0


CHANGE = {"y_goal": 4.0, "change_onset": 1.0, "change_duration": 4.0}


@pytest.mark.parametrize(("t", "changing", "y_target"), [(1.0, False, 0.0), (3.0, True, 2.0), (5.0, False, 4.0)])
def test_a_lane_change_moves_the_target_and_opens_both_lanes(t, changing, y_target):
    scene, _ = seen(k=round(t / 0.05), **CHANGE)
    assert bool(scene["changing"]) is changing
    assert scene["y_target"] == pytest.approx(y_target)
    low, high = scene["region"][2:]
    assert (low, high) == ((-2.0, 6.0) if changing else (y_target - 2.0, y_target + 2.0))


def test_vehicles_that_reach_into_the_region_are_its_holes():
    scene, corners = seen(others=[(60.0, 2.5, 9.0), (200.0, 0.0, 9.0)])
    assert len(corners) == 1  # with its edge at 1.5 m, in a lane that ends at 2 m
    np.testing.assert_allclose(corners[0].mean(axis=0), [60.0, 2.5], atol=1e-9)
    assert np.ptp(corners[0], axis=0) == pytest.approx([5.0, 2.0])
