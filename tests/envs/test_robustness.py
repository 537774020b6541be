"""A solver that fails or a blocked corridor never ends the episode."""

import numpy as np

from shared_control_env.controllers import Automation
from shared_control_env.core.control import automation as automation_mpc
from shared_control_env.core.parameters import LateralRiskParameters
from shared_control_env.core.records import SAFE_AREA
from shared_control_env.core.risk.corridor import new_scratch, search_triangles
from shared_control_env.core.risk.lateral import lateral_risk
from shared_control_env.core.risk.safe_area import BLOCKED
from shared_control_env.core.risk.triangulation import MAX_HOLES, triangulate_any
from shared_control_env.envs import TwoLaneEnv
from shared_control_env.wrappers import AuthorityLimiter, DriverModel
from tests import compiled


def test_a_failing_automation_holds_its_last_command_and_is_counted():
    env = DriverModel(AuthorityLimiter(TwoLaneEnv({"faults": [], "duration": 2.0})))
    env.reset(seed=0)
    env.step(0)
    bare = env.unwrapped

    class Blind(Automation):
        """The automation, which does not know where it is."""

        blind = False

        def act(self, scene):
            scene["z"][1] = np.nan if self.blind else scene["z"][1]
            return super().act(scene)

    bare.automation = Blind(bare.parameters)
    env.step(0)
    bare.automation.blind = True
    _, _, _, _, before = env.step(0)
    for count in range(1, 11):
        _, _, terminated, truncated, info = env.step(0)
        assert not terminated
        assert not truncated
        assert info["automation"]["status"] == automation_mpc.FAILED
        assert info["automation"]["failures"] >= count
        np.testing.assert_array_equal(info["u_a_des"], before["u_a_des"])
    bare.automation.blind = False
    env.step(0)
    assert env.step(0)[4]["automation"]["status"] != automation_mpc.FAILED


def test_a_blocked_corridor_is_reported_and_driven_on():
    # A wide load beside the lane reaches into it, its centre in the other lane.
    env = DriverModel(AuthorityLimiter(TwoLaneEnv({"faults": [], "vehicles": [], "duration": 2.0})))
    env.reset(seed=0)
    bare = env.unwrapped
    load = bare._vehicle_class(bare.road, (40.0, 2.5), heading=0.0, speed=0.0)
    load.array[7] = 5.4
    bare.road.vehicles.append(load)
    outcomes = []
    for _ in range(30):
        _, _, terminated, _, info = env.step(0)
        outcomes.append(info["safe_area_outcome"])
        assert not terminated
        assert np.isfinite(info["u"]).all()
    assert outcomes[-1] == BLOCKED
    assert lateral_risk(bare.scene["area"][()], 35.0, 0.0, LateralRiskParameters()) < 0.05
    assert lateral_risk(bare.scene["area"][()], 50.0, 0.0, LateralRiskParameters()) == 1.0


def test_out_of_the_lane_the_driver_comes_back():
    env = DriverModel(AuthorityLimiter(TwoLaneEnv({"faults": [], "vehicles": [], "duration": 4.0})))
    env.reset(seed=0)
    env.unwrapped.vehicle.array[1] = 2.6
    for _ in range(80):
        _, _, terminated, _, info = env.step(0)
        assert not terminated
    assert abs(info["z"][1]) < 0.5


def test_more_vehicles_than_the_compiled_triangulation_takes():
    vehicles = [{"lane": i % 2, "position": 9.0 + 3.0 * i, "speed": 0.0} for i in range(10)]
    change = {"lane": 1, "onset": 0.0, "duration": 9.0}
    env = TwoLaneEnv({"faults": [], "vehicles": vehicles, "lane_change": change})
    env.reset(seed=0)
    env.step({"driver": np.zeros(2), "authority": np.ones(1)})
    corners = np.zeros((10, 4, 2))
    holes = compiled.sense(
        env.steps, env.vehicle.array, env.traffic, env.line, env.parameters, env.scene.copy(), corners
    )
    assert holes > MAX_HOLES
    triangles = triangulate_any(env.scene["region"], corners[:holes])
    area = np.zeros((), SAFE_AREA)[()]
    region, d = env.scene["region"], float(env.scene["z"][1])
    search_triangles(triangles, region[0], region[1], d, 2.0, new_scratch(len(triangles)), area)
    for side in ("lower", "upper"):
        np.testing.assert_array_equal(env.scene["area"][side], area[side])
    assert np.ptp(area["upper"][:, 1]) > 0.5  # the vehicles bound it
