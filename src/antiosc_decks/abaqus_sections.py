"""Materials, their directions, and sections of Abaqus and CalculiX decks.

Solids, rods, shells with *NODAL THICKNESS, and beams with their cross-sections.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NoReturn

import numpy as np

from antiosc.io.deck import Array, IntArray, Place, real_number
from antiosc_decks import properties as geometry, properties as profiles
from antiosc_decks.abaqus_assembly import Instance, Whole
from antiosc_decks.abaqus_cards import Card, Row
from antiosc_decks.builder import Arguments, Family, ModelBuilder, Rod
from antiosc_decks.properties import Material, isotropic, of_stiffness, symmetric

#: Kinds of *ELASTIC by their first letters -> how many constants each has.
ELASTIC_CONSTANTS = {"ISO": 2, "ENGINEERINGCONSTANTS": 9, "LAMINA": 6, "ORTHO": 9, "ANISO": 21}
#: 11, 22, 33, 12, 13, 23 of Abaqus in the order 11, 22, 33, 23, 13, 12.
VOIGT = [0, 1, 2, 5, 4, 3]


def materials_of(cards: list[Card]) -> tuple[dict[str, Material], list[str]]:
    """(materials by name in upper case, what is ignored of them)."""
    found: dict[str, Material] = {}
    ignored: list[str] = []
    current: Material | None = None
    for card in cards:
        if card.keyword == "MATERIAL":
            name = card.needed("NAME")
            if name.upper() in found:
                raise card.place.error(
                    f"the material {name!r} is defined more than once, first in "
                    f"{found[name.upper()].place}."
                )
            current = found[name.upper()] = Material(name, card.place)
        elif current is not None and card.keyword == "ELASTIC":
            kind = _elastic(current, card)
            if kind == "ISO" and len(card.lines) > 1:
                ignored.append(f"*ELASTIC of other temperatures ({card.place})")
        elif current is not None and card.keyword == "DENSITY":
            current.density = card.first().real(0)
    return found, ignored


def _elastic(material: Material, card: Card) -> str:
    """Give a material what *ELASTIC says; its kind."""
    word = "".join(card.option("TYPE", "ISO").split()).upper()
    kind = next((one for one in ELASTIC_CONSTANTS if word.startswith(one)), "")
    card.needs(kind, f"*ELASTIC, TYPE={card.option('TYPE')} is not supported; write it as "
               "isotropic, ENGINEERING CONSTANTS, LAMINA, ORTHO or ANISOTROPIC.")  # fmt: skip
    values = card.first().reals() if kind == "ISO" else card.numbers()
    count = ELASTIC_CONSTANTS[kind]
    card.needs(len(values) >= count, f"*ELASTIC needs {count} constants; it has {len(values)}.")
    v = np.array(values[:count])
    material.place = card.place
    if kind == "ISO":
        material.constants = isotropic(v[0], v[1])
    elif kind == "LAMINA":  # E1, E2, nu12, G12, G13, G23
        material.constants = np.array([v[0], v[1], np.nan, v[2], np.nan, np.nan, *v[3:]])
    elif kind == "ENGINEERINGCONSTANTS":
        material.constants = v
    elif kind == "ANISO":  # the upper triangle by columns: the lower one by rows
        material.stiffness = symmetric(v)[np.ix_(VOIGT, VOIGT)]
    else:
        D = np.diag([0.0, 0.0, 0.0, *v[6:]])
        D[:3, :3] = symmetric(v[:6])
        try:
            material.constants = of_stiffness(D)
        except np.linalg.LinAlgError:
            raise card.place.error("the stiffness of *ELASTIC is singular.") from None
    return kind


class Orientations:
    """The *ORIENTATION cards among some cards, by their names and the instances they are in.

    Those of a part turn with each of its instances.
    """

    def __init__(self, cards: Iterable[tuple[Card, Instance]]) -> None:
        self._cards = {
            (within.prefix + card.needed("NAME")).upper(): (card, within)
            for card, within in cards
            if card.keyword == "ORIENTATION"
        }

    def find(self, name: str, within: Instance) -> tuple[Card, Instance] | None:
        """The card of a name in an instance, or else in the assembly, and the instance it is of."""
        own = self._cards.get((within.prefix + name).upper())
        return own or self._cards.get(name.upper())

    def cylindrical(self, name: str, within: Instance) -> bool:
        """Whether there is an orientation of this name about the axis of a cylinder."""
        found = self.find(name, within)
        return found is not None and found[0].option("SYSTEM").upper().startswith("C")

    def at(self, name: str, place: Place, within: Instance, x: Array) -> Array:
        """Directions 1, 2 and 3 of an *ORIENTATION (n, 3, 3) at points; those are rows."""
        found = self.find(name, within)
        if found is None:
            raise place.error(f"there is no orientation {name!r} (*ORIENTATION, NAME=).")
        card, of = found
        first, rows = card.first(), card.rows()
        if self.cylindrical(name, within):
            a, b = np.reshape(first.reals(6), (2, 3)) @ of.turn.T + of.shift
            if (a == b).all():
                raise card.place.error("a cylindrical *ORIENTATION needs two points on its axis.")
            return around_axis(a, b, x)
        system = card.option("SYSTEM", "R").upper()
        if not system.startswith("R") or not rows or "DEFINITION" in card.options:
            raise card.place.error("*ORIENTATION is read as RECTANGULAR or CYLINDRICAL, by points.")
        a, b, origin = np.reshape(first.reals(9), (3, 3)) @ of.turn.T
        normal = np.cross(a - origin, b - origin)
        card.needs(normal.any(), "the two points of *ORIENTATION give no plane.")
        one, z = (v / np.linalg.norm(v) for v in (a - origin, normal))
        if degrees := self.degrees(name, within):
            if rows[1].word(0) != "3":
                raise rows[1].place.error("*ORIENTATION is read with a rotation about 3 only.")
            angle = math.radians(degrees)
            one = math.cos(angle) * one + math.sin(angle) * np.cross(z, one)
        return np.broadcast_to(np.stack([one, np.cross(z, one), z]), (len(x), 3, 3))

    def degrees(self, name: str, within: Instance) -> float:
        """The angle in the second line: about 3, on shells about the normal."""
        found = self.find(name, within)
        rows = found[0].rows() if found else []
        return rows[1].real(1) if len(rows) > 1 else 0.0

    def frame(self, name: str, place: Place, within: Instance) -> Array:
        """Directions 1, 2 and 3, as rows, of an *ORIENTATION that is the same everywhere."""
        frame = self.at(name, place, within, np.zeros((1, 3)))[0]
        place.needs(not self.cylindrical(name, within), f"the orientation {name!r} is "
                    "CYLINDRICAL; here it must be RECTANGULAR.")  # fmt: skip
        return np.asarray(frame)


def around_axis(a: Array, b: Array, x: Array) -> Array:
    """Radial, circumferential and axial directions (n, 3, 3) at points; zero on the axis."""
    z = b - a
    out = x - a - ((x - a) @ z / (z @ z))[:, None] * z
    along = z / np.linalg.norm(z)
    out /= np.maximum(np.linalg.norm(out, axis=1, keepdims=True), np.finfo(float).tiny)
    return np.stack([out, np.cross(along, out), np.broadcast_to(along, out.shape)], axis=1)


#: SECTION= of beams by its first letters -> least number of dimensions, how many must be > 0.
BEAM_SECTIONS = {"RECT": (1, 1), "CIRC": (1, 1), "PIPE": (2, 2), "BOX": (6, 6), "GENERAL": (5, 2)}


def profile_of(card: Card) -> profiles.Profile:
    """The cross-section of *BEAM SECTION or *BEAM GENERAL SECTION, in the deck's units."""
    kind = card.option("SECTION", "RECT").upper()
    d = card.first().reals()
    short = next((name for name in BEAM_SECTIONS if kind.startswith(name)), "")
    card.needs(short, f"SECTION={kind} is not supported; it must be RECT, CIRC, PIPE, BOX or "
               "GENERAL.")  # fmt: skip
    needed, positive = BEAM_SECTIONS[short]
    if len(d) < needed or min(d[:positive]) <= 0:
        raise card.place.error(f"SECTION={kind} needs {needed} positive dimensions; got {d}.")
    if short == "RECT":
        return profiles.rectangle(d[0], d[1] if len(d) > 1 else d[0])
    if short == "CIRC":  # CalculiX gives two diameters, Abaqus one radius
        return profiles.ellipse(*(d[:2] if len(d) > 1 else (2 * d[0], 2 * d[0])))
    if short == "PIPE":
        return profiles.tube(d[0], d[1])
    if short == "BOX":
        found = profiles.box(d[0], d[1], (d[2], d[3], d[4], d[5]))
        if found is None:
            raise card.place.error("a BOX with unequal opposite walls is not supported.")
        return found
    area, about_1, mixed, about_2, torsion = d[:5]
    card.needs(not mixed, "I12 must be 0: rotate the section to its principal axes.")
    return profiles.Profile(area, about_2, about_1, torsion, profiles.RECTANGLE)


