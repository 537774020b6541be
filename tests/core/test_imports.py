"""Imports point one way: core <- controllers <- envs <- wrappers, vector <- agents <- experiments."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent
LAYERS = [
    ("shared_control_env.core",),
    ("shared_control_env.controllers",),
    ("shared_control_env.envs",),
    ("shared_control_env.wrappers", "shared_control_env.vector"),
    ("shared_control_env.evaluation",),
    ("agents",),
    ("experiments",),
]


def imported(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"relative import in {path}"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


@pytest.mark.parametrize("level", range(len(LAYERS)))
def test_no_layer_imports_one_above_it(level):
    above = [name for layer in LAYERS[level + 1 :] for name in layer]
    for package in LAYERS[level]:
        for path in (ROOT / package.replace(".", "/")).rglob("*.py"):
            for name in imported(path):
                assert not any(name == a or name.startswith(f"{a}.") for a in above), f"{path} imports {name}"


def test_core_needs_neither_gymnasium_nor_highway_env():
    modules = [
        f"shared_control_env.core.{path.stem}"
        for path in (ROOT / "shared_control_env/core").glob("*.py")
        if path.stem != "__init__"
    ]
    code = (
        "import sys, importlib, types\n"
        f"package = types.ModuleType('shared_control_env'); package.__path__ = [{str(ROOT / 'shared_control_env')!r}]\n"
        "sys.modules['shared_control_env'] = package\n"
        f"[importlib.import_module(name) for name in {modules!r}]\n"
        "print([name for name in ('gymnasium', 'highway_env', 'pygame', 'pandas') if name in sys.modules])\n"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"
