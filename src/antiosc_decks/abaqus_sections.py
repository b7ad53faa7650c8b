"""Materials, their directions, and sections of Abaqus and CalculiX decks."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NoReturn

import numpy as np

from antiosc.io.deck import Array, Block, IntArray, Place, real_number
from antiosc.io.neutral import Json
from antiosc_decks import properties as geometry
from antiosc_decks.abaqus_assembly import Whole
from antiosc_decks.abaqus_cards import Card, Row
from antiosc_decks.builder import Family, ModelBuilder
from antiosc_decks.properties import Material, Profile, of_stiffness, symmetric

#: Kinds of *ELASTIC by their first letters -> how many constants each has.
ELASTIC_CONSTANTS = {"ISO": 2, "ENGINEERINGCONSTANTS": 9, "LAMINA": 6, "ORTHO": 9, "ANISO": 21}
#: 11, 22, 33, 12, 13, 23 of Abaqus in the order 11, 22, 33, 23, 13, 12.
VOIGT = [0, 1, 2, 5, 4, 3]


def materials_of(cards: list[Card], builder: ModelBuilder) -> dict[str, Material]:
    """The materials by name in upper case."""
    materials: dict[str, Material] = {}
    current: Material | None = None
    for card in cards:
        if card.keyword == "MATERIAL":
            name = card.needed("NAME")
            if known := materials.get(name.upper()):
                message = (
                    f"the material {name!r} is defined more than once, first in {known.place}."
                )
                raise card.place.error(message)
            current = materials[name.upper()] = Material(name, card.place)
        elif current is not None and card.keyword == "ELASTIC":
            kind = _elastic(current, card)
            if kind == "ISO" and len(card.lines) > 1:
                builder.tell_once(f"*ELASTIC of other temperatures ({card.place})")
        elif current is not None and card.keyword == "DENSITY":
            current.density = card.first().real(0)
    return materials


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
        material.set_isotropic(v[0], v[1])
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
    """The *ORIENTATION cards among some cards; those of a part turn with each of its instances."""

    def __init__(self, cards: Iterable[Card]) -> None:
        orientation_cards = [card for card in cards if card.keyword == "ORIENTATION"]
        self._cards = {
            (card.within.prefix + card.needed("NAME")).upper(): card for card in orientation_cards
        }

    def find(self, name: str, by: Card) -> Card | None:
        """The card of a name in the instance of another, or else in the assembly."""
        card = self._cards.get((by.within.prefix + name).upper())
        return card or self._cards.get(name.upper())

    def cylindrical(self, name: str, by: Card) -> bool:
        """Whether there is an orientation of this name about the axis of a cylinder."""
        orientation = self.find(name, by)
        return orientation is not None and orientation.option("SYSTEM").upper().startswith("C")

    def at(self, name: str, by: Card, x: Array, place: Place | None = None) -> Array:
        """Directions 1, 2 and 3 of an *ORIENTATION (n, 3, 3) at points; those are rows."""
        card = self.find(name, by)
        if card is None:
            message = f"there is no orientation {name!r} (*ORIENTATION, NAME=)."
            raise (place or by.place).error(message)
        first, of = card.first(), card.within
        if self.cylindrical(name, by):
            a, b = np.reshape(first.reals(6), (2, 3)) @ of.turn.T + of.shift
            apart = (a != b).any()
            card.needs(apart, "a cylindrical *ORIENTATION needs two points on its axis.")
            return around_axis(a, b, x)
        plain = card.option("SYSTEM", "R").upper().startswith("R") and card.rows()
        by_points = plain and "DEFINITION" not in card.options
        card.needs(by_points, "*ORIENTATION is read as RECTANGULAR or CYLINDRICAL, by points.")
        a, b, origin = np.reshape(first.reals(9), (3, 3)) @ of.turn.T
        normal = np.cross(a - origin, b - origin)
        card.needs(normal.any(), "the two points of *ORIENTATION give no plane.")
        one, z = (v / np.linalg.norm(v) for v in (a - origin, normal))
        if degrees := self.degrees(name, by):
            row = card.rows()[1]
            row.needs(row.word(0) == "3", "*ORIENTATION is read with a rotation about 3 only.")
            one = geometry.turned(one, z, degrees)
        return np.broadcast_to(np.stack([one, np.cross(z, one), z]), (len(x), 3, 3))

    def degrees(self, name: str, by: Card) -> float:
        """The angle in the second line: about 3, on shells about the normal."""
        orientation = self.find(name, by)
        rows = orientation.rows() if orientation else []
        return rows[1].real(1) if len(rows) > 1 else 0.0

    def frame(self, by: Card) -> Array:
        """Directions 1, 2 and 3, as rows, of ORIENTATION=, which is the same everywhere."""
        name = by.option("ORIENTATION")
        frame = self.at(name, by, np.zeros((1, 3)))[0]
        by.needs(not self.cylindrical(name, by), f"the orientation {name!r} is CYLINDRICAL; here "
                 "it must be RECTANGULAR.")  # fmt: skip
        return np.asarray(frame)


def around_axis(a: Array, b: Array, x: Array) -> Array:
    """Radial, circumferential and axial directions (n, 3, 3) at points; zero on the axis."""
    z = b - a
    out = x - a - ((x - a) @ z / (z @ z))[:, None] * z
    along = z / np.linalg.norm(z)
    out /= np.maximum(np.linalg.norm(out, axis=1, keepdims=True), np.finfo(float).tiny)
    return np.stack([out, np.cross(along, out), np.broadcast_to(along, out.shape)], axis=1)


#: SECTION= of beams by its first letters -> least number of dimensions, how many must be > 0, and
#: the cross-section. Of CIRC CalculiX gives two diameters, Abaqus one radius.
BEAM_SECTIONS: dict[str, tuple[int, int, Callable[[list[float]], Profile]]] = {
    "RECT": (1, 1, lambda d: geometry.rectangle(d[0], d[1] if len(d) > 1 else d[0])),
    "CIRC": (1, 1, lambda d: geometry.ellipse(*(d[:2] if len(d) > 1 else [2 * d[0]] * 2))),
    "PIPE": (2, 2, lambda d: geometry.tube(d[0], d[1])),
    "BOX": (6, 6, lambda d: geometry.box(*d[:4])),
    "GENERAL": (5, 2, lambda d: Profile(d[0], d[3], d[1], d[4], geometry.RECTANGLE)),
}


def profile_of(card: Card) -> Profile:
    """The cross-section of *BEAM SECTION or *BEAM GENERAL SECTION, in the deck's units."""
    kind = card.option("SECTION", "RECT").upper()
    d = card.first().reals()
    short = next((name for name in BEAM_SECTIONS if kind.startswith(name)), "")
    card.needs(short, f"SECTION={kind} is not supported; it must be RECT, CIRC, PIPE, BOX or "
               "GENERAL.")  # fmt: skip
    needed, positive, made = BEAM_SECTIONS[short]
    enough = len(d) >= needed and min(d[:positive]) > 0
    card.needs(enough, f"SECTION={kind} needs {needed} positive dimensions; got {d}.")
    if short == "BOX":
        card.needs(d[2:4] == d[4:6], "a BOX with unequal opposite walls is not supported.")
    if short == "GENERAL":
        card.needs(not d[2], "I12 must be 0: rotate the section to its principal axes.")
    return made(d)


