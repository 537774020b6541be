"""Resets of the vectorised environment: settings, seeds, draws and masks, and what is refused."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import shared_control_env  # noqa: F401
from shared_control_env.vector import episodes
from tests.vector.agreement import assert_same_info, at, compare, gentle_driver

TWO_LANE = "SharedControl/TwoLane-v1"
LANE_CHANGE = "SharedControl/LaneChange-v1"
SPEEDS = {"randomise": [{"setting": "ego.speed", "low": 8.0, "high": 16.0}]}
IN_PYTHON = {"setting": "road.segments.0.length", "low": 900.0, "high": 1000.0}
IMPOSSIBLE = {"randomise": [{"setting": "ego.lateral_offset", "choices": [0.1, 9.0]}], "faults": []}


def state(env):
    """All of a vectorised environment that a step may change."""
    return [array.copy() for array in env.unwrapped._batch]


def assert_unmoved(env, before):
    for a, b in zip(before, state(env), strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize(
    ("name", "config"),
    [(TWO_LANE, {"ego": {"speed": 9.0}}), (TWO_LANE, SPEEDS), (LANE_CHANGE, {"duration": 3.0})],
)
def test_changed_settings_begin_the_episode_that_the_single_environment_begins(name, config):
    single, many = gym.make(name), gym.make_vec(name, num_envs=2)
    single.reset(seed=1)
    many.reset(seed=0)
    observation, info = single.reset(options={"config": config})
    observations, infos = many.reset(options={"config": config})
    np.testing.assert_allclose(observations[1], observation, atol=1e-9)
    assert_same_info(infos, info, 1)
    np.testing.assert_allclose(many.step(np.zeros((2, 2)))[0][1], single.step(np.zeros(2))[0], atol=1e-9)


def test_settings_of_each():
    env = gym.make_vec(TWO_LANE, num_envs=3)
    env.reset(seed=0)
    infos = env.reset(options={"config": [{"ego": {"speed": speed}} for speed in (9.0, 10.0, 11.0)]})[1]
    np.testing.assert_array_equal(infos["state"][:, 3], [9.0, 10.0, 11.0])
    assert np.isfinite(env.step(np.zeros((3, 2)))[0]).all()
    with pytest.raises(ValueError, match="one for each of 3"):
        env.reset(options={"config": [{}, {}]})
    idm = "highway_env.vehicle.behavior.IDMVehicle"
    different = {"duration": 1.0, "simulation_frequency": 40, "policy_frequency": 10, "other_vehicles_type": idm}
    for name, value in different.items():
        with pytest.raises(ValueError, match=rf"\[1\]\['{name}'\]"):
            env.reset(options={"config": [{}, {name: value}, {}]})
    with pytest.raises(ValueError, match="as many entries"):
        env.reset(options={"config": [{}, {"vehicles": []}, {}]})


def test_changes_add_up_as_in_the_single_environment():
    env = gym.make_vec(TWO_LANE, num_envs=2)
    env.reset(seed=0)
    env.reset(options={"config": [{"ego": {"speed": 9.0}}, {}]})
    infos = env.reset(options={"config": {"duration": 3.0}})[1]
    np.testing.assert_array_equal(infos["state"][:, 3], [9.0, 15.0])
    infos = env.reset(options={"config": [{}, {"ego": {"speed": 8.0}}]})[1]
    np.testing.assert_array_equal(infos["state"][:, 3], [9.0, 8.0])
    assert env.unwrapped.config["duration"] == 3.0


@pytest.mark.parametrize(
    "arguments",
    [
        {"seed": [1, 2, 3]},
        {"seed": [1, -2]},
        {"seed": 1.5},
        {"options": {"config": {"other_vehicles_type": "highway_env.vehicle.behavior.IDMVehicle"}}},
        {"options": {"config": {"ego": {"speed": -1.0}}}},
        {"options": {"config": {"duration": 3.0}, "else": 1}},
    ],
)
def test_a_refused_reset_changes_nothing(arguments):
    env = gym.make_vec(TWO_LANE, num_envs=2)
    env.reset(seed=0)
    env.step(np.zeros((2, 2)))
    config, before = env.unwrapped.config, state(env)
    arguments.setdefault("options", {"config": {"duration": 3.0}})
    with pytest.raises(ValueError, match=r"seed|config|unknown"):
        env.reset(**arguments)
    assert env.unwrapped.config == config
    assert_unmoved(env, before)
    env.step(np.zeros((2, 2)))
    env.reset(options={"config": {"duration": 2.0}})
    assert env.unwrapped.config["duration"] == 2.0


@pytest.mark.parametrize("mode", ["next_step", "disabled"])
def test_an_episode_that_cannot_be_drawn_is_refused_when_it_would_begin(mode):
    env = gym.make_vec(TWO_LANE, num_envs=2, config={**IMPOSSIBLE, "duration": 0.1}, autoreset_mode=mode)
    seeds = range(30)
    never = next(seed for seed in seeds if offsets(seed)[0] > 1.0 > offsets(seed + 1)[0])
    once = next(seed for seed in seeds if max(offsets(seed)[0], *offsets(seed + 1)) < 1.0 < offsets(seed)[1])
    with pytest.raises(ValueError, match="lateral_offset"):
        env.reset(seed=never)
    with pytest.raises(ValueError, match="needed first"):
        env.step(np.zeros((2, 2)))
    env.reset(seed=once)
    for _ in range(2):
        env.step(np.zeros((2, 2)))
    before = state(env)
    anew = env.reset if mode == "disabled" else lambda: env.step(np.zeros((2, 2)))
    with pytest.raises(ValueError, match="lateral_offset"):
        anew()
    assert_unmoved(env, before)


def test_a_draw_refused_in_the_same_step_leaves_the_end_to_a_reset():
    env = gym.make_vec(TWO_LANE, num_envs=1, config={**IMPOSSIBLE, "duration": 0.05}, autoreset_mode="same_step")
    seed = next(seed for seed in range(20) if offsets(seed)[0] < 1.0 < offsets(seed)[1])
    env.reset(seed=seed)
    with pytest.raises(ValueError, match="lateral_offset"):
        env.step(np.zeros((1, 2)))
    with pytest.raises(ValueError, match="has ended"):
        env.step(np.zeros((1, 2)))
    env.reset(options={"config": {"randomise": []}})
    assert env.step(np.zeros((1, 2)))[3].all()


def offsets(seed):
    """Offsets that the first two episodes of a seed are to have."""
    rng = np.random.default_rng(seed)
    return [IMPOSSIBLE["randomise"][0]["choices"][int(rng.integers(2))] for _ in range(2)]


@pytest.mark.parametrize("name", [TWO_LANE, LANE_CHANGE])
def test_seeds_of_masked_environments_alone_count_as_in_gymnasium(name):
    ours = gym.make_vec(name, num_envs=4, config={"duration": 0.3}, autoreset_mode="disabled")
    theirs = SyncVectorEnv(
        [lambda: gym.make(name, config={"duration": 0.3})] * 4, autoreset_mode=AutoresetMode.DISABLED
    )
    mask = np.array([False, True, True, False])
    for env in (ours, theirs):
        env.reset(seed=[0, 1, 2, 3])
        env.step(np.zeros((4, 2)))
    results = [env.reset(seed=[7, 8, None, 9], options={"reset_mask": mask.copy()}) for env in (ours, theirs)]
    np.testing.assert_allclose(results[0][0], results[1][0], atol=1e-9)
    assert ours.unwrapped.np_random_seed == (0, 8, 2, 3)
    # The next draw of every generator is the one that it would have been.
    results = [env.reset() for env in (ours, theirs)]
    np.testing.assert_allclose(results[0][0], results[1][0], atol=1e-9)


def test_seeds_that_were_not_given_are_reported():
    env = gym.make_vec(LANE_CHANGE, num_envs=2)
    first = env.reset()[0]
    seeds = env.unwrapped.np_random_seed
    np.testing.assert_array_equal(env.reset(seed=list(seeds))[0], first)
    assert len(env.unwrapped.np_random) == 2


@pytest.mark.parametrize("mode", AutoresetMode)
def test_episodes_of_different_lengths_follow_gymnasiums_own(mode):
    config = {"duration": 4.0, "authority": {"law": "none"}, "degradations": ["sign_error", "stuck", "bias_ramp"]}
    ours = gym.make_vec(LANE_CHANGE, num_envs=3, config=config, autoreset_mode=mode)
    theirs = SyncVectorEnv([lambda: gym.make(LANE_CHANGE, config=config)] * 3, autoreset_mode=mode)
    actions = np.zeros((3, 2), dtype=np.float32)
    a, b = ours.reset(seed=3)[0], theirs.reset(seed=3)[0]
    ends = set()
    for step in range(200):
        np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-9)
        (a, *mine, infos), (b, *his, his_infos) = ours.step(actions), theirs.step(actions)
        for x, y in zip(mine, his, strict=True):
            np.testing.assert_allclose(x, y, atol=1e-9)
        ended = his[1] | his[2]
        if not ended.any():
            continue
        ends.add((step, *ended))
        if mode is AutoresetMode.SAME_STEP:
            np.testing.assert_array_equal(infos["_final_obs"], his_infos["_final_obs"])
            for i in np.flatnonzero(ended):
                np.testing.assert_allclose(infos["final_obs"][i], his_infos["final_obs"][i], atol=1e-9)
                assert_same_info(infos["final_info"], at(his_infos["final_info"], i), i)
        elif mode is AutoresetMode.DISABLED:
            a, b = (env.reset(options={"reset_mask": ended.copy()})[0] for env in (ours, theirs))
    assert len(ends) >= 4
    assert any(sum(ended) < 3 for _, *ended in ends)


@pytest.mark.parametrize("mode", ["next_step", "same_step"])
def test_a_reset_clears_the_drivers_report(mode):
    env = gym.make_vec(TWO_LANE, num_envs=2, driver=True, config={"duration": 0.5}, autoreset_mode=mode)
    env.reset(seed=0)
    for _ in range(9):
        infos = env.step(None)[4]
        assert (infos["driver"]["iterations"] > 0).all()
    infos = env.step(None)[4]
    if mode == "next_step":
        infos = env.step(None)[4]  # which begins anew
    else:
        assert (infos["final_info"]["driver"]["iterations"] > 0).all()
    np.testing.assert_array_equal(infos["k"], 0)
    np.testing.assert_array_equal(infos["driver"]["iterations"], 0)


def test_a_collision_does_not_outlive_its_episode():
    config = {"vehicles": [{"lane": 0, "position": 12.0, "speed": 0.0}], "authority": {"law": "driver_only"}}
    single, many = gym.make(TWO_LANE, config=config), gym.make_vec(TWO_LANE, num_envs=3, config=config)
    lengths = compare(single, many, gentle_driver, episodes=3)
    assert max(lengths) < 40  # all end in the vehicle ahead
    assert min(lengths) > 3


@pytest.mark.parametrize("mode", AutoresetMode)
@pytest.mark.parametrize(("name", "config"), [("draw_starts", {}), ("write_start", {"randomise": [IN_PYTHON]})])
def test_an_interrupted_reset_is_not_driven_on(mode, name, config, monkeypatch):
    env = gym.make_vec(LANE_CHANGE, num_envs=4, autoreset_mode=mode, config=config)
    env.reset(seed=0)
    for _ in range(10):
        env.step(np.zeros((4, 2)))

    def interrupted(*arguments):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(episodes, name, interrupted)
        with pytest.raises(KeyboardInterrupt):
            env.reset(options={"reset_mask": np.array([True, False, True, True])})
    if mode is AutoresetMode.NEXT_STEP:
        infos = env.step(np.zeros((4, 2)))[4]
        np.testing.assert_array_equal(infos["k"], [0, 10, 0, 0])
    else:
        with pytest.raises(ValueError, match="environment 0 has ended"):
            env.step(np.zeros((4, 2)))


def test_the_infos_mask_is_not_the_callers():
    env = gym.make_vec(TWO_LANE, num_envs=2)
    env.reset(seed=0)
    mask = np.array([True, False])
    infos = env.reset(options={"reset_mask": mask})[1]
    mask[:] = True
    np.testing.assert_array_equal(infos["_t"], [True, False])


@pytest.mark.parametrize("mode", ["next_step", "same_step"])
def test_changed_settings_act_on_the_episodes_that_begin_then(mode):
    """More faults and a longer road than there was room for; the episodes under way go on as without the change."""
    config = {"duration": 0.5, "faults": []}
    many = {
        "faults": [{"channel": "acceleration", "onset": 0.0, "size": 0.5}, {"onset": 0.0, "size": 0.01}],
        "road": {"segments": [{"length": 40.0}, {"length": 90.0, "curvature": 1 / 60}]},
    }
    changed, plain, after = (
        gym.make_vec(TWO_LANE, num_envs=2, config=c, autoreset_mode=mode) for c in (config, config, {**config, **many})
    )
    for env in (changed, plain, after):
        env.reset(seed=0)
    action = np.full((2, 2), 0.1)
    for _ in range(4):
        changed.step(action)
        plain.step(action)
    changed.unwrapped.set_config(many)
    for _ in range(6):
        a, b = changed.step(action), plain.step(action)
    if mode == "same_step":
        np.testing.assert_array_equal(a[4]["final_obs"], b[4]["final_obs"])
    else:
        np.testing.assert_array_equal(a[0], b[0])
        changed.step(action)
    for _ in range(9):
        a, b = changed.step(action), after.step(action)
        np.testing.assert_array_equal(a[0], b[0])
        np.testing.assert_array_equal(a[4]["u_a_f"], b[4]["u_a_f"])
    assert a[4]["fault_active"].all()
