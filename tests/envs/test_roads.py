import numpy as np
import pytest
from highway_env.vehicle.kinematics import Vehicle

from shared_control_env.core.parameters import TRAFFIC_BODY
from shared_control_env.core.world.road import locate, point_at, reference_line
from shared_control_env.envs import CurveEnv
from shared_control_env.envs.highway.road import road_network

SEGMENTS = [(60.0, 0.0), (200.0, 1 / 60), (120.0, -1 / 40), (50.0, 0.0)]
LINE = reference_line(SEGMENTS, lead_in=50.0)
NETWORK = road_network(LINE, lanes=3, lane_width=4.0)


@pytest.mark.parametrize("lane", [0, 1, 2])
def test_highway_envs_lanes_are_the_shifted_line(lane):
    for i, row in enumerate(LINE):
        highway = NETWORK.get_lane((str(i), str(i + 1), lane))
        stretch = 1.0 - row[4] * 4.0 * lane
        assert highway.length == pytest.approx(row[5] * stretch)
        for along in np.linspace(0.0, row[5], 7):
            x, y, psi = point_at(LINE, row[0] + min(along, row[5] - 1e-9), 4.0 * lane)
            np.testing.assert_allclose(highway.position(along * stretch, 0.0), [x, y], atol=1e-6)
            assert np.cos(highway.heading_at(along * stretch) - psi) == pytest.approx(1.0)


def test_local_coordinates_agree():
    rng = np.random.default_rng(0)
    for i, row in enumerate(LINE):
        lane = NETWORK.get_lane((str(i), str(i + 1), 0))
        for along, d in zip(rng.uniform(0.1, row[5] - 0.1, 20), rng.uniform(-4, 10, 20), strict=True):
            x, y, _ = point_at(LINE, row[0] + along, d)
            s, offset, _, _ = locate(LINE, x, y)
            longitudinal, lateral = lane.local_coordinates(np.array([x, y]))
            assert longitudinal == pytest.approx(s - row[0], abs=1e-8)
            assert lateral == pytest.approx(offset, abs=1e-8)


def test_bodies_are_highway_envs():
    assert (Vehicle.LENGTH, Vehicle.WIDTH) == TRAFFIC_BODY


def test_traffic_follows_its_lane_at_constant_speed():
    env = CurveEnv({"vehicles": [{"lane": 1, "position": 20.0, "speed": 8.0}], "duration": 20.0})
    env.reset(seed=0)
    vehicle = env.road.vehicles[1]
    for _ in range(300):
        vehicle.step(0.05)
    s, d, psi, _ = locate(env.line, *vehicle.position)
    assert d == pytest.approx(4.0, abs=1e-9)
    assert s == pytest.approx(20.0 + 300 * 0.05 * 8.0 / (1.0 - 4.0 / 60.0), abs=1e-6)
    assert np.cos(psi - vehicle.heading) == pytest.approx(1.0)
