"""Abaqus and CalculiX decks as whole models: sections, supports, masses, springs, dashpots.

The model and the supports of the first step are read. Unsupported cards that would change the
result raise an error with their line; loads, later steps and nonlinear materials are ignored and
listed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from antiosc.base.errors import MeshError
from antiosc.io.deck import Array, IntArray, Place, real_number, whole_number
from antiosc.io.unit_system import UnitSystem
from antiosc_decks.abaqus.assembly import Instance, Whole
from antiosc_decks.abaqus.cards import Card
from antiosc_decks.abaqus.joints import read_joints, refuse_own_follower
from antiosc_decks.abaqus.properties import Orientations, materials_of
from antiosc_decks.abaqus.sections import SECTION_CARDS, Sections, roles_of, vary_thickness
from antiosc_decks.model import copies
from antiosc_decks.model.builder import ModelBuilder
from antiosc_decks.model.constraints import Term
from antiosc_decks.model.finished import finished
from antiosc_decks.model.nonstructural import UNITS, add_mass, add_total

#: Cards of springs and dampers, and what they give.
LINKS = {"SPRING": "stiffness", "DASHPOT": "damping coefficient"}
#: Names of supports -> the motions (0 to 5) that they fix.
NAMED = {
    "ENCASTRE": (0, 1, 2, 3, 4, 5),
    "PINNED": (0, 1, 2),
    "XSYMM": (0, 4, 5),
    "YSYMM": (1, 3, 5),
    "ZSYMM": (2, 3, 4),
    "XASYMM": (1, 2, 3),
    "YASYMM": (0, 2, 4),
    "ZASYMM": (0, 1, 5),
}


def model_of(whole: Whole, units: UnitSystem, density: float | None) -> dict[str, Any]:
    """The deck's model in SI units; its groups and fixed nodes go into the deck."""
    first = whole.steps[0] if whole.steps else []
    whole.account.refuse()
    whole.deck.told += whole.account.unknown_options()
    materials, ignored = materials_of([card for card, _ in whole.cards])
    doubled = copies.separate(whole.deck, roles_of(whole.deck))
    builder = ModelBuilder(whole.deck, units, density, lumped=bool(whole.named("MASS")))
    sections = Sections(whole, builder, materials)
    for card, within in whole.named(*SECTION_CARDS):
        sections.read(card, within)
    varied = vary_thickness(whole, builder, sections.roles)
    _nonstructural(whole, builder)
    builder.with_roles(sections.roles)
    for block in whole.deck.blocks:
        if block.type.startswith("T2D2"):  # bars of the plane
            builder.fix(np.unique(block.corners), [2])
    supports = _Supports(whole, builder)
    top = whole.instances[""]
    both = [*whole.cards, *((card, top) for card in first)]
    for card, within in whole.named("BOUNDARY"):
        supports.read(card, within)
    own = [card for card in first if card.keyword == "BOUNDARY"]
    if any(card.option("OP").upper() == "NEW" for card in own):
        supports.start_anew()
    for card in own:
        supports.read(card, top)
    supports.apply()
    copies.join(builder, doubled)
    read_joints(whole, builder.joints, both)
    _distributing(whole, builder)
    _masses(whole, builder)
    _springs(whole, builder, sections.orientations)
    builder.ignored += [*ignored, *whole.account.ignored(), *supports.ignored]
    builder.ignored += filter(None, [varied])
    return finished(builder, sections.roles)


# --- Supports -------------------------------------------------------------------------------------


