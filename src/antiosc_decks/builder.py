"""`ModelBuilder`: collects materials, sections, supports, masses, springs and dampers of a deck.

Nonstructural mass (*NONSTRUCTURAL MASS of Abaqus; NSM, NSM1, NSML and NSML1 of Nastran) is spread
over elements, as density of their sections.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from antiosc.base._types import BoolArray
from antiosc.base.errors import MeshError
from antiosc.base.plausible import MASSLESS_WAVE
from antiosc.io.deck import Array, Deck, IntArray, Place
from antiosc.io.neutral import Json, Term, UnitSystem
from antiosc_decks.constraints import SPRINGS, Constraints, one_piece
from antiosc_decks.properties import Material, measures_of


def chosen_elements(deck: Deck) -> BoolArray:
    """The elements of the parts that the caller chooses."""
    chosen = np.full(deck.n_elements, deck.wanted is None)
    for name in deck.wanted or ():
        own = deck.element_sets.get(name, np.zeros(0, dtype=np.int64))
        if not len(own):
            known = sorted(n for n, some in deck.element_sets.items() if len(some))
            shown = ", ".join(map(repr, known[:20])) or "none"
            raise MeshError(f"{deck.name} has no elements of a part {name!r}; it has: {shown}.")
        chosen[own] = True
    return chosen if deck.piece is None else one_piece(deck, chosen)


MOTIONS = ("x", "y", "z", "rx", "ry", "rz")
#: Direction cosines below this are rounding.
LEAST_TERM = 1e-12
#: Of a class of antiosc, as JSON holds them.
Arguments = Json


@dataclass
class Family:
    """The section of a group of elements, as a class of antiosc and its arguments."""

    kind: str
    arguments: Arguments
    place: Place


@dataclass(frozen=True)
class Rod:
    """The section of a rod or of a shear panel, in the deck's units."""

    E: float
    nu: float
    #: area, of a panel thickness
    across: float
    #: mass per length, of a panel per area
    mass: float
    place: Place
    torsion: float = 0.0
    #: F1, F2 of a panel: what of it is in rods along its sides 12 and 34, 23 and 41, as shares of
    #: its thickness and width (from 1.01: of the square of its thickness)
    effective: tuple[float, float] | None = None


