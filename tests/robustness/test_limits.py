"""What is reachable is right: long drives, the road's end, large counts, solvers that lose their footing."""

import time

import gymnasium as gym
import numpy as np
import pytest

from shared_control_env.controllers.automation import Automation
from shared_control_env.core.control import automation as automation_mpc
from shared_control_env.envs import TwoLaneEnv
from shared_control_env.registration import ENVIRONMENTS
from shared_control_env.wrappers import DriverModel

TWO_LANE = "SharedControl/TwoLane-v1"
SOUND = {"faults": [], "degradations": []}


@pytest.mark.parametrize("name", [name for name in ENVIRONMENTS if "Recorded" not in name])  # whose road is recorded
def test_where_the_road_ends_the_episode_is_truncated(name):
    """Not failed: at the road's end the car is in its lane, and the loop is as sound as before."""
    segments = {"road": {"segments": [{"length": 30.0}, {"length": 60.0, "curvature": 0.002}]}}
    config = {**SOUND, **segments, "vehicles": [], "lane_change": None, "duration": 100.0, "randomise": []}
    env = DriverModel(gym.make(name, config=config))
    many = gym.make_vec(name, num_envs=2, config=config, driver=True, autoreset_mode="disabled")
    env.reset(seed=0)
    many.reset(seed=0)
    truncated = False
    while not truncated:
        _, _, terminated, truncated, info = env.step(0)
        _, _, terminations, truncations, _ = many.step(np.zeros(2, dtype=int))
        assert not terminated
        assert not terminations.any()
        assert truncations.tolist() == [truncated] * 2
    assert 90.0 - 35.0 / 20 < info["z"][0] < 90.0
    assert abs(info["z"][1] - info["y_target"]) < 0.3
    assert info["alpha_a"] > 0.9


@pytest.mark.parametrize(
    ("name", "duration"), [("Curve", 40.0), ("Bend", 120.0), ("CurveWithLead", 120.0), ("TwoLane", 200.0)]
)
def test_a_duration_beyond_the_road_fails_nobody(name, duration):
    env = DriverModel(gym.make(f"SharedControl/{name}-v1", config={"duration": duration, **SOUND}))
    for seed in range(3):
        env.reset(seed=seed)
        ended = False
        while not ended:
            _, _, terminated, ended, _ = env.step(0)
            assert not terminated


COUNTS = {
    "duration": ({"duration": 1e9}, "largest is 3600"),
    "no duration": ({"duration": float("inf")}, "largest is 3600"),
    "simulation_frequency": ({"simulation_frequency": 20_000_000}, "largest is 1000"),
    "policy_frequency": ({"policy_frequency": 4000, "simulation_frequency": 4000}, "largest is"),
    "lanes": ({"road": {"lanes": 10**6}}, "smaller than|largest is"),
    "length": ({"road": {"segments": [{"length": 1e12}]}}, "largest is"),
    "segments": ({"road": {"segments": [{"length": 1.0}] * 100_000}}, "at most 200"),
    "vehicles": ({"vehicles": [{"lane": 0, "position": 20.0, "speed": 1.0}] * 100_000}, "at most 100"),
    "faults": ({"faults": [{"onset": 1.0, "size": 0.1}] * 1000}, "at most 20"),
    "fault size": ({"faults": [{"onset": 1.0, "size": 1e9}]}, r"must lie in \[-3.14159, 3.14159\]"),
    "fault seed": ({"faults": [{"kind": "white_noise", "onset": 1.0, "size": 0.1, "seed": 2**64}]}, "smaller than"),
    "small screen": ({"screen_width": 600, "screen_height": 150}, r"screen_height'\] = 150.*the smallest is 200"),
    "large screen": ({"screen_width": 10**6}, "the largest is 4096"),
    "iterations": ({"solver": {"iterations": 10**9}}, "the largest is 100"),
    "speed": ({"ego": {"speed": 1e6}}, "the largest is 60"),
    "weight": ({"automation": {"W": 1e300}}, "the largest is"),
    "mass": ({"vehicle": {"m": 1e-300}}, "the smallest is 100"),
}


@pytest.mark.parametrize("make", [gym.make, lambda name, config: gym.make_vec(name, num_envs=1, config=config)])
@pytest.mark.parametrize(("config", "message"), COUNTS.values(), ids=list(COUNTS))
def test_too_much_is_refused_at_once_with_the_bound(config, message, make):
    begin = time.perf_counter()
    with pytest.raises(ValueError, match=message):
        make(TWO_LANE, config=config)
    assert time.perf_counter() - begin < 2.0


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("frequency", [1, 2, 5])
def test_the_automation_is_finite_at_low_frequencies_and_long_horizons(frequency, seed):
    rng = np.random.default_rng(seed)
    automation = {
        "H_p": int(rng.integers(1, 31)),
        "H_c": int(rng.integers(1, 11)),
        **{name: float(10.0 ** rng.uniform(-9, 9)) for name in ("W", "H", "N", "Q_a", "Q_delta", "R")},
    }
    name = list(ENVIRONMENTS)[seed % len(ENVIRONMENTS)]
    env = gym.make_vec(name, num_envs=16, threads=1, config={"policy_frequency": frequency, "automation": automation})
    env.reset(seed=seed)
    for _ in range(10):
        observations, rewards, terminations, _, infos = env.step(rng.uniform(-1.0, 1.0, (16, 2)))
        for key in ("u_a_des", "u", "state", "alpha_a"):
            assert np.isfinite(infos[key]).all(), key
        assert np.isfinite(observations).all()
        assert np.isfinite(rewards[~terminations]).all()


def test_an_indefinite_hessian_is_a_failure_that_holds_the_last_command(monkeypatch):
    config = {"policy_frequency": 1, "automation": {"H_p": 30, "Q_a": 1e-12, "Q_delta": 1e-12, "R": 0.0}}
    env = gym.make_vec("SharedControl/Bend-v1", num_envs=256, threads=1, config=config)
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    failed = 0
    before = np.zeros((256, 2))
    for _ in range(8):
        _, _, terminations, _, infos = env.step(rng.uniform(-1.0, 1.0, (256, 2)))
        status, command = infos["automation"]["status"], infos["u_a_des"]
        assert np.isfinite(command).all()
        lost = status == automation_mpc.FAILED
        failed += lost.sum()
        np.testing.assert_array_equal(command[lost], before[lost])
        assert (infos["automation"]["failures"][lost] > 0).all()
        before = command
        assert not terminations.all()
    assert failed > 0


@pytest.mark.parametrize("index", range(6))
def test_a_state_that_is_lost_ends_the_episode(index):
    env = TwoLaneEnv()
    env.reset(seed=0)
    env.vehicle.array[index] = np.nan
    _, _, terminated, _, _ = env.step({"driver": np.zeros(2), "authority": np.ones(1)})
    assert terminated != np.isfinite(env.vehicle.array).all()  # the plant takes a lost speed for standstill


def test_the_automation_by_itself_gives_finite_commands_in_any_scene():
    env = TwoLaneEnv({"faults": []})
    env.reset(seed=0)
    automation, rng = Automation(env.parameters), np.random.default_rng(1)
    automation.reset()
    for _ in range(200):
        scene = env.scene.copy()
        scene["z"] += rng.normal(size=6) * [0.0, 3.0, 0.5, 10.0, 3.0, 1.0]
        scene["kappa"] = rng.normal() * 0.02
        solution = automation.act(scene)
        assert np.isfinite(solution.command).all()
        assert (np.abs(solution.command) <= env.command_limits + 1e-12).all()
