"""Sphinx configuration of the pages: `make docs`."""

from __future__ import annotations

import gc
import shutil
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

from sphinx.addnodes import pending_xref
from sphinx.errors import ExtensionError

import antiosc

gc.disable()  # the trees of all pages are kept: to search them for garbage took half of a build

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
generated, theme = (import_module(name) for name in ("generated", "theme"))

project = "antiosc"
author = "antiosc developers"
version = release = antiosc.__version__
extensions = ["sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.mathjax", "myst_parser"]
extensions += ["sphinx_copybutton"]
source_suffix = {".md": "markdown"}
default_role = "code"
html_theme = "furo"
html_title = f"antiosc {version}"
html_static_path = ["_static"]
html_css_files = ["pages.css"]
html_show_copyright = False
html_show_search_summary = False  # browsers fetch no text of pages that are files
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 3
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_attr_annotations = False
autodoc_typehints = "none"
autodoc_member_order = "bysource"

# Debian's MathJax goes into the pages, which ask no network; SVG needs no fonts of the browser.
MATHJAX = Path("/usr/share/javascript/mathjax")
MATHJAX_PARTS = ["MathJax.js", "extensions", "jax/element", "jax/input/TeX", "jax/output/SVG"]
OTHER_FONTS = ("Asana-Math", "Gyre-*", "Latin-Modern", "Neo-Euler", "STIX-Web")
mathjax_path = "mathjax/MathJax.js"
myst_update_mathjax = False
mathjax2_config = {
    "jax": ["input/TeX", "output/SVG"],
    "extensions": ["tex2jax.js"],
    "TeX": {"extensions": ["AMSmath.js", "AMSsymbols.js"]},
    "tex2jax": {
        "inlineMath": [["\\(", "\\)"]],
        "displayMath": [["\\[", "\\]"]],
        "ignoreClass": "page",
        "processClass": "math",
    },
    "showMathMenu": False,
    "messageStyle": "none",
}


def _lists(app: Any, name: str, source: list[str]) -> None:
    if name.startswith("api/"):
        source[0] = generated.with_lists(source[0], generated.api_pages())
    elif name == "index":
        source[0] = generated.with_other_pages(source[0])
    elif name == "howto/report":
        source[0] = source[0].replace("%REPORT", generated.embedded(app.outdir))
    source[0] = generated.with_words(name, source[0])
    if not name.startswith("demos/"):
        source[0] = generated.of_this_folder(source[0])


def _plain(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    generated.plain(lines)
    generated.with_notes(lines)


def _words(app: Any, tree: Any) -> None:
    """A word in the type of a parameter names no attribute, as Sphinx 9 would take it."""
    for name in list(tree.findall(pending_xref)):
        if name["reftype"] == "class" and name["reftarget"][0].islower():
            name.replace_self(name.children)


def _with_mathjax(app: Any, error: Exception | None) -> None:
    if error is not None or app.builder.format != "html":
        return
    if not MATHJAX.is_dir():
        raise ExtensionError(f"{MATHJAX} is missing: apt install libjs-mathjax.")
    for part in MATHJAX_PARTS:
        source, target = MATHJAX / part, Path(app.outdir, "_static/mathjax", part)
        if source.is_dir():
            unused = shutil.ignore_patterns(*OTHER_FONTS)
            shutil.copytree(source, target, ignore=unused, dirs_exist_ok=True)
        else:
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)


def _mended(app: Any, error: Exception | None) -> None:
    if error is None and app.builder.format == "html":
        theme.mend(Path(app.outdir, "_static"))


def setup(app: Any) -> None:
    generated.demo_pages(HERE / "demos")
    app.connect("source-read", _lists)
    app.connect("autodoc-process-docstring", _plain, priority=400)
    app.connect("doctree-read", _words)
    app.connect("build-finished", _with_mathjax)
    app.connect("build-finished", _mended)
