"""Sections of Abaqus and CalculiX decks: solids, rods, shells with *NODAL THICKNESS, and beams."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from antiosc.io.deck import Array, Deck, IntArray, Place, real_number
from antiosc_decks.abaqus.assembly import Instance, Whole
from antiosc_decks.abaqus.cards import Card
from antiosc_decks.abaqus.elements import element_type
from antiosc_decks.abaqus.properties import Orientations, profile_of
from antiosc_decks.model.builder import Family, ModelBuilder, Rod
from antiosc_decks.model.geometry import (
    common_direction,
    corners_of,
    everywhere,
    normals_of,
    side_of,
    tangents_of,
    top_of,
)
from antiosc_decks.model.properties import Material

#: Sine of the angle below which a direction is normal to a shell.
NORMAL = 0.05
SECTION_CARDS = ("SOLIDSECTION", "SHELLSECTION", "BEAMSECTION", "BEAMGENERALSECTION")


def roles_of(deck: Deck) -> list[str]:
    """What the blocks of a deck are."""
    return [known.role if (known := element_type(b.type)) else "other" for b in deck.blocks]


class Sections:
    """Adds the sections of a deck to a builder."""

    def __init__(self, whole: Whole, builder: ModelBuilder, materials: dict[str, Material]) -> None:
        self.whole = whole
        self.builder = builder
        self.materials = materials
        self.orientations = Orientations(whole.cards)
        self.roles = roles_of(whole.deck)

    def read(self, card: Card, within: Instance) -> None:
        """One section card."""
        elements = self.whole.elements(card.needed("ELSET"), card.place, within)
        if not len(elements):
            return  # of springs, masses, or of a set that is empty
        name = self._name(card, within)
        match card.keyword:
            case "SOLIDSECTION":
                self._solid(card, name, elements, within)
            case "SHELLSECTION":
                self._shell(card, name, elements, within)
            case _:
                self._beam(card, name, elements, within)

    def _name(self, card: Card, within: Instance) -> str:
        spelled = within.scope.spelling.get(card.option("ELSET").upper(), card.option("ELSET"))
        return f"{within.name}.{spelled}" if within.name else spelled

    def _material(self, name: str, place: Place) -> Material:
        if name.upper() not in self.materials:
            raise place.error(f"there is no material {name!r} (*MATERIAL, NAME=).")
        return self.materials[name.upper()]

    def _role(self, elements: IntArray) -> set[str]:
        starts = np.cumsum([0, *map(len, self.whole.deck.blocks)])
        return {self.roles[k] for k in np.searchsorted(starts, elements, side="right") - 1}

    def _solid(self, card: Card, name: str, elements: IntArray, within: Instance) -> None:
        arguments: dict[str, Any]
        material = self._material(card.needed("MATERIAL"), card.place)
        roles = self._role(elements)
        stiffness = self.builder.anisotropic(material)
        if stiffness is not None and roles == {"solid"}:
            arguments = {"stiffness": stiffness, "rho": self.builder.rho(material)}
            if card.option("ORIENTATION"):
                x, normal = self.orientations.frame(card.option("ORIENTATION"), card.place, within)
                arguments["axes"] = [x.tolist(), np.cross(normal, x).tolist()]
            else:
                within.refuse_turned(card)
            self.builder.add(name, elements, Family("AnisotropicSolid", arguments, card.place))
            return
        E, nu = self.builder.elastic(material, "solids")
        arguments = {"E": E, "nu": nu, "rho": self.builder.rho(material)}
        if roles & {"plane stress", "plane strain"}:
            if len(roles) > 1:
                raise card.place.error(
                    f"one section for {' and '.join(sorted(roles))} elements; give "
                    "each kind its own."
                )
            thickness = _first(card, "thickness")
            arguments["plane"] = roles.pop().removeprefix("plane ")
            arguments["thickness"] = thickness * self.builder.units.length
        elif roles == {"rod"}:
            self._rods(card, elements, arguments)
            return
        elif roles != {"solid"}:
            self._refuse_roles(card, roles)
        self.builder.add(name, elements, Family("Solid", arguments, card.place))

    def _rods(self, card: Card, elements: IntArray, material: dict[str, Any]) -> None:
        """T2D2 and T3D2, with their area in the first line."""
        area = _first(card, "area of rods")
        units = self.builder.units
        E, mass = material["E"] / units.stress, material["rho"] / units.density * area
        self.builder.add_rods(elements, Rod(E, material["nu"], area, 0.0, mass, card.place))

    def _refuse_roles(self, card: Card, roles: set[str]) -> None:
        kinds = sorted(
            {b.type for b, r in zip(self.whole.deck.blocks, self.roles, strict=True) if r in roles}
        )
        if any(kind.startswith(("CAX", "CGAX", "SAX")) for kind in kinds):
            raise card.place.error(
                f"the elements {', '.join(kinds)} are axisymmetric, which is not "
                "supported; model the part, or a sector between planes of symmetry, by solids."
            )
        raise card.place.error(
            f"*{card.keyword} for elements ({', '.join(kinds)}) that no element "
            "family here carries in this way."
        )

    def _shell(self, card: Card, name: str, elements: IntArray, within: Instance) -> None:
        roles = self._role(elements)
        if roles <= {"plane stress", "plane strain"} and "COMPOSITE" not in card.options:
            self._solid(card, name, elements, within)  # a thickness means the same there
            return
        if roles != {"shell"}:
            self._refuse_roles(card, roles)
        if "COMPOSITE" in card.options:
            layers = [(f, p) for f, p in card.rows() if f]
            self._laminate(card, name, elements, layers, within)
            return
        material = self._material(card.needed("MATERIAL"), card.place)
        thickness = (card.first_numbers() or [0.0])[0]
        if material.constants is not None and material.isotropic is None:
            row = [repr(thickness), "", material.name, "0"]
            self._laminate(card, name, elements, [(row, card.place)], within)
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

    def _offset(self, card: Card, elements: IntArray, thickness: float) -> dict[str, Any]:
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
        length = self.builder.units.length
        side = side_of(self.whole.deck, elements, length)
        return {"offset": -share * thickness * length, **side}

    def _laminate(
        self,
        card: Card,
        name: str,
        elements: IntArray,
        rows: list[tuple[list[str], Place]],
        within: Instance,
    ) -> None:
        normals = normals_of(self.whole.deck, elements)
        top = common_direction(normals)
        length = self.builder.units.length
        axis: Any = np.array([1.0, 0.0, 0.0])
        if card.option("ORIENTATION"):
            axis = self._direction(card.option("ORIENTATION"), card.place, within, elements)
        else:
            within.refuse_turned(card)
            if top is not None and abs(top[0]) > math.cos(math.radians(0.1)):
                axis = np.array([0.0, 0.0, 1.0])
        layers: list[dict[str, float]] = []
        for fields, place in rows:
            fields = [*fields, "", "", "", ""]
            material = self._material(fields[2] or card.option("MATERIAL"), place)
            angle = self._angle(fields[3], axis, top, place, within)
            layers.append(self.builder.layer(material, real_number(fields[0], place), angle))
            solid = material.constants is not None and np.isfinite(material.constants).all()
            if isinstance(axis, dict) and solid and material.isotropic is None:
                self.builder.tell_once(
                    f"the directions of the cylindrical *ORIENTATION ({card.place}) as CalculiX "
                    "has them: 1 along the radius; on shells 1 is around the axis, as Abaqus has it"
                )
        arguments = {
            "layers": layers,
            "axis": axis if isinstance(axis, dict) else axis.tolist(),
            **self._offset(card, elements, sum(one["thickness"] for one in layers) / length),
            "top": top_of(self.whole.deck, elements, length),
        }
        self.builder.add(name, elements, Family("Laminate", arguments, card.place))

    def _direction(self, name: str, place: Place, within: Instance, elements: IntArray) -> Any:
        """Direction 1 of an *ORIENTATION: one, or about the axis of a cylinder one in each element.

        Where it is the normal of a shell, it is direction 2.
        """
        around = self.orientations.cylinder(name, place, within)
        if around is None:
            return self.orientations.axis(name, place, within)
        origin, along, degrees = around
        deck = self.whole.deck
        normals = normals_of(deck, elements)
        out = np.array([x.mean(axis=0) for x in corners_of(deck, elements)]) - origin
        out -= (out @ along)[:, None] * along
        out /= np.maximum(np.linalg.norm(out, axis=1, keepdims=True), np.finfo(float).tiny)
        hoop = np.cross(along, out)
        is_normal = np.linalg.norm(np.cross(out, normals), axis=1) < NORMAL
        first = np.where(is_normal[:, None], hoop, out)
        first -= np.einsum("ni,ni->n", first, normals)[:, None] * normals
        angle = math.radians(degrees)
        first = math.cos(angle) * first + math.sin(angle) * np.cross(normals, first)
        return everywhere(deck, elements, first, self.builder.units.length)

    def _angle(
        self, word: str, axis: Any, top: Array | None, place: Place, within: Instance
    ) -> float:
        """Degrees from the axis of the stack to direction 1 of a layer."""
        if not word:
            return 0.0
        if self.orientations.find(word, within) is None:
            return real_number(word, place)
        own = self.orientations.axis(word, place, within)
        if top is None or isinstance(axis, dict):
            raise place.error(
                "layers with an *ORIENTATION of their own need a flat shell; give angles instead."
            )
        flat = [v - (v @ top) * top for v in (axis, own)]
        return math.degrees(math.atan2(np.cross(flat[0], flat[1]) @ top, flat[0] @ flat[1]))

    def _beam(self, card: Card, name: str, elements: IntArray, within: Instance) -> None:
        if self._role(elements) != {"beam"}:
            self._refuse_roles(card, self._role(elements))
        material = self._material(card.needed("MATERIAL"), card.place)
        E, nu = self.builder.elastic(material, "beams")
        rows = list(card.rows())
        profile = profile_of(card)
        if card.option("SECTION").upper().startswith("CIRC") and len(card.first_numbers()) == 1:
            self.whole.deck.told.append(
                f"{card.place}: the one number of SECTION=CIRC is taken for the radius, as Abaqus "
                "does; CalculiX means the diameter: give it twice there."
            )
        first = np.array([0.0, 0.0, -1.0])
        if len(rows) > 1 and rows[1][0]:
            values = [real_number(f, rows[1][1]) if f else 0.0 for f in (*rows[1][0], "0", "0")]
            first = within.turn @ values[:3]
        elif profile.I_side != profile.I or any(card.option(k) for k in ("OFFSET1", "OFFSET2")):
            within.refuse_turned(card)
        shares = [real_number(card.option(k, "0"), card.place) for k in ("OFFSET1", "OFFSET2")]
        offset = shares[0] * profile.height
        if all(shares):
            raise card.place.error("a beam off its nodes in both directions is not supported.")
        if shares[1]:
            tangent = common_direction(tangents_of(self.whole.deck, elements), least=1 - 1e-9)
            if tangent is None:
                raise card.place.error(
                    "OFFSET2 is read for beams in one direction only; give each "
                    "direction a section of its own."
                )
            offset = shares[1] * profile.width
            first, profile = np.cross(tangent, first), profile.rotated()
        length = self.builder.units.length
        arguments = {
            "E": E,
            "nu": nu,
            "rho": self.builder.rho(material),
            "section": profile.section(length),
            "orientation": first.tolist(),
            "offset": offset * length,
        }
        self.builder.add(name, elements, Family("Beam", arguments, card.place))


def _first(card: Card, what: str) -> float:
    """The thickness or the area in the first line, 1 where it is left out."""
    fields, place = next(card.rows(), ([], card.place))
    value = real_number(fields[0], place) if fields and fields[0] else 1.0
    if value <= 0:
        raise place.error(f"the {what} must be above 0; it is {value:g}.")
    return value


def vary_thickness(whole: Whole, builder: ModelBuilder, roles: Sequence[str]) -> str:
    """Thicknesses by *NODAL THICKNESS, the mean of each element; a sentence if they vary.

    CalculiX takes them whether or not the section says so.
    """
    count = len(whole.deck.points)
    at_node = np.full(count, np.nan)
    first: Card | None = None
    for card, within in whole.named("NODALTHICKNESS"):
        first = first or card
        for fields, place in card.rows():
            if len(fields) > 1:
                nodes = whole.nodes(fields[0], place, within)
                at_node[nodes] = real_number(fields[1], place)
    if first is None:
        return ""
    varying, start = 0, 0
    for block, role in zip(whole.deck.blocks, roles, strict=True):
        own = np.arange(start, start + len(block))
        start += len(block)
        if role != "shell":
            continue
        values = at_node[np.hstack([block.corners, np.maximum(block.mids, 0)])]
        values = np.where(
            np.hstack([block.corners >= 0, block.mids >= 0]) & np.isfinite(values),
            values,
            _own_thickness(builder, own)[:, None],
        )
        varying += int((np.ptp(values, axis=1) > 1e-9 * values.max(axis=1)).sum())
        _thin(builder, own, values[:, : block.corners.shape[1]].mean(axis=1), first.place)
    if not varying:
        return ""
    return (
        f"the variation of the thickness within {varying} elements (*NODAL THICKNESS, "
        f"{first.place}), the mean of the corners is taken in each"
    )


def _own_thickness(builder: ModelBuilder, elements: IntArray) -> Array:
    """That of the sections, in the deck's units."""
    length = builder.units.length
    families = [one.arguments.get("thickness", np.nan) / length for one in builder.families]
    number = builder.of_element[elements]
    return np.where(number >= 0, np.array([*families, np.nan])[number], np.nan)


def _thin(builder: ModelBuilder, elements: IntArray, thickness: Array, place: Place) -> None:
    """Give elements thicknesses of their own."""
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
