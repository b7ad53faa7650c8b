"""`ModelBuilder` collects the model of a deck; nonstructural mass is density of sections."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import log10
from typing import NamedTuple

import numpy as np

from antiosc.base._types import BoolArray
from antiosc.base.errors import MeshError
from antiosc.base.materials import density_like
from antiosc.base.plausible import DENSITIES, GRAVITY, MASSLESS_WAVE, MODULI
from antiosc.io.deck import Array, Deck, DeckPlace, IntArray
from antiosc.io.neutral import DIMENSION as SHAPE_DIMENSION, Json, Term, UnitSystem
from antiosc_decks.constraints import SPRINGS, DeckConstraints, one_piece, separate_copies
from antiosc_decks.properties import (
    Material,
    common_direction,
    curved,
    everywhere,
    measures_of,
    top_of,
    unit,
)


def chosen_elements(deck: Deck, length: float) -> BoolArray:
    """Mask (n,) of the elements that the caller chose by parts and by piece.

    `length`: metres per unit of the deck.
    """
    selected = np.full(deck.n_elements, deck.wanted is None)
    for name in deck.wanted or ():
        members = deck.element_sets.get(name, np.zeros(0, dtype=np.int64))
        if not len(members):
            set_names = sorted(n for n, rows in deck.element_sets.items() if len(rows))
            known_text = ", ".join(map(repr, set_names[:20])) or "none"
            raise MeshError(
                f"{deck.name} has no elements of a part {name!r}; it has: {known_text}."
            )
        selected[members] = True
    selected &= ~left_out(deck, selected)
    if deck.piece is None:
        return selected
    return one_piece(deck, selected, length)


#: Area over size squared, or volume over size cubed, of an element that has none.
FLAT = 1e-9


def left_out(deck: Deck, selected: BoolArray) -> BoolArray:
    """Mask (n,) of the selected surfaces without area and solids without volume, which are told.

    Of a deck of such elements alone there are none: it is refused where they become cells.
    """
    size = np.ones(deck.n_elements)
    lines = np.zeros(deck.n_elements, dtype=bool)
    for block, rows in deck.numbered():
        if len(block):
            extent = np.ptp(deck.points[block.corners], axis=1).max(axis=1)
            size[rows] = extent ** SHAPE_DIMENSION[block.shape]
            lines[rows] = block.shape == "line"
    measures = measures_of(deck, np.arange(len(size)))
    flat = selected & ~lines & (measures <= FLAT * size)
    count = int(flat.sum())
    if count == selected.sum():
        return np.zeros_like(flat)
    if count:
        deck.remarks.append(
            f"{count} of {len(flat)} elements of {deck.name} have no area or volume: they are left"
            " out."
        )
    return flat


def _in_kilograms_force(name: str, modulus: float, rho: float) -> str:
    """Remark on a modulus [Pa] that suits its density [kg/m³] in kgf per area alone; else ""."""
    likely = [density_like(modulus), density_like(GRAVITY * modulus)]
    as_read, in_kgf = (abs(log10(rho / one)) for one in likely)
    if in_kgf > EQUAL_DENSITY or as_read <= EQUAL_DENSITY:
        return ""
    return (
        f"The modulus of elasticity of {name}, {modulus / 1e9:.3g} GPa, is that of no common"
        f" material of {rho:.4g} kg/m³; in kgf per area it would be"
        f" {GRAVITY * modulus / 1e9:.3g} GPa: if it is, the unit is 'mm-kgf' (unit)."
    )


MOTIONS = ("x", "y", "z", "rx", "ry", "rz")
#: Poisson's ratio of a material that has the modulus of the caller.
POISSON = 0.3
#: Decades between a density and that of a common material of the same modulus, up to which it is
#: one: titanium and magnesium lie 0.25 from the nearest, foams and woods further off.
SAME_DENSITY = 0.4
#: The same of a material that has this density, and another modulus.
EQUAL_DENSITY = 0.05
#: Direction cosines below this are rounding errors.
LEAST_TERM = 1e-12


class GroupSection(NamedTuple):
    """The section of a group of elements: the name of a class of antiosc and its arguments.

    "Truss" has a further argument "torsion" in m⁴, which springs use and a truss ignores. "Panel"
    (a shear panel) is no class of antiosc; its "sides" are Nastran's F1 and F2, which give the area
    of rods along its sides 12 and 34, and 23 and 41: up to 1.01 a share of thickness × width, above
    it a share of the thickness squared.
    """

    kind: str
    arguments: Json
    place: DeckPlace


class Unstated(NamedTuple):
    """What the materials get that a deck does not state."""

    #: kg/m³
    density: float | None = None
    #: Young's modulus, Pa
    modulus: float | None = None
    #: whether they may have no mass
    massless: bool = False


class ModelBuilder:
    """Collects a model in SI units; `antiosc_decks.finished.finished` returns it."""

    def __init__(
        self,
        deck: Deck,
        units: UnitSystem,
        unstated: Unstated,
        lumped: bool = False,
    ) -> None:
        #: (node of a repeated element, original node that it follows)
        self.copies = separate_copies(deck)
        nodes = len(deck.points)
        #: lumped: the deck gives masses at nodes, so that materials may have no density
        self.deck = deck
        self.units = units
        self.unstated = unstated
        self.lumped = lumped or unstated.massless
        #: sections; the group name of each; index of the section of each element (-1: none)
        self.families: list[GroupSection] = []
        self.names: list[str] = []
        self.of_element = np.full(deck.n_elements, -1, dtype=np.int64)
        #: (node, place, kg, [kg m²])
        self.masses: list[tuple[int, DeckPlace, float, list[float]]] = []
        #: whether all elements are rods, which then form a truss
        self.truss = False
        #: nodes that are not merged with coincident nodes
        self.apart: list[int] = []
        #: indices of the sections of parts in contact, of which a remark tells
        self.touching: set[int] = set()
        #: what is ignored, in the deck's terms
        self.ignored: list[str] = []
        #: motions that are fixed; before `hold`, along the local axes of nodes that have such axes
        self.fixed = np.zeros((nodes, 6), dtype=bool)
        #: nodes of chosen elements; of those with rotations; of elements not chosen alone
        self.used, self.has_rotations, self.gone = np.zeros((3, nodes), dtype=bool)
        self.joints = DeckConstraints(deck, self.used, self.has_rotations)
        self.chosen = chosen_elements(deck, units.length)

    def find_nodes(self) -> None:
        """Mark the nodes of chosen elements, and those that have rotations (shells, beams)."""
        blocks = [(block, block[self.chosen[rows]]) for block, rows in self.deck.numbered()]
        roles = {members.role for _, members in blocks if len(members)}
        self.truss = "rod" in roles and roles <= SPRINGS
        is_used = np.zeros(len(self.used), dtype=bool)
        for block, members in blocks:
            is_used[block.nodes] = True
            if block.role not in SPRINGS or (self.truss and block.role == "rod"):
                self.used[members.nodes] = True
            else:
                is_used[members.nodes] = False
            if block.role in ("shell", "beam"):
                self.has_rotations[members.nodes] = True
        self.gone = is_used & ~self.used

    def complete(self, material: Material) -> None:
        """Give a material without elasticity the modulus that the caller gave for such ones."""
        given = (material.constants, material.stiffness, material.plane)
        if self.unstated.modulus is not None and all(numbers is None for numbers in given):
            material.set_isotropic(self.unstated.modulus / self.units.stress, POISSON)

    def rho(self, material: Material) -> float:
        """Density of a material in kg/m³."""
        if material.density:
            return self._meant_density(material, material.density)
        if self.unstated.density is not None:
            return self.unstated.density
        material.needs(
            self.lumped,
            f"the material {material.name!r} has no density, without which "
            "nothing can be struck; add it to the deck, or give a density in "
            "kg/m³.",
        )
        self.tell_once(f"the mass of {material.name}, whose density is 0")
        return material.modulus * self.units.stress / MASSLESS_WAVE**2

    def _meant_density(self, material: Material, stated: float) -> float:
        """The density in the unit of the deck; if no solid has it, the one that is meant."""
        density = stated * self.units.density
        modulus = material.modulus * self.units.stress
        if density <= DENSITIES[1] or not MODULI[0] <= modulus <= MODULI[1]:
            return density
        likely = density_like(modulus)
        gravity = GRAVITY / self.units.length
        units = {
            "a weight per volume": self.units.density / gravity,
            "kg/m³": 1.0,
            "g/cm³": 1e3,
            "kg/mm³": 1e9,
        }
        off = {words: abs(log10(stated * unit / likely)) for words, unit in units.items()}
        words = min(off, key=lambda name: off[name])
        if off[words] > SAME_DENSITY:
            return density
        meant = stated * units[words]
        sentence = (
            f"the density {stated:g} of the material {material.name} is {density:.3g} kg/m³ in the"
            f" units of {self.deck.name}, more than any solid has: it is taken as {words},"
            f" {meant:.4g} kg/m³; masses at nodes are taken as they are."
        )
        for told in (sentence, _in_kilograms_force(material.name, modulus, meant)):
            if told and told not in self.deck.remarks:
                self.deck.remarks.append(told)
        return meant

    def isotropic(self, material: Material, what: str) -> Json:
        """E (Pa), nu and rho (kg/m³) of a material that must be isotropic."""
        E, nu = self.elastic(material, what)
        return {"E": E, "nu": nu, "rho": self.rho(material)}

    def elastic(self, material: Material, what: str) -> tuple[float, float]:
        """(E in Pa, nu) of a material that must be isotropic; beams use its E and G."""
        material.elasticity()
        E, nu = material.isotropic or (0.0, 0.0)
        material.needs(
            material.isotropic,
            f"the material {material.name!r} is not isotropic, but "
            f"{what} must be; only layers of shells may be orthotropic.",
        )
        if what in ("beams", "rods") and material.of_lines is not None:
            E, G = material.of_lines
            material.needs(
                G > 0,
                f"{material.name} needs G above 0 for {what}; it is {G:g}: leave "
                "it blank, and it follows from E and NU.",
            )
            nu = E / (2 * G) - 1
        return E * self.units.stress, nu

    def anisotropic(self, material: Material) -> list[list[float]] | None:
        """Stiffness matrix (6, 6) of a solid in Pa; None if it is isotropic."""
        C = material.stiffness
        if C is None:
            if material.constants is None or material.isotropic is not None:
                return None
            material.needs(
                np.isfinite(material.constants).all(),
                "the material "
                f"{material.name!r} is given for layers alone, in plane "
                "stress, and cannot fill solids; give all nine constants.",
            )
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

    def add(self, name: str, elements: IntArray, family: GroupSection) -> None:
        """Set the section of elements, in place of an earlier one."""
        self.of_element[elements] = len(self.families)
        self.families.append(family)
        self.names.append(name)

    def add_shells(
        self,
        name: str,
        elements: IntArray,
        family: GroupSection,
        offset: float,
        axes: Array | None = None,
    ) -> None:
        """Set the section of shells with an offset along their normals, in the deck's units.

        `axes` (elements, 3): directions of 0° for layers and for given stiffnesses.
        """
        deck = self.deck
        length = self.units.length
        arguments = dict(family.arguments)
        if axes is not None:
            axes = unit(axes)
            axis = common_direction(axes, least=1 - 1e-6)
            arguments["axis"] = (
                everywhere(deck, elements, axes, length) if axis is None else axis.tolist()
            )
            arguments["top"] = top_of(deck, elements, length)
        if offset:
            arguments["offset"] = offset * length
            if axes is None and isinstance(top := top_of(deck, elements, length), dict):
                arguments["top"] = top
            if curved(deck, elements):
                self.tell_once(
                    f"the area of the offset surface of curved shells ({family.place}), "
                    "that at the nodes is taken"
                )
        self.add(name, elements, family._replace(arguments=arguments))

    def grouped(
        self, elements: IntArray, values: Array
    ) -> Iterator[tuple[str, GroupSection, float, IntArray]]:
        """Yield (name, section, value, elements) of elements grouped by section and value."""
        numbers = self.of_element[elements]
        for number in np.unique(numbers[numbers >= 0]):
            in_section = numbers == number
            for value in np.unique(values[in_section]):
                members = elements[in_section & (values == value)]
                yield self.names[number], self.families[number], float(value), members

    def tell_once(self, ignored: str) -> None:
        """Report an ignored property once for all elements that it concerns."""
        if ignored not in self.ignored:
            self.ignored.append(ignored)

    def fix(self, nodes: IntArray, motions: Sequence[int]) -> None:
        """Fix motions (0 to 5) of nodes, unless the supports of the deck are left out."""
        if self.deck.free:
            return
        self.fixed[nodes[:, None], np.array(motions, dtype=np.int64)] = True

    def hold(self) -> None:
        """Turn motions fixed along local axes into supports along x, y, z, or into constraints.

        Nodes of repeated elements follow the original nodes.
        """
        for node, frame in self.joints.frames.items():
            self.fixed[node] = self.joints.fixed_along(node, self.fixed[node], frame)
        for copy, node in self.copies:
            self.apart.append(copy)
            for motion in range(6 if self.has_rotations[copy] else 3):
                self.joints.equations.append([(copy, motion, 1.0), (node, motion, -1.0)])

    def link(self, by: str, what: str, terms: list[Term], value: float, place: DeckPlace) -> None:
        """Add the spring (`what` "stiffness") or damper of a card, in the deck's units."""
        place.needs(value >= 0, f"{by} has a negative {what}, {value:g}.")
        (self.sprung if what == "stiffness" else self.damped)(terms, value)

    def mass(self, node: int, mass: float, inertia: list[float], place: DeckPlace) -> None:
        """Add a point mass and its moments of inertia (3), in the deck's units."""
        scaled = [value * self.units.mass * self.units.length**2 for value in inertia]
        self.masses.append((node, place, mass * self.units.mass, scaled))

    def body(self, node: int, matrix: Array, mass: float, place: DeckPlace) -> None:
        """Add a mass matrix (6, 6) for the motions of a node along x, y, z, in the deck's units."""
        size = np.array([1.0] * 3 + [self.units.length] * 3)
        M = matrix * np.outer(size, size) * self.units.mass
        motions = [self.joints.alias.get((node, c), (node, c)) for c in range(6)]
        point = motions[0][0]
        if point < len(self.used) and self.used[point] and not self.has_rotations[point]:
            if M[3:, 3:].any():
                self.ignored.append(f"inertia ({place}) on a node of solids, which does not rotate")
            M[3:] = M[:, 3:] = 0.0
        nonzero = np.flatnonzero(M.any(axis=1))
        if len(nonzero):
            rows: list[list[Term]] = [[(*motions[c], 1.0)] for c in nonzero]
            self.joints.masses.append((rows, M[np.ix_(nonzero, nonzero)], mass * self.units.mass))

    def scalar_mass(self, terms: list[Term], value: float, mass: float) -> None:
        """Add a scalar mass on a sum of motions, in the deck's units; the total grows by `mass`."""
        unit = self.units.mass
        alias = self.joints.alias
        aliased = [(*alias.get((n, m), (n, m)), c) for n, m, c in terms]
        if any(n >= len(self.used) or self.used[n] or not self.fixed[n, m] for n, m, _ in aliased):
            self.joints.masses.append(([aliased], np.array([[value * unit]]), mass * unit))

    def sprung(self, terms: Sequence[Term], stiffness: float) -> None:
        """Add a spring on a sum of terms, in the deck's units; terms of fixed motions are left
        out.
        """
        free_terms = self._moving(terms)
        if len(free_terms) == 1:
            ((node, motion, coefficient),) = free_terms
            free_terms = [(node, motion, 1.0)]
            stiffness = stiffness * coefficient**2
        if free_terms:
            self.joints.springs.append((free_terms, stiffness))

    def damped(self, terms: Sequence[Term], damping: float) -> None:
        """Add a damper on a sum of terms, in the deck's units; terms of fixed motions are left
        out.
        """
        free_terms = self._moving(terms)
        if free_terms and damping:
            self.joints.dampers.append((free_terms, damping))

    def _moving(self, terms: Sequence[Term]) -> list[Term]:
        """The terms of motions that are not fixed, without rounding errors."""
        alias = self.joints.alias
        free = [t for t in terms if t[0] >= len(self.fixed) or not self.fixed[t[:2]]]
        return [(*alias.get((n, m), (n, m)), c) for n, m, c in free if abs(c) > LEAST_TERM]