@dataclass
class ModelBuilder:
    """Collects a model in SI units; `antiosc_decks.finished.finished` returns it."""

    deck: Deck
    units: UnitSystem
    #: kg/m³, of materials without one
    density: float | None = None
    families: list[Family] = field(default_factory=list)
    #: number of the family of each element, -1 without one
    of_element: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    #: name of each family's group of elements
    names: list[str] = field(default_factory=list)
    #: number of an element -> its section, of rods and shear panels
    rods: dict[int, Rod] = field(default_factory=dict)
    #: (node, place, kg, [kg m²])
    masses: list[tuple[int, Place, float, list[float]]] = field(default_factory=list)
    #: whether the deck has no other elements: the rods are a truss
    truss: bool = False
    #: whether the deck gives masses at nodes, so that materials may have none
    lumped: bool = False
    #: nodes that stay apart from others in their place
    apart: list[int] = field(default_factory=list)
    #: what is ignored, in the deck's terms
    ignored: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.of_element = np.full(self.deck.n_elements, -1, dtype=np.int64)
        self.fixed = np.zeros((len(self.deck.points), 6), dtype=bool)
        self.used = np.zeros(len(self.deck.points), dtype=bool)
        self.has_rotations = np.zeros(len(self.deck.points), dtype=bool)
        self.joints = Constraints(self.deck, self.used, self.has_rotations)
        self.chosen = chosen_elements(self.deck)
        self.gone = np.zeros(len(self.deck.points), dtype=bool)

    def find_nodes(self) -> None:
        """Which nodes the chosen elements use; those of shells and beams have rotations."""
        chosen = [(block, block[self.chosen[own]]) for block, own in self.deck.numbered()]
        present = {some.role for _, some in chosen if len(some)}
        self.truss = "rod" in present and present <= SPRINGS
        every = np.zeros(len(self.used), dtype=bool)
        for block, some in chosen:
            every[block.nodes] = True
            if block.role not in SPRINGS or (self.truss and block.role == "rod"):
                self.used[some.nodes] = True
            else:
                every[some.nodes] = False
            if block.role in ("shell", "beam"):
                self.has_rotations[some.nodes] = True
        #: nodes of elements that are not chosen alone
        self.gone = every & ~self.used

    def rho(self, material: Material) -> float:
        """Density in kg/m³."""
        if material.density:
            return material.density * self.units.density
        if self.density is not None:
            return self.density
        if self.lumped:
            self.tell_once(f"the mass of {material.name}, whose density is 0")
            return material.modulus * self.units.stress / MASSLESS_WAVE**2
        raise material.place.error(
            f"the material {material.name!r} has no density, without which "
            "nothing can be struck; add it to the deck, or give density= in kg/m³."
        )

    def elastic(self, material: Material, what: str) -> tuple[float, float]:
        """(E in Pa, nu) of a material that must be isotropic; for beams and rods by E and G."""
        material.elasticity()
        found = material.isotropic
        if found is None:
            raise material.place.error(
                f"the material {material.name!r} is not isotropic, but {what} "
                "must be; only layers of shells may be orthotropic."
            )
        if what in ("beams", "rods") and material.of_lines is not None:
            E, G = material.of_lines
            return E * self.units.stress, E / (2 * G) - 1
        return found[0] * self.units.stress, found[1]

    def anisotropic(self, material: Material) -> list[list[float]] | None:
        """The stiffness of a solid with directions, Pa; None of an isotropic one."""
        C = material.stiffness
        if C is None:
            if material.constants is None or material.isotropic is not None:
                return None
            material.needs(np.isfinite(material.constants).all(), "the material "
                           f"{material.name!r} is given for layers alone, in plane "
                           "stress, and cannot fill solids; give all nine constants.")  # fmt: skip
            E1, E2, E3, n12, n13, n23, G12, G13, G23 = material.constants
            S = np.diag([1 / E1, 1 / E2, 1 / E3, 1 / G23, 1 / G13, 1 / G12])
            S[[0, 0, 1], [1, 2, 2]] = S[[1, 2, 2], [0, 0, 1]] = -n12 / E1, -n13 / E1, -n23 / E2
            C = np.linalg.inv(S)
        return ((C + C.T) / 2 * self.units.stress).tolist()  # type: ignore[no-any-return]

    def layer(self, material: Material, thickness: float, angle: float) -> dict[str, float]:
        """Arguments of a `Layer`; the thickness is in the deck's units."""
        E1, E2, _, nu12, _, _, *G = material.elasticity().tolist()
        moduli = zip(("E1", "E2", "G12", "G13", "G23"), (E1, E2, *G), strict=True)
        found = {name: value * self.units.stress for name, value in moduli}
        thick = thickness * self.units.length
        return found | {"nu12": nu12, "rho": self.rho(material), "thickness": thick, "angle": angle}

    def add(self, name: str, elements: IntArray, family: Family) -> None:
        """Set the section of elements; a later one replaces an earlier one."""
        self.of_element[elements] = len(self.families)
        self.families.append(family)
        self.names.append(name)

    def tell_once(self, ignored: str) -> None:
        """Note what is ignored, once however many elements it concerns."""
        if ignored not in self.ignored:
            self.ignored.append(ignored)

    def fix(self, nodes: IntArray, motions: Sequence[int]) -> None:
        """Fix motions (0 to 5) of nodes."""
        self.fixed[nodes[:, None], np.array(motions, dtype=np.int64)] = True

    def mass(self, node: int, mass: float, inertia: list[float], place: Place) -> None:
        """A point mass in the deck's units."""
        scaled = [value * self.units.mass * self.units.length**2 for value in inertia]
        self.masses.append((node, place, mass * self.units.mass, scaled))

    def body(self, node: int, matrix: Array, mass: float, place: Place) -> None:
        """A mass matrix (6, 6) of the motions of a node along the axes, in the deck's units.

        A node of solids has no rotations: its rotary inertia stays at rest.
        """
        size = np.array([1.0] * 3 + [self.units.length] * 3)
        M = matrix * np.outer(size, size) * self.units.mass
        own = [self.joints.alias.get((node, c), (node, c)) for c in range(6)]
        point = own[0][0]
        if point < len(self.used) and self.used[point] and not self.has_rotations[point]:
            if M[3:, 3:].any():
                self.ignored.append(f"inertia ({place}) on a node of solids, which does not rotate")
            M[3:] = M[:, 3:] = 0.0
        kept = np.flatnonzero(M.any(axis=1))
        if len(kept):
            rows: list[list[Term]] = [[(*own[c], 1.0)] for c in kept]
            self.joints.masses.append((rows, M[np.ix_(kept, kept)], mass * self.units.mass))

    def scalar_mass(self, terms: list[Term], value: float, mass: float) -> None:
        """A mass on a sum of motions, of which `mass` counts, in the deck's units."""
        unit = self.units.mass
        alias = self.joints.alias
        own = [(*alias.get((n, m), (n, m)), c) for n, m, c in terms]
        if any(n >= len(self.used) or self.used[n] or not self.fixed[n, m] for n, m, _ in own):
            self.joints.masses.append(([own], np.array([[value * unit]]), mass * unit))

    def sprung(self, terms: Sequence[Term], stiffness: float) -> None:
        """A spring against the sum of terms, in the deck's units; fixed motions drop out."""
        moving = self._moving(terms)
        if len(moving) == 1:
            ((node, motion, coefficient),) = moving
            moving, stiffness = [(node, motion, 1.0)], stiffness * coefficient**2
        if moving:
            self.joints.springs.append((moving, stiffness))

    def damped(self, terms: Sequence[Term], damping: float) -> None:
        """A damper against the sum of terms, in the deck's units; fixed motions drop out."""
        moving = self._moving(terms)
        if moving and damping:
            self.joints.dampers.append((moving, damping))

    def join_copies(self, copies: list[tuple[int, int]]) -> None:
        """Let nodes of copies follow those of what they repeat: (own node, node)."""
        for own, node in copies:
            self.apart.append(own)
            for motion in range(6 if self.has_rotations[own] else 3):
                self.joints.equations.append([(own, motion, 1.0), (node, motion, -1.0)])

    def _moving(self, terms: Sequence[Term]) -> list[Term]:
        points = len(self.fixed)
        return [
            t for t in terms if abs(t[2]) > LEAST_TERM and not (t[0] < points and self.fixed[t[:2]])
        ]