class _Supports:
    """*BOUNDARY, in the axes of the deck or of a *TRANSFORM."""

    def __init__(self, whole: Whole, builder: ModelBuilder) -> None:
        self.whole = whole
        self.builder = builder
        self.local = np.zeros((len(whole.deck.points), 6), dtype=bool)
        self.frames: dict[int, Array] = {}
        self.ignored: list[str] = []
        for card, within in whole.named("TRANSFORM"):
            self._transform(card, within)

    def read(self, card: Card, within: Instance) -> None:
        """Mark the motions that one card fixes."""
        within.refuse_turned(card)
        moved = other = False
        for fields, place in card.rows():
            if len(fields) < 2:
                raise place.error("*BOUNDARY names no motion from 1 to 6.")
            nodes = self.whole.nodes(fields[0], place, within)
            if not len(nodes):
                raise place.error(f"the set of nodes {fields[0]} has no nodes.")
            name = fields[1].upper()
            if name in NAMED:
                self._mark(nodes, NAMED[name])
                continue
            first = whole_number(fields[1], place)
            last = whole_number(fields[2], place) if len(fields) > 2 and fields[2] else first
            if min(first, last) > 6 or first == last == 0:  # temperatures, pressures, …
                other = True
                continue
            if not 1 <= first <= last <= 6:
                raise place.error(
                    f"*BOUNDARY fixes motions from {first} to {last}; they are counted from 1 to 6."
                )
            if len(fields) > 3 and fields[3]:
                moved |= real_number(fields[3], place) != 0
            self._mark(nodes, range(first - 1, last))
        if moved:
            self.ignored.append(f"the motion of *BOUNDARY ({card.place}), fixed instead")
        if other:
            self.ignored.append(f"what is no motion of *BOUNDARY ({card.place})")

    def start_anew(self) -> None:
        """Drop the supports of the model (OP=NEW in the first step)."""
        self.local[:] = False

    def _mark(self, nodes: IntArray, motions: Sequence[int]) -> None:
        self.local[nodes[:, None], np.array(motions, dtype=np.int64)] = True

    def _transform(self, card: Card, within: Instance) -> None:
        nodes = self.whole.nodes(card.needed("NSET"), card.place, within)
        values = card.numbers()[:6]
        kind = card.option("TYPE", "R").upper()[:1]
        if len(values) < 6 or kind not in "RC":
            raise card.place.error("*TRANSFORM needs six coordinates, TYPE=R or C.")
        shift = within.shift if kind == "C" else 0.0
        a, b = np.reshape(values, (2, 3)) @ within.turn.T + shift
        for node in nodes:
            if kind == "R":
                x, z = a, np.cross(a, b)
            else:
                z = b - a
                x = self.whole.deck.points[node] - a
                x = x - (x @ z) / (z @ z) * z if z.any() else x
            if not (np.linalg.norm(x) and np.linalg.norm(z)):
                raise card.place.error("*TRANSFORM gives no axes.")
            x, z = x / np.linalg.norm(x), z / np.linalg.norm(z)
            self.frames[int(node)] = np.stack([x, np.cross(z, x), z])

    def apply(self) -> None:
        """Give the builder the fixed motions, along the axes of the deck."""
        for node, frame in self.frames.items():
            for part in (slice(0, 3), slice(3, 6)):
                own = self.local[node, part]
                own[:] = self.builder.joints.fixed_along(node, own, frame, part.start)
            self.builder.joints.frames[node] = frame
        self.builder.fixed |= self.local


# --- Masses and springs ---------------------------------------------------------------------------


def _others(whole: Whole, card: Card, within: Instance) -> Iterator[tuple[str, list[int]]]:
    """(type, rows of nodes) of the elements in the set of a card that are not cells."""
    name = card.needed("ELSET").upper()
    labels = set(within.scope.other_sets.get(name, []))
    for instance in [within] if within.name else [within, *whole.instances.values()]:
        if instance is not within and labels:
            break
        labels |= set(instance.scope.other_sets.get(name, []))
    if not labels:
        whole.elements(name, card.place, within)  # of cells, or an error
    for kind, label, nodes in within.scope.others:
        if label in labels:
            rows = within.scope.nodes.rows(np.array(nodes, dtype=np.int64))
            if (rows < 0).any():
                raise card.place.error(
                    f"element {label} ({kind}) has a node that the deck does not define."
                )
            yield kind, [int(row) + within.first_node for row in rows]


def _masses(whole: Whole, builder: ModelBuilder) -> None:
    given = 0
    for card, within in whole.named("MASS", "ROTARYINERTIA"):
        values = card.numbers()
        if not values:
            raise card.place.error(f"*{card.keyword} without a value.")
        if card.keyword == "ROTARYINERTIA" and any(values[3:6]):
            raise card.place.error("products of inertia are not supported.")
        alike = len({*values[:3]}) == 1 and len(values) >= 3
        if card.keyword == "ROTARYINERTIA" and not alike:
            within.refuse_turned(card)
        if card.option("ORIENTATION") and not alike:
            raise card.place.error(
                "*ROTARY INERTIA in an orientation is not supported; give it in the "
                "axes of the deck."
            )
        for _, nodes in _others(whole, card, within):
            given += 1
            if card.keyword == "MASS":
                builder.mass(nodes[0], values[0], [0.0] * 3, card.place)
            else:
                builder.mass(nodes[0], 0.0, (values + [0.0] * 3)[:3], card.place)
    _refuse_bare(whole, ("MASS", "ROTARYI"), given, "*MASS")


