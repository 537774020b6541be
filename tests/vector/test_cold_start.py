"""Compiling on two cores, and without a second one."""

import subprocess
import sys

import gymnasium as gym
import pytest

from shared_control_env.core.jit import is_cached
from shared_control_env.vector import cold_start, kernel, solvers


@pytest.fixture
def cold(monkeypatch):
    """A process that has compiled nothing yet, with two cores; what it starts and compiles is noted."""

    class Uncompiled:
        signatures = ()

    monkeypatch.setattr(cold_start.kernel, "advance", Uncompiled())
    monkeypatch.setattr(cold_start, "is_cached", lambda function: False)
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
    return noted


@pytest.mark.parametrize("driver", [False, True])
def test_the_other_process_compiles_solvers_beside_the_kernel(cold, driver):
    found = cold_start.compile_all(lambda: cold.append("kernel"), driver)
    code, compiled, returned = cold
    assert "AUTOMATE" in code
    assert ("DRIVE" in code) is driver
    assert (compiled, returned) == ("kernel", 0)
    assert found == solvers.addresses(driver)
    assert all(found[:-1])
    assert bool(found.drive) is driver


@pytest.mark.parametrize("reason", ["no process", "frozen", "cached", "compiled", "one core", "worker"])
def test_without_another_process_the_solvers_are_compiled_all_the_same(cold, monkeypatch, reason):
    def refuse(*arguments, **options):
        raise OSError("no more processes")

    if reason == "no process":
        monkeypatch.setattr(cold_start.subprocess, "Popen", refuse)
    elif reason == "frozen":
        monkeypatch.setattr(sys, "frozen", True, raising=False)
    elif reason == "cached":
        monkeypatch.setattr(cold_start, "is_cached", lambda function: True)
    elif reason == "compiled":
        cold_start.kernel.advance.signatures = ("one",)
    elif reason == "one core":
        monkeypatch.setattr(cold_start, "cores", lambda: [0])
    else:
        monkeypatch.setattr(cold_start.multiprocessing, "parent_process", lambda: "a pool")
    found = cold_start.compile_all(lambda: cold.append("kernel"), driver=False)
    assert cold == []
    assert found == solvers.addresses(False)


def test_a_process_that_hangs_is_not_waited_for(cold, monkeypatch):
    monkeypatch.setattr(cold_start, "PATIENCE", 0.01)
    assert cold_start.compile_all(lambda: None, driver=False) == solvers.addresses(False)
    assert cold[1] is None  # still running when it was killed


def test_a_kernel_that_ran_is_in_the_cache():
    gym.make_vec("SharedControl/TwoLane-v0", num_envs=1).reset(seed=0)
    assert is_cached(kernel.advance)
