"""Check of scripts in gmsh's `.geo` language: only geometry and meshing commands are permitted.

A `.geo` file is a program. It can run system commands, read and write files, and execute programs
named in fields, options and plugins. None of that is needed to describe a part. `harmless` divides
a script into tokens as gmsh's scanner (`Gmsh.l`) does and refuses the commands of the lists below,
which are taken from gmsh's grammar (`Gmsh.y`, `DefaultOptions.h`, `Field.cpp`; 4.8 to 4.15). It
returns the script without comments and with a blank on both sides of every name and string, so that
gmsh divides it into the same tokens.

Names can be composed at run time only by `StringToName`, which is refused. A token that is not a
command here is therefore not a command in gmsh. Commands that write files (`Save`, `Print`) are
left out, and scripts that it includes from its folder are inserted.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import NamedTuple

from antiosc.base.errors import MeshError

CAD = (".step", ".stp", ".brep", ".iges", ".igs")
MESHES = (".msh", ".inp", ".bdf", ".unv", ".med", ".stl", ".vtk")
#: `Command expression;`: commands that run programs, or read or write files. They may also be names
#: of variables; they are commands only if an argument follows.
FILE_COMMANDS = {
    *("System", "SystemCall", "NonBlockingSystemCall", "OnelabRun"),
    *("Include", "Merge", "MergeWithBoundingBox", "Print", "Save", "SendToServer", "CreateDir"),
}
#: Those that only write a file, and those that take in a script.
WRITING = ("Save", "Print")
INCLUDING = ("Include", "Merge")
#: Scripts that include each other, at most.
DEEPEST = 8
#: Reserved words of that kind, and those that turn a string into a name.
WORDS = {*("OnelabRun", "Plugin", "ShapeFromFile", "ListFromFile", "StringToName", "S2N")}
#: Fields that run a program or read a file.
FILE_FIELDS = {"ExternalProcess", "Structured", "ExternalField"}
#: Groups of options for other programs.
OPTIONS = {"Solver"}
#: Options, after a point: names of files and programs, and commands to be executed later.
OPTION = re.compile(
    r"(\w*(FileName\w*|File\d*|Command\w*|Executable\w*|Interpreter|Editor|WatchFile\w*)"
    r"|RemoteLogin\d*|SocketName|SaveOptions|SaveSession)",
    re.ASCII,
)
#: Characters at which gmsh's scanner ends a string and continues inside it.
LONGEST_STRING = 1000
#: Ends of blocks that are not executed. gmsh searches these words with a second scanner.
_END_OF_SKIPPED = re.compile(r"EndIf|ElseIf|Else|EndFor|Return")
_REFUSED = FILE_COMMANDS | WORDS | FILE_FIELDS | OPTIONS
_REFUSED_NAMES = re.compile("|".join(sorted(_REFUSED, key=len, reverse=True)))
_PRINTING = {"Printf", "Error", "Warning"}

_TOKEN = re.compile(
    r"""(?P<blank>[ \t\r\n\f]+)|(?P<comment>//[^\n]*|/\*.*?\*/)|(?P<string>"[^"]*"|'[^']*')"""
    r"""|(?P<name>[A-Za-z_][A-Za-z_0-9]*)"""
    r"""|(?P<number>\d+\.?\d*([Ee][-+]?\d+)?|\.\d+([Ee][-+]?\d+)?)|(?P<sign>.)""",
    re.DOTALL | re.ASCII,
)


class Token(NamedTuple):
    """A token of a script; its kind is "blank", "comment", "string", "name", "number" or "sign"."""

    kind: str
    text: str
    line: int


class Script(NamedTuple):
    """A script that gmsh may execute, with the geometry files beside it that it merges."""

    text: str
    merged: list[str]


def harmless(text: str, name: str, read_beside: Callable[[str], str]) -> Script:
    """The script `text` of the file `name` in the form in which gmsh may run it.

    `read_beside` reads a script in the folder of the file.

    Raises
    ------
    MeshError
        It runs programs, reads or writes files, or gmsh may divide it into other tokens.
    """
    tokens = list(_included(text, name, read_beside))
    significant = _significant_tokens(tokens)
    merged = [_check(significant, k, name) for k in range(len(significant))]
    if any(_END_OF_SKIPPED.search(t.text) for t in significant if t.kind == "string"):
        for token in significant:
            if token.kind == "string" and (refused := _REFUSED_NAMES.search(token.text)):
                raise _refusal(
                    name, token, f"{refused[0]} in a string beside one that ends a block"
                )
    text = "".join(map(_written, tokens)) + "\n"  # gmsh 4.8 ignores a last line without a line end
    return Script(text, [m for m in merged if m])


def _significant_tokens(tokens: list[Token]) -> list[Token]:
    """Tokens without blanks and comments."""
    return [t for t in tokens if t.kind not in ("blank", "comment")]


