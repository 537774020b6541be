"""Sphinx configuration: the pages run their code, the videos of the gallery are made, warnings are errors."""

from __future__ import annotations

import os
import sys
from hashlib import sha256
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parent.parent))
os.environ.setdefault("SDL_VIDEODRIVER", "dummy")

import gallery

import shared_control_env
from shared_control_env.evaluation.episodes import versions

HERE = Path(__file__).parent

project = "shared_control_env"
author = "The shared_control_env developers"
copyright = author
release = version = shared_control_env.__version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx.ext.mathjax",
    "sphinx_copybutton",
]
exclude_patterns = ["_build"]
highlight_language = "none"  # literal blocks of docstrings are equations

html_theme = "furo"
html_title = "shared control"
html_extra_path: list[str] = []

myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence", "deflist", "substitution"]
myst_heading_anchors = 3
nb_execution_mode = "cache"
# What a page shows is that of these sources: another state of them has another cache.
SOURCES = sha256((versions() + (HERE / "gallery.py").read_text()).encode()).hexdigest()[:16]
nb_execution_cache_path = str(HERE / "_build" / "notebooks" / SOURCES)
nb_execution_raise_on_error = True
nb_execution_timeout = 180
nb_merge_streams = True
nb_output_stderr = "remove"  # the notice of a first compilation

autodoc_member_order = "bysource"
autodoc_typehints = "none"
autosummary_generate = True
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True


def _make_gallery(app: Any) -> None:
    """Make the videos and the list pages of the gallery before the pages are read."""
    gallery.make(HERE / "_build" / "gallery")
    html_extra_path.append(str(HERE / "_build" / "gallery"))
    app.config.html_extra_path = html_extra_path


def setup(app: Any) -> None:
    """Register the gallery.

    Args:
        app: Sphinx's application.
    """
    app.connect("builder-inited", _make_gallery)
