"""`ModelBuilder` collects the model of a deck; nonstructural mass becomes density of sections."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from antiosc.base._types import BoolArray
from antiosc.base.errors import MeshError
from antiosc.base.plausible import DENSITY_RANGE, MASSLESS_WAVE
from antiosc.io.conversion import Array, Deck, IntArray
from antiosc.io.neutral import Json, MotionTerm, UnitSystem
from antiosc_decks.constraints import DeckConstraints, piece_mask, separate_copies
from antiosc_decks.entries import DeckPlace
from antiosc_decks.properties import (
    Material,
    common_direction,
    directions_at_centres,
    is_curved,
    top_directions,
    unit_rows,
)


def chosen_elements(deck: Deck, length: float) -> BoolArray:
    """Mask (n,) of the elements chosen by parts and by piece; `length`: metres per unit."""
    selected = np.full(deck.n_elements, deck.wanted_parts is None)
    for name in deck.wanted_parts or ():
        members = deck.element_sets.get(name, np.zeros(0, dtype=np.int64))
        if not len(members):
            known = sorted(n for n, rows in deck.element_sets.items() if len(rows))
            names = ", ".join(map(repr, known[:20])) or "none"
            raise MeshError(f"{deck.name} has no elements of a part {name!r}; it has: {names}.")
        selected[members] = True
    return selected if deck.piece is None else piece_mask(deck, selected, length)


MOTION_NAMES = ("x", "y", "z", "rx", "ry", "rz")
#: Poisson's ratio of a material that has the modulus of the caller.
DEFAULT_POISSON = 0.3
#: Direction cosines below this are rounding errors.
COSINE_ROUNDING = 1e-12


class GroupSection(NamedTuple):
    """The section of a group of elements: the name of a class of antiosc, its arguments."""

    kind: str
    arguments: Json
    place: DeckPlace


def cards_text(cards: Sequence[str]) -> str:
    """Text that names one card or counts several: "PSHELL 7", "11 PSHELL", "3 cards"."""
    kinds = {card.partition(" ")[0] for card in cards}
    what = kinds.pop() if len(kinds) == 1 else "cards"
    return cards[0] if len(cards) == 1 else f"{len(cards)} {what}"


class MaterialDefaults(NamedTuple):
    """Values for materials whose density or modulus the deck does not state."""

    #: kg/m³
    density: float | None = None
    #: Young's modulus, Pa
    modulus: float | None = None
    #: whether they may have no mass
    massless: bool = False


class ModelBuilder:
    """Collects a model in SI units; `antiosc_decks.finished.complete_model` returns it."""

    def __init__(
        self, deck: Deck, units: UnitSystem, defaults: MaterialDefaults, lumped: bool = False
    ) -> None:
        #: (node of a repeated element, original node that it follows)
        self.copies = separate_copies(deck)
        nodes = len(deck.points)
        #: lumped: the deck gives masses at nodes, so that materials may have no density
        self.deck = deck
        self.units = units
        self.defaults = defaults
        self.lumped = lumped or defaults.massless
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
        #: what is ignored, in the deck's terms
        self.ignored: list[str] = []
        #: what is told once -> of which cards or materials
        self._told: dict[str, dict[str, None]] = {}
        #: motions that are fixed; before `hold`, along the local axes of nodes that have such axes
        self.fixed = np.zeros((nodes, 6), dtype=bool)
        #: nodes of chosen elements; of those with rotations; of elements not chosen alone
        self.used, self.has_rotations, self.gone = np.zeros((3, nodes), dtype=bool)
        self.joints = DeckConstraints(deck, self.used, self.has_rotations)
        self.chosen = chosen_elements(deck, units.length)

    def mark_nodes(self) -> None:
        """Mark the nodes of chosen elements, and those that have rotations (shells, beams)."""
        blocks = [block[self.chosen[rows]] for block, rows in self.deck.numbered()]
        self.truss = {block.role for block in blocks if len(block)} == {"rod"}
        for block in blocks:
            self.used[block.nodes] |= block.role != "rod" or self.truss
            self.has_rotations[block.nodes] |= block.role in ("shell", "beam")
        for whole, block in zip(self.deck.blocks, blocks, strict=True):
            self.gone[whole.nodes] = True
            if block.role == "rod" and not self.truss:
                self.gone[block.nodes] = False
        self.gone &= ~self.used

    def complete_elasticity(self, material: Material) -> None:
        """Give a material without elasticity the modulus that the caller gave for this case."""
        given = (material.constants, material.stiffness, material.plane_stiffness)
        if self.defaults.modulus is not None and all(numbers is None for numbers in given):
            material.set_isotropic(self.defaults.modulus / self.units.stress, DEFAULT_POISSON)

    def rho(self, material: Material) -> float:
        """Density of a material in kg/m³."""
        label = f"the material {material.name!r}"
        if material.density:
            density = material.density * self.units.density
            material.needs(
                density <= DENSITY_RANGE[1] or self.defaults.massless,
                f"the density {material.density:g} of {label} is {density:.3g} kg/m³, "
                f"more than any solid has: give the unit of the deck (unit), "
                f"or mend it (a mass per volume).",
            )
            return density

        if self.defaults.density is not None:
            return self.defaults.density
        remedy = "add it to the deck, or give a density in kg/m³."
        material.needs(self.lumped, f"{label} has no density: {remedy}")
        self.report_once("the mass of {}, whose density is 0", material.name)
        return material.modulus * self.units.stress / MASSLESS_WAVE**2

    def isotropic(self, material: Material, what: str) -> Json:
        """E (Pa), nu and rho (kg/m³) of a material that must be isotropic."""
        E, nu = self.elastic_constants(material, what)
        return {"E": E, "nu": nu, "rho": self.rho(material)}

    def elastic_constants(self, material: Material, what: str) -> tuple[float, float]:
        """(E in Pa, nu) of a material that must be isotropic; beams use its E and G."""
        material.elasticity()
        E, nu = material.isotropic or (0.0, 0.0)
        fault = f"the material {material.name!r} is not isotropic, but {what} must be."
        material.needs(material.isotropic, fault)
        if what in ("beams", "rods") and material.line_moduli is not None:
            E, G = material.line_moduli
            material.needs(G > 0, f"{material.name} needs G above 0 for {what}, or a blank one.")
            nu = E / (2 * G) - 1
        return E * self.units.stress, nu

    def anisotropic_stiffness(self, material: Material) -> list[list[float]] | None:
        """Stiffness matrix (6, 6) of a solid in Pa; None if it is isotropic."""
        C = material.stiffness
        if C is None:
            if material.constants is None or material.isotropic is not None:
                return None
            complete = np.isfinite(material.constants).all()
            fault = f"{material.name!r} is for layers: solids need all nine constants."
            material.needs(complete, fault)
            E1, E2, E3, n12, n13, n23, G12, G13, G23 = material.constants
            S = np.diag([1 / E1, 1 / E2, 1 / E3, 1 / G23, 1 / G13, 1 / G12])
            S[[0, 0, 1], [1, 2, 2]] = S[[1, 2, 2], [0, 0, 1]] = -n12 / E1, -n13 / E1, -n23 / E2
            C = np.linalg.inv(S)
        return ((C + C.T) / 2 * self.units.stress).tolist()  # type: ignore[no-any-return]

    def layer_arguments(self, material: Material, thickness: float, angle: float) -> Json:
        """Arguments of a `Layer`; the thickness is in the deck's units."""
        E1, E2, _, nu12, _, _, *G = material.elasticity().tolist()
        moduli = zip(("E1", "E2", "G12", "G13", "G23"), (E1, E2, *G), strict=True)
        arguments = {name: value * self.units.stress for name, value in moduli}
        arguments |= {"nu12": nu12, "rho": self.rho(material), "angle": angle}
        return arguments | {"thickness": thickness * self.units.length}

    def add_section(self, name: str, elements: IntArray, section: GroupSection) -> None:
        """Set the section of elements, the group `name`; it replaces an earlier section."""
        self.of_element[elements] = len(self.families)
        self.families.append(section)
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
        top = top_directions(deck, elements, length) if offset or axes is not None else []
        if axes is not None:
            axes = unit_rows(axes)
            axis = common_direction(axes, least_cosine=1 - 1e-6)
            one = None if axis is None else axis.tolist()
            arguments["axis"] = one or directions_at_centres(deck, elements, axes, length)
        if axes is not None or (offset and isinstance(top, dict)):
            arguments["top"] = top
        if offset:
            arguments["offset"] = offset * length
            if is_curved(deck, elements):
                told = "the area of the offset surface of curved shells "
                self.report_once(f"{told}({family.place}), that at the nodes is taken")
        self.add_section(name, elements, family._replace(arguments=arguments))

    def report_once(self, property_text: str, of: str = "") -> None:
        """Report an ignored property once; "{}" is replaced by the cards `of` of all calls."""
        self._told.setdefault(property_text, {})[of] = None

    def ignored_texts(self) -> list[str]:
        """Texts on all ignored content."""
        once = [text.replace("{}", cards_text([*of])) for text, of in self._told.items()]
        return [*self.ignored, *once]

    def fix(self, nodes: IntArray, motions: Sequence[int]) -> None:
        """Fix motions (0 to 5) of nodes, unless the supports of the deck are left out."""
        if self.deck.without_supports:
            return
        self.fixed[nodes[:, None], np.array(motions, dtype=np.int64)] = True

    def apply_local_supports(self) -> None:
        """Turn motions fixed along local axes into supports or constraints; tie copies.

        Axes near x, y, z are replaced by these. The nodes of repeated elements follow the original
        nodes.
        """
        for node, frame in self.joints.motion_axes.items():
            self.fixed[node] = self.joints.fix_along(node, self.fixed[node], frame)
        for copy, node in self.copies:
            self.apart.append(copy)
            for motion in range(6 if self.has_rotations[copy] else 3):
                self.joints.equations.append([(copy, motion, 1.0), (node, motion, -1.0)])

    def add_link(
        self, by: str, quantity: str, terms: list[MotionTerm], value: float, place: DeckPlace
    ) -> None:
        """Add the spring (`quantity` "stiffness") or damper of the card `by`, in the deck's units.

        Terms of fixed motions and rounding errors of directions are left out.
        """
        place.require(value >= 0, f"{by} has a negative {quantity}, {value:g}.")
        moving = [t for t in terms if t[0] >= len(self.fixed) or not self.fixed[t[:2]]]
        moving = [(*self.joints.actual(n, m), c) for n, m, c in moving if abs(c) > COSINE_ROUNDING]
        if len(moving) == 1:
            ((node, motion, coefficient),) = moving
            moving = [(node, motion, 1.0)]
            value = value * coefficient**2
        if moving and quantity == "stiffness":
            self.joints.springs.append((moving, value))
        elif moving and value:
            self.joints.dampers.append((moving, value))

    def add_mass(self, node: int, mass: float, inertia: list[float], place: DeckPlace) -> None:
        """Add a point mass and its moments of inertia (3), in the deck's units."""
        scaled = [value * self.units.mass * self.units.length**2 for value in inertia]
        self.masses.append((node, place, mass * self.units.mass, scaled))

    def add_mass_matrix(self, node: int, matrix: Array, mass: float, place: DeckPlace) -> None:
        """Add a mass matrix (6, 6) for the motions of a node along x, y, z, in the deck's units."""
        size = np.array([1.0] * 3 + [self.units.length] * 3)
        M = matrix * np.outer(size, size) * self.units.mass
        motions = [self.joints.actual(node, c) for c in range(6)]
        point = motions[0][0]
        if point < len(self.used) and self.used[point] and not self.has_rotations[point]:
            if M[3:, 3:].any():
                self.ignored.append(f"inertia ({place}) on a node of solids, which does not rotate")
            M[3:] = M[:, 3:] = 0.0
        nonzero = np.flatnonzero(M.any(axis=1))
        if len(nonzero):
            rows: list[list[MotionTerm]] = [[(*motions[c], 1.0)] for c in nonzero]
            self.joints.masses.append((rows, M[np.ix_(nonzero, nonzero)], mass * self.units.mass))

    def add_scalar_mass(self, terms: list[MotionTerm], value: float, mass: float) -> None:
        """Add a scalar mass on a sum of motions, in the deck's units; the total grows by `mass`."""
        unit = self.units.mass
        aliased = [(*self.joints.actual(n, m), c) for n, m, c in terms]
        if any(n >= len(self.used) or self.used[n] or not self.fixed[n, m] for n, m, _ in aliased):
            self.joints.masses.append(([aliased], np.array([[value * unit]]), mass * unit))
