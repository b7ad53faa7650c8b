"""Materials, their directions, and sections of Abaqus and CalculiX decks."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from typing import NoReturn

import numpy as np

from antiosc.io.conversion import Array, IntArray
from antiosc.io.neutral import Json
from antiosc_decks import properties as geometry
from antiosc_decks.abaqus_assembly import AbaqusDeck
from antiosc_decks.abaqus_cards import Card, Row
from antiosc_decks.builder import GroupSection, ModelBuilder
from antiosc_decks.entries import DeckPlace, real_number
from antiosc_decks.properties import Material, Profile, constants_of_stiffness, symmetric

#: Kinds of *ELASTIC by their first letters -> how many constants each has.
ELASTIC_CONSTANTS = {"ISO": 2, "ENGINEERINGCONSTANTS": 9, "LAMINA": 6, "ORTHO": 9, "ANISO": 21}
#: Reorders Abaqus's 11, 22, 33, 12, 13, 23 to 11, 22, 33, 23, 13, 12.
VOIGT_ORDER = [0, 1, 2, 5, 4, 3]


def materials_of(cards: list[Card], builder: ModelBuilder) -> dict[str, Material]:
    """The materials by name in upper case."""
    materials: dict[str, Material] = {}
    current: Material | None = None
    for card in cards:
        if card.keyword == "MATERIAL":
            name = card.required_option("NAME")
            if earlier := materials.get(name.upper()):
                message = f"the material {name!r} is defined more than once, first in"
                raise card.place.error(f"{message} {earlier.place}.")
            current = materials[name.upper()] = Material(name, card.place)
        elif current is not None and card.keyword == "ELASTIC":
            kind = _set_elasticity(current, card)
            if kind == "ISO" and len(card.lines) > 1:
                builder.report_once(f"*ELASTIC of other temperatures ({card.place})")
        elif current is not None and card.keyword == "DENSITY":
            current.density = card.first().real(0)
    for material in materials.values():
        builder.complete_elasticity(material)
    return materials


def _set_elasticity(material: Material, card: Card) -> str:
    """Set the constants of a material from *ELASTIC; return their kind."""
    word = "".join(card.option("TYPE", "ISO").split()).upper()
    kind = next((name for name in ELASTIC_CONSTANTS if word.startswith(name)), "")
    known = "isotropic, ENGINEERING CONSTANTS, LAMINA, ORTHO or ANISOTROPIC"
    card.needs(kind, f"*ELASTIC, TYPE={card.option('TYPE')} is not supported; give {known}.")
    values = card.first().reals() if kind == "ISO" else card.numbers()
    count = ELASTIC_CONSTANTS[kind]
    card.needs(len(values) >= count, f"*ELASTIC needs {count} constants; it has {len(values)}.")
    v = np.array(values[:count])
    material.place = card.place

    if kind == "ISO" and not v[0]:
        material.constants = None  # thermal analyses state a modulus of 0
    elif kind == "ISO":
        material.set_isotropic(v[0], v[1])
    elif kind == "LAMINA":  # E1, E2, nu12, G12, G13, G23
        material.constants = np.array([v[0], v[1], np.nan, v[2], np.nan, np.nan, *v[3:]])
    elif kind == "ENGINEERINGCONSTANTS":
        material.constants = v
    elif kind == "ANISO":  # the upper triangle by columns: the lower one by rows
        material.stiffness = symmetric(v)[np.ix_(VOIGT_ORDER, VOIGT_ORDER)]
    else:
        D = np.diag([0.0, 0.0, 0.0, *v[6:]])
        D[:3, :3] = symmetric(v[:6])
        try:
            material.constants = constants_of_stiffness(D)
        except np.linalg.LinAlgError:
            raise card.place.error("the stiffness of *ELASTIC is singular: mend it.") from None

    return kind


class Orientations:
    """The *ORIENTATION cards of a deck; cards of a part rotate with each of its instances."""

    def __init__(self, cards: Iterable[Card]) -> None:
        self._cards = {
            (card.scope.prefix + card.required_option("NAME")).upper(): card
            for card in cards
            if card.keyword == "ORIENTATION"
        }

    def find_card(self, name: str, by: Card) -> Card | None:
        """The card of this name in the scope of the card `by`, or in the assembly; else None."""
        card = self._cards.get((by.scope.prefix + name).upper())
        return card or self._cards.get(name.upper())

    def _card(self, name: str, by: Card, place: DeckPlace | None) -> tuple[Card, bool]:
        """(the card of this name, whether it is cylindrical)."""
        card = self.find_card(name, by)
        if card is None:
            message = f"there is no orientation {name!r} (*ORIENTATION, NAME=)."
            raise (place or by.place).error(message)
        return card, card.option("SYSTEM").upper().startswith("C")

    def directions_at(self, name: str, by: Card, x: Array) -> Array:
        """Directions 1, 2 and 3, as rows, at each of the points `x` (n, 3): (n, 3, 3)."""
        card, cylindrical = self._card(name, by, None)
        if not cylindrical:
            return np.broadcast_to(self.rectangular_axes(name, by), (len(x), 3, 3))

        scope = card.scope
        a, b = np.reshape(card.first().reals(6), (2, 3)) @ scope.rotation.T + scope.translation
        card.needs((a != b).any(), "a cylindrical *ORIENTATION needs two points on its axis.")
        return cylindrical_axes(a, b, x)

    def rectangular_axes(self, name: str, by: Card, place: DeckPlace | None = None) -> Array:
        """Directions 1, 2 and 3, as rows, of an orientation that must be rectangular."""
        card, cylindrical = self._card(name, by, place)
        by.needs(not cylindrical, f"the orientation {name!r} is CYLINDRICAL: give it RECTANGULAR.")
        by_points = bool(card.rows()) and "DEFINITION" not in card.options
        by_points &= card.option("SYSTEM", "R").upper().startswith("R")
        card.needs(by_points, "*ORIENTATION is read as RECTANGULAR or CYLINDRICAL, by points.")

        a, b, origin = np.reshape(card.first().reals(9), (3, 3)) @ card.scope.rotation.T
        axes = geometry.axes_of(a - origin, b - origin)
        card.needs(axes[2].any(), "the two points of *ORIENTATION give no plane.")

        for row in card.rows()[1:2]:  # degrees about direction 3, for shells the normal
            if degrees := row.real(1):
                row.needs(row.word(0) == "3", "*ORIENTATION is read with a rotation about 3 only.")
                axes[:2] = geometry.rotated_about(axes[:2], axes[2], degrees)
        return axes

    def card_axes(self, by: Card) -> Array:
        """Directions of a card's ORIENTATION=, which must be rectangular."""
        return self.rectangular_axes(by.option("ORIENTATION"), by)


