"""Lines of a deck and of the files that it includes, and what becomes of each of its cards.

A card is read, harmless, ignored, refused or unknown, as the tables of the dialects say it; none is
dropped without a word: what is ignored or unknown is told with its count and its lines.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, NamedTuple

from antiosc.base.errors import MeshError, PiecesError
from antiosc.io.deck import Place

#: What the first lines of Nastran's bulk data are known by.
BULK = re.compile(r"(?im)^\s*(BEGIN\s+BULK|GRID[*, ]|CEND\b|PSHELL[*, ]|INCLUDE\s+['\"])")
#: Greatest depth of included files.
DEEPEST_INCLUDE = 16
#: Least names in the path of a folder above the deck's from which files may be included: none of
#: the system, no home.
DEEP_ENOUGH = 4
#: Largest size of all files of a deck together, bytes.
LARGEST_DECK = 4 * 2**30


Watch = Callable[[int], None]


class Sources:
    """The files of a deck; `on_size` gets the bytes of all so far, `root`: whence it includes."""

    def __init__(
        self, path: Path, name: str, on_size: Watch = lambda size: None, root: str | None = None
    ) -> None:
        self.path, self.name, self.folder = path, name, path.resolve().parent
        self.root = _root(path) if root is None else Path(root)
        self.size, self._on_size = 0, on_size
        self._open: list[Path] = []

    def lines(self, path: Path, name: str) -> list[str]:
        """Lines of one file, without line ends."""
        self.size += path.stat().st_size
        if self.size > LARGEST_DECK:
            raise MeshError(f"{self.name} and the files it includes have more than 4 GiB.")
        self._on_size(self.size)
        content = path.read_bytes()
        if b"\0" in content:
            wide = content.startswith((b"\xff\xfe", b"\xfe\xff"))
            message = "it is UTF-16; save it as UTF-8" if wide else "it is no text, or is damaged"
            raise MeshError(f"{name} contains zero bytes: {message}.")
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
        """Read an included file until `leave`; MeshError: missing, outside, or already open."""
        named = named.strip().strip("'\"").strip()
        at.needs(named, "an include without the name of a file.")
        try:
            path = self._path(named)
            inside = path.is_relative_to(self.root)
            exists = inside and os.path.isfile(path)
        except (OSError, ValueError):
            inside, exists = True, False
        folder = "/".join(self.root.parts[-2:])
        at.needs(inside, f"{named[:80]!r} lies outside the folder {folder!r}, from which "
                 f"{self.name} may include files; name the folder that holds them all by "
                 "root=.")  # fmt: skip
        at.needs(exists, f"there is no file {named[:80]!r} beside {self.name}: put the file "
                 "that it includes there.")  # fmt: skip
        at.needs(path not in self._open, f"{named[:80]!r} includes itself.")
        shallow = len(self._open) < DEEPEST_INCLUDE
        at.needs(shallow, f"files include one another more than {DEEPEST_INCLUDE} deep.")
        self._open.append(path)
        return self.lines(path, path.name)

    def _path(self, named: str) -> Path:
        """A file beside the deck, or else beside the file that includes it."""
        name = named.replace("\\", "/")
        folders = [self.folder, *(one.parent for one in self._open[-1:])]
        path, *more = ((folder / name).resolve() for folder in folders)
        # unlike Path.is_file, no error for names that are too long
        return next((p for p in more if not os.path.isfile(path) and os.path.isfile(p)), path)

    def holds(self, named: str) -> bool:
        """Whether a file that the deck includes is there; of a name that is none, True."""
        name = named.strip().strip("'\"")
        return not name or os.path.isfile(self._path(name))

    def leave(self) -> None:
        """Leave the file that was entered last."""
        self._open.pop()


def _root(path: Path) -> Path:
    """The folder that includes may not leave: the deck's, or its parent if the user owns both."""
    folder = path.resolve().parent
    above = folder.parent
    try:
        of_the_user = all(one.stat().st_uid == os.getuid() for one in (path, folder, above))
    except OSError:
        of_the_user = False
    return above if of_the_user and len(above.parts) >= DEEP_ENOUGH else folder


Kind = Literal["read", "harmless", "ignored", "refused", "unknown"]
#: Lines that are listed of each card.
MOST_LINES = 4


class Fate(NamedTuple):
    """What becomes of a card; `what`: of a refused one, what it is; of others, a remark."""

    kind: Kind
    what: str = ""


UNKNOWN = Fate("unknown")


def table(*, refused: Mapping[str, str], **names: Iterable[str]) -> dict[str, Fate]:
    """The fates of cards by their names; `refused`: what they are, or "" -> names and spaces."""
    fates: dict[str, Fate] = {}
    for kind, names_of_kind in names.items():  # read, harmless, ignored
        fates |= dict.fromkeys(names_of_kind, Fate(kind))  # type: ignore[arg-type]
    for what, some in refused.items():
        fates |= dict.fromkeys(some.split(), Fate("refused", what))
    return fates


@dataclass
class Account:
    """The cards of a deck, each with its place and its fate."""

    name: str
    cards: list[tuple[str, Place, Fate]] = field(default_factory=list)
    #: options and fields of cards that are read: what they are, the place of the card, their fate
    options: list[tuple[str, Place, Fate]] = field(default_factory=list)

    def refuse(self, between: Collection[str] = (), alone: bool = False) -> None:
        """MeshError for the first card or option that is refused.

        `between`: cards that act between pieces of the part: PiecesError for these, or they are
        ignored where one piece is read `alone`.
        """
        for k, (name, place, fate) in enumerate([*self.cards, *self.options]):
            if fate.kind != "refused":
                continue
            if alone and name in between:
                self.cards[k] = (name, place, Fate("ignored", "with other pieces"))
                continue
            what = f" is {fate.what}, which" if fate.what else ""
            message = f"{place}: {name}{what} is not supported here and would change the result;"
            if name in between:
                raise PiecesError(f"{message} remove it, or read one piece of the part (piece=1).")
            raise MeshError(f"{message} remove it from the deck, or model the part without it.")

    def ignored(self) -> list[str]:
        """Count, name and lines of what is ignored."""
        return _counted([*self.cards, *self.options], "ignored")

    def unknown(self, options: bool = False) -> list[str]:
        """A sentence on the cards, or options and fields, that the table lacks, if any."""
        names = ", ".join(_counted(self.options if options else self.cards, "unknown"))
        what = f"options of {self.name} are not read"
        return [f"{what if options else f'cards of {self.name} are unknown here and ignored'}: "
                f"{names}."] if names else []  # fmt: skip


def _counted(entries: Iterable[tuple[str, Place, Fate]], kind: Kind) -> list[str]:
    places: dict[str, list[Place]] = {}
    for name, place, fate in sorted(entries, key=lambda one: one[0]):
        if fate.kind == kind:
            places.setdefault(f"{name} {fate.what}".strip(), []).append(place)
    return [f"{len(some)} {label} ({lines(some)})" for label, some in places.items()]


def lines(places: Iterable[Place]) -> str:
    """Lines and their file as text, shortened where they are many."""
    some = list(places)
    shown, hidden = some[:MOST_LINES], len(some) - MOST_LINES
    more = f" and {hidden} more" if hidden > 0 else ""
    if len({place.file for place in some}) > 1:
        return ", ".join(map(str, shown)) + more
    numbers = ", ".join(str(place.line) for place in shown)
    return f"line{'s' * (len(some) > 1)} {numbers}{more} of {some[0].file}"
