"""The vectorised environment gives what the single one gives, and follows Gymnasium's vector interface."""

import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import shared_control_env  # noqa: F401
from shared_control_env.core.authority.laws import LAWS
from shared_control_env.core.compile.lanes import WIDTH
from shared_control_env.core.faults.kinds import KINDS
from shared_control_env.core.risk.safe_area import BLOCKED
from shared_control_env.envs import TwoLaneEnv
from shared_control_env.envs.degradations import DEGRADATIONS
from shared_control_env.envs.scenarios import TWO_LANE as SCENARIO
from shared_control_env.registration import ENVIRONMENTS
from shared_control_env.vector.environment import SharedControlVectorEnv
from shared_control_env.wrappers import DriverModel
from tests.vector.agreement import assert_same_info, at, compare, flat, gentle_driver, random_driver

IDS = ["SharedControl/TwoLane-v1", "SharedControl/Curve-v1"]
TWO_LANE = "SharedControl/TwoLane-v1"
BIAS = {"onset": 0.2, "ramp": 0.4}
NINE = [{"lane": 1, "position": 9.0 * i, "speed": 9.0} for i in range(9)]
FAULTS = {
    "none": [],
    "steering": [{"channel": "steering", "size": 0.2, **BIAS}],
    "acceleration": [{"channel": "acceleration", "size": 3.0, **BIAS}],
    "both": [{"channel": "steering", "size": -0.1, **BIAS}, {"channel": "acceleration", "size": -2.0, **BIAS}],
}


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("name", IDS)
def test_same_as_the_single_environment(name, fault, law):
    config = {"faults": FAULTS[fault], "authority": {"law": law}, "duration": 6.0}
    single = gym.make(name, config=config)
    many = gym.make_vec(name, num_envs=3, config=config)
    assert compare(single, many, random_driver, seed=len(fault) + len(law))[0] > 10


@pytest.mark.parametrize("degradation", DEGRADATIONS)
@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_same_in_every_scenario_under_every_degradation(name, degradation):
    config = {"degradations": [degradation], "duration": 4.0, "authority": {"law": "proportional"}}
    single, many = gym.make(name, config=config), gym.make_vec(name, num_envs=2, config=config)
    assert compare(single, many, gentle_driver, seed=len(name), index=0)[0] > 10


@pytest.mark.parametrize("law", ["proportional", "driver_only"])
@pytest.mark.parametrize("name", ["SharedControl/LeadBraking-v1", "SharedControl/CutIn-v1"])
def test_same_close_behind_others_and_in_collisions(name, law):
    # Beside a vehicle just ahead the free region is a rectangle, whose triangulation is not unique.
    config = {"authority": {"law": law}, "simulation_frequency": 60}
    single, many = gym.make(name, config=config), gym.make_vec(name, num_envs=2, config=config)
    lengths = compare(single, many, random_driver, seed=1, index=0, episodes=8)
    assert min(lengths) < 150  # some end in a collision or off the road


@pytest.mark.parametrize("config", [{"vehicle": {"width": 4.2}}, {"road": {"lane_width": 1.9}, "vehicles": []}])
def test_same_where_the_lane_is_narrower_than_the_vehicle(config):
    single, many = gym.make(TWO_LANE, config=config), gym.make_vec(TWO_LANE, num_envs=3, config=config)
    assert single.reset(seed=0)[1]["safe_area_outcome"] == BLOCKED
    compare(single, many, gentle_driver)


@pytest.mark.parametrize("kind", [kind.name for kind in KINDS.values() if kind.unit is not None])
def test_same_in_episodes_that_begin_anew_under_a_degradation(kind, tmp_path):
    # What a degradation remembers of one episode must not act in the next.
    fault = {"kind": kind, "onset": 0.0, "size": 0.1, **({"seed": 1} if KINDS[kind].draws else {})}
    if KINDS[kind].recorded:
        (tmp_path / "profile.csv").write_text("t,value\n0,0\n0.3,1\n1,-1\n")
        fault["file"] = str(tmp_path / "profile.csv")
    config = {"faults": [fault], "duration": 0.6, "authority": {"law": "none"}}
    single, many = gym.make(TWO_LANE, config=config), gym.make_vec(TWO_LANE, num_envs=3, config=config)
    assert compare(single, many, random_driver, episodes=3) == [12, 12, 12]


