"""What no sentence for a user without Python may contain."""

from __future__ import annotations

import re

#: Calls and arguments of Python: name=value, ao.name, Name(…), name(…), and its constants.
PYTHON = re.compile(
    r"\b[a-z_]\w*=(?!=)|\bao\.[a-z]|\b[A-Z]\w*[a-z]\(|\b[a-z_]+\([^)]*(?:…|\.\.\.)\)"
    r"|\b(?:None|True|False)\b"
)


def python_in(value: object) -> list[str]:
    """The sentences of an answer, a tree of tables and lists, in Python's terms."""
    if isinstance(value, str):
        return [value] if PYTHON.search(value) else []
    if isinstance(value, dict):  # the page shows its site in Python on purpose
        value = [entry for key, entry in value.items() if key != "python"]
    if isinstance(value, list | tuple):
        return [sentence for entry in value for sentence in python_in(entry)]
    return []
