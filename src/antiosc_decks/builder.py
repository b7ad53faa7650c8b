"""`ModelBuilder` collects the model of a deck; nonstructural mass is density of sections."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from antiosc.base._types import BoolArray
from antiosc.base.errors import MeshError
from antiosc.base.plausible import MASSLESS_WAVE
from antiosc.io.deck import Array, Deck, IntArray, Place
from antiosc.io.neutral import Json, Term, UnitSystem
from antiosc_decks.constraints import SPRINGS, Constraints, one_piece, separate_copies
from antiosc_decks.properties import (
    Material,
    common_direction,
    curved,
    everywhere,
    measures_of,
    top_of,
    unit,
)


def chosen_elements(deck: Deck) -> BoolArray:
    """The elements of the parts that the caller chooses."""
    chosen = np.full(deck.n_elements, deck.wanted is None)
    for name in deck.wanted or ():
        members = deck.element_sets.get(name, np.zeros(0, dtype=np.int64))
        if not len(members):
            known = sorted(n for n, some in deck.element_sets.items() if len(some))
            shown = ", ".join(map(repr, known[:20])) or "none"
            raise MeshError(f"{deck.name} has no elements of a part {name!r}; it has: {shown}.")
        chosen[members] = True
    return chosen if deck.piece is None else one_piece(deck, chosen)


MOTIONS = ("x", "y", "z", "rx", "ry", "rz")
#: Direction cosines below this are rounding.
LEAST_TERM = 1e-12


class Family(NamedTuple):
    """The section of a group of elements, as a class of antiosc and its arguments.

    "Truss" has a "torsion" beside, m⁴, which a truss does without. "Panel", of a shear panel, is no
    class; its "sides" are F1, F2 of Nastran: what of it is in rods along its sides 12 and 34, 23
    and 41, as shares of its thickness and width (from 1.01: of the square of its thickness).
    """

    kind: str
    arguments: Json
    place: Place


class ModelBuilder:
    """Collects a model in SI units; `antiosc_decks.finished.finished` returns it."""

    def __init__(
        self, deck: Deck, units: UnitSystem, density: float | None = None, lumped: bool = False
    ) -> None:
        #: own nodes of elements that repeat others, and those that they follow
        self.copies = separate_copies(deck)
        nodes = len(deck.points)
        #: density in kg/m³, of materials without one; lumped: whether the deck gives masses at
        #: nodes, so that materials may have none
        self.deck, self.units, self.density, self.lumped = deck, units, density, lumped
        #: sections, the name of the group of each, and which each element has, -1 without one
        self.families: list[Family] = []
        self.names: list[str] = []
        self.of_element = np.full(deck.n_elements, -1, dtype=np.int64)
        #: (node, place, kg, [kg m²])
        self.masses: list[tuple[int, Place, float, list[float]]] = []
        #: whether the deck has no other elements: the rods are a truss
        self.truss = False
        #: nodes that stay apart from others in their place
        self.apart: list[int] = []
        #: what is ignored, in the deck's terms
        self.ignored: list[str] = []
        #: until `hold` along directions of their own of the nodes that have such
        self.fixed = np.zeros((nodes, 6), dtype=bool)
        #: nodes of chosen elements, of those with rotations, and of elements not chosen alone
        self.used, self.has_rotations, self.gone = np.zeros((3, nodes), dtype=bool)
        self.joints = Constraints(deck, self.used, self.has_rotations)
        self.chosen = chosen_elements(deck)

    def find_nodes(self) -> None:
        """Which nodes the chosen elements use; those of shells and beams have rotations."""
        chosen = [(block, block[self.chosen[rows]]) for block, rows in self.deck.numbered()]
        present = {some.role for _, some in chosen if len(some)}
        self.truss = "rod" in present and present <= SPRINGS
        used = np.zeros(len(self.used), dtype=bool)
        for block, some in chosen:
            used[block.nodes] = True
            if block.role not in SPRINGS or (self.truss and block.role == "rod"):
                self.used[some.nodes] = True
            else:
                used[some.nodes] = False
            if block.role in ("shell", "beam"):
                self.has_rotations[some.nodes] = True
        self.gone = used & ~self.used

    def rho(self, material: Material) -> float:
        """Density in kg/m³."""
        if material.density:
            return material.density * self.units.density
        if self.density is not None:
            return self.density
        material.needs(self.lumped, f"the material {material.name!r} has no density, without which "
                       "nothing can be struck; add it to the deck, or give density= in "
                       "kg/m³.")  # fmt: skip
        self.tell_once(f"the mass of {material.name}, whose density is 0")
        return material.modulus * self.units.stress / MASSLESS_WAVE**2

    def isotropic(self, material: Material, what: str) -> Json:
        """E, nu and rho of a material that must be isotropic."""
        E, nu = self.elastic(material, what)
        return {"E": E, "nu": nu, "rho": self.rho(material)}

    def elastic(self, material: Material, what: str) -> tuple[float, float]:
        """(E in Pa, nu) of a material that must be isotropic; for beams and rods by E and G."""
        material.elasticity()
        E, nu = material.isotropic or (0.0, 0.0)
        material.needs(material.isotropic, f"the material {material.name!r} is not isotropic, but "
                       f"{what} must be; only layers of shells may be orthotropic.")  # fmt: skip
        if what in ("beams", "rods") and material.of_lines is not None:
            E, G = material.of_lines
            material.needs(G > 0, f"{material.name} needs G above 0 for {what}; it is {G:g}: leave "
                           "it blank, and it follows from E and NU.")  # fmt: skip
            nu = E / (2 * G) - 1
        return E * self.units.stress, nu

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
        moduli_in_si = {name: value * self.units.stress for name, value in moduli}
        thick = thickness * self.units.length
        return moduli_in_si | {
            "nu12": nu12,
            "rho": self.rho(material),
            "thickness": thick,
            "angle": angle,
        }

    def add(self, name: str, elements: IntArray, family: Family) -> None:
        """Set the section of elements, in place of an earlier one."""
        self.of_element[elements] = len(self.families)
        self.families.append(family)
        self.names.append(name)

    def add_shells(
        self,
        name: str,
        elements: IntArray,
        family: Family,
        offset: float,
        axes: Array | None = None,
    ) -> None:
        """Set the section of shells with an offset along their normals, in the deck's units.

        `axes` (elements, 3): the directions of 0°, of layers and of given stiffnesses.
        """
        deck, length, arguments = self.deck, self.units.length, dict(family.arguments)
        if axes is not None:
            axes = unit(axes)
            axis = common_direction(axes, least=1 - 1e-6)
            arguments["axis"] = (everywhere(deck, elements, axes, length) if axis is None else
                           axis.tolist())  # fmt: skip
            arguments["top"] = top_of(deck, elements, length)
        if offset:
            arguments["offset"] = offset * length
            if axes is None and isinstance(top := top_of(deck, elements, length), dict):
                arguments["top"] = top
            if curved(deck, elements):
                self.tell_once(f"the area of the offset surface of curved shells ({family.place}), "
                               "that at the nodes is taken")  # fmt: skip
        self.add(name, elements, family._replace(arguments=arguments))

    def alike(
        self, elements: IntArray, values: Array
    ) -> Iterator[tuple[str, Family, float, IntArray]]:
        """(name of a section, the section, a value, elements) of elements with one of each."""
        numbers = self.of_element[elements]
        for number in np.unique(numbers[numbers >= 0]):
            mine = numbers == number
            for value in np.unique(values[mine]):
                some = elements[mine & (values == value)]
                yield self.names[number], self.families[number], float(value), some

    def tell_once(self, ignored: str) -> None:
        """Note what is ignored, once however many elements it concerns."""
        if ignored not in self.ignored:
            self.ignored.append(ignored)

    def fix(self, nodes: IntArray, motions: Sequence[int]) -> None:
        """Fix motions (0 to 5) of nodes, unless the supports of the deck are left out."""
        if self.deck.free:
            return
        self.fixed[nodes[:, None], np.array(motions, dtype=np.int64)] = True

    def hold(self) -> None:
        """Fix motions along directions of their own by supports along the axes, or constraints.

        Nodes of copies follow those of what they repeat.
        """
        for node, frame in self.joints.frames.items():
            self.fixed[node] = self.joints.fixed_along(node, self.fixed[node], frame)
        for copy, node in self.copies:
            self.apart.append(copy)
            for motion in range(6 if self.has_rotations[copy] else 3):
                self.joints.equations.append([(copy, motion, 1.0), (node, motion, -1.0)])

    def link(self, by: str, what: str, terms: list[Term], value: float, place: Place) -> None:
        """The spring ("stiffness") or damper of a card, in the deck's units."""
        place.needs(value >= 0, f"{by} has a negative {what}, {value:g}.")
        (self.sprung if what == "stiffness" else self.damped)(terms, value)

    def mass(self, node: int, mass: float, inertia: list[float], place: Place) -> None:
        """A point mass in the deck's units."""
        scaled = [value * self.units.mass * self.units.length**2 for value in inertia]
        self.masses.append((node, place, mass * self.units.mass, scaled))

    def body(self, node: int, matrix: Array, mass: float, place: Place) -> None:
        """A mass matrix (6, 6) of the motions of a node along the axes, in the deck's units."""
        size = np.array([1.0] * 3 + [self.units.length] * 3)
        M = matrix * np.outer(size, size) * self.units.mass
        motions = [self.joints.alias.get((node, c), (node, c)) for c in range(6)]
        point = motions[0][0]
        if point < len(self.used) and self.used[point] and not self.has_rotations[point]:
            if M[3:, 3:].any():
                self.ignored.append(f"inertia ({place}) on a node of solids, which does not rotate")
            M[3:] = M[:, 3:] = 0.0
        kept = np.flatnonzero(M.any(axis=1))
        if len(kept):
            rows: list[list[Term]] = [[(*motions[c], 1.0)] for c in kept]
            self.joints.masses.append((rows, M[np.ix_(kept, kept)], mass * self.units.mass))

    def scalar_mass(self, terms: list[Term], value: float, mass: float) -> None:
        """A mass on a sum of motions, of which `mass` counts, in the deck's units."""
        unit = self.units.mass
        alias = self.joints.alias
        aliased = [(*alias.get((n, m), (n, m)), c) for n, m, c in terms]
        if any(n >= len(self.used) or self.used[n] or not self.fixed[n, m] for n, m, _ in aliased):
            self.joints.masses.append(([aliased], np.array([[value * unit]]), mass * unit))

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

    def _moving(self, terms: Sequence[Term]) -> list[Term]:
        alias = self.joints.alias
        free = [t for t in terms if t[0] >= len(self.fixed) or not self.fixed[t[:2]]]
        return [(*alias.get((n, m), (n, m)), c) for n, m, c in free if abs(c) > LEAST_TERM]


