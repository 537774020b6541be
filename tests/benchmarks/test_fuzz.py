import json

from typer import Typer
from typer.testing import CliRunner

from benchmarks import fuzz
from benchmarks.fuzz import attempt, main

app = Typer()
app.command()(main)


def run(tmp_path, *options):
    arguments = ["--configs", "60", "--steps", "6000", "--out", str(tmp_path), *options]
    return CliRunner().invoke(app, arguments, env={"COLUMNS": "1000"})


def test_nothing_random_or_hostile_does_harm(tmp_path):
    result = run(tmp_path, "--seed", "1")
    assert result.exit_code == 0, result.output
    assert result.output.count("0 fault(s)") == 2
    (path,) = tmp_path.glob("*.json")
    done = json.loads(path.read_text())
    assert done["single"]["tried"] == 60
    assert 10 < done["single"]["drove"] < 50
    assert done["kernel"]["steps"] >= 6000


def test_the_same_number_is_the_same_trial():
    assert attempt("single", 3, 5) == attempt("single", 3, 5)


def test_a_fault_is_found_and_told_with_its_command_and_resumed(tmp_path, monkeypatch):
    real, calls = fuzz._check, []

    def check(observation, reward, info, terminated, what):
        real(observation, reward, info, terminated, what)
        calls.append(what)
        assert len(calls) != 1, "a fault put in"

    monkeypatch.setattr(fuzz, "_check", check)
    result = run(tmp_path)
    assert result.exit_code == 1
    assert "a fault put in" in result.output
    assert "python -m benchmarks.fuzz --seed 0 --only single:" in result.output
    again = run(tmp_path)
    assert again.exit_code == 1
    assert "a fault put in" not in again.output  # nothing was left to try
