"""Lines of a deck and of the files that it includes, and the treatment of each of its cards.

The tables of the dialects say whether a card is read, harmless or refused. All others are ignored,
and reported with their count and lines.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, NamedTuple

from antiosc.base.errors import MeshError, PiecesError
from antiosc.io.conversion import Deck
from antiosc_decks.entries import DeckPlace

#: Pattern of the first lines of Nastran's bulk data.
BULK = re.compile(r"(?im)^\s*(BEGIN\s+BULK|GRID[*, ]|CEND\b|PSHELL[*, ]|INCLUDE\s+['\"])")
#: Greatest depth of included files.
DEEPEST_INCLUDE = 16
#: Files may be included from the folder above the deck's if its path has at least so many names,
#: which excludes folders of the system and home folders.
DEEP_ENOUGH = 4
#: Largest size of all files of a deck together, bytes.
LARGEST_DECK = 4 * 2**30


#: What is called with the size of all files read so far, in bytes.
Watch = Callable[[int], None]


class Sources:
    """The files of a deck: those that it includes must lie below the folder `root`.

    `on_size` is called with the size of all files read so far, in bytes.
    """

    def __init__(
        self, path: Path, name: str, on_size: Watch = lambda size: None, root: str | None = None
    ) -> None:
        self.path = path
        self.name = name
        self.folder = path.resolve().parent
        self.root = _root(path) if root is None else Path(root)
        self.size = 0
        self._on_size = on_size
        self._open: list[Path] = []

    def lines(self, path: Path, name: str) -> list[str]:
        """Lines of one file, without line ends."""
        self.size += path.stat().st_size
        if self.size > LARGEST_DECK:
            raise MeshError(f"{self.name} and the files it includes have more than 4 GiB.")
        self._on_size(self.size)
        content = path.read_bytes()
        if b"\0" in content:
            utf16 = content.startswith((b"\xff\xfe", b"\xfe\xff"))
            what = "is UTF-16; save it as UTF-8" if utf16 else "is no text, or is damaged"
            raise MeshError(f"{name} contains zero bytes: it {what}.")
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

    def enter(self, named: str, at: DeckPlace) -> list[str]:
        """Lines of an included file, which stays open until `leave`."""
        named = named.strip().strip("'\"").strip()
        at.needs(named, "an include without the name of a file.")
        try:
            path = self._path(named)
            below_root = path.is_relative_to(self.root)
            exists = below_root and os.path.isfile(path)
        except (OSError, ValueError):
            below_root, exists = True, False
        folder = "/".join(self.root.parts[-2:])
        outside = f"{named[:80]!r} lies outside the folder {folder!r}, from which {self.name} may "
        at.needs(below_root, f"{outside}include files; name the folder that holds them all (root).")
        at.needs(exists, f"there is no file {named[:80]!r}: put it beside {self.name}.")
        at.needs(path not in self._open, f"{named[:80]!r} includes itself.")
        shallow = len(self._open) < DEEPEST_INCLUDE
        at.needs(shallow, f"files include one another more than {DEEPEST_INCLUDE} deep.")
        self._open.append(path)
        return self.lines(path, path.name)

    def _path(self, named: str) -> Path:
        """Path of a file beside the deck, else beside the file that includes it."""
        name = named.replace("\\", "/")
        folders = [self.folder, *(opened.parent for opened in self._open[-1:])]
        path, *alternatives = ((folder / name).resolve() for folder in folders)
        # unlike Path.is_file, no error for names that are too long
        return next(
            (p for p in alternatives if not os.path.isfile(path) and os.path.isfile(p)), path
        )

    def holds(self, named: str) -> bool:
        """Whether an included file exists; True for an empty name."""
        name = named.strip().strip("'\"")
        return not name or os.path.isfile(self._path(name))

    def leave(self) -> None:
        """Leave the file that was entered last."""
        self._open.pop()


#: Variable with the folder above which no file is read: that of `antiosc mcp`.
LIMIT = "ANTIOSC_FOLDER"


def _root(path: Path) -> Path:
    """Folder of all files that a deck may include: its own, or its parent if the user owns both."""
    folder = path.resolve().parent
    if LIMIT in os.environ and not folder.parent.is_relative_to(os.environ[LIMIT]):
        return folder
    try:
        own = all(item.stat().st_uid == os.getuid() for item in (path, folder, folder.parent))
    except OSError:
        own = False
    return folder.parent if own and len(folder.parent.parts) >= DEEP_ENOUGH else folder


Kind = Literal["read", "harmless", "ignored", "refused"]
#: Largest number of lines that are listed for a card.
MOST_LINES = 4


class Fate(NamedTuple):
    """Treatment of a card: its kind, and a text on a refused card, or a remark."""

    kind: Kind = "ignored"
    what: str = ""


def table(*, refused: Mapping[str, str], **names: Iterable[str]) -> dict[str, Fate]:
    """Name of a card -> fate; `refused`: text on refused cards ("what: remedy") -> their names."""
    fates: dict[str, Fate] = {}
    for kind, names_of_kind in names.items():  # read, harmless, ignored
        fates |= dict.fromkeys(names_of_kind, Fate(kind))  # type: ignore[arg-type]
    for refusal, card_names in refused.items():
        fates |= dict.fromkeys(card_names.split(), Fate("refused", refusal))
    return fates


#: Sentence on cards of contact between parts of what is read.
CONTACT_LEFT_OUT = (
    "contact between parts of {name} is not modelled ({cards}): parts that only touch do not press"
    " on each other, and hold together where they share nodes or joints, also a few, alone."
)


@dataclass
class Account:
    """The cards of a deck, each with its place and its fate."""

    name: str
    cards: list[tuple[str, DeckPlace, Fate]] = field(default_factory=list)
    #: options and fields of cards that are read: (what it is, place of the card, fate)
    options: list[tuple[str, DeckPlace, Fate]] = field(default_factory=list)

    def refuse(self, contact: Collection[str], deck: Deck) -> None:
        """MeshError for the first card or option refused; PiecesError for those of `contact`."""
        left: list[tuple[str, DeckPlace, Fate]] = []
        for name, place, fate in [*self.cards, *self.options]:
            between = name.replace(" ", "") in contact
            if deck.without_contact and (
                name == "*CONTACT PAIR" or (between and fate.kind == "refused")
            ):
                left.append((name, place, Fate("refused")))
                continue
            if fate.kind != "refused":
                continue

            what, _, remedy = fate.what.partition(": ")
            remedy = remedy or "remove it from the deck, or model the part without it"
            what = f" is {what}, which" if what else ""
            message = f"{place}: {name}{what} is not supported here and would change the result"
            if between:
                remedy = 'leave contact out (contact "apart"), or read one piece (piece 1)'
                raise PiecesError(f"{message}; {remedy}.")
            raise MeshError(f"{message}; {remedy}.")

        if cards := ", ".join(_counted(left, "refused")):
            deck.remarks.append(CONTACT_LEFT_OUT.format(name=self.name, cards=cards))

    def ignored(self) -> list[str]:
        """Count, name and lines of the cards and options that are ignored."""
        return _counted([*self.cards, *self.options], "ignored")


def _counted(entries: Iterable[tuple[str, DeckPlace, Fate]], kind: Kind) -> list[str]:
    """ "count name (lines)" of the cards of one fate."""
    places: dict[str, list[DeckPlace]] = {}
    for name, place, fate in sorted(entries, key=lambda entry: entry[0]):
        if fate.kind == kind:
            places.setdefault(f"{name} {fate.what}".strip(), []).append(place)
    return [f"{len(at)} {label} ({lines(at)})" for label, at in places.items()]


def lines(places: Iterable[DeckPlace]) -> str:
    """Text of lines and their file; a long list is shortened."""
    every = list(places)
    shown = every[:MOST_LINES]
    more = f" and {len(every) - MOST_LINES} more" * (len(every) > MOST_LINES)
    if len({place.file for place in every}) > 1:
        return ", ".join(map(str, shown)) + more
    numbers = ", ".join(str(place.line) for place in shown)
    return f"line{'s' * (len(every) > 1)} {numbers}{more} of {every[0].file}"
