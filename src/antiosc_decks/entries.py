"""Entries of a deck: their places in its files, and their numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from antiosc.base.errors import MeshError
from antiosc.io.conversion import IntArray

K = TypeVar("K")
V = TypeVar("V")

#: Largest number of a node or element; larger ones indicate a damaged file.
MAX_LABEL = 2**62
#: Largest quantity in a deck; its powers stay within double precision. Smaller ones than its
#: inverse are zero.
MAX_REAL = 1e60


@dataclass(frozen=True)
class DeckPlace:
    """File and line of an entry of a deck, for messages."""

    file: str
    line: int

    def __str__(self) -> str:
        return f"line {self.line} of {self.file}"

    def error(self, text: str) -> MeshError:
        """MeshError with this file and line, and the sentence `text`."""
        return MeshError(f"{self}: {text}")

    def require(self, condition: object, text: str) -> None:
        """MeshError with file, line and the sentence `text` unless `condition` holds."""
        if not condition:
            raise self.error(text)

    def look_up(self, known: Mapping[K, V], key: K, text: str) -> V:
        """`known[key]`; MeshError with this file, line and the sentence `text` if it is unknown."""
        self.require(key in known, text)
        return known[key]


class DeckItem:
    """A card, an entry or a line of a deck."""

    place: DeckPlace

    def needs(self, condition: object, text: str) -> None:
        """MeshError with file, line and the sentence `text` unless `condition` holds."""
        self.place.require(condition, text)


class Numbering:
    """Node or element numbers of a deck, and the row of each."""

    def __init__(self, labels: IntArray) -> None:
        self.order = np.argsort(labels, kind="stable")
        self.labels = labels[self.order]

    def rows(self, labels: IntArray) -> IntArray:
        """The row of each of `labels`, -1 for unknown ones."""
        if not len(self.labels):
            return np.full(np.shape(labels), -1, dtype=np.int64)
        place = np.minimum(np.searchsorted(self.labels, labels), len(self.labels) - 1)
        return np.where(self.labels[place] == labels, self.order[place], -1)

    def rows_between(self, first: int, last: int, step: int = 1) -> IntArray:
        """Rows of the existing numbers among first, first + step, … up to `last`."""
        low, high = np.searchsorted(self.labels, [first, last + 1])
        labels = self.labels[low:high]
        return self.order[low:high][(labels - first) % step == 0]


def whole_number(text: str, place: DeckPlace) -> int:
    """An integer of a deck; MeshError if the text is not an integer."""
    try:
        value = int(text)
    except ValueError:
        try:
            number = real_number(text, place)
        except MeshError:
            number = 0.5
        if not (abs(number) < 2**53 and number.is_integer()):
            raise place.error(f"{text.strip()[:40]!r} is not an integer.") from None
        value = int(number)
    if abs(value) > MAX_LABEL:
        raise place.error(f"the number {text.strip()[:40]} is too large.")
    return value


def real_number(text: str, place: DeckPlace) -> float:
    """A finite number of a deck, also 1.5D+7 and Nastran's 1.5+7; MeshError for other text."""
    word = text.strip().upper().replace("D", "E")
    try:
        value = float(word)
    except ValueError:
        sign = max(word.rfind("+"), word.rfind("-"))
        try:
            value = float(f"{word[:sign]}E{word[sign:]}") if sign > 0 else float("nan")
        except ValueError:
            value = float("nan")
    if not np.isfinite(value) or "_" in word:
        raise place.error(f"{text.strip()[:40]!r} is not a number.")
    if abs(value) > MAX_REAL:
        raise place.error(f"the number {text.strip()[:40]} is too large.")
    if abs(value) > 1 / MAX_REAL:
        return value
    return 0.0
