"""Every block of the README runs."""

import re
import shlex
from importlib.util import find_spec
from pathlib import Path

import matplotlib
import pytest

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "README.md").read_text()


def test_python_blocks_run_in_order():
    pytest.importorskip("stable_baselines3", reason="the README's training block needs the extra 'train'")
    matplotlib.use("Agg")
    blocks = re.findall(r"```python\n(.*?)```", TEXT, flags=re.DOTALL)
    assert len(blocks) >= 6
    scope = {}
    for block in blocks:
        exec(compile(block, "README.md", "exec"), scope)


def test_make_commands_are_targets():
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE))
    named = set(re.findall(r"make ([a-z]+)", TEXT))
    assert {"reproduce", "test", "bench"} <= named
    assert {name for name in named if f"`make {name}`" in TEXT or f"    make {name}" in TEXT} <= targets


def test_plain_lines_name_things_that_exist():
    lines = [line.strip() for line in TEXT.splitlines() if line.startswith("    .venv/bin/python -m ")]
    modules = [shlex.split(line)[2] for line in lines]
    assert "experiments.reproduce" in modules
    for module in modules:
        path = ROOT / module.replace(".", "/")
        assert path.with_suffix(".py").is_file() or (path / "__main__.py").is_file() or find_spec(module), module


def test_linked_files_exist():
    for target in re.findall(r"\]\((?!https?:)([^)]+)\)", TEXT):
        assert (ROOT / target).is_file(), target
