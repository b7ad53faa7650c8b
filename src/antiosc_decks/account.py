"""What becomes of each card of a deck: read, harmless, ignored, refused, or unknown.

The tables of the dialects (`abaqus_table`, `nastran_table`) say it card by card; a card that a
table does not have is unknown. No card is dropped without a word: what is ignored or unknown is
told with its count and its lines.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from antiosc.io.deck import Place

Kind = Literal["read", "harmless", "ignored", "refused", "unknown"]
#: Lines that are listed of each card.
MOST_LINES = 4


class Fate(NamedTuple):
    """What becomes of a card; `what`: of a refused one, what it is; of others, a remark."""

    kind: Kind
    what: str = ""


UNKNOWN = Fate("unknown")


def table(*, refused: Mapping[str, str], **names: Iterable[str]) -> dict[str, Fate]:
    """The fates of the cards of a dialect: read=, harmless=, ignored= the names of cards.

    `refused`: what they are, or "", -> names between spaces.
    """
    found: dict[str, Fate] = {}
    for kind in ("read", "harmless", "ignored"):
        found |= dict.fromkeys(names[kind], Fate(kind))  # type: ignore[arg-type]
    for what, some in refused.items():
        found |= dict.fromkeys(some.split(), Fate("refused", what))
    return found


@dataclass
class Account:
    """The cards of a deck, each with its place and its fate."""

    name: str
    cards: list[tuple[str, Place, Fate]] = field(default_factory=list)
    #: options and fields of cards that are read: what they are, the place of the card, their fate
    options: list[tuple[str, Place, Fate]] = field(default_factory=list)

    def refuse(self) -> None:
        """MeshError for the first card or option that is refused."""
        for name, place, fate in (*self.cards, *self.options):
            if fate.kind == "refused":
                what = f" is {fate.what}, which" if fate.what else ""
                raise place.error(
                    f"{name}{what} is not supported here and would change the result; "
                    "remove it from the deck, or model the part without it."
                )

    def ignored(self) -> list[str]:
        """Count, name and lines of what is ignored."""
        return _counted([*self.cards, *self.options], "ignored")

    def unknown_cards(self) -> list[str]:
        """A sentence on the cards that the table does not have, if there are such."""
        found = _counted(self.cards, "unknown")
        return found and [f"cards of {self.name} are unknown here and ignored: {', '.join(found)}."]

    def unknown_options(self) -> list[str]:
        """A sentence on the options and fields that are not read, if there are such."""
        found = _counted(self.options, "unknown")
        return found and [f"options of {self.name} are not read: {', '.join(found)}."]


def _counted(entries: Iterable[tuple[str, Place, Fate]], kind: Kind) -> list[str]:
    places: dict[str, list[Place]] = {}
    for name, place, fate in sorted(entries, key=lambda one: one[0]):
        if fate.kind == kind:
            places.setdefault(f"{name} {fate.what}".strip(), []).append(place)
    return [f"{len(some)} {label} ({lines(some)})" for label, some in places.items()]


def lines(places: Iterable[Place]) -> str:
    """Lines and their file as text, shortened where they are many."""
    some = list(places)
    shown, left = some[:MOST_LINES], len(some) - MOST_LINES
    more = f" and {left} more" if left > 0 else ""
    if len({place.file for place in some}) > 1:
        return ", ".join(map(str, shown)) + more
    numbers = ", ".join(str(place.line) for place in shown)
    return f"line{'s' * (len(some) > 1)} {numbers}{more} of {some[0].file}"
