"""The line of every key and value of a TOML text, which `tomllib` does not give."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable
from typing import Any

#: Names of tables and keys, and indices of arrays, from the top of the file to a value.
Place = tuple[str | int, ...]

_TOKEN = re.compile(
    r'"""(?:\\.|[^\\])*?"{3,5}|\'\'\'.*?\'{3,5}|"(?:\\.|[^"\\])*"|\'[^\']*\''  # strings
    r'|#[^\n]*|\n|[ \t\r]+|[\[\]{},=.]|[^\s\[\]{},=.#"\']+',
    re.DOTALL,
)
#: The key that holds the line of a table; no file may have it, because of its control character.
_MARK = "\0line"


def lines_of(text: str, places: Iterable[Place]) -> list[int]:
    """The line of each place of a valid TOML text, or of the closest table around it."""
    try:
        tree = tomllib.loads(_numbered(text))
    except tomllib.TOMLDecodeError:  # a text that has the key of the lines itself
        tree = {}
    return [_line(tree, place) for place in places]


def _numbered(text: str) -> str:
    """The text with its line in place of each value, in each table, and first in each array."""
    found: list[str] = []
    open_brackets, header, state, line = "", False, "key", 1
    for token in _TOKEN.findall(text + "\n"):
        if token == "\n" and not open_brackets:
            found.append(f'\n"\\u0000line" = {line}\n' if header else "\n")
            header, state = False, "key"
        elif token[0] in " \t\r\n#":
            pass
        elif header or (token == "[" and state == "key"):  # [table] and [[table]]
            header = True
            found.append(token)
        elif token in "[{" and state == "value":
            found.append(f"[{line}, " if token == "[" else f'{{"\\u0000line" = {line}, ')
            open_brackets += token
            state = "value" if token == "[" else "key"
        elif token in "]}" and open_brackets:
            found[-1] = found[-1].removesuffix(", ")  # of a table or array without entries
            found.append(token)
            open_brackets, state = open_brackets[:-1], "past"
        elif token == "," and open_brackets:
            found.append(token)
            state = "value" if open_brackets[-1] == "[" else "key"
        elif state == "key":
            found.append(token)
            state = "value" if token == "=" else "key"
        elif state == "value":
            found.append(str(line))
            state = "past"
        line += token.count("\n")
    return "".join(found)


def _line(tree: Any, place: Place) -> int:
    line = 1
    for part in place:
        if isinstance(tree, list) and isinstance(part, int):
            part += isinstance(tree[0], int)  # the line of an array in brackets stands first
            tree = tree[part] if part < len(tree) else None
        else:
            tree = tree.get(part) if isinstance(tree, dict) else None
        if tree is None:
            break
        line = _first(tree) or line
    return line


def _first(tree: Any) -> int:
    """The line at which a table, an array or a value begins."""
    if isinstance(tree, dict):
        return tree[_MARK] if _MARK in tree else _first(next(iter(tree.values()), 0))
    return _first(tree[0]) if isinstance(tree, list) else tree