#: Section -> the dimension of what it spreads its mass over: a length, an area, a volume.
DIMENSION = {"Beam": 1, "Shell": 2, "Laminate": 2, "GivenSheet": 2}
DIMENSION |= {"Solid": 3, "AnisotropicSolid": 3}
UNITS = {"MASSPERLENGTH": 1, "MASSPERAREA": 2, "MASSPERVOLUME": 3}


def add_mass(
    builder: ModelBuilder, elements: IntArray, value: float, dimension: int, place: Place
) -> None:
    """A mass per length, area or volume (1, 2, 3) of elements; 0: of what each has."""
    own, across, _ = _sections(builder, elements, place)
    if dimension in (1, 2) and (own != dimension).any():
        what = "length" if dimension == 1 else "area"
        raise place.error(f"a mass per {what} on elements that have none.")
    _spread(builder, elements, np.where((own < 3) & (dimension < 3), value / across, value))


def add_total(
    builder: ModelBuilder, elements: IntArray, value: float, place: Place, by: str
) -> None:
    """A mass spread over elements by their "measure" (length or area), "volume" or "mass"."""
    dimension, across, density = _sections(builder, elements, place)
    if by == "measure" and len(set(dimension.tolist())) > 1:
        raise place.error("one mass is spread over lines, areas or volumes alone.")
    measure = measures_of(builder.deck, elements)
    share = {"measure": 1 / across, "volume": np.ones(len(across)), "mass": density}[by]
    total = float((share * across * measure).sum())
    place.needs(total > 0, f"the elements of the nonstructural mass have no {by}.")
    _spread(builder, elements, value / total * share)


def _sections(
    builder: ModelBuilder, elements: IntArray, place: Place
) -> tuple[IntArray, Array, Array]:
    """(dimension, thickness or area across it, density) of elements, in the deck's units."""
    place.needs(len(elements), "the nonstructural mass is on no element with a section.")
    found = [_section(builder, int(element), place) for element in elements]
    dimension, across, density = (np.array(column) for column in zip(*found, strict=True))
    return dimension, across, density


def _section(builder: ModelBuilder, element: int, place: Place) -> tuple[int, float, float]:
    if element in builder.rods:
        rod = builder.rods[element]
        return 1 if rod.effective is None else 2, rod.across, rod.mass / rod.across
    number = builder.of_element[element]
    place.needs(number >= 0, "the nonstructural mass is on an element without a section.")
    family = builder.families[number]
    units, a = builder.units, family.arguments
    across = 1.0
    density = a.get("rho", 0.0)
    if family.kind == "Beam":
        across = a["section"]["A"] / units.length**2
    elif family.kind == "Laminate":
        thick = [layer["thickness"] for layer in a["layers"]]
        across = sum(thick) / units.length
        density = sum(t * layer["rho"] for t, layer in zip(thick, a["layers"], strict=True))
        density /= sum(thick)
    elif "thickness" in a:
        across = a["thickness"] / units.length
        density = a.get("rho", a.get("mass", 0.0) / a["thickness"])
    return DIMENSION[family.kind], across, density / units.density


def _spread(builder: ModelBuilder, elements: IntArray, density: Array) -> None:
    rods = np.array([int(element) in builder.rods for element in elements])
    for element, more in zip(elements[rods].tolist(), density[rods].tolist(), strict=True):
        rod = builder.rods[element]
        builder.rods[element] = replace(rod, mass=rod.mass + more * rod.across)
    numbers = builder.of_element[elements]
    for number in np.unique(numbers[~rods]):
        family, name = builder.families[number], builder.names[number]
        mine = (numbers == number) & ~rods
        for value in np.unique(density[mine]):
            more = float(value) * builder.units.density
            own = Family(family.kind, _heavier(family.arguments, more), family.place)
            builder.add(name, elements[mine & (density == value)], own)


def _heavier(arguments: Arguments, density: float) -> Arguments:
    """Arguments of a section with more density, kg/m³."""
    own = dict(arguments)
    if "layers" in own:
        own["layers"] = [{**layer, "rho": layer["rho"] + density} for layer in own["layers"]]
    elif "rho" in own:
        own["rho"] += density
    else:  # stiffnesses and masses of a sheet
        share = own["inertia"] / own["mass"]
        own["mass"] += density * own["thickness"]
        own["inertia"] = share * own["mass"]
    return own