@pytest.mark.parametrize("mode", ["next_step", "same_step"])
@pytest.mark.parametrize("name", ["SharedControl/LaneChange-v1", "SharedControl/Bend-v1"])
def test_same_episodes_are_drawn_one_after_the_other(name, mode):
    config = {"duration": 0.5}
    single, many = gym.make(name, config=config), gym.make_vec(name, num_envs=3, config=config, autoreset_mode=mode)
    kernel = many.unwrapped
    single.reset(seed=7)
    many.reset(seed=[5, 6, 7])
    drawn = set()
    for _ in range(4):
        left_out = {"offscreen_rendering"}  # which the single environment settles by its render mode
        episode = single.unwrapped.episode.model_dump(exclude=left_out)
        assert kernel.episodes[2].model_dump(exclude=left_out) == episode
        drawn.add(str(episode))
        done = False
        while not done:
            _, _, terminated, truncated, info = single.step(np.zeros(2))
            observations, _, terminations, truncations, infos = many.step(np.zeros((3, 2)))
            done = terminated or truncated
            assert done == (terminations[2] or truncations[2])
            if not done:
                assert_same_info(infos, info, 2)
        observation, info = single.reset()
        if mode == "next_step":
            observations, _, _, _, infos = many.step(np.zeros((3, 2)))
        np.testing.assert_allclose(observations[2], observation, atol=1e-9)
        assert_same_info(infos, info, 2)
    assert len(drawn) == 4


def test_a_rollout_of_a_drawn_scenario_draws_every_episode():
    config = {"duration": 0.5}
    many = [gym.make_vec("SharedControl/CutIn-v1", num_envs=3, driver=True, config=config) for _ in range(2)]
    for env in many:
        env.reset(seed=0)
    rewards = np.array([many[0].step(None)[1] for _ in range(25)])
    np.testing.assert_array_equal(many[1].unwrapped.rollout(25).rewards, rewards)
    assert many[0].unwrapped.episodes == many[1].unwrapped.episodes


def test_environments_of_a_drawn_scenario_differ_and_repeat_with_their_seeds():
    env = gym.make_vec("SharedControl/LaneKeeping-v1", num_envs=4)
    first = env.reset(seed=[1, 2, 1, None])[0]
    assert (first[0] == first[2]).all()
    assert (first[0] != first[1]).any()
    again = env.reset(seed=[1, 2, 1, None])[0]
    np.testing.assert_array_equal(first[:3], again[:3])


def test_a_drawn_episode_is_shown_as_it_is():
    env = gym.make_vec("SharedControl/Bend-v1", num_envs=2, render_mode="rgb_array", config={"duration": 0.2})
    env.reset(seed=0)
    first = env.render()[0]
    for _ in range(6):
        env.step(np.zeros((2, 2)))
    assert env.render()[0].shape == first.shape
    assert env.unwrapped._pictures._viewer_env.settings.road == env.unwrapped.episodes[-1].road


@pytest.mark.parametrize("name", IDS)
def test_same_over_a_full_episode_at_finer_simulation_steps(name):
    config = {"faults": FAULTS["steering"], "simulation_frequency": 60, "longitudinal_risk": {"preset": "paper"}}
    assert compare(gym.make(name, config=config), gym.make_vec(name, num_envs=3, config=config), gentle_driver)[0] > 40


def test_same_where_vehicles_reach_into_the_driving_region():
    # Slow vehicles whose lane lies half across the edge: the region has holes, so that the triangles count.
    vehicles = [{"lane": 1, "position": s, "speed": 3.0} for s in (15.0, 28.0, 45.0)]
    config = {"vehicles": vehicles, "faults": FAULTS["steering"], "duration": 5.0}
    single = gym.make(TWO_LANE, config=config)
    many = gym.make_vec(TWO_LANE, num_envs=3, config=config)
    start = many.unwrapped._setup.starts.traffic[0]
    start[:, 1] -= (1.2, 1.6, 0.9)
    start[:, 2] += (0.05, -0.1, 0.0)
    place = single.unwrapped._place_vehicles

    def place_across():
        single.unwrapped._batch.traffic[0] = start
        place()
        for vehicle, row in zip(single.unwrapped.road.vehicles[1:], start, strict=True):
            vehicle.array[:] = row

    single.unwrapped._place_vehicles = place_across
    assert compare(single, many, gentle_driver)[0] > 15
    outline = many.step(np.zeros((3, 2)))[4]["safe_area_upper"]
    assert np.ptp(outline[0, :, 1]) > 0.1  # the boundary does bend around a vehicle