#: Sine of the angle below which a direction is normal to a shell.
NORMAL = 0.05
#: Degrees from the normal below which x is no direction 1 of a shell; Abaqus: 0.1.
STEEP = 0.1
#: Degrees by which the angle of a layer may differ between elements.
SAME_ANGLE = 0.5
OF_SHELLS = ("SHELLSECTION", "SHELLGENERALSECTION")
SECTION_CARDS = ("SOLIDSECTION", *OF_SHELLS, "BEAMSECTION", "BEAMGENERALSECTION")
#: OFFSET= of shells -> the share of the thickness from the middle surface to the nodes.
OFFSETS = {"": 0.0, "MIDDLE": 0.0, "SPOS": 0.5, "SNEG": -0.5}
PLANE = {"plane stress", "plane strain"}


class Sections:
    """Adds the sections of a deck to a builder."""

    def __init__(self, whole: Whole, builder: ModelBuilder) -> None:
        self.whole, self.builder = whole, builder
        self.materials = materials_of(whole.cards, builder)
        self.orientations = Orientations(whole.cards)
        cards = whole.named("NODALTHICKNESS")
        #: of nodes, nan without one; and in how many elements it varies
        self.thickness = np.full(len(whole.deck.points) if cards else 0, np.nan)
        self.varying = 0
        for row in (row for card in cards for row in card.rows() if row.word(1)):
            self.thickness[row.nodes()] = row.real(1)
        for card in whole.named(*SECTION_CARDS):
            self._read(card)
        if self.varying:
            message = f"the variation of the thickness within {self.varying} elements (*NODAL "
            message += f"THICKNESS, {cards[0].place}), the mean of the corners is taken in each"
            self.builder.tell_once(message)

    def _read(self, card: Card) -> None:
        """One section card."""
        elements = card.elements()
        if not len(elements):
            return  # of springs, masses, or of a set that is empty
        blocks = [block for block, _ in self.whole.deck.blocks_of(elements)]
        roles = {block.role for block in blocks}
        composite = "COMPOSITE" in card.options
        name = card.within.spelled(card.option("ELSET"))
        if card.keyword in OF_SHELLS and roles == {"shell"}:
            made = composite or "MATERIAL" in card.options or card.keyword == "SHELLSECTION"
            if made:
                self._shells(card, name, elements)
            else:
                family = Family("GivenSheet", self._stiffnesses(card), card.place)
                self.builder.add_shells(name, elements, family, 0.0, self._zero(card, elements))
            return
        if card.keyword == "SOLIDSECTION" and roles == {"rod"}:
            area = _positive(card, "area of rods") * self.builder.units.length**2
            own = {**self._isotropic(card, "solids"), "area": area, "torsion": 0.0}
            kind, arguments = "Truss", own
        elif card.keyword == "SOLIDSECTION" and roles == {"solid"}:
            kind, arguments = self._solid(card)
        elif "BEAM" not in card.keyword and roles <= PLANE and not composite:
            kind, arguments = self._plane(card, roles)  # a thickness means the same of shells
        elif "BEAM" in card.keyword and roles == {"beam"}:
            self._refuse_nodal(card, blocks)
            kind, arguments = self._beam(card, elements)
        else:
            self._refuse(card, roles, {block.type for block in blocks})
        name = "rods" if kind == "Truss" else name
        self.builder.add(name, elements, Family(kind, arguments, card.place))

    def _refuse_nodal(self, card: Card, blocks: Sequence[Block]) -> None:
        """MeshError for beams whose dimensions are given at their nodes."""
        known = np.flatnonzero(np.isfinite(self.thickness))
        nodal = any(np.isin(block.nodes, known).any() for block in blocks)
        of_card = not nodal and "NODALTHICKNESS" not in card.options
        card.needs(of_card, "beams with *NODAL THICKNESS are not supported: give the dimensions in "
                   "*BEAM SECTION.")  # fmt: skip

    def _refuse(self, card: Card, roles: set[str], types: set[str]) -> NoReturn:
        kinds = ", ".join(sorted(types))
        around = any(kind.startswith(("CAX", "CGAX", "SAX")) for kind in types)
        card.needs(not around, f"the elements {kinds} are axisymmetric, which is not supported; "
                   "model the part, or a sector between planes of symmetry, by "
                   "solids.")  # fmt: skip
        card.needs(len(roles) <= 1, f"one section for {' and '.join(sorted(roles))} elements "
                   f"({kinds}); give each kind its own.")  # fmt: skip
        raise card.place.error(
            f"*{card.keyword} for elements ({kinds}) that carry no forces in this way; give them "
            "as stress elements (of solids C3D…, shells S…, beams B…, trusses T…)."
        )

    def _material(self, name: str, place: Place) -> Material:
        message = f"there is no material {name!r} (*MATERIAL, NAME=)."
        return place.found(self.materials, name.upper(), message)

    def _isotropic(self, card: Card, what: str) -> Json:
        material = self._material(card.needed("MATERIAL"), card.place)
        return self.builder.isotropic(material, what)

    def _solid(self, card: Card) -> tuple[str, Json]:
        material = self._material(card.needed("MATERIAL"), card.place)
        stiffness = self.builder.anisotropic(material)
        if stiffness is None:
            return "Solid", self._isotropic(card, "solids")
        arguments: Json = {"stiffness": stiffness, "rho": self.builder.rho(material)}
        if card.option("ORIENTATION"):
            arguments["axes"] = self.orientations.frame(card)[:2].tolist()
        else:
            card.refuse_turned()
        return "AnisotropicSolid", arguments

    def _plane(self, card: Card, roles: set[str]) -> tuple[str, Json]:
        if len(roles) > 1:
            self._refuse(card, roles, set())
        thickness = _positive(card, "thickness") * self.builder.units.length
        plane = {"plane": min(roles).removeprefix("plane "), "thickness": thickness}
        return "Solid", {**self._isotropic(card, "solids"), **plane}

    def _shells(self, card: Card, name: str, elements: IntArray) -> None:
        word = card.option("OFFSET").upper()
        share = OFFSETS[word] if word in OFFSETS else real_number(word, card.place)
        rows = card.rows()
        if "COMPOSITE" not in card.options:
            material = self._material(card.needed("MATERIAL"), card.place)
            thickness = card.first().real(0)
            if material.constants is None or material.isotropic is not None:
                elastic = self.builder.isotropic(material, "shells")
                for value, some in self._by_thickness(elements, thickness):
                    arguments = {**elastic, "thickness": value * self.builder.units.length}
                    label = f"{name} of thickness {value:g}" if len(self.thickness) else name
                    family = Family("Shell", arguments, card.place)
                    self.builder.add_shells(label, some, family, -share * value)
                return
            rows = [Row(f"{thickness!r},,{material.name},0", card, card.place)]
        layers, axes = self._laminate(card, elements, rows)
        thickness = sum(layer["thickness"] for layer in layers) / self.builder.units.length
        family = Family("Laminate", {"layers": layers}, card.place)
        self.builder.add_shells(name, elements, family, -share * thickness, axes)
        nodes = self.whole.deck.nodes_of(elements)
        if len(self.thickness) and np.isfinite(self.thickness[nodes]).any():
            self.builder.tell_once(f"*NODAL THICKNESS of layers, which have theirs ({card.place})")

    def _stiffnesses(self, card: Card) -> Json:
        """Of the forces and moments of (ε11, ε22, γ12, κ11, κ22, κ12), in columns to the diagonal.

        The stiffness against transverse shear is that which Abaqus takes where none is given
        (User's Guide, "Shell section behavior").
        """
        values, units = card.numbers(), self.builder.units
        card.needs(len(values) >= 21, "*SHELL GENERAL SECTION needs MATERIAL=, COMPOSITE or 21 "
                   f"stiffnesses; it has {len(values)} numbers.")  # fmt: skip
        card.needs(not card.option("OFFSET"), "OFFSET= is not supported where *SHELL GENERAL "
                   "SECTION has stiffnesses: they are those about the nodes.")  # fmt: skip
        whole = symmetric(np.array(values[:21]))
        scale = np.sqrt(np.maximum(np.diag(whole), np.finfo(float).tiny))
        sound = np.linalg.eigvalsh(whole / np.outer(scale, scale)).min() > 0
        card.needs(sound, "the stiffness of *SHELL GENERAL SECTION is not positive definite.")
        A, B, D = whole[:3, :3], whole[:3, 3:], whole[3:, 3:]
        shear = (A[0, 0] + A[1, 1]) / 6 + A[2, 2] / 3
        t = math.sqrt(12 * np.trace(D) / np.trace(A)) * units.length
        per_area = card.option("DENSITY")
        density = self.builder.density
        card.needs(
            per_area or density,
            "*SHELL GENERAL SECTION has no density (DENSITY=, per area), without which nothing can"
            " be struck; give it, or density= in kg/m³.",
        )
        mass = (density or 0.0) * t
        if per_area:
            mass = real_number(per_area, card.place) * units.density * units.length
        line = units.force / units.length
        return {
            **{"A": (A * line).tolist(), "B": (B * units.force).tolist()},
            **{"D": (D * units.force * units.length).tolist()},
            **{"S": (shear * line * np.eye(2)).tolist(), "thickness": t},
            **{"mass": mass, "inertia": mass * t**2 / 12},
        }

    def _zero(self, card: Card, elements: IntArray, steep: float = STEEP) -> Array:
        """The direction of 0° in each element, of ORIENTATION= or x; z where x is the normal."""
        name = card.option("ORIENTATION")
        if name:
            return self._directions(name, card, elements, card.place)
        card.refuse_turned()
        normals = geometry.normals_of(self.whole.deck, elements)
        across = np.abs(normals[:, :1]) > math.cos(math.radians(steep))
        return np.where(across, np.eye(3)[2], np.eye(3)[0])

    def _by_thickness(self, elements: IntArray, given: float) -> Iterator[tuple[float, IntArray]]:
        """(mean of *NODAL THICKNESS, elements), whether or not the section says so (CalculiX)."""
        if not len(self.thickness):
            yield given, elements
            return
        thickness = np.zeros(len(elements))
        for block, mine in self.whole.deck.blocks_of(elements):
            nodes = np.hstack([block.corners, block.mids])
            values = np.where(nodes >= 0, self.thickness[nodes], np.nan)
            values = np.where(np.isfinite(values), values, given)
            self.varying += int((np.ptp(values, axis=1) > 1e-9 * values.max(axis=1)).sum())
            thickness[mine] = np.round(values[:, : block.corners.shape[1]].mean(axis=1), 12)
        for value in np.unique(thickness):
            yield float(value), elements[thickness == value]

    def _laminate(
        self, card: Card, elements: IntArray, rows: list[Row]
    ) -> tuple[list[dict[str, float]], Array]:
        """(arguments of the layers, the direction of 0° in each element)."""
        normals = geometry.normals_of(self.whole.deck, elements)
        words = [(row.word(2) or card.option("MATERIAL"), row.place) for row in rows]
        materials = [self._material(*word) for word in words]
        known = [row for row in rows if self.orientations.find(row.word(3), card)]
        name = card.option("ORIENTATION") or (known[0].word(3) if known else "")
        if name and not card.option("ORIENTATION"):
            axis = self._directions(name, card, elements, card.place)
        else:
            alike = all(one.isotropic is not None for one in materials)
            axis = self._zero(card, elements, 45.0 if alike else STEEP)
        layers: list[dict[str, float]] = []
        for row, material in zip(rows, materials, strict=True):
            angle = row.real(3) if row not in known else 0.0
            if row in known:
                directions = self._directions(row.word(3), card, elements, row.place)
                angle = _turned(axis, directions, normals, row.place)
            layers.append(self.builder.layer(material, row.real(0), angle))
            solid = material.constants is not None and np.isfinite(material.constants).all()
            around = any(self.orientations.cylindrical(n, card) for n in (name, row.word(3)))
            if around and solid and material.isotropic is None:
                message = (
                    f"the directions of the cylindrical *ORIENTATION ({card.place}) as CalculiX"
                )
                message += (
                    " has them: 1 along the radius; on shells 1 is around the axis, as Abaqus"
                )
                self.builder.tell_once(f"{message} has it")
        return layers, axis

    def _directions(self, name: str, card: Card, elements: IntArray, place: Place) -> Array:
        """Direction 1 of an *ORIENTATION in each element; 2 where 1 is the normal of a shell."""
        deck = self.whole.deck
        centres = np.array([x.mean(axis=0) for x in geometry.corners_of(deck, elements)])
        frames = self.orientations.at(name, card, centres, place)
        first = frames[:, 0]
        if self.orientations.cylindrical(name, card):
            normals = geometry.normals_of(deck, elements)
            is_normal = np.linalg.norm(np.cross(first, normals), axis=1) < NORMAL
            first = np.where(is_normal[:, None], frames[:, 1], first)
            first -= np.einsum("ni,ni->n", first, normals)[:, None] * normals
            first = geometry.turned(first, normals, self.orientations.degrees(name, card))
        return first

    def _beam(self, card: Card, elements: IntArray) -> tuple[str, Json]:
        arguments = self._isotropic(card, "beams")
        profile = profile_of(card)
        if card.option("SECTION").upper().startswith("CIRC") and len(card.first().fields) == 1:
            message = "the one number of SECTION=CIRC is taken for the radius, as Abaqus does; "
            message += "CalculiX means the diameter: give it twice there."
            self.whole.deck.told.append(f"{card.place}: {message}")
        first = np.array([0.0, 0.0, -1.0])
        shares = [real_number(card.option(k, "0"), card.place) for k in ("OFFSET1", "OFFSET2")]
        rows = card.rows()
        if len(rows) > 1:
            first = card.within.turn @ rows[1].reals(3)
        elif profile.I_side != profile.I or any(shares):
            card.refuse_turned()
        offset = shares[0] * profile.height
        card.needs(not all(shares), "a beam off its nodes in both directions is not supported.")
        if shares[1]:
            tangents = geometry.tangents_of(self.whole.deck, elements)
            tangent = geometry.common_direction(tangents, least=1 - 1e-9)
            if tangent is None:
                message = "OFFSET2 is read for beams in one direction only; give each direction a"
                raise card.place.error(f"{message} section of its own.")
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
    apart = np.abs((degrees - degrees[0] + 90) % 180 - 90).max() > SAME_ANGLE
    place.needs(not apart, "the *ORIENTATION of this layer turns against that of the section, or "
                "of the first layer, from element to element; give the layers angles "
                "instead.")  # fmt: skip
    return float(degrees[0])


def _positive(card: Card, what: str) -> float:
    """The thickness or the area in the first line, 1 where it is left out."""
    value = card.first().real(0, 1.0)
    card.first().needs(value > 0, f"the {what} must be above 0; it is {value:g}.")
    return value
