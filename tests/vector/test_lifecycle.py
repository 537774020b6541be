"""What a vectorised environment lives through: copies, interrupts, closing, forks, threads, rollouts."""

import copy
import os
import pickle
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ClosedEnvironmentError

import shared_control_env  # noqa: F401
from shared_control_env.core import kernel
from shared_control_env.vector import environment
from tests.vector.agreement import flat

TWO_LANE = "SharedControl/TwoLane-v1"
LANE_CHANGE = "SharedControl/LaneChange-v1"


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
        "env = gym.make_vec('SharedControl/TwoLane-v1', num_envs=4, threads=2)\n"
        "env.reset(seed=0); env.step(np.zeros((4, 2)))\n"
        "read, write = os.pipe()\n"
        "child = os.fork()\n"
        "x = env.step(np.zeros((4, 2)))[0].tobytes()\n"
        "if child == 0:\n"
        "    os.write(write, x)\n"
        "    os._exit(0)\n"
        "status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])\n"
        "print(status, os.read(read, 10**6) == x)"
    )
    result = subprocess.run([sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True, timeout=120)
    assert result.stdout.strip() == "0 True", result.stderr


@pytest.mark.parametrize("mode", ["next_step", "same_step"])
@pytest.mark.parametrize("driver", [False, True])
def test_a_step_writes_all_that_it_returns(driver, mode, monkeypatch):
    options = {"driver": driver, "config": {"duration": 0.2}, "autoreset_mode": mode}
    envs = [gym.make_vec(LANE_CHANGE, num_envs=3, **options) for _ in range(2)]
    for env in envs:
        env.reset(seed=0)
    real = np.empty

    def dirty(*arguments):
        array = real(*arguments)
        array.view(np.uint8)[...] = 0xA5
        return array

    for _ in range(9):
        clean = flat_step(envs[0])
        with monkeypatch.context() as patch:
            patch.setattr(environment.np, "empty", dirty)
            written = flat_step(envs[1])
        assert clean.keys() == written.keys()
        for name, value in clean.items():
            np.testing.assert_array_equal(written[name], value, err_msg=name)


def flat_step(env):
    *values, infos = env.step(np.zeros((3, 2)))
    return {**flat(infos), **dict(enumerate(values))}


def test_threads_are_those_that_the_process_may_use(monkeypatch):
    monkeypatch.setattr(environment, "cores", lambda: [0, 1, 2])
    assert gym.make_vec(TWO_LANE, num_envs=1000).unwrapped.threads == 3
    assert gym.make_vec(TWO_LANE, num_envs=8).unwrapped.threads == 1


def test_two_at_once_do_not_meet():
    names = (TWO_LANE, LANE_CHANGE)
    alone = [driven(name, steps=200).step(np.zeros((4, 2)))[0] for name in names]
    with ThreadPoolExecutor(2) as pool:
        envs = list(pool.map(lambda name: driven(name, steps=200, threads=2), names))
    for env, observations in zip(envs, alone, strict=True):
        np.testing.assert_array_equal(env.step(np.zeros((4, 2)))[0], observations)


def test_a_rollout_looks_for_interrupts_between_its_pieces(monkeypatch):
    monkeypatch.setattr(environment, "AT_ONCE", 12)
    envs = [gym.make_vec(TWO_LANE, num_envs=4, driver=True) for _ in range(2)]
    for env in envs:
        env.reset(seed=0)
    pieces, advance = [], kernel.advance

    def counted(taken, steps, *arguments):
        pieces.append(steps)
        if len(pieces) == 3:
            raise KeyboardInterrupt
        advance(taken, steps, *arguments)

    with monkeypatch.context() as patch:
        patch.setattr(kernel, "advance", counted)
        with pytest.raises(KeyboardInterrupt):
            envs[0].unwrapped.rollout(10)
    assert pieces == [3, 3, 3]
    envs[1].unwrapped.rollout(6)
    mask = np.array([True, False, False, False])
    observations = [env.reset(options={"reset_mask": mask})[0] for env in envs]
    np.testing.assert_array_equal(*observations)  # those left out show where the rollout was interrupted


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


def test_rendering_out_of_turn():
    env = gym.make_vec(TWO_LANE, num_envs=2, render_mode="rgb_array")
    with pytest.raises(ValueError, match="reset"):
        env.render()
    env.reset(seed=0)
    env.close()
    with pytest.raises(ClosedEnvironmentError):
        env.render()
    env = gym.make_vec(TWO_LANE, num_envs=2)
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="render_mode"):
        assert env.render() is None


def test_the_picture_stays_where_a_reset_leaves_environment_0_out():
    env = driven(TWO_LANE, steps=20, render_mode="rgb_array")
    before = env.render()[0]
    viewer = env.unwrapped._pictures._viewer_env
    env.reset(options={"reset_mask": np.array([False, True, True, True])})
    np.testing.assert_array_equal(env.render()[0], before)
    closed = []
    viewer.close = lambda: closed.append(True)
    env.reset(options={"config": {"duration": 3.0}})
    assert closed
