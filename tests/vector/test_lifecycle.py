"""What a vectorised environment lives through: copies, interrupts, closing, forks, threads, rollouts."""

import copy
import os
import pickle
import subprocess
import sys
import threading
import time

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ClosedEnvironmentError

import shared_control_env  # noqa: F401
from shared_control_env.vector import cold_start, kernel

TWO_LANE = "SharedControl/TwoLane-v0"
LANE_CHANGE = "SharedControl/LaneChange-v0"


def driven(name, steps=5, **options):
    env = gym.make_vec(name, num_envs=4, **options)
    env.reset(seed=0)
    for _ in range(steps):
        env.step(np.full((4, 2), 0.05))
    return env


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("name", [TWO_LANE, LANE_CHANGE])
def test_copies_go_on_as_the_original(name, threads):
    env = driven(name, threads=threads, config={"duration": 0.5})
    twins = [copy.deepcopy(env), pickle.loads(pickle.dumps(env))]
    for _ in range(20):
        observations = env.step(np.full((4, 2), 0.05))[0]
        for twin in twins:
            np.testing.assert_array_equal(twin.step(np.full((4, 2), 0.05))[0], observations)


def test_a_pickled_environment_goes_on_in_another_process(tmp_path):
    env = driven(TWO_LANE)
    (tmp_path / "env.pkl").write_bytes(pickle.dumps(env))
    code = (
        "import pickle, sys, numpy as np\n"
        "env = pickle.load(open(sys.argv[1], 'rb'))\n"
        "print(env.step(np.full((4, 2), 0.05))[0].tobytes().hex())"
    )
    run = [sys.executable, "-c", code, str(tmp_path / "env.pkl")]
    result = subprocess.run(run, capture_output=True, text=True, check=True)
    assert result.stdout.strip() == env.step(np.full((4, 2), 0.05))[0].tobytes().hex()


def test_an_interrupt_leaves_no_thread_at_work(monkeypatch):
    env = driven(TWO_LANE, threads=2)
    finished = threading.Event()

    def advance(*arguments):
        if arguments[-1] == 0:
            raise KeyboardInterrupt
        time.sleep(0.3)
        finished.set()

    with monkeypatch.context() as patch:
        patch.setattr(kernel, "advance", advance)
        with pytest.raises(KeyboardInterrupt):
            env.step(np.zeros((4, 2)))
        assert finished.is_set()
    assert np.isfinite(env.step(np.zeros((4, 2)))[0]).all()


def test_what_a_thread_raises_is_raised(monkeypatch):
    env = driven(TWO_LANE, threads=2)

    def advance(*arguments):
        if arguments[-1] == 1:
            raise MemoryError("in a thread")

    monkeypatch.setattr(kernel, "advance", advance)
    with pytest.raises(MemoryError, match="in a thread"):
        env.step(np.zeros((4, 2)))


@pytest.mark.parametrize("threads", [1, 2])
def test_a_closed_environment_says_so(threads):
    env = driven(TWO_LANE, threads=threads)
    env.close()
    env.close()
    for call in (env.reset, lambda: env.step(np.zeros((4, 2))), lambda: env.unwrapped.rollout(1)):
        with pytest.raises(ClosedEnvironmentError):
            call()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_goes_on_in_a_forked_process():
    code = (
        "import os, numpy as np, gymnasium as gym, shared_control_env\n"
        "env = gym.make_vec('SharedControl/TwoLane-v0', num_envs=4, threads=2)\n"
        "env.reset(seed=0); env.step(np.zeros((4, 2)))\n"
        "child = os.fork()\n"
        "x = env.step(np.zeros((4, 2)))[0].sum()\n"
        "if child == 0:\n"
        "    os._exit(0 if x > -1e9 else 1)\n"
        "print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))"
    )
    result = subprocess.run([sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True, timeout=120)
    assert result.stdout.strip() == "0", result.stderr


def test_threads_are_those_that_the_process_may_use(monkeypatch):
    monkeypatch.setattr(cold_start, "cores", lambda: 3)
    assert gym.make_vec(TWO_LANE, num_envs=1000).unwrapped.threads == 3
    assert gym.make_vec(TWO_LANE, num_envs=8).unwrapped.threads == 1


def test_two_at_a_time_do_not_meet():
    alone = [driven(name, steps=30).step(np.zeros((4, 2)))[0] for name in (TWO_LANE, LANE_CHANGE)]
    envs = [driven(name, steps=0, threads=2) for name in (TWO_LANE, LANE_CHANGE)]
    for _ in range(30):
        for env in envs:
            env.step(np.full((4, 2), 0.05))
    for env, observations in zip(envs, alone, strict=True):
        np.testing.assert_array_equal(env.step(np.zeros((4, 2)))[0], observations)


@pytest.mark.parametrize("mode", ["next_step", "same_step"])
@pytest.mark.parametrize("name", [TWO_LANE, LANE_CHANGE])
@pytest.mark.parametrize("render_mode", [None, "rgb_array"])
def test_a_rollout_is_its_steps(name, mode, render_mode):
    options = {"driver": True, "config": {"duration": 0.5}, "autoreset_mode": mode, "render_mode": render_mode}
    stepped, rolled = (gym.make_vec(name, num_envs=3, **options) for _ in range(2))
    for env in (stepped, rolled):
        env.reset(seed=0)
    steps = [stepped.step(None) for _ in range(27)]
    rollout = rolled.unwrapped.rollout(27)
    np.testing.assert_array_equal(rollout.rewards, [step[1] for step in steps])
    np.testing.assert_array_equal(rollout.ends, [step[2] | step[3] for step in steps])
    np.testing.assert_array_equal(rolled.step(None)[0], stepped.step(None)[0])
    if render_mode:
        np.testing.assert_array_equal(rolled.render()[0], stepped.render()[0])


@pytest.mark.parametrize("render_mode", [None, "rgb_array"])
def test_without_autoreset_a_rollout_ends_with_the_episodes(render_mode):
    options = {"driver": True, "config": {"duration": 0.5}, "autoreset_mode": "disabled", "render_mode": render_mode}
    env = gym.make_vec(TWO_LANE, num_envs=3, **options)
    env.reset(seed=0)
    rollout = env.unwrapped.rollout(30)
    assert rollout.ends[9].all()
    assert not rollout.ends[10:].any()
    assert (rollout.rewards[10:] == 0.0).all()
    assert (env.unwrapped.scenes["k"] == 10).all()
    with pytest.raises(ValueError, match="environment 0 has ended"):
        env.unwrapped.rollout(1)


def test_rendering_before_a_reset():
    with pytest.raises(ValueError, match="reset"):
        gym.make_vec(TWO_LANE, num_envs=2, render_mode="rgb_array").render()