#: Sine of the angle below which a direction is normal to a shell.
NORMAL = 0.05
#: Degrees from the normal below which x is no direction 1 of a shell; Abaqus: 0.1.
STEEP = 0.1
#: Degrees by which the angle of a layer may differ between elements.
SAME_ANGLE = 0.5
SECTION_CARDS = ("SOLIDSECTION", "SHELLSECTION", "BEAMSECTION", "BEAMGENERALSECTION")
#: OFFSET= of shells -> the share of the thickness from the middle surface to the nodes.
OFFSETS = {"": 0.0, "MIDDLE": 0.0, "SPOS": 0.5, "SNEG": -0.5}
PLANE = {"plane stress", "plane strain"}


class Sections:
    """Adds the sections of a deck to a builder."""

    def __init__(self, whole: Whole, builder: ModelBuilder, materials: dict[str, Material]) -> None:
        self.whole = whole
        self.builder = builder
        self.materials = materials
        self.orientations = Orientations(whole.cards)

    def read(self, card: Card, within: Instance) -> None:
        """One section card."""
        elements = self.whole.elements(card.needed("ELSET"), card.place, within)
        if not len(elements):
            return  # of springs, masses, or of a set that is empty
        blocks = [block for block, _ in self.whole.deck.blocks_of(elements)]
        roles = {block.role for block in blocks}
        composite = "COMPOSITE" in card.options
        if card.keyword == "SHELLSECTION" and roles == {"shell"}:
            kind, arguments = self._shell(card, elements, within)
        elif card.keyword == "SOLIDSECTION" and roles == {"rod"}:
            self._rods(card, elements)
            return
        elif card.keyword == "SOLIDSECTION" and roles == {"solid"}:
            kind, arguments = self._solid(card, within)
        elif "BEAM" not in card.keyword and roles <= PLANE and not composite:
            kind, arguments = self._plane(card, roles)  # a thickness means the same of shells
        elif "BEAM" in card.keyword and roles == {"beam"}:
            kind, arguments = self._beam(card, elements, within)
        else:
            self._refuse(card, roles, {block.type for block in blocks})
        name = self.whole.spelled(card.option("ELSET"), within)
        self.builder.add(name, elements, Family(kind, arguments, card.place))

    def _refuse(self, card: Card, roles: set[str], types: set[str]) -> NoReturn:
        kinds = ", ".join(sorted(types))
        if any(kind.startswith(("CAX", "CGAX", "SAX")) for kind in types):
            raise card.place.error(
                f"the elements {kinds} are axisymmetric, which is not "
                "supported; model the part, or a sector between planes of symmetry, by solids."
            )
        card.needs(len(roles) <= 1, f"one section for {' and '.join(sorted(roles))} elements "
                   f"({kinds}); give each kind its own.")  # fmt: skip
        raise card.place.error(
            f"*{card.keyword} for elements ({kinds}) that no element "
            "family here carries in this way."
        )

    def _material(self, name: str, place: Place) -> Material:
        if name.upper() not in self.materials:
            raise place.error(f"there is no material {name!r} (*MATERIAL, NAME=).")
        return self.materials[name.upper()]

    def _isotropic(self, card: Card, what: str) -> Arguments:
        material = self._material(card.needed("MATERIAL"), card.place)
        E, nu = self.builder.elastic(material, what)
        return {"E": E, "nu": nu, "rho": self.builder.rho(material)}

    def _solid(self, card: Card, within: Instance) -> tuple[str, Arguments]:
        material = self._material(card.needed("MATERIAL"), card.place)
        stiffness = self.builder.anisotropic(material)
        if stiffness is None:
            return "Solid", self._isotropic(card, "solids")
        arguments: Arguments = {"stiffness": stiffness, "rho": self.builder.rho(material)}
        if name := card.option("ORIENTATION"):
            arguments["axes"] = self.orientations.frame(name, card.place, within)[:2].tolist()
        else:
            within.refuse_turned(card)
        return "AnisotropicSolid", arguments

    def _plane(self, card: Card, roles: set[str]) -> tuple[str, Arguments]:
        if len(roles) > 1:
            self._refuse(card, roles, set())
        thickness = _positive(card, "thickness") * self.builder.units.length
        plane = {"plane": min(roles).removeprefix("plane "), "thickness": thickness}
        return "Solid", {**self._isotropic(card, "solids"), **plane}

    def _rods(self, card: Card, elements: IntArray) -> None:
        """T2D2 and T3D2, with their area in the first line."""
        given, units = self._isotropic(card, "solids"), self.builder.units
        area = _positive(card, "area of rods")
        E, mass = given["E"] / units.stress, given["rho"] / units.density * area
        rod = Rod(E, given["nu"], area, mass, card.place)
        self.builder.rods |= dict.fromkeys(elements.tolist(), rod)

    def _shell(self, card: Card, elements: IntArray, within: Instance) -> tuple[str, Arguments]:
        if "COMPOSITE" in card.options:
            return self._laminate(card, elements, card.rows(), within)
        material = self._material(card.needed("MATERIAL"), card.place)
        thickness = card.first().real(0)
        if material.constants is not None and material.isotropic is None:
            row = Row(f"{thickness!r},,{material.name},0", card.place)
            return self._laminate(card, elements, [row], within)
        length = {"thickness": thickness * self.builder.units.length}
        offset = self._offset(card, elements, thickness)
        return "Shell", {**self._isotropic(card, "shells"), **length, **offset}

    def _offset(self, card: Card, elements: IntArray, thickness: float) -> Arguments:
        word = card.option("OFFSET").upper()
        share = OFFSETS[word] if word in OFFSETS else real_number(word, card.place)
        if not share:
            return {}
        if geometry.curved(self.whole.deck, elements):
            self.whole.deck.told.append(
                f"{card.place}: the area of a curved shell with OFFSET={word} is that at its nodes."
            )
        length = self.builder.units.length
        side = geometry.side_of(self.whole.deck, elements, length)
        return {"offset": -share * thickness * length, **side}

    def _laminate(
        self, card: Card, elements: IntArray, rows: list[Row], within: Instance
    ) -> tuple[str, Arguments]:
        deck, length = self.whole.deck, self.builder.units.length
        normals = geometry.normals_of(deck, elements)
        words = [(row.word(2) or card.option("MATERIAL"), row.place) for row in rows]
        materials = [self._material(*word) for word in words]
        known = [row for row in rows if self.orientations.find(row.word(3), within)]
        name = card.option("ORIENTATION") or (known[0].word(3) if known else "")
        if name:
            axis = self._directions(name, card.place, within, elements)
        else:
            within.refuse_turned(card)
            alike = all(one.isotropic is not None for one in materials)
            across = np.abs(normals[:, :1]) > math.cos(math.radians(45.0 if alike else STEEP))
            axis = np.where(across, np.eye(3)[2], np.eye(3)[0])
        layers: list[dict[str, float]] = []
        for row, material in zip(rows, materials, strict=True):
            angle = row.real(3) if row not in known else 0.0
            if row in known:
                own = self._directions(row.word(3), row.place, within, elements)
                angle = _turned(axis, own, normals, row.place)
            layers.append(self.builder.layer(material, row.real(0), angle))
            solid = material.constants is not None and np.isfinite(material.constants).all()
            names = name, row.word(3)
            if any(self.orientations.cylindrical(n, within) for n in names) and (
                solid and material.isotropic is None
            ):
                self.builder.tell_once(
                    f"the directions of the cylindrical *ORIENTATION ({card.place}) as CalculiX "
                    "has them: 1 along the radius; on shells 1 is around the axis, as Abaqus has it"
                )
        alike = np.allclose(axis, axis[0], rtol=0, atol=1e-12)
        return "Laminate", {
            "layers": layers,
            "axis": axis[0].tolist()
            if alike
            else geometry.everywhere(deck, elements, axis, length),
            **self._offset(card, elements, sum(one["thickness"] for one in layers) / length),
            "top": geometry.top_of(deck, elements, length),
        }

    def _directions(self, name: str, place: Place, within: Instance, elements: IntArray) -> Array:
        """Direction 1 of an *ORIENTATION in each element.

        Where that about an axis is the normal of a shell, it is direction 2.
        """
        deck = self.whole.deck
        centres = np.array([x.mean(axis=0) for x in geometry.corners_of(deck, elements)])
        frames = self.orientations.at(name, place, within, centres)
        first = frames[:, 0]
        if self.orientations.cylindrical(name, within):
            normals = geometry.normals_of(deck, elements)
            is_normal = np.linalg.norm(np.cross(first, normals), axis=1) < NORMAL
            first = np.where(is_normal[:, None], frames[:, 1], first)
            first -= np.einsum("ni,ni->n", first, normals)[:, None] * normals
            angle = math.radians(self.orientations.degrees(name, within))
            first = math.cos(angle) * first + math.sin(angle) * np.cross(normals, first)
        return first

    def _beam(self, card: Card, elements: IntArray, within: Instance) -> tuple[str, Arguments]:
        arguments = self._isotropic(card, "beams")
        profile = profile_of(card)
        if card.option("SECTION").upper().startswith("CIRC") and len(card.first().fields) == 1:
            self.whole.deck.told.append(
                f"{card.place}: the one number of SECTION=CIRC is taken for the radius, as Abaqus "
                "does; CalculiX means the diameter: give it twice there."
            )
        first = np.array([0.0, 0.0, -1.0])
        shares = [real_number(card.option(k, "0"), card.place) for k in ("OFFSET1", "OFFSET2")]
        rows = card.rows()
        if len(rows) > 1:
            first = within.turn @ rows[1].reals(3)
        elif profile.I_side != profile.I or any(shares):
            within.refuse_turned(card)
        offset = shares[0] * profile.height
        card.needs(not all(shares), "a beam off its nodes in both directions is not supported.")
        if shares[1]:
            tangent = geometry.common_direction(
                geometry.tangents_of(self.whole.deck, elements), least=1 - 1e-9
            )
            if tangent is None:
                raise card.place.error(
                    "OFFSET2 is read for beams in one direction only; give each "
                    "direction a section of its own."
                )
            offset = shares[1] * profile.width
            first, profile = np.cross(tangent, first), profile.rotated()
        length = self.builder.units.length
        arguments["section"] = profile.section(length)
        return "Beam", {**arguments, "orientation": first.tolist(), "offset": offset * length}