def test_same_for_an_allocator():
    single = DriverModel(TwoLaneEnv({"authority": {"law": "proportional"}}))
    many = gym.make_vec(TWO_LANE, num_envs=3, config={"authority": {"law": "proportional"}}, limiter=False, driver=True)
    assert many.single_action_space == gym.spaces.Box(0.0, 1.0, (1,), np.float32)
    single.reset(seed=0)
    many.reset(seed=0)
    for _ in range(60):
        alpha = np.full((3, 1), 0.3, dtype=np.float32)
        info = single.step(alpha[0])[4]
        infos = many.step(alpha)[4]
        assert infos["alpha_a"][1] == info["alpha_a"]
        # The drivers' solvers differ: OSQP to 1e-5, the active set to rounding.
        np.testing.assert_allclose(infos["u_h_des"][1], info["u_h_des"], atol=2e-3)


@pytest.mark.parametrize("config", [{}, {"internal_model": {"active": True}, "authority": {"law": "proportional"}}])
@pytest.mark.parametrize("name", [*IDS, "SharedControl/Bend-v1"])
def test_driver_in_the_kernel_is_the_predictive_driver(name, config):
    single = DriverModel(gym.make(name, config=config))
    many = gym.make_vec(name, num_envs=2, driver=True, config=config)
    single.reset(seed=0)
    many.reset(seed=0)
    done = False
    while not done:
        _, _, terminated, truncated, info = single.step(0)
        infos = many.step(None)[4]
        np.testing.assert_allclose(infos["z"][0], info["z"], atol=2e-2)  # OSQP stops at 1e-5
        assert infos["driver"]["status"][0] == 0
        assert infos["driver"]["primal_residual"][0] < 1e-8
        assert infos["driver"]["dual_residual"][0] < 1e-6
        done = terminated or truncated


def test_a_rollout_is_the_steps_in_one_call():
    config = {"duration": 1.5}
    stepped = gym.make_vec(TWO_LANE, num_envs=3, driver=True, config=config)
    rolled = gym.make_vec(TWO_LANE, num_envs=3, driver=True, config=config)
    for env in (stepped, rolled):
        env.reset(seed=0)
    rewards, ends = [], []
    for _ in range(70):
        _, reward, terminated, truncated, _ = stepped.step(None)
        rewards.append(reward)
        ends.append(terminated | truncated)
    result = rolled.rollout(70)
    np.testing.assert_array_equal(result.rewards, rewards)
    np.testing.assert_array_equal(result.ends, ends)
    np.testing.assert_array_equal(stepped.step(None)[0], rolled.step(None)[0])


def test_threads_change_nothing():
    results = []
    for threads in (1, 2, 3):
        env = gym.make_vec(TWO_LANE, num_envs=5 * WIDTH + 3, threads=threads)
        env.reset(seed=0)
        rng = np.random.default_rng(0)
        results.append([env.step(random_driver(rng, env))[:4] for _ in range(40)])
        env.close()
    for other in results[1:]:
        for a, b in zip(results[0], other, strict=True):
            for x, y in zip(a, b, strict=True):
                np.testing.assert_array_equal(x, y)


