"""Reads a scene file as data, finds the lines of its values, and collects its mistakes."""

from __future__ import annotations

import difflib
import os
import re
import stat
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

from antiosc.base import checks
from antiosc.base.errors import InputError

#: Endings of files that have to be meshed first.
GEOMETRY_ENDINGS = (".geo", ".geo_unrolled", ".step", ".stp", ".brep", ".iges", ".igs")
#: Names of tables and keys, and indices of arrays, from the top of the file to a value.
Place: TypeAlias = tuple[str | int, ...]

#: A table of a scene file; and arguments of a call, by name.
Table: TypeAlias = Mapping[str, Any]

#: Largest scene file, bytes; time histories of loads are the longest part of one.
MAX_FILE_BYTES = 4_000_000
#: Deepest brackets within each other.
MAX_DEPTH = 32
TOO_DEEP_MESSAGE = f"{{}}:1: brackets are nested deeper than {MAX_DEPTH} levels."
#: Most sentences of one report, and mistakes after which no further ones are looked for.
MAX_SHOWN_MISTAKES, MAX_MISTAKES = 100, 1000
#: Control characters, line ends among them.
_CONTROL_CHARACTERS = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029]")


class SceneFileError(InputError):
    """A scene file with mistakes: one sentence for each, with the file and the line."""

    def __init__(self, message: str, sentence: str = "") -> None:
        super().__init__(message)
        self.sentence = sentence or message


@dataclass
class Mistakes:
    """The mistakes found so far in a file, each with its place."""

    name: str
    text: str
    sentences: dict[tuple[Place, str], None] = field(default_factory=dict)
    varied_origins: Mapping[Place, Place] = field(default_factory=dict)

    def add_mistake(self, place: Place, sentence: str) -> None:
        """Note a mistake at a place of the scene; raises after MAX_MISTAKES of them."""
        sentence = " ".join(sentence.split())
        if self.varied_origins and (place, sentence) in self.sentences:
            return  # the scene has this mistake for all values
        self.sentences[self._origin(place), sentence] = None
        if len(self.sentences) >= MAX_MISTAKES:
            self.raise_if_any()

    def error(self, place: Place, sentence: str) -> SceneFileError:
        """The error for a mistake that is found while the scene runs."""
        line = line_numbers_of(self.text, [self._origin(place)])[0]
        return SceneFileError(f"{self.name}:{line}: {sentence}", sentence)

    def _origin(self, place: Place) -> Place:
        """The place in [sweep] or [monte_carlo] from which the value at `place` comes.

        A place without a varied value gets the place of the first one, or `place` if there is none.
        """
        for prefix, origin in self.varied_origins.items():
            if place[: len(prefix)] == prefix or prefix[: len(place)] == place:
                return origin
        return next(iter(self.varied_origins.values()), place)

    def raise_if_any(self) -> None:
        """Raise SceneFileError with all mistakes, in the order of the file, if there are any."""
        if not self.sentences:
            return
        lines = line_numbers_of(self.text, [place for place, _ in self.sentences])
        sentences = sorted({(n, text) for n, (_, text) in zip(lines, self.sentences, strict=True)})
        sentences_shown = [
            f"{self.name}:{line}: {text}" for line, text in sentences[:MAX_SHOWN_MISTAKES]
        ]
        if len(sentences) > MAX_SHOWN_MISTAKES:
            sentences_shown.append(f"{self.name}: and {len(sentences) - MAX_SHOWN_MISTAKES} more.")
        raise SceneFileError("\n".join(sentences_shown), "\n".join(one for _, one in sentences))


@dataclass(frozen=True)
class Document:
    """A scene file as data: its path as given, its tables, and the mistakes in them."""

    path: Path
    data: dict[str, Any]
    mistakes: Mistakes


def read_document(path: str | os.PathLike[str]) -> Document:
    """Read a scene file; SceneFileError if it is not TOML, InputError if there is no file."""
    source = checks.path("the scene file", path)
    text = _file_text(source)
    too_deep = TOO_DEEP_MESSAGE.format(source)
    if checks.nests_deeper(text, 4 * MAX_DEPTH):  # brackets of strings over several lines count too
        raise SceneFileError(too_deep)
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise SceneFileError(_syntax_message(str(source), text, str(error))) from None
    except RecursionError:
        raise SceneFileError(too_deep) from None
    except ValueError as error:
        raise SceneFileError(f"{source}:1: this is not a TOML file: {error}.") from None
    return checked_document(source, data, text)


def checked_document(source: Path, data: dict[str, Any], text: str) -> Document:
    """The document of `data`, after a check of its depth and texts; `text`: the file's text."""
    problems = Mistakes(str(source), text)
    level: list[tuple[Place, object]] = [((), data)]  # level by level, without recursion
    for _ in range(MAX_DEPTH):
        level = [
            inner for place, value in level for inner in _valid_entries(place, value, problems)
        ]
    if any(isinstance(value, dict | list) for _, value in level):
        raise SceneFileError(TOO_DEEP_MESSAGE.format(source))
    problems.raise_if_any()
    return Document(source, data, problems)