#: Section -> dimension of its elements: 1 (line), 2 (surface), 3 (volume).
DIMENSION = {"Beam": 1, "Truss": 1, "Shell": 2, "Laminate": 2, "GivenSheet": 2, "Panel": 2}
DIMENSION |= {"Solid": 3, "AnisotropicSolid": 3}
UNITS = {"MASSPERLENGTH": 1, "MASSPERAREA": 2, "MASSPERVOLUME": 3}


def add_mass(
    builder: ModelBuilder, elements: IntArray, value: float, dimension: int, place: DeckPlace
) -> None:
    """Add mass per length, area or volume (`dimension` 1, 2, 3; 0: the elements' own dimension)."""
    sizes, size, _ = _sections(builder, elements, place)
    measurable = dimension not in (1, 2) or (sizes == dimension).all()
    kind = "length" if dimension == 1 else "area"
    place.needs(measurable, f"a mass per {kind} on elements that have none.")
    _spread(builder, elements, np.where((sizes < 3) & (dimension < 3), value / size, value))


def add_total(
    builder: ModelBuilder, elements: IntArray, value: float, place: DeckPlace, by: str
) -> None:
    """Spread a total mass over elements by "measure" (length or area), "volume" or "mass"."""
    dimension, size, density = _sections(builder, elements, place)
    comparable = by != "measure" or len(set(dimension.tolist())) == 1
    place.needs(comparable, "one mass is spread over lines, areas or volumes alone.")
    measure = measures_of(builder.deck, elements)
    share = {"measure": 1 / size, "volume": np.ones(len(size)), "mass": density}[by]
    total = float((share * size * measure).sum())
    place.needs(total > 0, f"the elements of the nonstructural mass have no {by}.")
    _spread(builder, elements, value / total * share)


