"""Texts from the templates beside this file, by jinja2."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

from antiosc.app.scene_file.result_tables import shown, with_prefixes
from antiosc.base.errors import MissingDependencyError
from antiosc.base.isolation import loading


def rendered(template: str, **content: Any) -> str:
    """The text of a template; in HTML all content is escaped: it is no markup."""
    try:
        with loading():
            jinja2 = importlib.import_module("jinja2")
    except ImportError:
        raise MissingDependencyError(
            "reports and new scenes need jinja2: apt install python3-jinja2, or pip install jinja2."
        ) from None
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=lambda name: name is None or name.endswith(".html"),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {"shown": shown, "prefixed": with_prefixes}
    environment.filters["zipped"] = lambda columns: zip(*columns, strict=True)
    environment.tests["numeric"] = lambda cell: shown(cell).strip("-–+.0123456789eE% ") == ""
    return str(environment.get_template(template).render(content))
