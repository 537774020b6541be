"""Every example runs, with little to do, and says what its page promises."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
FOLDER = ROOT / "examples"
ARGUMENTS = {
    "train": "4096",
    "controllability": "400",
    "video_side_by_side": "1.0",
    "offline": "6",
    "sweep_on_ray": "1",
}
SAYS = {
    "train": "return ",
    "own_driver": "internal_model",
    "own_allocator": "own_allocator.png",
    "own_scenario": "radius",
    "own_fault": "dead band of 20 %",
    "controllability": "report.html",
    "recorded_traffic": "human_displacement",
    "video_side_by_side": "side_by_side.mp4",
    "offline": "Log-likelihood",
    "sweep_on_ray": "lateral_rms",
}
NEEDS = {"train": "stable_baselines3", "offline": "stable_baselines3", "sweep_on_ray": "ray"}


def test_the_page_lists_them_all():
    listed = re.findall(r"\| \[(\w+)\.py\]", (FOLDER / "README.md").read_text())
    assert sorted(listed) == sorted(path.stem for path in FOLDER.glob("*.py")) == sorted(SAYS)


@pytest.mark.parametrize("name", list(SAYS))
def test_an_example_runs(name, tmp_path):
    if name in NEEDS:
        pytest.importorskip(NEEDS[name], reason="needs an extra")
    environment = {**os.environ, "MINARI_DATASETS_PATH": str(tmp_path / "minari"), "PYTHONPATH": str(ROOT)}
    command = [sys.executable, str(FOLDER / f"{name}.py"), *ARGUMENTS.get(name, "").split()]
    result = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=environment)
    assert result.returncode == 0, result.stdout + result.stderr
    assert SAYS[name] in result.stdout
