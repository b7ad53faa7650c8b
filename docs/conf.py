"""Sphinx configuration of the pages: `make docs`."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import antiosc

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
generated = import_module("generated")

project = "antiosc"
author = "antiosc developers"
version = release = antiosc.__version__
extensions = ["sphinx.ext.autodoc", "sphinx.ext.napoleon", "myst_parser"]
source_suffix = {".md": "markdown"}
default_role = "code"
html_theme = "alabaster"
html_theme_options = {"description": "Impacts by reduced models", "page_width": "1000px"}
html_static_path = ["_static"]
html_css_files = ["narrow.css"]
html_sidebars = {"**": ["about.html", "navigation.html", "searchbox.html"]}
myst_heading_anchors = 3
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_attr_annotations = False
autodoc_typehints = "none"
autodoc_member_order = "bysource"


def _lists(app: Any, name: str, source: list[str]) -> None:
    if name.startswith("api/"):
        source[0] = generated.with_lists(source[0], generated.api_pages())
    elif name == "index":
        source[0] = generated.with_other_pages(source[0])
    elif "/" not in name:
        source[0] = generated.of_this_folder(source[0])


def _plain(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    generated.plain(lines)
    generated.with_notes(lines)


def setup(app: Any) -> None:
    generated.demo_pages(HERE / "demos")
    app.connect("source-read", _lists)
    app.connect("autodoc-process-docstring", _plain, priority=400)