#: Section -> the dimension of what it spreads its mass over: a length, an area, a volume.
DIMENSION = {"Beam": 1, "Truss": 1, "Shell": 2, "Laminate": 2, "GivenSheet": 2, "Panel": 2}
DIMENSION |= {"Solid": 3, "AnisotropicSolid": 3}
UNITS = {"MASSPERLENGTH": 1, "MASSPERAREA": 2, "MASSPERVOLUME": 3}


def add_mass(
    builder: ModelBuilder, elements: IntArray, value: float, dimension: int, place: Place
) -> None:
    """A mass per length, area or volume (1, 2, 3) of elements; 0: of what each has."""
    sizes, across, _ = _sections(builder, elements, place)
    alike = dimension not in (1, 2) or (sizes == dimension).all()
    place.needs(alike, f"a mass per {'length' if dimension == 1 else 'area'} on elements that have "
                "none.")  # fmt: skip
    _spread(builder, elements, np.where((sizes < 3) & (dimension < 3), value / across, value))


def add_total(
    builder: ModelBuilder, elements: IntArray, value: float, place: Place, by: str
) -> None:
    """A mass spread over elements by their "measure" (length or area), "volume" or "mass"."""
    dimension, across, density = _sections(builder, elements, place)
    alike = by != "measure" or len(set(dimension.tolist())) == 1
    place.needs(alike, "one mass is spread over lines, areas or volumes alone.")
    measure = measures_of(builder.deck, elements)
    share = {"measure": 1 / across, "volume": np.ones(len(across)), "mass": density}[by]
    total = float((share * across * measure).sum())
    place.needs(total > 0, f"the elements of the nonstructural mass have no {by}.")
    _spread(builder, elements, value / total * share)


