"""Compiling on two cores, and without a second one."""

import subprocess
import sys

import gymnasium as gym
import pytest

from shared_control_env.core import kernel, loading
from shared_control_env.core.authority.allocators import fuzzy_authority
from shared_control_env.core.compile import cold_start
from shared_control_env.core.compile.jit import is_cached
from shared_control_env.core.feedback.observation import DRIVER_V0


def load(driver=False):
    return loading.load(driver, fuzzy_authority, DRIVER_V0)


@pytest.fixture
def cold(monkeypatch):
    """A process that has compiled nothing yet, with two cores; what it starts and compiles is noted."""

    class Uncompiled:
        signatures = ()

    monkeypatch.setattr(loading.kernel, "advance", Uncompiled())
    monkeypatch.setattr(loading, "is_cached", lambda function: False)
    monkeypatch.setattr(cold_start, "cores", lambda: [0, 1])
    monkeypatch.setattr(cold_start.multiprocessing, "parent_process", lambda: None)
    noted = []

    class Noted(subprocess.Popen):
        def __init__(self, command, **options):
            super().__init__(command, **options)
            noted.append(command[-1])

        def kill(self):
            noted.append(self.poll())

    monkeypatch.setattr(cold_start.subprocess, "Popen", Noted)
    monkeypatch.setattr(loading, "compile_with_kernel", lambda driver: noted.append("kernel"))
    return noted


@pytest.mark.parametrize("driver", [False, True])
def test_the_other_process_compiles_what_the_kernel_calls(cold, driver):
    found = load(driver)
    code, compiled, returned = cold
    assert f"compile_beside_kernel({driver}, True)" in code
    assert (compiled, returned) == ("kernel", 0)
    assert all(found._replace(drive=1))
    assert bool(found.drive) is driver


@pytest.mark.parametrize("reason", ["no process", "frozen", "cached", "compiled", "one core", "worker"])
def test_without_another_process_all_is_compiled_here(cold, monkeypatch, reason):
    def refuse(*arguments, **options):
        raise OSError("no more processes")

    if reason == "no process":
        monkeypatch.setattr(cold_start.subprocess, "Popen", refuse)
    elif reason == "frozen":
        monkeypatch.setattr(sys, "frozen", True, raising=False)
    elif reason == "cached":
        monkeypatch.setattr(loading, "is_cached", lambda function: True)
    elif reason == "compiled":
        loading.kernel.advance.signatures = ("one",)
    elif reason == "one core":
        monkeypatch.setattr(cold_start, "cores", lambda: [0])
    else:
        monkeypatch.setattr(cold_start.multiprocessing, "parent_process", lambda: "a pool")
    assert all(load()._replace(drive=1))
    assert cold == []


def test_a_process_that_hangs_is_not_waited_for(cold, monkeypatch):
    monkeypatch.setattr(cold_start, "PATIENCE", 0.01)
    assert all(load()._replace(drive=1))
    assert cold[1:] == ["kernel", None]  # still running when it was killed


def test_it_begins_before_what_takes_time_and_once(cold):
    for _ in range(2):
        loading.begin(driver=False, limiter=True)
    assert len(cold) == 1
    assert all(load()._replace(drive=1))
    assert cold[1:] == ["kernel", 0]


@pytest.mark.parametrize("make", [gym.make, gym.make_vec])
def test_a_kernel_that_ran_is_in_the_cache(make):
    make("SharedControl/TwoLane-v1").reset(seed=0)
    assert is_cached(kernel.advance)