def cylindrical_axes(a: Array, b: Array, x: Array) -> Array:
    """Radial (0 on the axis), tangential, axial unit vectors (n, 3, 3) at `x`; the axis: a to b."""
    z = b - a
    radial = x - a - ((x - a) @ z / (z @ z))[:, None] * z
    axial = z / np.linalg.norm(z)
    radial /= np.maximum(np.linalg.norm(radial, axis=1, keepdims=True), np.finfo(float).tiny)
    return np.stack([radial, np.cross(axial, radial), np.broadcast_to(axial, radial.shape)], axis=1)


#: SECTION= of beams by its first letters -> least number of dimensions, how many must be > 0, and
#: the cross-section. For CIRC, CalculiX gives two diameters, Abaqus one radius.
BEAM_SECTIONS: dict[str, tuple[int, int, Callable[[list[float]], Profile]]] = {
    "RECT": (1, 1, lambda d: geometry.rectangle(d[0], d[1] if len(d) > 1 else d[0])),
    "CIRC": (1, 1, lambda d: geometry.ellipse(*(d[:2] if len(d) > 1 else [2 * d[0]] * 2))),
    "PIPE": (2, 2, lambda d: geometry.tube(d[0], d[1])),
    "BOX": (6, 6, lambda d: geometry.box(*d[:4])),
    "GENERAL": (5, 2, lambda d: Profile(d[0], d[3], d[1], d[4], geometry.RECTANGLE_SHEAR)),
}


def profile_of(card: Card) -> Profile:
    """The cross-section of *BEAM SECTION or *BEAM GENERAL SECTION in the deck's units."""
    word = card.option("SECTION", "RECT").upper()
    d = card.first().reals()
    kind = next((name for name in BEAM_SECTIONS if word.startswith(name)), "")
    card.needs(kind, f"SECTION={word} must be RECT, CIRC, PIPE, BOX or GENERAL.")
    count, positive, profile = BEAM_SECTIONS[kind]
    complete = len(d) >= count and min(d[:positive]) > 0
    card.needs(complete, f"SECTION={word} needs {count} positive dimensions; got {d}.")
    equal = kind != "BOX" or d[2:4] == d[4:6]
    card.needs(equal, "a BOX with unequal opposite walls is not supported.")
    principal = kind != "GENERAL" or not d[2]
    card.needs(principal, "I12 must be 0: rotate the section to its principal axes.")
    return profile(d)