def _turned(axis: Array, own: Array, normals: Array, place: Place) -> float:
    """Degrees from directions to others about the normals, the same in all elements."""
    flat = [v - np.einsum("ni,ni->n", v, normals)[:, None] * normals for v in (axis, own)]
    sine = np.einsum("ni,ni->n", np.cross(*flat), normals)
    degrees = np.degrees(np.arctan2(sine, np.einsum("ni,ni->n", *flat)))
    if np.abs((degrees - degrees[0] + 90) % 180 - 90).max() > SAME_ANGLE:
        raise place.error(
            "the *ORIENTATION of this layer turns against that of the section, or of the first "
            "layer, from element to element; give the layers angles instead."
        )
    return float(degrees[0])


def _positive(card: Card, what: str) -> float:
    """The thickness or the area in the first line, 1 where it is left out."""
    value = card.first().real(0, 1.0)
    card.first().needs(value > 0, f"the {what} must be above 0; it is {value:g}.")
    return value


def vary_thickness(whole: Whole, builder: ModelBuilder) -> None:
    """Thicknesses by *NODAL THICKNESS, the mean of each element.

    CalculiX takes them whether or not the section says so.
    """
    at_node = np.full(len(whole.deck.points), np.nan)
    cards = whole.named("NODALTHICKNESS")
    for card, within in cards:
        for row in card.rows():
            if row.word(1):
                at_node[whole.nodes(row.word(0), row.place, within)] = row.real(1)
    if not cards:
        return
    place, varying = cards[0][0].place, 0
    length = builder.units.length
    families = [one.arguments.get("thickness", np.nan) / length for one in builder.families]
    by_section = np.array([*families, np.nan])[builder.of_element]
    for block, own in whole.deck.numbered():
        if block.role == "shell":
            nodes = np.hstack([block.corners, block.mids])
            values = np.where(nodes >= 0, at_node[nodes], np.nan)
            values = np.where(np.isfinite(values), values, by_section[own, None])
            varying += int((np.ptp(values, axis=1) > 1e-9 * values.max(axis=1)).sum())
            _thin(builder, own, values[:, : block.corners.shape[1]].mean(axis=1), place)
    if varying:
        builder.ignored.append(
            f"the variation of the thickness within {varying} elements (*NODAL THICKNESS, "
            f"{place}), the mean of the corners is taken in each"
        )


def _thin(builder: ModelBuilder, elements: IntArray, thickness: Array, place: Place) -> None:
    numbers = builder.of_element[elements]
    for number in np.unique(numbers[numbers >= 0]):
        family, name = builder.families[number], builder.names[number]
        mine = numbers == number
        if family.kind != "Shell":
            if np.isfinite(thickness[mine]).any():
                builder.ignored.append(f"*NODAL THICKNESS of layers, which have theirs ({place})")
            continue
        for value in np.unique(np.round(thickness[mine], 12)):
            some = elements[mine & (np.round(thickness, 12) == value)]
            own = {**family.arguments, "thickness": float(value) * builder.units.length}
            if "offset" in own:
                own["offset"] *= own["thickness"] / family.arguments["thickness"]
            label = f"{name} of thickness {value:g}"
            builder.add(label, some, Family("Shell", own, family.place))
