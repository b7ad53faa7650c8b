"""A scene file as data, the line of every value in it, and the mistakes that are found."""

from __future__ import annotations

import difflib
import os
import re
import stat
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

from antiosc.base import checks
from antiosc.base.errors import InputError

#: Endings of files that have to be meshed first.
GEOMETRIES = (".geo", ".geo_unrolled", ".step", ".stp", ".brep", ".iges", ".igs")
#: Names of tables and keys, and indices of arrays, from the top of the file to a value.
Place: TypeAlias = tuple[str | int, ...]

#: A table of a scene file; and arguments of a call, by name.
Table: TypeAlias = Mapping[str, Any]

#: Largest scene file, bytes; time histories of loads are the longest part of one.
LARGEST_FILE = 4_000_000
#: Deepest brackets within each other.
DEEPEST = 32
#: Most sentences of one report.
MOST_SHOWN = 100
#: Number of mistakes after which no further ones are looked for.
MOST_FOUND = 1000
#: Control characters, line ends among them.
_CONTROL = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029]")


class SceneFileError(InputError):
    """A scene file with mistakes: one sentence for each, with the file and the line."""


#: Prefix "file:line: " of a message about a scene.
LINE = re.compile(r"^\S+\.toml:\d+: ", re.MULTILINE)


def without_line(error: Exception) -> str:
    """The message of an error of a scene that its reader does not see, without file and line."""
    return LINE.sub("", str(error.__cause__ or error))


@dataclass
class Problems:
    """The mistakes found so far in a file, each with its place.

    `origins` is for a scene with varied values: place of each value in this scene -> its place in
    the file.
    """

    name: str
    text: str
    found: dict[tuple[Place, str], None] = field(default_factory=dict)
    origins: Mapping[Place, Place] = field(default_factory=dict)

    def add(self, place: Place, sentence: str) -> None:
        """Note a mistake at a place of the file; SceneFileError once there are MOST_FOUND."""
        sentence = " ".join(sentence.split())
        if self.origins and (place, sentence) in self.found:
            return  # the scene has this mistake for all values
        self.found[self._origin(place), sentence] = None
        if len(self.found) >= MOST_FOUND:
            self.raise_if_any()

    def error(self, place: Place, sentence: str) -> SceneFileError:
        """The error for a mistake that is found while the scene runs."""
        line = lines_of(self.text, [self._origin(place)])[0]
        return SceneFileError(f"{self.name}:{line}: {sentence}")

    def _origin(self, place: Place) -> Place:
        """Place in the file of a varied value; of another place, that of the first varied value."""
        for prefix, origin in self.origins.items():
            if place[: len(prefix)] == prefix or prefix[: len(place)] == place:
                return origin
        return next(iter(self.origins.values()), place)

    def raise_if_any(self) -> None:
        """Raise SceneFileError with all mistakes, in the order of the file, if there are any."""
        if not self.found:
            return
        lines = lines_of(self.text, [place for place, _ in self.found])
        sentences = sorted({(n, text) for n, (_, text) in zip(lines, self.found, strict=True)})
        sentences_shown = [f"{self.name}:{line}: {text}" for line, text in sentences[:MOST_SHOWN]]
        if len(sentences) > MOST_SHOWN:
            or_more = ", or still more" if len(self.found) >= MOST_FOUND else ""
            sentences_shown.append(f"{self.name}: and {len(sentences) - MOST_SHOWN} more{or_more}.")
        raise SceneFileError("\n".join(sentences_shown))


@dataclass(frozen=True)
class Document:
    """A scene file as data: its path as given, its tables, and the mistakes in them."""

    path: Path
    data: dict[str, Any]
    problems: Problems


def read(path: str | os.PathLike[str]) -> Document:
    """Read a scene file; SceneFileError for a text that is not TOML, InputError for no file."""
    source = checks.path("the scene file", path)
    text = _text(source)
    too_deep = f"{source}:1: brackets are nested deeper than {DEEPEST} levels."
    if checks.nests_deeper(text, 4 * DEEPEST):  # brackets of strings over several lines count too
        raise SceneFileError(too_deep)
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise SceneFileError(_syntax(str(source), text, str(error))) from None
    except RecursionError:
        raise SceneFileError(too_deep) from None
    except ValueError as error:
        raise SceneFileError(f"{source}:1: this is not a TOML file: {error}.") from None
    problems = Problems(str(source), text)
    level: list[tuple[Place, object]] = [((), data)]  # level by level, without recursion
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
        return source.read_bytes().decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        raise InputError(f"{refused}: it is not a text in UTF-8 (byte {error.start}).") from None
    except OSError as error:
        raise InputError(f"{refused}: {error.strerror}.") from None


def _syntax(name: str, text: str, error: str) -> str:
    """Message with the line of a syntax error, which ends tomllib's message `error`."""
    message, _, position_text = error.rpartition(" (at ")
    words = position_text.rstrip(")").replace(",", "").split()
    line = words[1] if words[:1] == ["line"] else str(text.count("\n") + 1)
    return (
        f"{name}:{line}: this is not TOML: {message or error}; a line is `key = value`, where a"
        ' text stands in "quotes", a list in [brackets] and a comment after #.'
    )


