"""A scene file as data."""

from __future__ import annotations

import os
import re
import stat
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from antiosc.app.scene_file.problems import Problems, SceneFileError
from antiosc.base import checks
from antiosc.base.errors import InputError

#: Largest scene file, bytes; time histories of loads are the longest part of one.
LARGEST_FILE = 4_000_000
#: Deepest brackets within each other.
DEEPEST = 32
#: Control characters, line ends among them.
_CONTROL = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029]")


@dataclass(frozen=True)
class Document:
    """What a scene file says.

    Attributes
    ----------
    path : of the file, as given.
    data : tables, as `tomllib` reads them.
    problems : mistakes found in it; knows the lines.
    """

    path: Path
    data: dict[str, Any]
    problems: Problems

    def file(self, name: str) -> str:
        """A path of the scene, which is relative to the folder of the scene file."""
        return os.path.normpath(self.path.parent / name)


def read(path: str | os.PathLike[str]) -> Document:
    """Read a scene file; SceneFileError for a text that is not TOML, InputError for no file."""
    source = checks.path("the scene file", path)
    text = _text(source)
    too_deep = f"{source}:1: brackets are nested deeper than {DEEPEST} levels."
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise SceneFileError(_syntax(str(source), text, error)) from None
    except RecursionError:
        raise SceneFileError(too_deep) from None
    except ValueError as error:
        raise SceneFileError(f"{source}:1: this is not a TOML file: {error}.") from None
    problems = Problems(str(source), text)
    # level by level, without recursion
    level: list[tuple[tuple[str | int, ...], Any]] = [((), data)]
    for _ in range(DEEPEST):
        level = [inner for place, value in level for inner in _inner(place, value, problems)]
    if any(isinstance(value, dict | list) for _, value in level):
        raise SceneFileError(too_deep)
    problems.raise_if_any()
    return Document(source, data, problems)


def _text(source: Path) -> str:
    refused = f"cannot read the scene file {str(source)!r}"
    try:
        status = source.stat()
        if not stat.S_ISREG(status.st_mode):
            raise InputError(f"{refused}: it is not a regular file.")
        if status.st_size > LARGEST_FILE:
            raise InputError(
                f"the scene file {str(source)!r} has {status.st_size} bytes, more than "
                f"{LARGEST_FILE}; is it a scene? It names meshes and matrices by their paths."
            )
        return source.read_bytes().decode("utf-8").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        raise InputError(f"{refused}: it is not a text in UTF-8 (byte {error.start}).") from None
    except OSError as error:
        raise InputError(f"{refused}: {error.strerror}.") from None


def _syntax(name: str, text: str, error: tomllib.TOMLDecodeError) -> str:
    """tomllib's message ends with "(at line 3, column 5)" or "(at end of document)"."""
    message, _, where = str(error).rpartition(" (at ")
    words = where.rstrip(")").replace(",", "").split()
    line = words[1] if words[:1] == ["line"] else str(text.count("\n") + 1)
    return (
        f"{name}:{line}: this is not TOML: {message or error}; a line is `key = value`, where a"
        ' text stands in "quotes", a list in [brackets] and a comment after #.'
    )


def _inner(place: Any, value: Any, problems: Problems) -> list[tuple[Any, Any]]:
    """Entries of a table or list; names and texts that would change a terminal are noted."""
    if isinstance(value, dict):
        for key in filter(_CONTROL.search, value):
            problems.add(place, f"a name holds a control character: {checks.shown(key)}.")
        return [((*place, key), each) for key, each in value.items()]
    if isinstance(value, list):
        return [((*place, i), each) for i, each in enumerate(value)]
    if isinstance(value, str) and _CONTROL.search(value):
        problems.add(place, f"the text holds a control character: {checks.shown(value)}.")
    return []
