"""Lines of a deck and of the files that it includes, from its folder or another that is given."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path

from antiosc.base.errors import MeshError
from antiosc.io.deck import Place

#: What the first lines of Nastran's bulk data are known by.
BULK = re.compile(
    r"^\s*(BEGIN\s+BULK|GRID[*, ]|CEND\b|PSHELL[*, ]|INCLUDE\s+['\"])", re.IGNORECASE | re.MULTILINE
)
#: Greatest depth of included files.
DEEPEST_INCLUDE = 16
#: Least names in the path of a folder above the deck's from which files may be included: none of
#: the system, no home.
DEEP_ENOUGH = 4
#: Largest size of all files of a deck together, bytes.
LARGEST_DECK = 4 * 2**30


class Sources:
    """The files of a deck, each read where it is included; `on_size` gets the bytes of all so far.

    `root`: the folder of the files that it may include; None: its own, or the one above.
    """

    def __init__(
        self,
        path: Path,
        name: str,
        on_size: Callable[[int], None] = lambda size: None,
        root: str | None = None,
    ) -> None:
        self.path = path
        self.name = name
        self.folder = path.resolve().parent
        self.root = _root(path) if root is None else Path(root)
        self.size = 0
        self._open: list[Path] = []
        self._on_size = on_size

    def lines(self, path: Path, name: str) -> list[str]:
        """Lines of one file, without line ends."""
        self.size += path.stat().st_size
        if self.size > LARGEST_DECK:
            raise MeshError(f"{self.name} and the files it includes have more than 4 GiB.")
        self._on_size(self.size)
        content = path.read_bytes()
        if b"\0" in content:
            raise MeshError(f"{name} contains zero bytes: it is not a text file, or it is damaged.")
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = content.decode("latin-1")
        # splitlines() would also divide lines at other characters; DOS ends a file by \x1a
        return text.rstrip("\x1a").replace("\r\n", "\n").replace("\r", "\n").split("\n")

    def main(self) -> list[str]:
        """Lines of the deck itself."""
        self._open = [self.path.resolve()]
        return self.lines(self.path, self.name)

    def enter(self, named: str, at: Place) -> list[str]:
        """Lines of a file that the deck includes; `leave` ends it.

        Raises
        ------
        MeshError
            No such file, one outside the deck's folder, one that includes itself.
        """
        named = named.strip().strip("'\"").strip()
        at.needs(named, "an include without the name of a file.")
        try:
            path = self._path(named)
            inside = path.is_relative_to(self.root)
            found = inside and path.is_file()
        except (OSError, ValueError):
            inside, found = True, False
        if not inside:
            folder = "/".join(self.root.parts[-2:])
            raise at.error(
                f"{named[:80]!r} lies outside the folder {folder!r}, from which "
                f"{self.name} may include files; name the folder that holds them all by root=."
            )
        at.needs(found, f"there is no file {named[:80]!r} beside {self.name}.")
        at.needs(path not in self._open, f"{named[:80]!r} includes itself.")
        if len(self._open) >= DEEPEST_INCLUDE:
            raise at.error(f"files include one another more than {DEEPEST_INCLUDE} deep.")
        self._open.append(path)
        return self.lines(path, path.name)

    def _path(self, named: str) -> Path:
        """A file beside the deck, or else beside the file that includes it."""
        name = named.replace("\\", "/")
        path, *more = (
            (folder / name).resolve()
            for folder in (self.folder, *(one.parent for one in self._open[-1:]))
        )
        return next((one for one in more if not path.is_file() and one.is_file()), path)

    def holds(self, named: str) -> bool:
        """Whether a file that the deck includes is there; of a name that is none, True."""
        name = named.strip().strip("'\"")
        return not name or self._path(name).is_file()

    def leave(self) -> None:
        """Leave the file that was entered last."""
        self._open.pop()


def _root(path: Path) -> Path:
    """The folder of a deck, or the one above where the deck and both folders are the user's own."""
    folder = path.resolve().parent
    above = folder.parent
    try:
        own = all(one.stat().st_uid == os.getuid() for one in (path, folder, above))
    except OSError:
        own = False
    return above if own and len(above.parts) >= DEEP_ENOUGH else folder
