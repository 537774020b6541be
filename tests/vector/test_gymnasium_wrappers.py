"""Gymnasium's own wrappers of vectorised environments work around ours, and say what they say around its own."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import shared_control_env  # noqa: F401

pytest.importorskip("array_api_compat", reason="Gymnasium's wrappers of vectorised environments need it")

from gymnasium.wrappers import vector as wrappers

ID, CONFIG = "SharedControl/LaneChange-v1", {"duration": 0.5}


def both(mode=AutoresetMode.NEXT_STEP):
    ours = gym.make_vec(ID, num_envs=3, config=CONFIG, autoreset_mode=mode)
    return ours, SyncVectorEnv([lambda: gym.make(ID, config=CONFIG)] * 3, autoreset_mode=mode)


@pytest.mark.parametrize(
    "wrap",
    [
        wrappers.NormalizeObservation,
        wrappers.NormalizeReward,
        lambda env: wrappers.ClipReward(env, -0.1, 0.1),
        lambda env: wrappers.RescaleAction(env, np.full(2, -2.0, np.float32), np.full(2, 2.0, np.float32)),
    ],
)
def test_same_as_around_gymnasiums_own(wrap):
    ours, theirs = map(wrap, both())
    np.testing.assert_allclose(ours.reset(seed=1)[0], theirs.reset(seed=1)[0], atol=1e-6)
    rng = np.random.default_rng(0)
    for _ in range(25):
        actions = (0.2 * rng.normal(size=(3, 2))).astype(np.float32)
        for x, y in zip(ours.step(actions)[:4], theirs.step(actions)[:4], strict=True):
            np.testing.assert_allclose(x, y, atol=1e-6)


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_statistics_of_episodes(mode):
    episodes = []
    for env in map(wrappers.RecordEpisodeStatistics, both(mode)):
        env.reset(seed=1)
        found = []
        for _ in range(25):
            infos = env.step(np.zeros((3, 2), dtype=np.float32))[4]
            if "episode" in infos:
                found += [
                    (infos["episode"]["l"][i], infos["episode"]["r"][i]) for i in np.flatnonzero(infos["_episode"])
                ]
        episodes.append(found)
    assert len(episodes[0]) >= 6
    np.testing.assert_allclose(*episodes, rtol=1e-6)


def test_infos_as_a_list_are_those_of_the_single_environment():
    env = wrappers.DictInfoToList(both()[0])
    single = gym.make(ID, config=CONFIG)
    env.reset(seed=1)
    info = single.reset(seed=2)[1]
    for _ in range(5):
        infos, info = env.step(np.zeros((3, 2)))[4], single.step(np.zeros(2))[4]
        assert infos[1].keys() == info.keys()
        np.testing.assert_allclose(infos[1]["z"], info["z"], atol=1e-9)
        assert infos[1]["automation"] == info["automation"]
