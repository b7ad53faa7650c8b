"""The reader of each file type.

A new format is one function here: it gets a `Request`, reads `ask.path` and returns a `FileMesh`,
or raises MeshError with one sentence that names the file `ask.name`. It runs in a separate process
with limits on time and memory (`child`), which can import only those modules of antiosc that do not
need dolfinx: `antiosc.errors`, `antiosc.checks` and this package. All other types go to meshio.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from antiosc.fem.readers import by_deck, by_gmsh, by_meshio, by_unv
from antiosc.fem.readers.neutral import FileMesh
from antiosc.fem.readers.request import Request

Reader = Callable[[Request], FileMesh]

DECKS: dict[str, Reader] = {
    ".inp": by_deck.abaqus,
    **dict.fromkeys((".bdf", ".nas", ".fem"), by_deck.nastran),
}
READERS: dict[str, Reader] = {
    ".msh": by_gmsh.read,
    **DECKS,
    ".unv": by_unv.read,
    **dict.fromkeys(by_gmsh.GEOMETRY, by_gmsh.generate),
}


#: Extensions that Nastran decks share with other files, and by what they are known.
PERHAPS_BULK = (".dat", ".blk", ".pch", ".nastran", ".asm")
BULK = re.compile(rb"^\s*(BEGIN\s+BULK|GRID[*, ]|CEND\b)", re.IGNORECASE | re.MULTILINE)
FIRST_BYTES = 2**20


def reader_of(path: str | Path, solid: bool = False) -> Reader:
    """The reader of a file, by its extension; `solid`: a surface to be filled."""
    if solid:
        return by_gmsh.generate
    if is_bulk(path):
        return by_deck.nastran
    return READERS.get(Path(path).suffix.lower(), by_meshio.read)


def is_bulk(path: str | Path) -> bool:
    """Whether a file named like those of several programs (.dat, …) holds Nastran bulk data."""
    if Path(path).suffix.lower() not in PERHAPS_BULK:
        return False
    try:
        with Path(path).open("rb") as file:
            start = file.read(FIRST_BYTES)
    except OSError:
        return False
    return BULK.search(start) is not None


def library_of(path: str | Path, solid: bool = False) -> str:
    """The library that the reader of a file needs; it is imported once for all files."""
    reader = reader_of(path, solid)
    if reader is by_meshio.read:
        return "meshio"
    return "gmsh" if reader in (by_gmsh.read, by_gmsh.generate) else "numpy"


def is_deck(path: str | Path) -> bool:
    """Whether a file, by its extension, may contain a whole model."""
    return Path(path).suffix.lower() in DECKS or is_bulk(path)