def _nonstructural(whole: Whole, builder: ModelBuilder) -> None:
    """*NONSTRUCTURAL MASS."""
    for card, within in whole.named("NONSTRUCTURALMASS"):
        elements = whole.elements(card.needed("ELSET"), card.place, within)
        value, *more = card.first_numbers() or [0.0]
        unit = "".join(card.needed("UNITS").split()).upper()
        way = "".join(card.option("DISTRIBUTION", "MASS PROPORTIONAL").split()).upper()
        if unit == "TOTALMASS" and way in ("MASSPROPORTIONAL", "VOLUMEPROPORTIONAL") and not more:
            by = way.removesuffix("PROPORTIONAL").lower()
            add_total(builder, elements, value, card.place, by)
        elif unit in UNITS and not more:
            add_mass(builder, elements, value, UNITS[unit], card.place)
        else:
            raise card.place.error(
                "*NONSTRUCTURAL MASS is one number in UNITS=TOTAL MASS "
                "(DISTRIBUTION=MASS or VOLUME PROPORTIONAL), MASS PER VOLUME, PER AREA, PER LENGTH."
            )


def _refuse_bare(whole: Whole, kinds: tuple[str, ...], given: int, card: str) -> None:
    there = {kind: whole.deck.left.pop(kind) for kind in kinds if kind in whole.deck.left}
    count = sum(there.values())
    if count != given:
        raise MeshError(
            f"{whole.deck.name} has {count} {' and '.join(there or kinds)} elements, but {card} "
            f"cards give values to {given} of them."
        )


def _springs(whole: Whole, builder: ModelBuilder, orientations: Orientations) -> None:
    """Springs and dashpots."""
    given = dict.fromkeys(LINKS, 0)
    for card, within in whole.named(*LINKS):
        rows = [(f, p) for f, p in card.rows() if f]
        if not rows:
            raise card.place.error(f"*{card.keyword} without a {LINKS[card.keyword]}.")
        for kind, nodes in _others(whole, card, within):
            given[card.keyword] += 1
            if kind.endswith("A"):
                terms, _ = builder.joints.elongation(nodes[0], nodes[1], card.place)
                values = rows
            else:
                axes = np.eye(3)
                if card.option("ORIENTATION"):
                    x, z = orientations.frame(card.option("ORIENTATION"), card.place, within)
                    axes = np.stack([x, np.cross(z, x), z])
                else:
                    within.refuse_turned(card)
                terms, values = _along_motions(nodes, axes, *rows[0]), rows[1:]
            if len(values) != 1:
                raise card.place.error(
                    f"*{card.keyword} needs one {LINKS[card.keyword]} that does not "
                    f"depend on frequency or temperature; it has {len(values)}."
                )
            value = real_number(values[0][0][0], values[0][1])
            if value < 0:
                raise values[0][1].error(f"the {LINKS[card.keyword]} {value:g} is negative.")
            if card.keyword == "SPRING":
                builder.sprung(terms, value, card.place)
            else:
                builder.damped(terms, value)
    for keyword, number in given.items():
        _refuse_bare(whole, tuple(f"{keyword}{end}" for end in "A12"), number, f"*{keyword}")
    if whole.deck.left:
        kind = next(iter(whole.deck.left))
        raise MeshError(
            f"{whole.deck.name} has {whole.deck.left[kind]} {kind} elements, which are not "
            "supported here and would change the result."
        )


def _along_motions(nodes: list[int], axes: Array, fields: list[str], place: Place) -> list[Term]:
    """The motion of a node along one of the axes (rows), or the difference of two."""
    dofs = [whole_number(f, place) - 1 for f in fields[:2]]
    if not all(0 <= dof < 6 for dof in dofs) or len(dofs) < len(nodes):
        raise place.error("a spring or a dashpot acts on motions from 1 to 6.")
    return [
        (node, dof - dof % 3 + c, sign * float(axes[dof % 3, c]))
        for node, dof, sign in zip(nodes, dofs, (1.0, -1.0), strict=False)
        for c in range(3)
        if axes[dof % 3, c]
    ]


def _distributing(whole: Whole, builder: ModelBuilder) -> None:
    """*DISTRIBUTING COUPLING: the node of an element DCOUP3D follows the mean of others."""
    for card, within in whole.named("DISTRIBUTINGCOUPLING"):
        nodes, weights = [], []
        for fields, place in card.rows():
            if not fields:
                continue
            own = whole.nodes(fields[0], place, within)
            weight = real_number(fields[1], place) if len(fields) > 1 and fields[1] else 1.0
            nodes += [int(n) for n in own]
            weights += [weight] * len(own)
        if not nodes or sum(weights) <= 0:
            raise card.place.error("*DISTRIBUTING COUPLING names no nodes with weights.")
        for kind, (reference, *_) in _others(whole, card, within):
            refuse_own_follower(reference, nodes, card)
            follower = builder.joints.leader(reference)
            some, own_weights = np.array(nodes), np.array(weights)
            builder.joints.mean(follower, range(6), some, own_weights, card.place)
            whole.deck.left[kind] = whole.deck.left.get(kind, 1) - 1
        whole.deck.left = {kind: n for kind, n in whole.deck.left.items() if n}
