"""What is wrong in a scene file: sentences with the file and the line."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass, field

from antiosc.app.scene_file.locations import Place, lines_of
from antiosc.base import checks
from antiosc.base.errors import InputError

#: Most sentences of one report, and number of mistakes after which no further ones are looked for.
MOST_SHOWN, MOST_FOUND = 100, 1000


class SceneFileError(InputError):
    """A scene file with mistakes: one sentence for each, with the file and the line."""


@dataclass
class Problems:
    """The mistakes found so far in a file of this name and text, and where they are."""

    name: str
    text: str
    found: dict[tuple[Place, str], None] = field(default_factory=dict)

    def add(self, place: Place, sentence: str) -> None:
        """Note a mistake at a place of the file; SceneFileError once there are MOST_FOUND."""
        self.found[place, " ".join(sentence.split())] = None
        if len(self.found) >= MOST_FOUND:
            self.raise_if_any()

    def error(self, place: Place, sentence: str) -> SceneFileError:
        """An error of this one mistake, which was found while the scene runs."""
        return SceneFileError(f"{self.name}:{lines_of(self.text, [place])[0]}: {sentence}")

    def raise_if_any(self) -> None:
        """SceneFileError with all of them, in the order of the file."""
        if not self.found:
            return
        lines = lines_of(self.text, [place for place, _ in self.found])
        told = sorted({(n, told) for n, (_, told) in zip(lines, self.found, strict=True)})
        shown = [f"{self.name}:{line}: {text}" for line, text in told[:MOST_SHOWN]]
        if len(told) > MOST_SHOWN:
            or_more = ", or still more" if len(self.found) >= MOST_FOUND else ""
            shown.append(f"{self.name}: and {len(told) - MOST_SHOWN} more{or_more}.")
        raise SceneFileError("\n".join(shown))


def label(place: Place) -> str:
    """A place as a user writes it: material, supports[2], sites.eye.point."""
    parts = (f"[{part}]" if isinstance(part, int) else f".{part}" for part in place)
    return "".join(parts).removeprefix(".") or "the scene"


#: Words that a file may have in place of a class.
SYNONYMS = {
    **dict.fromkeys(("ball", "bead", "bullet", "projectile"), "Sphere"),
    **dict.fromkeys(("mass", "hammer", "striker", "block", "rigid"), "RigidMass"),
    **dict.fromkeys(("wall", "floor", "stop", "ground"), "Obstacle"),
    **dict.fromkeys(("plate", "sheet", "membrane"), "Shell"),
    **dict.fromkeys(("composite", "layers", "sandwich", "stack"), "Laminate"),
    **dict.fromkeys(("volume", "steel", "isotropic", "elastic"), "Solid"),
    **dict.fromkeys(("orthotropic", "wood", "crystal"), "AnisotropicSolid"),
    **dict.fromkeys(("rod", "bar", "cable"), "Truss"),
    **dict.fromkeys(("spring", "penalty", "stiffness"), "Linear"),
    **dict.fromkeys(("table", "measured", "curve"), "Tabulated"),
    **dict.fromkeys(("glue", "bond", "bonded", "tied"), "Tie"),
    **dict.fromkeys(("screw", "rivet"), "Bolt"),
}


def nearest(name: str, known: Iterable[str], least: float = 0.5) -> str | None:
    """The known name that is meant: a synonym, or the one written most like this one.

    `least` of its letters are alike.
    """
    lowered = {each.lower(): each for each in known}
    meant = SYNONYMS.get(name.lower(), "").lower()
    if meant in lowered:
        return lowered[meant]
    close = difflib.get_close_matches(name.lower(), lowered, 1, least)
    return lowered[close[0]] if close else None


def listed(names: Iterable[str]) -> str:
    """a, b and c; at most twenty of them."""
    shown = list(names)
    return ", ".join([*shown[:20], *(["…"] if len(shown) > 20 else [])]) or "none"


def unknown(what: str, name: str, known: Iterable[str]) -> str:
    """A sentence on a name that does not exist."""
    names = list(known)
    close = nearest(name, names)
    hint = f"; did you mean {close!r}?" if close else "."
    return f"{what} {checks.shown(name)} does not exist{hint} There is {listed(names)}."
