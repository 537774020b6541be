"""The tests on every promised Python that this machine has; the others are named as missing.

``nox`` runs all tests except ``tests/agents`` on each of them; ``nox -s tests-3.12 -- tests/core`` runs a part on one.
"""

from __future__ import annotations

import nox

PYTHONS = ("3.11", "3.12", "3.13")
"""The versions that pyproject.toml promises."""

nox.options.error_on_missing_interpreters = False  # a missing one is reported as skipped
nox.options.default_venv_backend = "venv"


@nox.session(python=PYTHONS)
def tests(session: nox.Session) -> None:
    """All tests but those of training, which need PyTorch.

    Args:
        session: virtual environment of one interpreter.
    """
    session.install("-c", "constraints.txt", "-e", ".[dev]")
    session.run("python", "-m", "pytest", "-q", "-n", "auto", *(session.posargs or ["--ignore=tests/agents"]))


@nox.session(python="3.11")
def docs(session: nox.Session) -> None:
    """The documentation, with its code run and warnings as errors.

    Args:
        session: virtual environment.
    """
    session.install("-c", "constraints.txt", "-e", ".[docs,train]")
    session.run("python", "-m", "sphinx", "-W", "--keep-going", "-j", "auto", "-q", "docs", "docs/_build/html")
