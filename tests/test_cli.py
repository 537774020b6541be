"""The command: every option's wrong values are refused in words before anything runs, and its output can be read."""

import json

import pytest
from typer.testing import CliRunner

from shared_control_env import __version__
from shared_control_env.cli import app

ONE = ("benchmark", "--drivers", "none", "--authorities", "paper", "--seeds", "0")


def run(*arguments, **environment):
    result = CliRunner().invoke(app, [str(each) for each in arguments], env={"COLUMNS": "200", **environment})
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result.exit_code, " ".join(result.output.split())


def test_version():
    assert run("--version") == (0, f"shared_control_env {__version__}")


SEEDS = ["", "-", "-1", "5-1", "a", "1-2-3", "0..4", "0 1", "1e3", "0-99999999999", str(2**64), "0-999,,"]


@pytest.mark.parametrize("seeds", SEEDS)
def test_wrong_seeds(seeds, tmp_path):
    code, output = run(*ONE[:-1], seeds, "--out", tmp_path / "out")
    assert code == 2
    assert "seeds = " in output
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--drivers", ""), "names nothing"),
        (("--drivers", ","), "names nothing"),
        (("--drivers", "mcp"), "did you mean 'mpc'"),
        (("--authorities", "papper"), "did you mean 'paper'"),
        (("--suite", "papr"), "did you mean 'paper'"),
        (("--engine", "raay"), "did you mean 'ray'"),
        (("--jobs", "0"), "--jobs"),
        (("--jobs", "many"), "--jobs"),
    ],
)
def test_wrong_options(options, words, tmp_path):
    code, output = run("benchmark", *options, "--out", tmp_path / "out")
    assert code == 2
    assert words in output
    assert not (tmp_path / "out").exists()


def test_places_that_cannot_be_written_to(tmp_path):
    (tmp_path / "file").write_text("mine")
    for place in (tmp_path / "file", tmp_path / "file/below", "/proc/here"):
        code, output = run(*ONE, "--out", place)
        assert code == 2
        assert "is a file" in output or "cannot be written" in output
        assert "what could be written" not in output


@pytest.mark.parametrize("place", ["/proc/x.mp4", "file/x.mp4", ".mp4", "drive.avi", "there.mp4"])
def test_videos_that_cannot_be_written_are_refused_before_the_drive(place, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("mine")
    (tmp_path / "there.mp4").write_text("mine")
    monkeypatch.setattr("shared_control_env.evaluation.replay.replay_episode", None)  # never called
    code, output = run("replay", "--scenario", "curve", "--video", place)
    assert code == 2
    assert "video" in output or "exists already" in output


@pytest.mark.parametrize("width", [20, 40, 60, 80, 200])
def test_the_table_is_whole_in_any_terminal(width, tmp_path):
    code, output = run(*ONE, "--out", tmp_path / "out", COLUMNS=str(width))
    assert code == 0
    for word in ("failures", "collisions", "lateral", "effort"):
        assert word in output


def test_home_is_found_in_any_option(tmp_path):
    code, _ = run(*ONE, "--out", "~/res", HOME=str(tmp_path))
    assert code == 0
    assert (tmp_path / "res/benchmark.json").exists()


def test_what_a_folder_says_is_replayed(tmp_path):
    from shared_control_env.evaluation import evaluate

    config = {"duration": 1.0, "faults": [{"channel": "acceleration", "onset": 0.1, "size": 5.0}]}
    table = evaluate("none", "none", config=config, out=tmp_path)
    options = ("--scenario", "curve", "--driver", "none", "--authority", "none")
    code, output = run("replay", "--from", tmp_path, *options)
    assert code == 0
    effort = f"{table.loc[table['scenario'] == 'curve', 'lateral_max'].iloc[0]:.4g}"
    assert effort in output
    code, output = run("replay", "--from", tmp_path, *options[:-1], "paper")
    assert code == 2
    assert "'paper' is not known" in output
    code, output = run("replay", "--from", tmp_path / "nowhere", *options)
    assert code == 2
    assert "there is no such folder" in output


@pytest.mark.parametrize("option", ["--scenario", "--driver", "--authority", "--degradation"])
def test_all_is_no_episode(option):
    chosen = {"--scenario": "curve", option: "all"}
    code, output = run("replay", *(part for pair in chosen.items() for part in pair))
    assert code == 2
    assert "must be one name" in output


def test_brackets_in_names_are_no_markup(tmp_path):
    code, output = run(*ONE, "--out", tmp_path / "runs[bold]x[/a]")
    assert code == 0
    assert "runs[bold]x[/a]" in output


def test_a_video_is_as_fast_as_the_drive(tmp_path):
    import imageio_ffmpeg

    from shared_control_env.evaluation import evaluate

    evaluate("none", "none", config={"policy_frequency": 10, "duration": 2.0, "faults": []}, out=tmp_path / "run")
    options = ("--from", tmp_path / "run", "--scenario", "two_lane", "--driver", "none", "--authority", "none")
    assert run("replay", *options, "--video", tmp_path / "drive.mp4")[0] == 0
    _, seconds = imageio_ffmpeg.count_frames_and_secs(str(tmp_path / "drive.mp4"))
    assert seconds == pytest.approx(2.0, abs=0.11)


def test_a_video_is_as_fast_as_the_drive_of_its_driver_and_law(tmp_path):
    import imageio_ffmpeg

    from shared_control_env.evaluation import DriverEntry, evaluate

    slow = DriverEntry("ten decisions a second", config={"policy_frequency": 10})
    config = {"fault_at": "planner", "duration": 2.0}
    evaluate({"slow": slow}, "proportional", config=config, out=tmp_path / "run")
    options = ("--from", tmp_path / "run", "--scenario", "two_lane", "--driver", "slow", "--authority", "proportional")
    assert run("replay", *options, "--video", tmp_path / "drive.mp4")[0] == 0
    _, seconds = imageio_ffmpeg.count_frames_and_secs(str(tmp_path / "drive.mp4"))
    assert seconds == pytest.approx(2.0, abs=0.11)


def test_notices_are_lines(tmp_path):
    assert run(*ONE, "--out", tmp_path)[0] == 0
    (tmp_path / "episodes/mine.parquet").write_text("mine")
    code, output = run(*ONE, "--out", tmp_path)
    assert code == 0
    assert "Note: left out, being no results of this benchmark: mine.parquet" in output
    assert "UserWarning" not in output
    assert json.loads((tmp_path / "benchmark.json").read_text())["seeds"] == [0]
