"""Run the worked example of docs/controllability.md, and write its output and its picture into the page.

``python -m experiments.worked_example``
"""

from __future__ import annotations

import contextlib
import io
import re
import tempfile
from pathlib import Path
from typing import Annotated, Any

import matplotlib as mpl
import typer

from shared_control_env.evaluation.controllability import study_controllability
from shared_control_env.evaluation.controllability_report import draw_curves
from shared_control_env.evaluation.storage import write_atomically
from shared_control_env.evaluation.study import planned_study

BLOCK = re.compile(r"```python\n(.*?)```", re.DOTALL)
OUTPUT = re.compile(r"(?<=<!-- worked example -->\n).*(?=<!-- /worked example -->)", re.DOTALL)


def main(page: Annotated[Path, typer.Option(help="The page.")] = Path("docs/controllability.md")) -> None:
    """Run the page's block, and write what it prints and draws.

    Args:
        page: path of the page, an option of the command.
    """
    text = page.read_text()
    found = BLOCK.search(text)
    assert found is not None
    scope: dict[str, Any] = {}
    printed = io.StringIO()
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        with contextlib.redirect_stdout(printed):
            exec(compile(found[1], str(page), "exec"), scope)
        # The same study again: its episodes are in the folder, which refuses any other study.
        study = planned_study(
            *("bias", ["none", "proportional", "barrier"], "hands_on", "steering", "motorway", "lane"),
            *({"bias": 0.05}, True, 3000, 0.1, 0, scope["road"]),
        )
        result = study_controllability(study, "curve_at_25")
    output = f"\n```text\n{printed.getvalue().rstrip()}\n```\n\n"
    write_atomically(page, lambda path: path.write_text(OUTPUT.sub(lambda _: output, text)))
    with mpl.rc_context({"axes.spines.top": False, "axes.spines.right": False}):
        figure = draw_curves(study, result, "hands_on")
    write_atomically(
        page.with_name("worked_example.png"),
        lambda path: figure.savefig(path, dpi=110, facecolor="white", format="png"),
    )
    typer.echo(printed.getvalue())


if __name__ == "__main__":
    typer.run(main)
