import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs the extra 'train'")

from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor, VecNormalize, VecVideoRecorder

import shared_control_env  # noqa: F401
from shared_control_env.vector.stable_baselines import StableBaselinesVecEnv

TWO_LANE = "SharedControl/TwoLane-v1"
CONFIG = {"duration": 1.0}


def bare(n=4, **options):
    return gym.make_vec(TWO_LANE, num_envs=n, autoreset_mode="same_step", config=CONFIG, **options)


def make(n=4, **options):
    return StableBaselinesVecEnv(bare(n, **options))


def test_same_as_stable_baselines_own_over_the_single_environment():
    ours, theirs = make(), DummyVecEnv([lambda: gym.make(TWO_LANE, config=CONFIG)] * 4)
    ours.seed(0)
    theirs.seed(0)
    np.testing.assert_allclose(ours.reset(), theirs.reset(), atol=1e-9)
    rng = np.random.default_rng(0)
    ended = 0
    for _ in range(50):
        actions = (0.1 * rng.normal(size=(4, 2))).astype(np.float32)
        a, b = ours.step(actions), theirs.step(actions)
        for x, y in zip(a[:3], b[:3], strict=True):
            np.testing.assert_allclose(x, y, atol=1e-6)
        for done, x, y in zip(a[2], a[3], b[3], strict=True):
            if done:
                ended += 1
                np.testing.assert_allclose(x["terminal_observation"], y["terminal_observation"], atol=1e-9)
                assert x["TimeLimit.truncated"] == y["TimeLimit.truncated"]
    assert ended >= 8


def test_monitor_counts_episodes():
    env = VecNormalize(VecMonitor(make(), info_keywords=("crashed", "speed")))
    env.reset()
    episodes = []
    for _ in range(45):
        infos = env.step(np.zeros((4, 2), dtype=np.float32))[3]
        episodes += [info["episode"] for info in infos if "episode" in info]
    assert [episode["l"] for episode in episodes] == [20] * 8
    assert {bool(episode["crashed"]) for episode in episodes} == {False}
    assert all(5.0 < episode["speed"] < 30.0 for episode in episodes)


def test_ppo_learns_on_it_and_repeats():
    weights = []
    for _ in range(2):
        model = PPO("MlpPolicy", VecMonitor(make()), n_steps=32, batch_size=64, seed=1, device="cpu")
        model.learn(256)
        weights.append(model.policy.state_dict()["action_net.weight"].numpy().copy())
    np.testing.assert_array_equal(*weights)


def test_refused():
    with pytest.raises(ValueError, match="same_step"):
        StableBaselinesVecEnv(gym.make_vec(TWO_LANE, num_envs=2))
    with pytest.raises(ValueError, match="SharedControlVectorEnv"):
        StableBaselinesVecEnv(gym.make_vec("CartPole-v1", num_envs=2, vectorization_mode="sync"))
    with pytest.raises(ValueError, match="config"):
        make().set_attr("config", {})


def test_gymnasiums_vector_wrappers_go_before_it():
    wrapped = gym.wrappers.vector.RecordEpisodeStatistics(gym.wrappers.vector.ClipReward(bare(), -0.5, 0.5))
    env, plain = StableBaselinesVecEnv(wrapped), make()
    for each in (env, plain):
        each.seed(0)
        each.reset()
    returns, lengths, ended = np.zeros(env.num_envs), np.zeros(env.num_envs, dtype=int), 0
    rng = np.random.default_rng(0)
    for _ in range(400):
        actions = rng.uniform(-0.5, 0.5, (env.num_envs, 2)).astype(np.float32)
        observations, rewards, dones, infos = env.step(actions)
        bare_observations, bare_rewards, *_ = plain.step(actions)
        np.testing.assert_array_equal(observations, bare_observations)
        np.testing.assert_array_equal(rewards, bare_rewards.clip(-0.5, 0.5))
        returns, lengths = returns + rewards, lengths + 1
        for i in np.flatnonzero(dones):
            ended += 1
            assert infos[i]["episode"]["l"] == lengths[i]
            assert infos[i]["episode"]["r"] == pytest.approx(returns[i], rel=1e-4)
            assert infos[i]["terminal_observation"].shape == observations[i].shape
        returns[dones], lengths[dones] = 0.0, 0
    assert ended > 3
    env.set_options({"config": {"ego": {"speed": 9.0}}})
    env.reset()
    assert (env.signals["state"][:, 3] == 9.0).all()


def test_options_change_the_settings():
    env = make()
    env.set_options({"config": {"ego": {"speed": 9.0}}})
    env.reset()
    assert (env.signals["state"][:, 3] == 9.0).all()
    env.set_options([{"config": {"ego": {"speed": speed}}} for speed in (9.0, 10.0, 11.0, 12.0)])
    env.reset()
    np.testing.assert_array_equal(env.signals["state"][:, 3], [9.0, 10.0, 11.0, 12.0])
    env.set_options({"confg": {}})
    with pytest.raises(ValueError, match="confg"):
        env.reset()
    env.reset()  # options are for one reset


def test_human_mode_is_shown(monkeypatch):
    shown = []
    monkeypatch.setattr(type(bare()), "render", lambda self: shown.append(self))
    env = make(2, render_mode="human")
    env.reset()
    assert env.render() is None
    assert len(shown) == 2


def test_videos_are_recorded(tmp_path):
    assert make(3).metadata["render_fps"] == 20
    env = VecVideoRecorder(make(3, render_mode="rgb_array"), str(tmp_path), lambda step: step == 0, video_length=5)
    env.reset()
    for _ in range(6):
        env.step(np.zeros((3, 2), dtype=np.float32))
    env.close()
    assert [path.suffix for path in tmp_path.iterdir()] == [".mp4"]


def test_images_and_attributes():
    env = make(3, render_mode="rgb_array")
    env.reset()
    images = env.get_images()
    assert [image.shape for image in images] == [images[0].shape] * 3
    assert env.render().ndim == 3
    assert env.get_attr("threads") == [env.env.threads] * 3
    assert env.env_is_wrapped(gym.Wrapper) == [False] * 3


def test_options_act_while_learning():
    class Curriculum(BaseCallback):
        speeds = ()

        def _on_step(self):
            if self.n_calls == 15:
                self.training_env.set_options({"config": {"ego": {"speed": 9.0}, "faults": []}})
            self.speeds = [episode.ego.speed for episode in self.training_env.env.episodes]
            return True

    env = make(3)
    callback = Curriculum()
    PPO("MlpPolicy", env, n_steps=16, batch_size=48, device="cpu").learn(3 * 48, callback=callback)
    assert callback.speeds == [9.0] * 3
    assert env.env.scenes["z"][:, 3].max() < 12.0


def test_options_that_need_a_reset_are_refused_while_stepping():
    env = make(2)
    env.reset()
    for options, words in (({"duration": 0.5}, "duration"), ({"vehicles": []}, "vehicles")):
        env.set_options({"config": options})
        with pytest.raises(ValueError, match=words):
            env.step(np.zeros((2, 2)))
    env.set_options({"config": {"duration": 0.5}})
    env.reset()
    ends = [env.step(np.zeros((2, 2)))[2].all() for _ in range(10)]
    assert ends == [False] * 9 + [True]