def _sections(builder: ModelBuilder, elements: IntArray, place: DeckPlace) -> Array:
    """Rows (3, n): dimension, thickness or area, and density of elements, in the deck's units."""
    place.needs(len(elements), "the nonstructural mass is on no element with a section.")
    return np.array([_section(builder, int(element), place) for element in elements], dtype=float).T


def _section(builder: ModelBuilder, element: int, place: DeckPlace) -> tuple[int, float, float]:
    """(dimension, thickness or area, density) of one element in the deck's units."""
    number = builder.of_element[element]
    place.needs(number >= 0, "the nonstructural mass is on an element without a section.")
    family = builder.families[number]
    units = builder.units
    a = family.arguments
    size = 1.0
    per_area = a.get("mass", 0.0)
    if family.kind in ("Beam", "Truss"):
        size = (a["section"]["A"] if "section" in a else a["area"]) / units.length**2
    elif "layers" in a:
        size = sum(layer["thickness"] for layer in a["layers"]) / units.length
        per_area = sum(layer["thickness"] * layer["rho"] for layer in a["layers"])
    elif "thickness" in a:
        size = a["thickness"] / units.length
    place.needs(
        size > 0,
        "the nonstructural mass is on an element without thickness or area; give its section one.",
    )
    density = a["rho"] if "rho" in a else per_area / (size * units.length)
    return DIMENSION[family.kind], size, density / units.density


def _spread(builder: ModelBuilder, elements: IntArray, density: Array) -> None:
    """Raise the density of elements by `density`, in the deck's units."""
    for name, family, value, members in builder.grouped(elements, density):
        added_density = value * builder.units.density
        builder.add(
            name, members, family._replace(arguments=_heavier(family.arguments, added_density))
        )


def _heavier(arguments: Json, density: float) -> Json:
    """Arguments of a section whose density is higher by `density` in kg/m³."""
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