@pytest.mark.parametrize("mode", AutoresetMode)
def test_autoreset_follows_gymnasiums_own(mode):
    config = {"duration": 0.3}
    ours = gym.make_vec(TWO_LANE, num_envs=2, config=config, autoreset_mode=mode)
    theirs = SyncVectorEnv([lambda: gym.make(TWO_LANE, config=config)] * 2, autoreset_mode=mode)
    assert ours.metadata["autoreset_mode"] is mode
    rng = np.random.default_rng(0)
    pairs = [(ours.reset(seed=3), theirs.reset(seed=3))]
    for _ in range(20):
        actions = random_driver(rng, ours)
        pairs.append((ours.step(actions), theirs.step(actions)))
        if mode is AutoresetMode.DISABLED and pairs[-1][0][3].all():
            with pytest.raises(ValueError, match="environment 0 has ended"):
                ours.step(actions)
            mask = np.array([True, True])
            pairs.append((ours.reset(options={"reset_mask": mask}), theirs.reset(options={"reset_mask": mask.copy()})))
    for a, b in pairs:
        for x, y in zip(a[:-1], b[:-1], strict=True):
            np.testing.assert_allclose(x, y, atol=1e-9)
        finals = {key for key in b[-1] if key.startswith(("final", "_final"))}
        assert finals == {key for key in a[-1] if key.startswith(("final", "_final"))}
        for i in range(2):
            assert_same_info(
                {k: v for k, v in a[-1].items() if not k.startswith("final")},
                {k: at(v, i) for k, v in b[-1].items() if not k.startswith(("final", "_"))},
                i,
            )
            if finals and a[-1]["_final_obs"][i]:
                np.testing.assert_allclose(a[-1]["final_obs"][i], b[-1]["final_obs"][i], atol=1e-9)
                assert a[-1]["final_info"]["t"][i] == b[-1]["final_info"]["t"][i]


def test_reset_mask_touches_the_named_environments_alone():
    env = gym.make_vec(TWO_LANE, num_envs=3)
    env.reset(seed=0)
    for _ in range(10):
        observations = env.step(np.full((3, 2), 0.05))[0]
    mask = np.array([False, True, False])
    reset, infos = env.reset(options={"reset_mask": mask})
    np.testing.assert_array_equal(reset[[0, 2]], observations[[0, 2]])
    assert not np.array_equal(reset[1], observations[1])
    np.testing.assert_array_equal(infos["_t"], mask)
    infos = env.step(np.full((3, 2), 0.05))[4]
    np.testing.assert_array_equal(infos["k"], [10, 0, 10])


def test_spaces_seeds_and_infos():
    env = gym.make_vec(TWO_LANE, num_envs=4)
    assert env.observation_space.shape == (4, 25)
    env.action_space.seed(1)
    first = env.action_space.sample()
    env.action_space.seed(1)
    observations, infos = env.reset(seed=[5, 6, 7, None])
    np.testing.assert_array_equal(env.action_space.sample(), first)
    assert env.observation_space.contains(observations)
    assert env.unwrapped.np_random_seed[:3] == (5, 6, 7)
    for path, value in flat(infos).items():
        assert value.dtype != object, path
        assert len(value) == 4
    kept = {path: value.copy() for path, value in flat(infos).items()}
    env.step(first)
    for path, value in flat(infos).items():
        np.testing.assert_array_equal(value, kept[path])


def test_options_change_the_settings_of_all():
    env = gym.make_vec(TWO_LANE, num_envs=2)
    env.reset(seed=0)
    env.reset(options={"config": {"ego": {"speed": 9.0}}})
    assert (env.step(np.zeros((2, 2)))[4]["state"][:, 3] == 9.0).all()


