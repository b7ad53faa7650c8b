"""What is wrong in a scene file: sentences with the file and the line."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass, field

from antiosc import checks
from antiosc.errors import InputError
from antiosc.scene_file.locations import Place, line_of

#: Most sentences of one report, and number of mistakes after which no further ones are looked for.
MOST_SHOWN, MOST_FOUND = 100, 1000


class SceneFileError(InputError):
    """A scene file with mistakes: one sentence for each, with the file and the line."""


@dataclass
class Problems:
    """The mistakes found so far, and where they are."""

    name: str
    lines: dict[Place, int]
    found: list[tuple[int, str]] = field(default_factory=list)

    def add(self, place: Place, sentence: str) -> None:
        """Note a mistake at a place of the file; SceneFileError once there are MOST_FOUND."""
        entry = (line_of(self.lines, place), " ".join(sentence.split()))
        if entry not in self.found:
            self.found.append(entry)
        if len(self.found) >= MOST_FOUND:
            self.raise_if_any()

    def error(self, place: Place, sentence: str) -> SceneFileError:
        """An error of this one mistake, which was found while the scene runs."""
        return SceneFileError(f"{self.name}:{line_of(self.lines, place)}: {sentence}")

    def raise_if_any(self) -> None:
        """SceneFileError with all of them, in the order of the file."""
        if not self.found:
            return
        shown = [f"{self.name}:{line}: {text}" for line, text in sorted(self.found)[:MOST_SHOWN]]
        if len(self.found) > MOST_SHOWN:
            or_more = ", or still more" if len(self.found) >= MOST_FOUND else ""
            shown.append(f"{self.name}: and {len(self.found) - MOST_SHOWN} more{or_more}.")
        raise SceneFileError("\n".join(shown))


def label(place: Place) -> str:
    """A place as a user writes it: [material], [[supports]] 2, sites.eye.point."""
    text = ""
    for part in place:
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            text += f".{part}" if text else part
    return text or "the scene"


def nearest(name: str, known: Iterable[str], least: float = 0.5) -> str | None:
    """The known name that is written most like this one; `least` of its letters are alike."""
    lowered = {each.lower(): each for each in known}
    close = difflib.get_close_matches(name.lower(), lowered, 1, least)
    return lowered[close[0]] if close else None


def listed(names: Iterable[str]) -> str:
    """a, b and c; at most twenty of them."""
    shown = list(names)
    if len(shown) > 20:
        shown = [*shown[:20], "…"]
    return ", ".join(shown) if shown else "none"


def unknown(what: str, name: str, known: Iterable[str]) -> str:
    """A sentence on a name that does not exist."""
    names = list(known)
    close = nearest(name, names)
    hint = f"; did you mean {close!r}?" if close else "."
    tail = f" There is {listed(names)}." if names else " There is none."
    return f"{what} {checks.shown(name)} does not exist{hint}{tail}"
