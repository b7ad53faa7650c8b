"""Cross-sections of beams in Abaqus and CalculiX decks."""

from __future__ import annotations

from antiosc.errors import MeshError
from antiosc_decks.abaqus.cards import Card
from antiosc_decks.model import profiles


def profile_of(card: Card) -> profiles.Profile:
    """The cross-section of *BEAM SECTION or *BEAM GENERAL SECTION, in the deck's units."""
    kind = card.option("SECTION", "RECT").upper()
    d = card.first_numbers()
    needed = {"RECT": 1, "CIRC": 1, "PIPE": 2, "BOX": 6, "GENERAL": 5}
    short = next((name for name in needed if kind.startswith(name)), "")
    if not short:
        raise MeshError(
            f"{card.place}: SECTION={kind} is not supported; it must be RECT, CIRC, PIPE, BOX or "
            "GENERAL."
        )
    if len(d) < needed[short] or min(d[: 2 if short == "GENERAL" else needed[short]]) <= 0:
        raise MeshError(
            f"{card.place}: SECTION={kind} needs {needed[short]} positive dimensions; got {d}."
        )
    if short == "RECT":
        return profiles.rectangle(d[0], d[1] if len(d) > 1 else d[0])
    if short == "CIRC":  # CalculiX gives two diameters, Abaqus one radius
        return profiles.ellipse(d[0], d[1]) if len(d) > 1 else profiles.ellipse(2 * d[0], 2 * d[0])
    if short == "PIPE":
        return profiles.tube(d[0], d[1])
    if short == "BOX":
        found = profiles.box(d[0], d[1], (d[2], d[3], d[4], d[5]))
        if found is None:
            raise MeshError(f"{card.place}: a BOX with unequal opposite walls is not supported.")
        return found
    area, about_1, mixed, about_2, torsion = d[:5]
    if mixed:
        raise MeshError(f"{card.place}: I12 must be 0: rotate the section to its principal axes.")
    return profiles.Profile(area, about_2, about_1, torsion, profiles.RECTANGLE)