#: Degrees from the normal below which x cannot be direction 1 of a shell (Abaqus: 0.1).
NORMAL_ANGLE = 0.1
#: Tolerance in degrees within which a layer's angle must be the same in all elements.
ANGLE_TOLERANCE = 0.5
SHELL_CARDS = ("SHELLSECTION", "SHELLGENERALSECTION", "MEMBRANESECTION")
SECTION_CARDS = ("SOLIDSECTION", *SHELL_CARDS, "BEAMSECTION", "BEAMGENERALSECTION")
#: OFFSET= of shells -> the share of the thickness from the middle surface to the nodes.
SHELL_OFFSETS = {"": 0.0, "MIDDLE": 0.0, "SPOS": 0.5, "SNEG": -0.5}
PLANE_ROLES = {"plane stress", "plane strain"}


class Sections:
    """Adds the sections of a deck to a model builder."""

    def __init__(self, assembly: AbaqusDeck, builder: ModelBuilder) -> None:
        self.assembled = assembly
        self.builder = builder
        self.materials = materials_of(assembly.cards, builder)
        self.orientations = Orientations(assembly.cards)
        cards = assembly.cards_named("NODALTHICKNESS")
        #: thickness at the nodes, nan if not given; number of elements in which it varies
        self.thickness = np.full(len(assembly.deck.points) if cards else 0, np.nan)
        self.varying = 0
        for row in (row for card in cards for row in card.rows() if row.word(1)):
            self.thickness[row.nodes()] = row.real(1)
        for card in assembly.cards_named(*SECTION_CARDS):
            self._read_section(card)
        if self.varying:
            told = f"the variation of the thickness within {self.varying} elements"
            told = f"{told} (*NODAL THICKNESS, {cards[0].place}), the mean of the corners is taken"
            self.builder.report_once(told)

    def _read_section(self, card: Card) -> None:
        """Add the section of one card."""
        elements = card.elements()
        if not len(elements):
            return  # of springs, masses, or of a set that is empty
        blocks = [block for block, _ in self.assembled.deck.blocks_of(elements)]
        roles = {block.role for block in blocks}
        types = sorted({block.type for block in blocks})
        flat = "axisymmetric" not in roles
        card.needs(flat, "axisymmetric elements: revolve the part in your CAD.")
        for kind in types:
            if kind.startswith("D"):
                self.builder.report_once(f"the heat transfer of {kind}, which carry forces here")
            if kind.startswith("M3D"):
                bend = f"that {kind} do not bend: they are shells of their thickness"
                self.builder.report_once(bend)

        plane = len(roles) == 1 and roles <= PLANE_ROLES and "COMPOSITE" not in card.options
        name = card.scope.original_name(card.option("ELSET"))
        if card.keyword in SHELL_CARDS and roles == {"shell"}:
            self._add_shells(card, name, elements)
            return
        if card.keyword == "SOLIDSECTION" and roles == {"rod"}:
            area = _positive_number(card, "area of rods") * self.builder.units.length**2
            name, kind = "rods", "Truss"
            arguments = {**self._isotropic_arguments(card, "solids"), "area": area, "torsion": 0.0}
        elif card.keyword == "SOLIDSECTION" and roles == {"solid"}:
            kind, arguments = self._solid_family(card)
        elif plane and "BEAM" not in card.keyword:  # a thickness means the same of shells
            kind, arguments = self._plane_family(card, *roles)
        elif "BEAM" in card.keyword and roles == {"beam"}:
            given = np.flatnonzero(np.isfinite(self.thickness))
            nodal = any(np.isin(block.nodes, given).any() for block in blocks)
            nodal |= "NODALTHICKNESS" in card.options
            card.needs(not nodal, "beams with *NODAL THICKNESS: give dimensions in *BEAM SECTION.")
            kind, arguments = self._beam_family(card, elements)
        else:
            self._refuse_elements(card, roles, types)
        self.builder.add_section(name, elements, GroupSection(kind, arguments, card.place))

    def _refuse_elements(self, card: Card, roles: set[str], types: list[str]) -> NoReturn:
        """Raise the error of a section card that does not fit its elements."""
        kinds = ", ".join(types)
        mixed = f"one section for {' and '.join(sorted(roles))} elements ({kinds})"
        card.needs(len(roles) <= 1, f"{mixed}; give each kind its own.")
        remedy = "give them as stress elements (of solids C3D…, shells S…, beams B…, trusses T…)."
        fault = f"{card.label} for elements ({kinds}) that carry no forces in this way"
        raise card.place.error(f"{fault}; {remedy}")

    def _material(self, name: str, place: DeckPlace) -> Material:
        """The material of this name."""
        message = f"there is no material {name!r} (*MATERIAL, NAME=)."
        return place.look_up(self.materials, name.upper(), message)

    def _isotropic_arguments(self, card: Card, what: str) -> Json:
        """Family arguments of the card's material, which must be isotropic."""
        material = self._material(card.required_option("MATERIAL"), card.place)
        return self.builder.isotropic(material, what)

    def _solid_family(self, card: Card) -> tuple[str, Json]:
        """Family and arguments of *SOLID SECTION."""
        material = self._material(card.required_option("MATERIAL"), card.place)
        stiffness = self.builder.anisotropic_stiffness(material)
        if stiffness is None:
            return "Solid", self._isotropic_arguments(card, "solids")
        arguments: Json = {"stiffness": stiffness, "rho": self.builder.rho(material)}
        if card.option("ORIENTATION"):
            arguments["axes"] = self.orientations.card_axes(card)[:2].tolist()
        else:
            card.refuse_rotated()
        return "AnisotropicSolid", arguments

    def _plane_family(self, card: Card, role: str) -> tuple[str, Json]:
        """Family and arguments of plane stress or plane strain elements."""
        thickness = _positive_number(card, "thickness") * self.builder.units.length
        plane = {"plane": role.removeprefix("plane "), "thickness": thickness}
        return "Solid", {**self._isotropic_arguments(card, "solids"), **plane}

    def _add_shells(self, card: Card, name: str, elements: IntArray) -> None:
        """Add shells of one material or of layers; several groups if the thickness varies."""
        word = card.option("OFFSET").upper()
        share = SHELL_OFFSETS[word] if word in SHELL_OFFSETS else real_number(word, card.place)
        rows = card.rows()
        if "COMPOSITE" not in card.options:
            material = self._material(card.required_option("MATERIAL"), card.place)
            thickness = card.first().real(0)
            if material.constants is None or material.isotropic is not None:
                elastic = self.builder.isotropic(material, "shells")
                for value, members in self._by_thickness(elements, thickness):
                    arguments = {**elastic, "thickness": value * self.builder.units.length}
                    label = f"{name} of thickness {value:g}" if len(self.thickness) else name
                    family = GroupSection("Shell", arguments, card.place)
                    self.builder.add_shells(label, members, family, -share * value)
                return
            rows = [Row(f"{thickness!r},,{material.name},0", card, card.place)]
        layers, axes = self._laminate_arguments(card, elements, rows)
        thickness = sum(layer["thickness"] for layer in layers) / self.builder.units.length
        family = GroupSection("Laminate", {"layers": layers}, card.place)
        self.builder.add_shells(name, elements, family, -share * thickness, axes)
        nodes = self.assembled.deck.nodes_of(elements)
        if len(self.thickness) and np.isfinite(self.thickness[nodes]).any():
            told = f"*NODAL THICKNESS of layers, which have theirs ({card.place})"
            self.builder.report_once(told)

    def _zero_direction(self, card: Card, elements: IntArray, normal_angle: float) -> Array:
        """Direction of 0° in each element (n, 3): ORIENTATION=, else x, else z.

        z is used where x is within `normal_angle` degrees of the normal.
        """
        name = card.option("ORIENTATION")
        if name:
            return self._direction_1(name, card, elements, card.place)
        card.refuse_rotated()
        normals = geometry.normals_of(self.assembled.deck, elements)
        x_is_normal = np.abs(normals[:, :1]) > math.cos(math.radians(normal_angle))
        return np.where(x_is_normal, np.eye(3)[2], np.eye(3)[0])

    def _by_thickness(self, elements: IntArray, given: float) -> Iterator[tuple[float, IntArray]]:
        """Yield (thickness, elements) by the mean of *NODAL THICKNESS, as in CalculiX."""
        if not len(self.thickness):
            yield given, elements
            return
        thickness = np.zeros(len(elements))
        for block, positions in self.assembled.deck.blocks_of(elements):
            nodes = np.hstack([block.corners, block.mids])
            values = np.where(nodes >= 0, self.thickness[nodes], np.nan)
            values = np.where(np.isfinite(values), values, given)
            self.varying += int((np.ptp(values, axis=1) > 1e-9 * values.max(axis=1)).sum())
            thickness[positions] = np.round(values[:, : block.corners.shape[1]].mean(axis=1), 12)
        for value in np.unique(thickness):
            yield float(value), elements[thickness == value]

    def _laminate_arguments(
        self, card: Card, elements: IntArray, rows: list[Row]
    ) -> tuple[list[dict[str, float]], Array]:
        """(arguments of the layers, direction of 0° in each element)."""
        normals = geometry.normals_of(self.assembled.deck, elements)
        words = [(row.word(2) or card.option("MATERIAL"), row.place) for row in rows]
        materials = [self._material(*word) for word in words]
        oriented = [row for row in rows if self.orientations.find_card(row.word(3), card)]
        if oriented and not card.option("ORIENTATION"):
            axis = self._direction_1(oriented[0].word(3), card, elements, card.place)
        else:
            isotropic = all(material.isotropic is not None for material in materials)
            axis = self._zero_direction(card, elements, 45.0 if isotropic else NORMAL_ANGLE)
        layers: list[dict[str, float]] = []
        for row, material in zip(rows, materials, strict=True):
            if row in oriented:
                directions = self._direction_1(row.word(3), card, elements, row.place)
                angle = _angle_between(axis, directions, normals, row.place)
            else:
                angle = row.real(3)
            layers.append(self.builder.layer_arguments(material, row.real(0), angle))
        return layers, axis

    def _direction_1(self, name: str, card: Card, elements: IntArray, place: DeckPlace) -> Array:
        """Direction 1 of a rectangular orientation, for each element (n, 3)."""
        axes = self.orientations.rectangular_axes(name, card, place)
        return np.broadcast_to(axes[0], (len(elements), 3))

    def _beam_family(self, card: Card, elements: IntArray) -> tuple[str, Json]:
        """Family and arguments of a beam section."""
        arguments = self._isotropic_arguments(card, "beams")
        profile = profile_of(card)
        if card.option("SECTION").upper().startswith("CIRC") and len(card.first().fields) == 1:
            told = f"{card.place}: the one number of SECTION=CIRC is taken for the radius, as "
            told += "Abaqus does; CalculiX means the diameter: give it twice there."
            self.assembled.deck.remarks.append(told)
        axis = np.array([0.0, 0.0, -1.0])
        shares = [real_number(card.option(k, "0"), card.place) for k in ("OFFSET1", "OFFSET2")]
        rows = card.rows()

        if len(rows) > 1:
            axis = card.scope.rotation @ rows[1].reals(3)
        elif profile.I_side != profile.I or any(shares):
            card.refuse_rotated()
        offset = shares[0] * profile.height
        card.needs(not all(shares), "a beam off its nodes in both directions is not supported.")

        if shares[1]:
            tangents = geometry.tangents_of(self.assembled.deck, elements)
            tangent = geometry.common_direction(tangents, least_cosine=1 - 1e-9)
            if tangent is None:
                raise card.place.error("OFFSET2 is read for beams in one direction only.")
            offset = shares[1] * profile.width
            axis = np.cross(tangent, axis)
            profile = profile.rotated()
        length = self.builder.units.length
        arguments |= {"section": profile.section(length), "orientation": axis.tolist()}
        return "Beam", {**arguments, "offset": offset * length}


def _angle_between(axis: Array, direction: Array, normals: Array, place: DeckPlace) -> float:
    """Angle in degrees from one direction to another about the normals, equal in all elements."""
    flat = [v - np.einsum("ni,ni->n", v, normals)[:, None] * normals for v in (axis, direction)]
    sine = np.einsum("ni,ni->n", np.cross(*flat), normals)
    degrees = np.degrees(np.arctan2(sine, np.einsum("ni,ni->n", *flat)))
    equal = np.abs((degrees - degrees[0] + 90) % 180 - 90).max() <= ANGLE_TOLERANCE
    place.require(equal, "the *ORIENTATION of a layer turns from element to element; give angles.")
    return float(degrees[0])


def _positive_number(card: Card, quantity: str) -> float:
    """The first number of a card's first line, `quantity` in messages; 1 if it is left out."""
    value = card.first().real(0, 1.0)
    card.first().needs(value > 0, f"the {quantity} must be above 0; it is {value:g}.")
    return value