def _inner(place: Place, value: object, problems: Problems) -> Iterator[tuple[Place, object]]:
    """Yield the entries of a table or list; note keys and texts that contain control characters."""
    if isinstance(value, dict):
        for key in filter(_CONTROL.search, value):
            problems.add(place, f"a name holds a control character: {checks.shown(key)}.")
        yield from (((*place, key), entry) for key, entry in value.items())
    elif isinstance(value, list):
        yield from (((*place, i), entry) for i, entry in enumerate(value))
    elif isinstance(value, str) and _CONTROL.search(value):
        problems.add(place, f"the text holds a control character: {checks.shown(value)}.")


# -- lines, which `tomllib` does not give

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
        tree: object = tomllib.loads(_numbered(text))
    except tomllib.TOMLDecodeError:  # a text that has the key of the lines itself
        tree = {}
    return [_line(tree, place) for place in places]


def _numbered(text: str) -> str:
    """The text with the line of each value in its place; tables and arrays get an entry for it."""
    rows: list[str] = []
    open_brackets = ""
    header = False
    state = "key"
    line = 1
    for token in _TOKEN.findall(text + "\n"):
        if token == "\n" and not open_brackets:
            rows.append(f'\n"\\u0000line" = {line}\n' if header else "\n")
            header = False
            state = "key"
        elif token[0] in " \t\r\n#":
            pass
        elif header or (token == "[" and state == "key"):  # [table] and [[table]]
            header = True
            rows.append(token)
        elif token in "[{" and state == "value":
            rows.append(f"[{line}, " if token == "[" else f'{{"\\u0000line" = {line}, ')
            open_brackets += token
            state = "value" if token == "[" else "key"
        elif token in "]}" and open_brackets:
            rows[-1] = rows[-1].removesuffix(", ")  # of a table or array without entries
            rows.append(token)
            open_brackets = open_brackets[:-1]
            state = "past"
        elif token == "," and open_brackets:
            rows.append(token)
            state = "value" if open_brackets[-1] == "[" else "key"
        elif state == "key":
            rows.append(token)
            state = "value" if token == "=" else "key"
        elif state == "value":
            rows.append(str(line))
            state = "past"
        line += token.count("\n")
    return "".join(rows)


def _line(tree: object, place: Place) -> int:
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


def _first(tree: object) -> int:
    """The line at which a table, an array or a value begins."""
    if isinstance(tree, dict):
        return _first(tree.get(_MARK) or next(iter(tree.values()), 0))
    if isinstance(tree, list):
        return _first(tree[0])
    return int(str(tree))


# -- words of messages


def label(place: Place) -> str:
    """A place as a user writes it: material, supports[2], sites.eye.point."""
    parts = (f"[{part}]" if isinstance(part, int) else f".{part}" for part in place)
    return "".join(parts).removeprefix(".") or "the scene"


#: Words that a file may have in place of a class.
SYNONYMS = {
    word: name
    for name, words in {
        "Sphere": "ball bead bullet projectile",
        "RigidMass": "mass hammer striker block rigid",
        "Obstacle": "wall floor stop ground",
        "Shell": "plate sheet membrane",
        "Laminate": "composite layers sandwich stack",
        "Solid": "volume steel isotropic elastic",
        "AnisotropicSolid": "orthotropic wood crystal",
        "Truss": "rod bar cable",
        "Linear": "spring penalty stiffness",
        "Tabulated": "table measured curve",
        "Tie": "glue bond bonded tied",
        "Bolt": "screw rivet",
    }.items()
    for word in words.split()
}


def closest_name(name: str, known: Iterable[str], least: float = 0.5) -> str | None:
    """The known name that is probably meant: a synonym, or the most similar one, or None.

    `least`: smallest similarity, from 0 to 1 (difflib).
    """
    lowered = {entry.lower(): entry for entry in known}
    synonym = SYNONYMS.get(name.lower(), "").lower()
    matches = [synonym] if synonym in lowered else []
    matches = matches or difflib.get_close_matches(name.lower(), lowered, 1, least)
    if matches:
        return lowered[matches[0]]
    return None


def suggestion(name: object, known: Iterable[str]) -> str:
    """End of a sentence on an unknown name: "; did you mean 'E'?", or a full stop."""
    similar = closest_name(str(name), known)
    return f"; did you mean {similar!r}?" if similar else "."


def listed(names: Iterable[str]) -> str:
    """The names as text, "a, b and c"; the first twenty of many."""
    listed_names = list(names)
    return ", ".join([*listed_names[:20], *(["…"] if len(listed_names) > 20 else [])]) or "none"


def unknown(what: str, name: str, known: Iterable[str]) -> str:
    """A sentence on an unknown name, with those that are known."""
    names = list(known)
    known_names = f"There is {listed(names)}."
    return f"{what} {checks.shown(name)} does not exist{suggestion(name, names)} {known_names}"
