"""Public functions say what they take: an ``Args:`` section names every argument, with its shape and unit."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = ("shared_control_env", "agents", "experiments", "benchmarks")
WANTED = 0.9
"""Share of the public functions that take arguments; the rest are one-line entries that name what they stand for."""


def functions(tree, owner=""):
    """Public functions and methods with their names, those of private classes left out."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            yield from functions(node, f"{owner}{node.name}.")
        elif isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            yield f"{owner}{node.name}", node


def arguments(node, method):
    a = node.args
    names = [arg.arg for arg in (*a.posonlyargs, *a.args, *a.kwonlyargs)]
    return names[1:] if method and not any("staticmethod" in ast.unparse(d) for d in node.decorator_list) else names


def is_setter(node):
    return any(isinstance(d, ast.Attribute) and d.attr == "setter" for d in node.decorator_list)


def undocumented(node, names):
    """Arguments that neither the docstring nor the help of an option describes."""
    text = ast.get_docstring(node) or ""
    helped = {arg.arg for arg in node.args.args if arg.annotation and "help=" in ast.unparse(arg.annotation)}
    names = [name for name in names if name not in helped]
    if "Args:" not in text:
        return names
    section = text.split("Args:", 1)[1]
    described = {name for line in re.findall(r"^\s+([\w, *]+):", section, re.M) for name in re.split(r"[, ]+", line)}
    return [name for name in names if name not in described]


def found(package):
    for path in sorted((ROOT / package).rglob("*.py")):
        for name, node in functions(ast.parse(path.read_text())):
            names = arguments(node, "." in name)
            if names and not is_setter(node):
                yield f"{path.relative_to(ROOT)}:{node.lineno} {name}", undocumented(node, names)


@pytest.mark.parametrize("package", PACKAGES)
def test_public_functions_describe_their_arguments(package):
    all_of_them = list(found(package))
    lacking = [f"{name}: {', '.join(missing)}" for name, missing in all_of_them if missing]
    share = 1.0 - len(lacking) / len(all_of_them)
    assert share >= WANTED, f"{share:.0%} of {len(all_of_them)}:\n" + "\n".join(lacking)
