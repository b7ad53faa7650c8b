"""The reader of each file type.

A reader gets a `Request`, reads `ask.path` and returns a `FileMesh`, or raises MeshError with one
sentence that names the file `ask.name`. It runs in a separate process with limits on time and
memory (`child`), which can import only those modules of antiosc that do not need dolfinx:
`antiosc.base` and this package. Packages register further readers, each for one ending, as entry
points of the group `antiosc.readers`; all other types go to meshio.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from antiosc.io import by_gmsh, facets
from antiosc.io.mesh_files import read_by_meshio
from antiosc.io.request import FileReader, loaded, registered

#: Name is the ending of the files without its dot, value a `FileReader`.
GROUP = "antiosc.readers"
GENERATOR = FileReader(by_gmsh.generate)
BUILT_IN = {
    ".msh": FileReader(by_gmsh.read),
    **dict.fromkeys(by_gmsh.GEOMETRY, GENERATOR),
    **dict.fromkeys(facets.SURFACES, FileReader(facets.read)),
}
MESHIO = FileReader(read_by_meshio)
#: Bytes from its begin by which the type of a file is recognized.
FIRST_BYTES = 2**20


def reader_of(path: str | Path, solid: bool = False) -> FileReader:
    """The reader for a file, by its ending and content; `solid`: a surface to be filled."""
    if solid:
        return GENERATOR
    ending = Path(path).suffix.lower()
    for reader in _registered(ending):
        if reader.matches is None or reader.matches(_start(path)):
            return reader
    return BUILT_IN.get(ending, MESHIO)


def _registered(ending: str) -> Iterator[FileReader]:
    for entry in registered(GROUP):
        if f".{entry.name.lower()}" == ending:
            yield loaded(entry, FileReader)


def _start(path: str | Path) -> bytes:
    try:
        with Path(path).open("rb") as file:
            return file.read(FIRST_BYTES)
    except OSError:
        return b""


def is_deck(path: str | Path) -> bool:
    """Whether a file may contain a whole model."""
    return reader_of(path).model


def deck_endings() -> list[str]:
    """Endings of the files that `read_model` reads, whatever their content."""
    readers = {f".{entry.name.lower()}": loaded(entry, FileReader) for entry in registered(GROUP)}
    return sorted(
        ending for ending, reader in readers.items() if reader.model and not reader.matches
    )
