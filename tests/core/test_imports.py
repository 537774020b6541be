"""Imports point one way, between the layers and between the rooms of the core, and nowhere in a circle."""

import ast
import subprocess
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LAYERS = [
    ("shared_control_env.core",),
    ("shared_control_env.controllers",),
    ("shared_control_env.envs",),
    ("shared_control_env.wrappers", "shared_control_env.vector"),
    ("shared_control_env.learned", "shared_control_env.evaluation"),
    ("shared_control_env.recordings",),
    ("shared_control_env.drive",),
    ("shared_control_env.identification",),
    ("agents",),
    ("experiments",),
]
ROOMS = ["compile", "world", "faults", "risk", "authority", "control", "feedback"]
"""Rooms of the core: each imports from those before it, and from the parameters and records."""


def imported(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"relative import in {path}"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def module_of(path):
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def modules():
    return {module_of(path): path for path in (ROOT / "shared_control_env").rglob("*.py")}


@pytest.mark.parametrize("level", range(len(LAYERS)))
def test_no_layer_imports_one_above_it(level):
    above = [name for layer in LAYERS[level + 1 :] for name in layer]
    for package in LAYERS[level]:
        for path in (ROOT / package.replace(".", "/")).rglob("*.py"):
            for name in imported(path):
                assert not any(name == a or name.startswith(f"{a}.") for a in above), f"{path} imports {name}"


def graph():
    """Every module of the package, and those that it imports, for annotations alone too."""
    known = modules()
    found = {}
    for module, path in known.items():
        # What is imported is a module, or something of one.
        targets = {name if name in known else name.rpartition(".")[0] for name in imported(path)}
        found[module] = {target for target in targets if target in known}
    return found


def test_no_circle_of_imports():
    try:
        list(TopologicalSorter(graph()).static_order())
    except CycleError as error:
        pytest.fail(f"circle: {' -> '.join(error.args[1])}")


def room(module):
    parts = module.split(".")
    return parts[2] if parts[:2] == ["shared_control_env", "core"] and len(parts) > 2 and parts[2] in ROOMS else None


def test_rooms_of_the_core_import_from_those_before_them():
    for module, targets in graph().items():
        for target in targets:
            here, there = room(module), room(target)
            if here and there:
                assert ROOMS.index(there) <= ROOMS.index(here), f"{module} imports {target}"
            elif here:
                assert target.rpartition(".")[2] in ("core", "records", "parameters", "nearest", "shared_control_env")


def test_core_needs_neither_gymnasium_nor_highway_env():
    names = [name for name in modules() if name.startswith("shared_control_env.core")]
    code = (
        "import sys, importlib, types\n"
        f"package = types.ModuleType('shared_control_env'); package.__path__ = [{str(ROOT / 'shared_control_env')!r}]\n"
        "sys.modules['shared_control_env'] = package\n"
        f"[importlib.import_module(name) for name in {names!r}]\n"
        "print([name for name in ('gymnasium', 'highway_env', 'pygame', 'pandas') if name in sys.modules])\n"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"
