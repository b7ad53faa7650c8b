"""Materials of Abaqus and CalculiX decks."""

from __future__ import annotations

import numpy as np

from antiosc.errors import MeshError
from antiosc.fem.readers.deck import Array
from antiosc_decks.abaqus.cards import Card
from antiosc_decks.model.material import Material, isotropic, of_stiffness

#: Kinds of *ELASTIC without their last letters, and how many constants each has.
ELASTIC_CONSTANTS = {"ISO": 2, "ENGINEERINGCONSTANTS": 9, "LAMINA": 6, "ORTHO": 9}


def materials_of(cards: list[Card]) -> tuple[dict[str, Material], list[str]]:
    """(materials by name in upper case, what is ignored of them)."""
    found: dict[str, Material] = {}
    ignored: list[str] = []
    current: Material | None = None
    for card in cards:
        if card.keyword == "MATERIAL":
            name = card.needed("NAME")
            if name.upper() in found:
                raise MeshError(
                    f"{card.place}: the material {name!r} is defined more than once, first in "
                    f"{found[name.upper()].place}."
                )
            current = found[name.upper()] = Material(name, card.place)
        elif current is None:
            continue
        elif card.keyword == "ELASTIC":
            if _kind(card).startswith("ANISO"):
                current.stiffness = _anisotropic(card)
            else:
                current.constants = _elastic(card)
            current.place = card.place
            if _kind(card) == "ISO" and len(card.lines) > 1:
                ignored.append(f"*ELASTIC of other temperatures ({card.place})")
        elif card.keyword == "DENSITY":
            values = card.first_numbers()
            current.density = values[0] if values else None
    return found, ignored


def _kind(card: Card) -> str:
    kind = "".join(card.option("TYPE", "ISO").split()).upper()
    return "ISO" if kind.startswith("ISO") else "ORTHO" if kind.startswith("ORTHO") else kind


def _anisotropic(card: Card) -> Array:
    """21 constants: the upper triangle, column by column, in the order 11, 22, 33, 12, 13, 23."""
    values = card.numbers()
    if len(values) < 21:
        raise MeshError(f"{card.place}: *ELASTIC needs 21 constants; it has {len(values)}.")
    C = np.zeros((6, 6))
    places = [(row, column) for column in range(6) for row in range(column + 1)]
    for (row, column), value in zip(places, values, strict=False):
        C[row, column] = C[column, row] = value
    order = [0, 1, 2, 5, 4, 3]
    return C[np.ix_(order, order)]


def _elastic(card: Card) -> Array:
    kind = _kind(card)
    if kind not in ELASTIC_CONSTANTS:
        raise MeshError(
            f"{card.place}: *ELASTIC, TYPE={card.option('TYPE')} is not supported; write it as "
            "isotropic, ENGINEERING CONSTANTS, LAMINA, ORTHO or ANISOTROPIC."
        )
    values = card.numbers() if kind != "ISO" else card.first_numbers()
    count = ELASTIC_CONSTANTS[kind]
    if len(values) < count:
        raise MeshError(f"{card.place}: *ELASTIC needs {count} constants; it has {len(values)}.")
    v = np.array(values[:count])
    if kind == "ISO":
        return isotropic(v[0], v[1])
    if kind == "LAMINA":  # E1, E2, nu12, G12, G13, G23
        return np.array([v[0], v[1], np.nan, v[2], np.nan, np.nan, *v[3:]])
    if kind == "ENGINEERINGCONSTANTS":
        return v
    D = np.zeros((6, 6))
    D[0, 0], D[0, 1], D[1, 1], D[0, 2], D[1, 2], D[2, 2] = v[:6]
    D += np.triu(D, 1).T
    D[range(3, 6), range(3, 6)] = v[6:]
    try:
        return of_stiffness(D)
    except np.linalg.LinAlgError:
        raise MeshError(f"{card.place}: the stiffness of *ELASTIC is singular.") from None