def _included(
    text: str, name: str, read_beside: Callable[[str], str], depth: int = 0
) -> Iterator[Token]:
    """The tokens of a script and of the scripts it includes, without commands that write files."""
    if depth > DEEPEST:
        raise MeshError(f"{name} includes scripts more than {DEEPEST} deep, or itself.")
    tokens = list(_tokens(text, name))
    places = [k for k, t in enumerate(tokens) if t.kind not in ("blank", "comment")]
    position = 0
    for k, file, end in zip(places, places[1:], places[2:], strict=False):
        word = tokens[k].text
        argument = tokens[file]
        if k < position or argument.kind != "string" or tokens[end].text != ";":
            continue
        if word in WRITING or (word in INCLUDING and _is_beside(argument, (".geo",))):
            yield from tokens[position:k]
            position = end + 1
            if word in INCLUDING:
                inner = argument.text[1:-1]
                yield from _included(read_beside(inner), inner, read_beside, depth + 1)
                yield Token("blank", "\n", argument.line)
    yield from tokens[position:]


def _tokens(text: str, name: str) -> Iterator[Token]:
    if "\0" in text:
        raise MeshError(
            f"{name} is binary and no script of gmsh, as the geometries of GiD: write it there as "
            ".step, or its mesh as .inp or .bdf."
        )
    line = 1
    for match in _TOKEN.finditer(text):
        token = Token(str(match.lastgroup), match[0], line)
        if token.kind == "string" and len(token.text) > LONGEST_STRING:
            raise _refusal(name, token, f"a string of {len(token.text)} characters")
        if token.kind == "sign" and token.text in "\"'":
            raise _refusal(name, token, "a string that does not end")
        if token.text == "/" and text.startswith("/*", match.start()):
            raise _refusal(name, token, "a comment that does not end")
        yield token
        line += token.text.count("\n")


def _check(tokens: list[Token], k: int, name: str) -> str | None:
    """Check the command at token k; returns the name of the file if it merges a permitted one."""
    token = tokens[k]
    ahead, second, previous_token = (_at(tokens, j) for j in (k + 1, k + 2, k - 1))
    if token.kind != "name":
        return None
    word = token.text
    if word in WORDS:
        raise _refusal(name, token, word)
    if word in FILE_COMMANDS and ahead.kind in ("string", "name"):
        if word == "Merge" and second.text == ";" and _is_beside(ahead, CAD):
            return ahead.text[1:-1]
        if word in INCLUDING and _is_beside(ahead, MESHES):
            raise MeshError(
                f"{name} merges the mesh {ahead.text[1:-1]} (line {token.line}), which is refused "
                "in a geometry: read that file in its place."
            )
        raise _refusal(name, token, f"{word} {ahead.text[:60]}")
    if word in FILE_FIELDS and previous_token.text == "=":
        raise _refusal(name, token, f"a field of type {word}")
    if word in OPTIONS and ahead.text in (".", "["):
        raise _refusal(name, token, f"{word}{ahead.text}{second.text}")
    if previous_token.text == "." and OPTION.fullmatch(word):
        raise _refusal(name, token, f"the option {word}")
    if word in _PRINTING and ahead.text in ("(", "[") and _behind(tokens, k + 1).startswith(">"):
        raise _refusal(name, token, f"{word} into a file")
    return None


def _at(tokens: list[Token], k: int) -> Token:
    if 0 <= k < len(tokens):
        return tokens[k]
    return Token("end", "", 0)


def _is_beside(token: Token, endings: tuple[str, ...]) -> bool:
    """Whether a string names a file of these endings beside the script."""
    file = token.text[1:-1]
    plain = token.kind == "string" and re.fullmatch(r"[\w\- .+=()]+", file, re.ASCII) is not None
    return plain and file.lower().endswith(endings) and not file.startswith(".")


def _behind(tokens: list[Token], k: int) -> str:
    """Text of the token after the bracket that closes the one at k; empty if there is none."""
    depth = 0
    for j in range(k, len(tokens)):
        depth += (tokens[j].text in ("(", "[")) - (tokens[j].text in (")", "]"))
        if depth == 0:
            return _at(tokens, j + 1).text
    return ""


def _written(token: Token) -> str:
    """The token as text for gmsh, with its line break kept."""
    if token.kind == "comment":
        return " " + "\n" * token.text.count("\n")
    if token.kind in ("name", "string"):
        return f" {token.text} "
    return token.text


def _refusal(name: str, token: Token, what: str) -> MeshError:
    quoted = " ".join(what.split())
    return MeshError(
        f"{name} is refused for line {token.line} ({quoted}): a geometry may run no program and "
        "read no other file but CAD and scripts beside it; if you know who wrote it, read it with "
        "trust (in Python alone)."
    )
