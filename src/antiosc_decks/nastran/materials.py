"""Materials of Nastran decks, and what every reader of their properties needs of them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from antiosc.io.deck import Array
from antiosc_decks.model.builder import ModelBuilder
from antiosc_decks.model.properties import Material, isotropic
from antiosc_decks.nastran.cards import Entry
from antiosc_decks.nastran.mesh import NastranDeck, defined_once


def materials_of(found: NastranDeck) -> tuple[dict[int, Material], list[str]]:
    """(materials by number, what is ignored of them)."""
    materials: dict[int, Material] = {}
    ignored: list[str] = []
    entries = found.named("MAT1", "MAT2", "MAT8", "MAT9", "MAT11")
    for own, entry in defined_once(entries, "material").items():
        number = entry.whole(0)
        material = Material(f"{entry.name} {number}", entry.place)
        if entry.name == "MAT1":
            E, G, nu = _moduli(entry)
            material.constants = isotropic(E, nu)
            material.density = entry.real(4) or None
            if G is not None and not math.isclose(G, E / (2 * (1 + nu)), rel_tol=0.02):
                material.of_lines = E, G
                ignored.append(
                    f"G of MAT1 {number}, which does not follow from E and NU, of solids and shells"
                )
        elif entry.name == "MAT2":
            plane = _triangle([entry.real(k) for k in range(1, 7)])
            material.plane = plane
            material.density = entry.real(7) or None
        elif entry.name == "MAT9":
            # Nastran's order of the shear stresses is 12, 23, 31
            order = [0, 1, 2, 4, 5, 3]
            stiffness = _triangle([entry.real(k) for k in range(1, 22)])
            material.stiffness = stiffness[np.ix_(order, order)]
            material.density = entry.real(22) or None
        elif entry.name == "MAT11":
            material.constants = np.array([entry.real(k, None) for k in range(1, 10)])
            material.density = entry.real(10) or None
        else:
            E1, E2, n12, G12 = (entry.real(k, None) for k in (1, 2, 3, 4))
            G13, G23 = (entry.real(k) or G12 for k in (5, 6))
            if not (entry.real(5) and entry.real(6)):
                ignored.append(f"rigid transverse shear of MAT8 {number}, whose G12 is taken")
            constants = [E1, E2, np.nan, n12, np.nan, np.nan, G12, G13, G23]
            material.constants = np.array(constants)
            material.density = entry.real(7) or None
        materials[own] = material
    return materials, ignored


def _triangle(values: list[float]) -> Array:
    """A symmetric matrix of its upper triangle by rows."""
    n = int((2 * len(values)) ** 0.5)
    m = np.zeros((n, n))
    m[np.triu_indices(n)] = values
    return np.asarray(m + np.triu(m, 1).T)


def _moduli(entry: Entry) -> tuple[float, float | None, float]:
    """(E, G as given, nu); one of the three may be left out."""
    E, G, nu = (entry.real(k) if entry.text(k) else None for k in (1, 2, 3))
    if E is None and G is not None and nu is not None:
        E = 2 * G * (1 + nu)
    if nu is None and E and G:
        nu = E / (2 * G) - 1
    if not E:
        raise entry.place.error("MAT1 needs E, or G and NU, above 0.")
    return E, G, nu or 0.0


@dataclass
class PropertyReader:
    """A deck, the builder of its model and its materials by number."""

    found: NastranDeck
    builder: ModelBuilder
    materials: dict[int, Material]
    #: PARAM,WTMASS: factor of the deck's masses
    mass_factor: float
    #: what is ignored of the properties
    ignored: list[str] = field(default_factory=list)

    def material(self, entry: Entry, k: int) -> Material:
        """The material whose number is in field k (from 0)."""
        number = entry.number(k)
        if number not in self.materials:
            raise entry.place.error(
                f"there is no MAT1, MAT2, MAT8, MAT9 or MAT11 with the number {entry.whole(k)}."
            )
        return self.materials[number]

    def beside(self, extra: float, size: float) -> float:
        """Nonstructural mass per area or length, as density of the thickness or cross-section."""
        return extra * self.mass_factor / size * self.builder.units.density if size else 0.0

    def tell_beside(self, entry: Entry, extra: float) -> None:
        """Where the nonstructural mass lies is not known."""
        if extra:
            self.ignored.append(
                f"where the nonstructural mass of {entry.name} {entry.text(0)} lies, it is spread "
                "over the section"
            )
