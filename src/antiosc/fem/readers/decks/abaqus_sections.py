"""Materials and sections of Abaqus and CalculiX decks."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from antiosc.errors import MeshError
from antiosc.fem.readers.decks import profiles
from antiosc.fem.readers.decks.abaqus_assembly import Instance, Whole
from antiosc.fem.readers.decks.abaqus_cards import Card
from antiosc.fem.readers.decks.abaqus_elements import element_type
from antiosc.fem.readers.decks.deck import Array, IntArray, Place, real_number
from antiosc.fem.readers.decks.geometry import common_direction, normals_of, tangents_of
from antiosc.fem.readers.decks.material import Material, isotropic, of_stiffness
from antiosc.fem.readers.decks.model import Family, ModelBuilder

#: Kinds of *ELASTIC without their last letters, and how many constants each has.
ELASTIC_CONSTANTS = {"ISO": 2, "ENGINEERINGCONSTANTS": 9, "LAMINA": 6, "ORTHO": 9}
SECTIONS = (
    *("SOLIDSECTION", "SHELLSECTION", "BEAMSECTION", "BEAMGENERALSECTION"),
    "SHELLGENERALSECTION",
)
#: Cards of a material that say nothing of linear elasticity.
NONLINEAR = ("PLASTIC", "CREEP", "HYPERFOAM", "VISCO", "CYCLICHARDENING", "DEFORMATIONPLASTICITY")


def materials_of(cards: list[Card]) -> tuple[dict[str, Material], list[str]]:
    """(materials by name in upper case, what is ignored of them)."""
    found: dict[str, Material] = {}
    ignored: list[str] = []
    current: Material | None = None
    for card in cards:
        if card.keyword == "MATERIAL":
            name = card.needed("NAME")
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
            values = _first(card)
            current.density = values[0] if values else None
        elif card.keyword in NONLINEAR:
            ignored.append(f"*{card.keyword} ({card.place})")
    return found, ignored


def _first(card: Card) -> list[float]:
    """Numbers of the first data line."""
    for fields, place in card.rows():
        return [real_number(field, place) if field else 0.0 for field in fields]
    return []


def _every(card: Card) -> list[float]:
    return [real_number(f, place) if f else 0.0 for fields, place in card.rows() for f in fields]


def _kind(card: Card) -> str:
    kind = "".join(card.option("TYPE", "ISO").split()).upper()
    return "ISO" if kind.startswith("ISO") else "ORTHO" if kind.startswith("ORTHO") else kind


def _anisotropic(card: Card) -> Array:
    """21 constants: the upper triangle, column by column, in the order 11, 22, 33, 12, 13, 23."""
    values = _every(card)
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
    values = _every(card) if kind != "ISO" else _first(card)
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


class Sections:
    """Adds the sections of a deck to a builder."""

    def __init__(self, whole: Whole, builder: ModelBuilder, materials: dict[str, Material]) -> None:
        self.whole = whole
        self.builder = builder
        self.materials = materials
        self.orientations = {
            card.needed("NAME").upper(): card
            for card, _ in whole.cards
            if card.keyword == "ORIENTATION"
        }
        self.roles = [
            known.role if (known := element_type(block.type)) else "other"
            for block in whole.deck.blocks
        ]

    def read(self, card: Card, within: Instance) -> None:
        """One section card."""
        elements = self.whole.elements(card.needed("ELSET"), card.place, within)
        if not len(elements):
            return  # of springs, masses, or of a set that is empty
        name = self._name(card, within)
        match card.keyword:
            case "SOLIDSECTION":
                self._solid(card, name, elements)
            case "SHELLSECTION":
                self._shell(card, name, elements)
            case "BEAMSECTION" | "BEAMGENERALSECTION":
                self._beam(card, name, elements)
            case _:
                raise MeshError(f"{card.place}: *{card.keyword} is not supported.")

    def _name(self, card: Card, within: Instance) -> str:
        spelled = within.scope.spelling.get(card.option("ELSET").upper(), card.option("ELSET"))
        return f"{within.name}.{spelled}" if within.name else spelled

    def _material(self, name: str, place: Place) -> Material:
        if name.upper() not in self.materials:
            raise MeshError(f"{place}: there is no material {name!r} (*MATERIAL, NAME=).")
        return self.materials[name.upper()]

    def _role(self, elements: IntArray) -> set[str]:
        starts = np.cumsum([0, *map(len, self.whole.deck.blocks)])
        return {self.roles[k] for k in np.searchsorted(starts, elements, side="right") - 1}

    def _solid(self, card: Card, name: str, elements: IntArray) -> None:
        arguments: dict[str, Any]
        material = self._material(card.needed("MATERIAL"), card.place)
        roles = self._role(elements)
        stiffness = self.builder.anisotropic(material)
        if stiffness is not None and roles == {"solid"}:
            arguments = {"stiffness": stiffness, "rho": self.builder.rho(material)}
            if card.option("ORIENTATION"):
                x, normal = self._frame(card.option("ORIENTATION"), card.place)
                arguments["axes"] = [x.tolist(), np.cross(normal, x).tolist()]
            self.builder.add(name, elements, Family("AnisotropicSolid", arguments, card.place))
            return
        E, nu = self.builder.elastic(material, "solids")
        arguments = {"E": E, "nu": nu, "rho": self.builder.rho(material)}
        if roles & {"plane stress", "plane strain"}:
            if len(roles) > 1:
                raise MeshError(
                    f"{card.place}: one section for {' and '.join(sorted(roles))} elements; give "
                    "each kind its own."
                )
            thickness = (_first(card) or [1.0])[0] or 1.0
            arguments["plane"] = roles.pop().removeprefix("plane ")
            arguments["thickness"] = thickness * self.builder.units.length
        elif roles == {"rod"}:
            self._rods(card, elements, E, arguments["rho"])
            return
        elif roles != {"solid"}:
            self._refuse_roles(card, roles)
        self.builder.add(name, elements, Family("Solid", arguments, card.place))

    def _rods(self, card: Card, elements: IntArray, E: float, rho: float) -> None:
        """T3D2, with their area in the first line."""
        area = (_first(card) or [1.0])[0] or 1.0
        units = self.builder.units
        self.builder.rods.add(
            elements, E / units.stress * area, 0.0, rho / units.density * area, card.place
        )

    def _refuse_roles(self, card: Card, roles: set[str]) -> None:
        kinds = sorted(
            {b.type for b, r in zip(self.whole.deck.blocks, self.roles, strict=True) if r in roles}
        )
        if any(kind.startswith(("CAX", "CGAX", "SAX")) for kind in kinds):
            raise MeshError(
                f"{card.place}: the elements {', '.join(kinds)} are axisymmetric, which is not "
                "supported; model the part, or a sector between planes of symmetry, by solids."
            )
        raise MeshError(
            f"{card.place}: *{card.keyword} for elements ({', '.join(kinds)}) that no element "
            "family here carries in this way."
        )

    def _shell(self, card: Card, name: str, elements: IntArray) -> None:
        if self._role(elements) != {"shell"}:
            self._refuse_roles(card, self._role(elements))
        if "COMPOSITE" in card.options:
            layers = [(f, p) for f, p in card.rows() if f]
            self._laminate(card, name, elements, layers)
            return
        material = self._material(card.needed("MATERIAL"), card.place)
        thickness = (_first(card) or [0.0])[0]
        if material.constants is not None and material.isotropic is None:
            row = [repr(thickness), "", material.name, "0"]
            self._laminate(card, name, elements, [(row, card.place)])
            return
        E, nu = self.builder.elastic(material, "shells")
        arguments = {
            "E": E,
            "nu": nu,
            "rho": self.builder.rho(material),
            "thickness": thickness * self.builder.units.length,
            **self._offset(card, elements, thickness),
        }
        self.builder.add(name, elements, Family("Shell", arguments, card.place))

    def _offset(self, card: Card, elements: IntArray, thickness: float) -> dict[str, float]:
        """OFFSET=, the share of the thickness from the middle surface to the nodes."""
        word = card.option("OFFSET", "0").upper() or "0"
        known = {"MIDDLE": 0.0, "SPOS": 0.5, "SNEG": -0.5}
        share = known[word] if word in known else real_number(word, card.place)
        if not share:
            return {}
        if common_direction(normals_of(self.whole.deck, elements), least=1 - 1e-6) is None:
            self.whole.deck.told.append(
                f"{card.place}: the area of a curved shell with OFFSET={word} is that at its nodes."
            )
        return {"offset": -share * thickness * self.builder.units.length}

    def vary(self, cards: list[tuple[Card, Instance]]) -> str:
        """Thicknesses by *NODAL THICKNESS, the mean of each element; a sentence if they vary.

        CalculiX takes them whether or not the section says so.
        """
        count = len(self.whole.deck.points)
        at_node = np.full(count, np.nan)
        first: Card | None = None
        for card, within in cards:
            if card.keyword != "NODALTHICKNESS":
                continue
            first = first or card
            for fields, place in card.rows():
                if len(fields) > 1:
                    nodes = self.whole.nodes(fields[0], place, within)
                    at_node[nodes] = real_number(fields[1], place)
        if first is None:
            return ""
        varying, start = 0, 0
        for block, role in zip(self.whole.deck.blocks, self.roles, strict=True):
            own = np.arange(start, start + len(block))
            start += len(block)
            if role != "shell":
                continue
            values = at_node[np.hstack([block.corners, np.maximum(block.mids, 0)])]
            values = np.where(
                np.hstack([block.corners >= 0, block.mids >= 0]) & np.isfinite(values),
                values,
                self._own_thickness(own)[:, None],
            )
            varying += int((np.ptp(values, axis=1) > 1e-9 * values.max(axis=1)).sum())
            self._thin(own, values[:, : block.corners.shape[1]].mean(axis=1), first.place)
        if not varying:
            return ""
        return (
            f"the variation of the thickness within {varying} elements (*NODAL THICKNESS, "
            f"{first.place}), the mean of the corners is taken in each"
        )

    def _own_thickness(self, elements: IntArray) -> Array:
        """That of the sections, in the deck's units."""
        length = self.builder.units.length
        families = [
            one.arguments.get("thickness", np.nan) / length for one in self.builder.families
        ]
        number = self.builder.of_element[elements]
        return np.where(number >= 0, np.array([*families, np.nan])[number], np.nan)

    def _thin(self, elements: IntArray, thickness: Array, place: Place) -> None:
        """Give elements thicknesses of their own."""
        builder = self.builder
        numbers = builder.of_element[elements]
        for number in np.unique(numbers[numbers >= 0]):
            family, name = builder.families[number], builder.names[number]
            if family.kind != "Shell":
                raise MeshError(f"{place}: *NODAL THICKNESS is read for isotropic shells only.")
            mine = numbers == number
            for value in np.unique(np.round(thickness[mine], 12)):
                some = elements[mine & (np.round(thickness, 12) == value)]
                own = {**family.arguments, "thickness": float(value) * builder.units.length}
                if "offset" in own:
                    own["offset"] *= own["thickness"] / family.arguments["thickness"]
                label = f"{name} of thickness {value:g}"
                builder.add(label, some, Family("Shell", own, family.place))

    def _laminate(
        self, card: Card, name: str, elements: IntArray, rows: list[tuple[list[str], Place]]
    ) -> None:
        normals = normals_of(self.whole.deck, elements)
        top = common_direction(normals)
        length = self.builder.units.length
        axis = np.array([1.0, 0.0, 0.0])
        if card.option("ORIENTATION"):
            axis = self._axis(card.option("ORIENTATION"), card.place)
        elif top is not None and abs(top[0]) > math.cos(math.radians(0.1)):
            axis = np.array([0.0, 0.0, 1.0])
        layers: list[dict[str, float]] = []
        for fields, place in rows:
            fields = [*fields, "", "", "", ""]
            material = self._material(fields[2] or card.option("MATERIAL"), place)
            angle = self._angle(fields[3], axis, top, place)
            layers.append(self.builder.layer(material, real_number(fields[0], place), angle))
        arguments = {
            "layers": layers,
            "axis": axis.tolist(),
            "top": None if top is None else top.tolist(),
            **self._offset(card, elements, sum(one["thickness"] for one in layers) / length),
        }
        self.builder.add(name, elements, Family("Laminate", arguments, card.place))

    def _angle(self, word: str, axis: Array, top: Array | None, place: Place) -> float:
        """Degrees from the axis of the stack to direction 1 of a layer."""
        if not word:
            return 0.0
        if word.upper() not in self.orientations:
            return real_number(word, place)
        own = self._axis(word, place)
        if top is None:
            raise MeshError(
                f"{place}: layers with an *ORIENTATION of their own need a flat shell; give "
                "angles instead."
            )
        flat = [v - (v @ top) * top for v in (axis, own)]
        return math.degrees(math.atan2(np.cross(flat[0], flat[1]) @ top, flat[0] @ flat[1]))

    def _axis(self, name: str, place: Place) -> Array:
        """Direction 1 of an *ORIENTATION."""
        return self._frame(name, place)[0]

    def _frame(self, name: str, place: Place) -> tuple[Array, Array]:
        """Directions 1 and 3 of an *ORIENTATION."""
        card = self.orientations.get(name.upper())
        if card is None:
            raise MeshError(f"{place}: there is no orientation {name!r} (*ORIENTATION, NAME=).")
        system = card.option("SYSTEM", "RECTANGULAR").upper()
        rows = [(f, p) for f, p in card.rows() if f]
        if not system.startswith("R") or not rows or "DEFINITION" in card.options:
            raise MeshError(
                f"{card.place}: *ORIENTATION is read as RECTANGULAR, by two points, only."
            )
        values = [real_number(f, rows[0][1]) if f else 0.0 for f in (*rows[0][0], *"000000")][:6]
        a, b = np.array(values[:3]), np.array(values[3:])
        normal = np.cross(a, b)
        if not normal.any():
            raise MeshError(f"{card.place}: the two points of *ORIENTATION give no plane.")
        if len(rows) > 1:
            about, angle, *_ = [*rows[1][0], "0", "0"]
            degrees = real_number(angle or "0", rows[1][1])
            if degrees and about.strip() != "3":
                raise MeshError(f"{rows[1][1]}: *ORIENTATION is read with a rotation about 3 only.")
            across = np.cross(normal / np.linalg.norm(normal), a)
            a = math.cos(math.radians(degrees)) * a + math.sin(math.radians(degrees)) * across
        return np.asarray(a / np.linalg.norm(a)), np.asarray(normal / np.linalg.norm(normal))

    def _beam(self, card: Card, name: str, elements: IntArray) -> None:
        if self._role(elements) != {"beam"}:
            self._refuse_roles(card, self._role(elements))
        material = self._material(card.needed("MATERIAL"), card.place)
        E, nu = self.builder.elastic(material, "beams")
        rows = list(card.rows())
        profile = _profile(card)
        if card.option("SECTION").upper().startswith("CIRC") and len(_first(card)) == 1:
            self.whole.deck.told.append(
                f"{card.place}: the one number of SECTION=CIRC is taken for the radius, as Abaqus "
                "does; CalculiX means the diameter: give it twice there."
            )
        first = np.array([0.0, 0.0, -1.0])
        if len(rows) > 1 and rows[1][0]:
            values = [real_number(f, rows[1][1]) if f else 0.0 for f in (*rows[1][0], "0", "0")]
            first = np.array(values[:3])
        shares = [real_number(card.option(k, "0"), card.place) for k in ("OFFSET1", "OFFSET2")]
        offset = shares[0] * profile.height
        if all(shares):
            raise MeshError(
                f"{card.place}: a beam off its nodes in both directions is not supported."
            )
        if shares[1]:
            tangent = common_direction(tangents_of(self.whole.deck, elements), least=1 - 1e-9)
            if tangent is None:
                raise MeshError(
                    f"{card.place}: OFFSET2 is read for beams in one direction only; give each "
                    "direction a section of its own."
                )
            offset = shares[1] * profile.width
            first, profile = np.cross(tangent, first), profile.rotated()
        length = self.builder.units.length
        section = {
            "A": profile.A * length**2,
            "I": profile.I * length**4,
            "I_side": profile.I_side * length**4,
            "J": profile.J * length**4,
            "shear": profile.shear,
        }
        arguments = {
            "E": E,
            "nu": nu,
            "rho": self.builder.rho(material),
            "section": section,
            "orientation": first.tolist(),
            "offset": offset * length,
        }
        self.builder.add(name, elements, Family("Beam", arguments, card.place))


def _profile(card: Card) -> profiles.Profile:
    kind = card.option("SECTION", "RECT").upper()
    d = _first(card)
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