def test_spec_round_trips():
    env = gym.make_vec(TWO_LANE, num_envs=2, config={"duration": 1.0})
    again = gym.make_vec(gym.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    assert again.num_envs == 2
    assert again.unwrapped.config == env.unwrapped.config


def test_renders_every_environment_as_the_single_one():
    config = {"faults": FAULTS["steering"]}
    single = gym.make(TWO_LANE, config=config, render_mode="rgb_array")
    many = gym.make_vec(TWO_LANE, num_envs=3, config=config, render_mode="rgb_array")
    single.reset(seed=0)
    many.reset(seed=0)
    for _ in range(30):
        single.step(np.zeros(2, dtype=np.float32))
        many.step(np.zeros((3, 2), dtype=np.float32))
    frames = many.render()
    assert len(frames) == 3
    for frame in frames:
        np.testing.assert_array_equal(frame, single.render())
    many.close()


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_bad_action_names_its_environment_and_moves_nothing(bad):
    env = gym.make_vec(TWO_LANE, num_envs=5)
    env.reset(seed=0)
    actions = np.zeros((5, 2))
    env.step(actions)
    before = [array.copy() for array in env.unwrapped._batch]
    actions[3, 1] = bad
    with pytest.raises(ValueError, match="environment 3"):
        env.step(actions)
    for a, b in zip(before, env.unwrapped._batch, strict=True):
        assert (a == b).all()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda env: env.step(np.zeros((5, 2))), r"shape \(5, 2\); it must be numbers of shape \(3, 2\)"),
        (lambda env: env.step([[0.0, 0.0], [0.0], [0.0, 0.0]]), "must be numbers"),
        (lambda env: env.step([["a", "b"]] * 3), "must be numbers"),
        (lambda env: env.step(np.zeros((3, 2), dtype=complex)), "must be numbers"),
        (lambda env: env.reset(seed=[1, 2]), "one for each of 3"),
        (lambda env: env.reset(options={"config": {"vehicles": NINE}}), "0 to 8"),
        (lambda env: env.reset(seed=[1, 2.5, 3]), "seed of environment 1 = 2.5"),
        (lambda env: env.reset(seed=[1, 2, -3]), "seed of environment 2 = -3"),
        (lambda env: env.reset(options=[1]), "must be a dict"),
        (lambda env: env.reset(options={"config": 3}), "must be a dict, or a list"),
        (lambda env: env.reset(options={"maks": 1}), "unknown key"),
        (lambda env: env.reset(options={"reset_mask": [1] * 3}), "bool array"),
        (lambda env: env.reset(options={"reset_mask": np.zeros(3, dtype=bool)}), "names no environment"),
        (lambda env: env.reset(options={"config": {"duratoin": 1.0}}), "duration"),
        (lambda env: env.unwrapped.rollout(3), "open are"),
        (lambda env: gym.make_vec(TWO_LANE, num_envs=2, driver=True).unwrapped.rollout(3), "reset\\(\\) is needed"),
    ],
)
def test_refused(call, message):
    env = gym.make_vec(TWO_LANE, num_envs=3)
    env.reset(seed=0)
    with pytest.raises(ValueError, match=message):
        call(env)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"num_envs": 0}, "num_envs = 0"),
        ({"num_envs": 2.5}, "num_envs = 2.5"),
        ({"threads": True}, "threads = True"),
        ({"threads": 0}, "threads = 0"),
        ({"driver": object()}, "must be True or False"),
        ({"autoreset_mode": "sometimes"}, "one of"),
        ({"render_mode": "ansi"}, "render_mode = 'ansi'"),
        ({"config": {"other_vehicles_type": "highway_env.vehicle.behavior.IDMVehicle"}}, "not in the kernel"),
        ({"config": {"vehicles": NINE}}, "0 to 8"),
        ({"config": {"authority": {"law": "papr"}}}, "'paper'"),
    ],
)
def test_wrong_construction(options, message):
    with pytest.raises(ValueError, match=message):
        SharedControlVectorEnv(SCENARIO, **options)


def test_stepping_before_a_reset():
    with pytest.raises(ValueError, match="reset"):
        gym.make_vec(TWO_LANE, num_envs=2).step(np.zeros((2, 2)))


def test_starts_without_highway_env():
    code = (
        "import sys, gymnasium as gym, shared_control_env\n"
        "gym.make_vec('SharedControl/TwoLane-v1', num_envs=2).reset(seed=0)\n"
        "print([name for name in ('highway_env', 'pygame', 'pandas') if name in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_memory_of_an_environment(name):
    env = gym.make_vec(name, num_envs=64).unwrapped
    most = 5_700 if name != "SharedControl/Recorded-v1" else 15_000  # a long line, and many vehicles
    assert sum(array.nbytes for array in env._batch) // 64 == env.bytes_per_environment <= most


class Failing:
    """An allocator whose authority is undefined from the fourth step on."""

    @staticmethod
    def compiled(now):
        alpha = 0.5 if now.scene.k < 3 or now.scene.k > 4 else np.nan
        return 1.0, alpha, 0


@pytest.mark.parametrize(
    "drive", [lambda env: env.rollout(10), lambda env: [env.step(np.zeros(2, int)) for _ in "0123"]]
)
def test_an_authority_that_is_no_number_is_refused(drive):
    env = gym.make_vec(TWO_LANE, num_envs=2, driver=True, limiter=Failing())
    env.reset(seed=0)
    with pytest.raises(ValueError, match="environment 0 alpha_a = nan"):
        drive(env)
