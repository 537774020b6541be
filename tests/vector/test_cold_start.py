"""What is compiled beforehand is what the kernel will ask for."""

import subprocess
import sys

import gymnasium as gym
import pytest

from shared_control_env.core.jit import is_cached
from shared_control_env.vector import cold_start, kernel

CODE = """
import numpy as np
from numba import njit, typeof
from shared_control_env.core import automation_mpc, closed_loop, degradation, delaunay, safe_area
from shared_control_env.core.parameters import DegradationParameters, Parameters
from shared_control_env.core.records import AUTOMATION_MEMORY, FAULT_MEMORY, SCENE, SIGNALS, record_dtype
from shared_control_env.vector import cold_start, kernel
from shared_control_env.vector.records import WORKSPACE

@njit
def caller(scenes, traffic, lines, parameters, automations, faults, memories, signals, works):
    scene, p, work = scenes[0], parameters[0], works[0]
    kernel.find_area(scene, traffic[0], lines[0], p, work)
    closed_loop.automate(scene, p, automations[0], work.solver)
    closed_loop.monitor(scene, traffic[0], lines[0], faults[0], memories[0], p, signals[0])

arrays = [np.zeros(2, SCENE), np.zeros((2, 1, 8)), np.zeros((2, 3, 6)), np.zeros(2, record_dtype(Parameters))]
arrays += [np.zeros(2, AUTOMATION_MEMORY), np.zeros((2, 1), record_dtype(DegradationParameters))]
arrays += [np.zeros((2, 1), FAULT_MEMORY), np.zeros(2, SIGNALS), np.zeros(2, WORKSPACE)]
cold_start.compile_safe_area()
cold_start.compile_automation()
functions = delaunay.triangulate, safe_area.search_triangles, automation_mpc.solve, degradation.degrade
made = [set(function.signatures) for function in functions]
assert all(len(each) == 1 for each in made), made
caller.compile(tuple(typeof(array) for array in arrays))
for function, each in zip(functions, made):
    assert set(function.signatures) == each, (function, each ^ set(function.signatures))
"""


def test_what_is_compiled_beforehand_is_what_the_kernel_calls():
    done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.fixture
def cold(monkeypatch):
    """A process that has compiled nothing yet, with two cores; what it starts is noted."""
    cold_start.prepare.cache_clear()
    monkeypatch.setattr(cold_start, "is_cached", lambda function: False)
    monkeypatch.setattr(cold_start, "_cores", lambda: 2)
    monkeypatch.setattr(cold_start.multiprocessing, "parent_process", lambda: None)
    monkeypatch.setattr(cold_start, "compile_automation", lambda: None)
    started = []

    class Noted(subprocess.Popen):
        def __init__(self, command, **options):
            super().__init__(command, **options)
            started.append(self)

        def kill(self):
            started.append(self.poll())

    monkeypatch.setattr(cold_start.subprocess, "Popen", Noted)
    yield started
    cold_start.prepare.cache_clear()


def test_the_other_process_does_its_part_once(cold):
    cold_start.prepare()
    cold_start.prepare()
    process, returned = cold
    assert "compile_safe_area()" in process.args[-1]
    assert returned == 0


@pytest.mark.parametrize("refusal", [OSError, "frozen", "cached"])
def test_a_process_that_cannot_be_started_is_done_without(cold, monkeypatch, refusal):
    def refuse(*arguments, **options):
        raise OSError("no more processes")

    if refusal is OSError:
        monkeypatch.setattr(cold_start.subprocess, "Popen", refuse)
    elif refusal == "frozen":
        monkeypatch.setattr(sys, "frozen", True, raising=False)
    else:
        monkeypatch.setattr(cold_start, "is_cached", lambda function: True)
    cold_start.prepare()
    assert cold == []


def test_a_kernel_that_ran_is_in_the_cache():
    gym.make_vec("SharedControl/TwoLane-v0", num_envs=1).reset(seed=0)
    assert is_cached(kernel.advance)