def _file_text(source: Path) -> str:
    """The text of a scene file; InputError if it is missing, too large or not UTF-8."""
    refused = f"cannot read the scene file {str(source)!r}"
    try:
        status = source.stat()
        if not stat.S_ISREG(status.st_mode):
            raise InputError(f"{refused}: it is not a regular file.")
        if status.st_size > MAX_FILE_BYTES:
            raise InputError(
                f"the scene file {str(source)!r} has {status.st_size} bytes, more than "
                f"{MAX_FILE_BYTES}; is it a scene? It names meshes and matrices by their paths."
            )
        return source.read_bytes().decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        raise InputError(f"{refused}: it is not a text in UTF-8 (byte {error.start}).") from None
    except OSError as error:
        raise InputError(f"{refused}: {error.strerror}.") from None


def _syntax_message(name: str, text: str, error: str) -> str:
    """Message on a syntax error, with the line that tomllib's message `error` states."""
    message, _, position_text = error.rpartition(" (at ")
    words = position_text.rstrip(")").replace(",", "").split()
    line = words[1] if words[:1] == ["line"] else str(text.count("\n") + 1)
    return (
        f"{name}:{line}: this is not TOML: {message or error}; a line is `key = value`, where a"
        ' text stands in "quotes", a list in [brackets] and a comment after #.'
    )


def _valid_entries(
    place: Place, value: object, problems: Mistakes
) -> Iterator[tuple[Place, object]]:
    """Yield (place, value) of the entries of `value`, a table or list at `place`.

    Keys and texts with control characters are noted as mistakes.
    """
    if isinstance(value, dict):
        for key in filter(_CONTROL_CHARACTERS.search, value):
            problems.add_mistake(place, f"a name holds a control character: {checks.shown(key)}.")
        yield from (((*place, key), entry) for key, entry in value.items())
    elif isinstance(value, list):
        yield from (((*place, i), entry) for i, entry in enumerate(value))
    elif isinstance(value, str) and _CONTROL_CHARACTERS.search(value):
        problems.add_mistake(place, f"the text holds a control character: {checks.shown(value)}.")


# -- lines, which `tomllib` does not give

#: A heading: "[a.b]" or "[[a]]"; the key before a value; a name in them.
_TABLE_HEADING = re.compile(r"\s*(\[\[?)([^\[\]]+)\]")
_KEY_BEFORE_VALUE = re.compile(r"\s*([^\[\]=#{}]+?)\s*=")
_NAME_IN_KEY = re.compile(r'"([^"]*)"|\'([^\']*)\'|([^\s."\']+)')


def line_numbers_of(text: str, places: Iterable[Place]) -> list[int]:
    """Line numbers of places in a TOML text; for a place not found, that of its table."""
    lines: dict[Place, int] = {(): 1}
    counts: Counter[Place] = Counter()
    table: Place = ()
    for number, row in enumerate(text.split("\n"), 1):
        heading, key = _TABLE_HEADING.match(row), _KEY_BEFORE_VALUE.match(row)
        if heading:
            table = place = _dotted_names(heading[2])
            if heading[1] == "[[":
                counts[table] += 1
                table = place = (*table, counts[table] - 1)
        elif key:
            place = (*table, *_dotted_names(key[1]))
        else:
            continue
        for length in range(len(place), 0, -1):
            lines.setdefault(place[:length], number)

    def line_of(place: Place) -> int:
        return next(lines[place[:n]] for n in range(len(place), -1, -1) if place[:n] in lines)

    return [line_of(place) for place in places]


def _dotted_names(text: str) -> Place:
    """The names in a dotted heading or key: 'sites."my eye"' -> ("sites", "my eye")."""
    return tuple(next(filter(None, name), "") for name in _NAME_IN_KEY.findall(text))


# -- words of messages


def place_text(place: Place) -> str:
    """A place as text in the user's form: material, supports[2], sites.eye.point."""
    parts = (f"[{part}]" if isinstance(part, int) else f".{part}" for part in place)
    return "".join(parts).removeprefix(".") or "the scene"


def closest_name(name: str, known: Iterable[str], min_similarity: float = 0.5) -> str | None:
    """The known name most similar to `name`.

    None if no similarity reaches `min_similarity` (0 to 1).
    """
    lowered = {entry.lower(): entry for entry in known}
    matches = difflib.get_close_matches(name.lower(), lowered, 1, min_similarity)
    return lowered[matches[0]] if matches else None


def spelling_suggestion(name: object, known: Iterable[str]) -> str:
    """End of a sentence on an unknown name: "; did you mean 'E'?", or a full stop."""
    similar = closest_name(str(name), known)
    return f"; did you mean {similar!r}?" if similar else "."


def names_text(names: Iterable[str]) -> str:
    """The names (at most twenty) as text: "a, b and c"."""
    listed_names = list(names)
    return ", ".join([*listed_names[:20], *(["…"] if len(listed_names) > 20 else [])]) or "none"
