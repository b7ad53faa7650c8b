"""Lines of a deck and of the files that it includes, and the treatment of each of its cards.

The tables of the dialects say whether a card is read, harmless or refused. All other cards are
ignored, and reported with their count and lines.
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
BULK_DATA_START = re.compile(
    r"(?im)^\s*(BEGIN\s+BULK|GRID[*, ]|CEND\b|PSHELL[*, ]|INCLUDE\s+['\"])"
)
#: Greatest depth of included files.
MAX_INCLUDE_DEPTH = 16
#: Files may be included from the folder above the deck's if its path has at least so many names,
#: which excludes folders of the system and home folders.
MIN_ROOT_DEPTH = 4
#: Largest size of all files of a deck together, bytes.
MAX_DECK_BYTES = 4 * 2**30


class Sources:
    """The files of a deck; included files must be below the folder `root`.

    `on_size` is called with the size of all files read so far, in bytes.
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
        self.root = _include_root(path) if root is None else Path(root)
        self.size = 0
        self._on_size = on_size
        self._open: list[Path] = []

    def lines(self, path: Path, name: str) -> list[str]:
        """Lines of one file, without line ends."""
        self.size += path.stat().st_size
        if self.size > MAX_DECK_BYTES:
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

    def main_lines(self) -> list[str]:
        """Lines of the deck itself."""
        self._open = [self.path.resolve()]
        return self.lines(self.path, self.name)

    def enter_file(self, file_name: str, at: DeckPlace) -> list[str]:
        """Lines of an included file, which stays open until `leave_file`."""
        file_name = file_name.strip().strip("'\"").strip()
        at.require(file_name, "an include without the name of a file.")
        try:
            path = self._included_path(file_name)
            below_root = path.is_relative_to(self.root)
            exists = below_root and os.path.isfile(path)
        except (OSError, ValueError):
            below_root, exists = True, False
        folder = "/".join(self.root.parts[-2:])
        told = f"{file_name[:80]!r} lies outside the folder {folder!r}, from which {self.name} may"
        at.require(below_root, f"{told} include files; name the folder that holds them all (root).")
        at.require(exists, f"there is no file {file_name[:80]!r}: put it beside {self.name}.")
        at.require(path not in self._open, f"{file_name[:80]!r} includes itself.")
        shallow = len(self._open) < MAX_INCLUDE_DEPTH
        at.require(shallow, f"files include one another more than {MAX_INCLUDE_DEPTH} deep.")
        self._open.append(path)
        return self.lines(path, path.name)

    def _included_path(self, file_name: str) -> Path:
        """Path of a file beside the deck, else beside the file that includes it."""
        name = file_name.replace("\\", "/")
        folders = [self.folder, *(opened.parent for opened in self._open[-1:])]
        paths = [(folder / name).resolve() for folder in folders]
        # unlike Path.is_file, no error for names that are too long
        return next(filter(os.path.isfile, paths), paths[0])

    def exists(self, file_name: str) -> bool:
        """Whether an included file exists; True for an empty name."""
        name = file_name.strip().strip("'\"")
        return not name or os.path.isfile(self._included_path(name))

    def leave_file(self) -> None:
        """Leave the file that was entered last."""
        self._open.pop()


#: Variable with the folder above which no file is read: that of `antiosc mcp`.
FOLDER_VARIABLE = "ANTIOSC_FOLDER"


def _include_root(path: Path) -> Path:
    """Folder of the files that a deck may include: its own, or the parent if the user owns both."""
    folder = path.resolve().parent
    top = os.environ.get(FOLDER_VARIABLE)
    if top is not None and not folder.parent.is_relative_to(top):
        return folder
    try:
        own = all(item.stat().st_uid == os.getuid() for item in (path, folder, folder.parent))
    except OSError:
        own = False
    return folder.parent if own and len(folder.parent.parts) >= MIN_ROOT_DEPTH else folder


FateKind = Literal["read", "harmless", "ignored", "refused"]
#: Largest number of lines that are listed for a card.
MAX_LISTED_LINES = 4


class Fate(NamedTuple):
    """Treatment of a card: its kind, and a remark or the text for a refused card."""

    kind: FateKind = "ignored"
    text: str = ""


def fate_table(*, refused: Mapping[str, str], **names: Iterable[str]) -> dict[str, Fate]:
    """Fates by name of the card; `refused`: names of cards by their text ("what: remedy")."""
    fates: dict[str, Fate] = {}
    for kind, names_of_kind in names.items():  # read, harmless, ignored
        fates |= dict.fromkeys(names_of_kind, Fate(kind))  # type: ignore[arg-type]
    for refusal, card_names in refused.items():
        fates |= dict.fromkeys(card_names.split(), Fate("refused", refusal))
    return fates


#: Sentence on cards of contact between parts of what is read.
UNMODELLED_CONTACT_TEXT = (
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
        """MeshError for the first refused card or option; PiecesError if it is in `contact`."""
        left: list[tuple[str, DeckPlace, Fate]] = []
        for name, place, fate in [*self.cards, *self.options]:
            between = name.replace(" ", "") in contact
            refused = between and fate.kind == "refused"
            if deck.without_contact and (name == "*CONTACT PAIR" or refused):
                left.append((name, place, Fate("refused")))
                continue
            if fate.kind != "refused":
                continue

            what, _, remedy = fate.text.partition(": ")
            remedy = remedy or "remove it from the deck, or model the part without it"
            what = f" is {what}, which" if what else ""
            message = f"{place}: {name}{what} is not supported here and would change the result"
            if between:
                remedy = 'leave contact out (contact "apart"), or read one piece (piece 1)'
                raise PiecesError(f"{message}; {remedy}.")
            raise MeshError(f"{message}; {remedy}.")

        if cards := ", ".join(_counted_entries(left, "refused")):
            deck.remarks.append(UNMODELLED_CONTACT_TEXT.format(name=self.name, cards=cards))

    def ignored(self) -> list[str]:
        """Count, name and lines of the cards and options that are ignored."""
        return _counted_entries([*self.cards, *self.options], "ignored")


def _counted_entries(entries: Iterable[tuple[str, DeckPlace, Fate]], kind: FateKind) -> list[str]:
    """ "count name (lines)" of the cards of one fate."""
    places: dict[str, list[DeckPlace]] = {}
    for name, place, fate in sorted(entries, key=lambda entry: entry[0]):
        if fate.kind == kind:
            places.setdefault(f"{name} {fate.text}".strip(), []).append(place)
    return [f"{len(at)} {label} ({lines_text(at)})" for label, at in places.items()]


def lines_text(places: Iterable[DeckPlace]) -> str:
    """Text of lines and their file; a long list is shortened."""
    every = list(places)
    shown = every[:MAX_LISTED_LINES]
    more = f" and {len(every) - MAX_LISTED_LINES} more" * (len(every) > MAX_LISTED_LINES)
    if len({place.file for place in every}) > 1:
        return ", ".join(map(str, shown)) + more
    numbers = ", ".join(str(place.line) for place in shown)
    return f"line{'s' * (len(every) > 1)} {numbers}{more} of {every[0].file}"
