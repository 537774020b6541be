"""Every block of the README runs."""

import re
import shlex
from importlib.util import find_spec
from pathlib import Path

import matplotlib

from shared_control_env.envs.degradations import DEGRADATIONS
from shared_control_env.envs.scenarios import SCENARIOS
from shared_control_env.evaluation.catalogue import AUTHORITIES

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "README.md").read_text()


def test_python_blocks_run_in_order():
    matplotlib.use("Agg")
    blocks = re.findall(r"```python\n(.*?)```", TEXT, flags=re.DOTALL)
    assert len(blocks) >= 3
    scope = {}
    for block in blocks:
        exec(compile(block, "README.md", "exec"), scope)


def test_make_commands_are_targets():
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE))
    named = set(re.findall(r"make ([a-z]+)", TEXT))
    assert {"reproduce", "test", "docs"} <= named
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


def test_it_is_short():
    assert len(TEXT.splitlines()) <= 150


def test_its_numbers_are_those_of_the_sources_and_of_the_run():
    """Counts are those of the tables; every figure of the result stands on the page that the run wrote."""
    words = {12: "Twelve", 13: "Thirteen", 14: "Fourteen", 16: "sixteen", 17: "seventeen", 18: "eighteen"}
    counts = words[len(SCENARIOS)], words[len(DEGRADATIONS) - 1], words[len(AUTHORITIES)]
    assert "{} scenarios, {} degradations, {} authorities".format(*counts) in TEXT
    result = TEXT.split("<!-- reference -->")[1].split("<!-- /reference -->")[0]
    page = (ROOT / "docs/reference.md").read_text()
    figures = re.findall(r"-?\d+\.\d+ \(-?\d+\.\d+ to -?\d+\.\d+\)", result)
    assert len(figures) == 12
    for figure in figures:
        assert figure in page, figure