def _sections(builder: ModelBuilder, elements: IntArray, place: Place) -> Array:
    """Rows: dimension, thickness or area across it, density of elements, in the deck's units."""
    place.needs(len(elements), "the nonstructural mass is on no element with a section.")
    return np.array([_section(builder, int(element), place) for element in elements], dtype=float).T


def _section(builder: ModelBuilder, element: int, place: Place) -> tuple[int, float, float]:
    number = builder.of_element[element]
    place.needs(number >= 0, "the nonstructural mass is on an element without a section.")
    family = builder.families[number]
    units, a = builder.units, family.arguments
    across, per_area = 1.0, a.get("mass", 0.0)
    if family.kind in ("Beam", "Truss"):
        across = (a["section"]["A"] if "section" in a else a["area"]) / units.length**2
    elif "layers" in a:
        across = sum(layer["thickness"] for layer in a["layers"]) / units.length
        per_area = sum(layer["thickness"] * layer["rho"] for layer in a["layers"])
    elif "thickness" in a:
        across = a["thickness"] / units.length
    place.needs(across > 0, "the nonstructural mass is on an element without thickness "
                "or area; give its section one.")  # fmt: skip
    density = a["rho"] if "rho" in a else per_area / (across * units.length)
    return DIMENSION[family.kind], across, density / units.density


def _spread(builder: ModelBuilder, elements: IntArray, density: Array) -> None:
    for name, family, value, some in builder.alike(elements, density):
        more = value * builder.units.density
        builder.add(name, some, family._replace(arguments=_heavier(family.arguments, more)))


def _heavier(arguments: Json, density: float) -> Json:
    """Arguments of a section with more density, kg/m³."""
    heavier = dict(arguments)
    if "layers" in heavier:
        heavier["layers"] = [
            {**layer, "rho": layer["rho"] + density} for layer in heavier["layers"]
        ]
    elif "rho" in heavier:
        heavier["rho"] += density
    else:  # stiffnesses and masses of a sheet
        share = heavier["inertia"] / heavier["mass"]
        heavier["mass"] += density * heavier["thickness"]
        heavier["inertia"] = share * heavier["mass"]
    return heavier
