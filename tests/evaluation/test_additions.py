"""What a program adds is known in the processes that it starts, and results of another definition are not mixed in."""

import subprocess
import sys

import pytest

MODULE = """
from shared_control_env.core.faults.kinds import SHARE, Kind, add_kind
from shared_control_env.envs.degradations import Degradation, add_degradation
from shared_control_env.envs.scenarios import Scenario, add_scenario
from shared_control_env.evaluation import metric


def halved(c):
    return FACTOR * c.u


@metric("-", "neither")
def steps_taken(t):
    '''States of the episode.'''
    return float(len(t.speed))


add_kind(Kind("halved", SHARE, act=halved))
add_degradation("halved_steering", Degradation("half of the command", "halved", ("steering",), size=(0.5, 0.5)))
add_scenario("short", Scenario("Mine/Short-v0", "two seconds", {"duration": 2.0, "vehicles": []}))
"""
SCRIPT = """
import sys
import additions_of_mine
from shared_control_env.evaluation import Suite, evaluate

if __name__ == "__main__":
    suite = Suite("mine", ("short",), ("halved_steering", "none"))
    table = evaluate(["scripted", "none"], "none", suite, seeds=range(2), jobs=int(sys.argv[1]), out=sys.argv[2])
    print(len(table), table["steps_taken"].max(), table.drop(columns=["versions", "computing_time"], errors="ignore").to_csv())
"""


def run(folder, jobs, out):
    command = [sys.executable, str(folder / "script.py"), str(jobs), str(folder / out)]
    return subprocess.run(command, capture_output=True, text=True, cwd=folder)


@pytest.fixture
def program(tmp_path):
    (tmp_path / "script.py").write_text(SCRIPT)
    (tmp_path / "additions_of_mine.py").write_text(MODULE.replace("FACTOR", "0.5"))
    return tmp_path


def test_processes_know_what_was_added(program):
    one, two = run(program, 1, "one"), run(program, 2, "two")
    assert one.returncode == two.returncode == 0, one.stderr + two.stderr
    assert one.stdout.startswith("8 41.0")
    assert (program / "one/episodes.parquet").is_file()
    columns = lambda text: [line.rsplit(",", 6)[0] for line in text.splitlines()]
    assert columns(one.stdout) == columns(two.stdout)


def test_a_changed_definition_is_another_benchmark(program):
    assert run(program, 1, "out").returncode == 0
    assert run(program, 1, "out").returncode == 0  # goes on, with nothing left to do
    (program / "additions_of_mine.py").write_text(MODULE.replace("FACTOR", "0.25"))
    refused = run(program, 1, "out")
    assert refused.returncode == 1
    assert "additions" in refused.stderr
