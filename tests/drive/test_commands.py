"""``shared-control drive`` and ``study``: wrong options in words, what is printed, and how they end."""

import os
import re
import signal
import subprocess
import sys
import time

import pytest
from typer.testing import CliRunner
from websockets.sync.client import connect

from shared_control_env.cli import app
from tests.drive.conftest import Page
from tests.drive.study.test_plan import written

CLI = [sys.executable, "-m", "shared_control_env.cli"]


def refused(*arguments):
    result = CliRunner().invoke(app, [str(each) for each in arguments], env={"COLUMNS": "200"})
    assert result.exit_code == 2, result.output
    return " ".join(result.output.replace("│", " ").split())


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--scenario", "bnd"], "did you mean 'bend'"),
        (["--degradation", "bias:steering"], "kind:channel:size:duration"),
        (["--degradation", "bias:steering:99:-"], "size"),
        (["--authority", "papr"], "did you mean 'paper'"),
        (["--wheel", "none of that name"], "is not connected"),
        (["--torque", "0.2"], "--torque would not act without --wheel"),
        (["--torque", "0.9", "--wheel", "any"], "--torque"),
        (["--port", "99999"], "--port"),
    ],
)
def test_wrong_options_of_drive(options, said, tmp_path):
    assert said in refused("drive", "--out", tmp_path / "out", "--no-browser", *options)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--people", "3"], "--people would not act without --simulate"),
        (["--remnant", "0.1"], "--remnant would not act without --simulate"),
        (["--simulate", "population", "--code", "P01"], "--code would not act with --simulate"),
        (["--simulate", "populatin"], "did you mean 'population'"),
        (["--simulate", "population", "--port", "9999"], "--port would not act with --simulate"),
        (["--wheel", "any"], "the plan allows keyboard alone"),
        (["--code", "Ada Lovelace", "--no-browser"], "no name of a person"),
    ],
)
def test_wrong_options_of_study(options, said, tmp_path):
    assert said in refused("study", written(tmp_path), "--out", tmp_path / "out", *options)


def test_a_plan_with_an_error(tmp_path):
    path = tmp_path / "plan.toml"
    path.write_text("title = 1")
    assert "plan.toml" in refused("study", path, "--out", tmp_path / "out")


def test_without_the_extra_it_says_what_is_needed(tmp_path):
    code = "import sys; sys.modules['starlette'] = None; from shared_control_env.cli import app; app(['drive'])"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path)
    assert result.returncode == 2
    assert 'the extra "drive"' in " ".join(result.stderr.replace("│", " ").split())


@pytest.mark.skipif(os.name == "nt", reason="Ctrl+C of a process")
def test_ctrl_c_within_a_drive_says_what_is_lost_and_the_folder_is_kept_by_one(tmp_path):
    command = [*CLI, "drive", "--no-browser", "--port", "0", "--out", "drives"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, cwd=tmp_path)
    try:
        while not (found := re.search(r"http://127.0.0.1:(\d+)/\?token=(\S+)", process.stdout.readline())):
            assert process.poll() is None
        port, token = found.groups()
        second = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
        assert second.returncode == 2
        assert "another run is writing there" in " ".join(second.stderr.replace("│", " ").split())
        time.sleep(0.5)
        with connect(f"ws://127.0.0.1:{port}/ws?token={token}", origin=f"http://127.0.0.1:{port}") as connection:
            page = Page(connection)
            page.start(degradation="none")
            page.say(type="begin")
            page.drive(0.5)
            process.send_signal(signal.SIGINT)
            rest = process.communicate(timeout=20)[0]
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
    assert process.returncode == 0
    assert "The drive that was under way is lost." in rest
    assert not list((tmp_path / "drives").glob("*.parquet"))
