"""What Debian's furo needs to work in pages that are files: one style sheet, one script.

Debian's style sheet imports normalize.css from where the pages have none, and its script is a
module, which browsers take neither as a plain script nor from files.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

#: Of Debian, which furo imports; the packages furo and node-normalize.css have both.
NORMALIZE = Path("/usr/share/javascript/normalize.css/normalize.css")
#: The line of the style sheet that imports it, and that of the script with its module.
IMPORT_OF_STYLE = re.compile(r"@import [^;]*normalize\.css[^;]*;")
IMPORT_OF_SCRIPT = re.compile(r'^import \w+ from "\./([\w-]+\.js)";$', re.MULTILINE)


def mend(static: Path) -> None:
    """Put into furo's style sheet and script what they import; others are left as they are."""
    style, script = static / "styles/furo.css", static / "scripts/furo.js"
    replaced(style, IMPORT_OF_STYLE, lambda _: NORMALIZE.read_text("utf-8"))
    replaced(script, IMPORT_OF_SCRIPT, lambda found: (script.parent / found[1]).read_text("utf-8"))


def replaced(path: Path, what: re.Pattern[str], by: Callable[[re.Match[str]], str]) -> None:
    """Replace all occurrences in a file."""
    text = path.read_text("utf-8")
    path.write_text(what.sub(by, text), "utf-8")
