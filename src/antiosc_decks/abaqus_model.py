"""Abaqus and CalculiX decks as whole models: the model and the supports of the first step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from antiosc.base.errors import MeshError
from antiosc.io.deck import Array, real_number
from antiosc.io.neutral import Model, Term, UnitSystem
from antiosc_decks.abaqus_assembly import Whole
from antiosc_decks.abaqus_cards import Card, Row
from antiosc_decks.abaqus_contact import read_contacts
from antiosc_decks.abaqus_joints import read_joints
from antiosc_decks.abaqus_sections import Orientations, Sections, around_axis
from antiosc_decks.builder import UNITS, ModelBuilder, Unstated, add_mass, add_total
from antiosc_decks.constraints import axis_terms
from antiosc_decks.finished import finished
from antiosc_decks.properties import axes_of
from antiosc_decks.revolved import revolve
from antiosc_decks.unfolded import unfolded

#: Cards with the values of elements that are not cells -> what they give, types of the elements.
POINT_ELEMENTS = {
    **dict.fromkeys(("MASS", "ROTARYINERTIA"), ("mass", ("MASS", "ROTARYI"))),
    "SPRING": ("stiffness", ("SPRINGA", "SPRING1", "SPRING2")),
    "DASHPOT": ("damping coefficient", ("DASHPOTA", "DASHPOT1", "DASHPOT2")),
    "GAP": ("clearance", ("GAPUNI",)),
}
#: Cards of contact, and those that name what can be tied.
BETWEEN_PIECES = ("*CONTACTPAIR", "*CLEARANCE", "*CONTACT")
TIED = ("*CONTACTPAIR", "*CLEARANCE")
#: Names of supports -> the motions (0 to 5) that they fix.
NAMED = {"ENCASTRE": (0, 1, 2, 3, 4, 5), "PINNED": (0, 1, 2)}
NAMED |= {"XSYMM": (0, 4, 5), "YSYMM": (1, 3, 5), "ZSYMM": (2, 3, 4)}
NAMED |= {"XASYMM": (1, 2, 3), "YASYMM": (0, 2, 4), "ZASYMM": (0, 1, 5)}


def model_of(assembled: Whole, units: UnitSystem, unstated: Unstated) -> Model:
    """The deck's model in SI units; its groups and fixed nodes are added to the deck."""
    top = assembled.instances[""]
    first = [card.of(top) for card in (assembled.steps[0] if assembled.steps else [])]
    left = assembled.account.refuse(BETWEEN_PIECES, assembled.deck.contact, TIED)
    assembled.deck.remarks += assembled.account.unknown(options=True)
    revolved = revolve(assembled)
    ring = unfolded(assembled, first)
    builder = ModelBuilder(assembled.deck, units, unstated, bool(assembled.named("MASS")))
    sections = Sections(assembled, builder)
    for card in assembled.named("NONSTRUCTURALMASS"):
        _nonstructural(builder, card)
    builder.find_nodes()
    for card in assembled.named("TRANSFORM"):
        _transform(builder, card)
    for card in assembled.named("BOUNDARY"):
        _boundary(builder, card)
    boundaries = [card for card in first if card.keyword == "BOUNDARY"]
    if any(card.option("OP").upper() == "NEW" for card in boundaries):
        builder.fixed[:] = False  # those of the model end
    for card in boundaries:
        _boundary(builder, card)
    if revolved is not None:
        revolved.hold(builder)
    if ring is not None:
        ring.hold(builder)
    builder.hold()
    for block in assembled.deck.blocks:
        if block.type.startswith("T2D2"):  # bars of the plane
            builder.fix(np.unique(block.corners), [2])
    read_joints(assembled, builder.joints, [*assembled.cards, *first])
    read_contacts(assembled, builder, [*assembled.cards, *first], left)
    _add_points_and_links(assembled, builder, sections.orientations)
    builder.ignored += assembled.account.ignored()
    return finished(builder)


def _boundary(builder: ModelBuilder, card: Card) -> None:
    """*BOUNDARY: fix the motions of nodes; prescribed values other than 0 are reported."""
    card.refuse_turned()
    prescribed = no_motion = False
    for row in card.rows():
        row.needs(row.word(1), "*BOUNDARY names no motion from 1 to 6.")
        nodes = row.nodes()
        row.needs(len(nodes), f"the set of nodes {row.word(0)} has no nodes.")
        motions: Sequence[int] | None = NAMED.get(row.word(1).upper())
        if motions is None:
            first = row.whole(1)
            last = row.whole(2, first)
            if min(first, last) > 6 or first == last == 0:  # temperatures, pressures, …
                no_motion = True
                continue
            row.needs(
                1 <= first <= last <= 6,
                f"*BOUNDARY fixes motions from {first} to {last}; they are counted from 1 to 6.",
            )
            prescribed |= row.real(3) != 0
            motions = range(first - 1, last)
        builder.fix(nodes, motions)
    if prescribed:
        builder.ignored.append(f"the motion of *BOUNDARY ({card.place}), fixed instead")
    if no_motion:
        builder.ignored.append(f"what is no motion of *BOUNDARY ({card.place})")


def _transform(builder: ModelBuilder, card: Card) -> None:
    """*TRANSFORM: the axes in which the motions of nodes are counted."""
    nodes = card.nodes("NSET")
    values = card.numbers()[:6]
    kind = card.option("TYPE", "R").upper()[:1]
    complete = len(values) == 6 and kind in "RC"
    card.needs(complete, "*TRANSFORM needs six coordinates, TYPE=R or C.")
    shift = card.within.shift if kind == "C" else 0.0
    a, b = np.reshape(values, (2, 3)) @ card.within.turn.T + shift
    if kind == "C" and (a != b).any():
        frames = around_axis(a, b, builder.deck.points[nodes])
        on_axis = np.linalg.norm(frames[:, 0], axis=1) < 0.5
        if on_axis.any():  # as good as any, of nodes that are held in both or in none
            frames[on_axis] = np.roll(_frame(b - a), -1, axis=0)
            builder.tell_once(
                f"the radial direction of {on_axis.sum()} nodes on the axis of "
                f"*TRANSFORM ({card.place}), one across it is taken"
            )
    else:
        axes = axes_of(a, b if kind == "R" else a)
        frames = np.broadcast_to(axes, (len(nodes), 3, 3))
    sound = np.linalg.norm(frames, axis=2).min(initial=1.0) >= 0.5
    card.needs(sound, "*TRANSFORM gives no axes.")
    builder.joints.frames.update(zip(nodes.tolist(), frames, strict=True))


def _frame(along: Array) -> Array:
    """Orthonormal axes as rows (3, 3); the first is along `along`."""
    z = along / np.linalg.norm(along)
    x = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
    x /= np.linalg.norm(x)
    return np.stack([z, x, np.cross(z, x)])


def _nonstructural(builder: ModelBuilder, card: Card) -> None:
    """*NONSTRUCTURAL MASS: add mass to elements."""
    elements = card.elements()
    unit = "".join(card.needed("UNITS").split()).upper()
    distribution = "".join(card.option("DISTRIBUTION", "MASS PROPORTIONAL").split()).upper()
    measure = distribution.removesuffix("PROPORTIONAL").lower()
    row = card.first()
    if unit == "TOTALMASS" and measure in ("mass", "volume") and len(row.fields) < 2:
        add_total(builder, elements, row.real(0), card.place, measure)
    elif unit in UNITS and len(row.fields) < 2:
        add_mass(builder, elements, row.real(0), UNITS[unit], card.place)
    else:
        message = (
            "*NONSTRUCTURAL MASS is one number in UNITS=TOTAL MASS (DISTRIBUTION=MASS or VOLUME"
        )
        raise card.place.error(f"{message} PROPORTIONAL), MASS PER VOLUME, PER AREA, PER LENGTH.")


def _add_points_and_links(
    assembled: Whole, builder: ModelBuilder, orientations: Orientations
) -> None:
    """Add masses, springs and dashpots; each of their elements needs a card."""
    counts = dict.fromkeys(POINT_ELEMENTS, 0)
    for card in assembled.named(*POINT_ELEMENTS):
        rows = card.rows()
        card.needs(rows, f"{card.label} without a value: a mass, stiffness or damping.")
        for kind, nodes in assembled.elements_of(card):
            counts[card.keyword] += 1
            if card.keyword == "MASS":
                builder.mass(nodes[0], rows[0].real(0), [0.0] * 3, card.place)
            elif card.keyword == "ROTARYINERTIA":
                builder.mass(nodes[0], 0.0, _inertia(card, rows[0]), card.place)
            elif card.keyword == "GAP":
                _gap(builder, rows[0], nodes)
            else:
                _link(builder, orientations, card, kind, nodes)
    counts["MASS"] += counts.pop("ROTARYINERTIA")
    skipped = assembled.deck.left
    for keyword, number in counts.items():
        kinds = [kind for kind in POINT_ELEMENTS[keyword][1] if kind in skipped]
        count = sum(skipped.pop(kind) for kind in kinds)
        if count != number:
            names = " and ".join(kinds or POINT_ELEMENTS[keyword][1])
            raise MeshError(
                f"{assembled.deck.name} has {count} {names} elements, but *{keyword} cards "
                f"give values to {number} of them."
            )
    if skipped:
        kind = next(iter(skipped))
        raise MeshError(
            f"{assembled.deck.name} has {skipped[kind]} {kind} elements, which are not "
            "supported here and would change the result."
        )


def _gap(builder: ModelBuilder, row: Row, nodes: list[int]) -> None:
    """*GAP: a gap stays as it is at first, as CGAP of Nastran does in linear solutions.

    An open one joins nothing; a closed one acts along its direction, by the stiffness that
    CalculiX's field 6 gives, else rigidly.
    """
    is_open = row.real(0) > 0
    state = "open" if is_open else "closed"
    builder.tell_once(f"the contact in GAPUNI ({row.place}), which stay {state}, as at first")
    if is_open:
        return
    normal = np.array([row.real(k) for k in (1, 2, 3)])
    length = float(np.linalg.norm(normal))
    if length:
        row.card.refuse_turned()
        ends = zip(nodes, (-1.0, 1.0), strict=True)
        terms = [t for node, sign in ends for t in axis_terms(node, normal / length, 0, sign)]
    else:
        terms, _ = builder.joints.elongation(nodes[0], nodes[1], row.place)
    if stiffness := row.real(5):
        builder.link("*GAP", "stiffness", terms, stiffness, row.place)
    else:
        builder.joints.equation(terms, row.place)


def _inertia(card: Card, row: Row) -> list[float]:
    """Moments of inertia (3) of *ROTARY INERTIA about the axes of the deck."""
    values = row.reals(6)
    card.needs(not any(values[3:]), "products of inertia are not supported.")
    if len({*values[:3]}) > 1:
        card.refuse_turned()
        card.needs(
            not card.option("ORIENTATION"),
            "*ROTARY INERTIA in an orientation is not supported; give it in the axes of the deck.",
        )
    return values[:3]


def _link(
    builder: ModelBuilder, orientations: Orientations, card: Card, kind: str, nodes: list[int]
) -> None:
    """Add a spring or a dashpot."""
    values = card.rows()
    property_name = POINT_ELEMENTS[card.keyword][0]
    if kind.endswith("A"):
        terms, _ = builder.joints.elongation(nodes[0], nodes[1], card.place)
    else:
        axes = np.eye(3)
        if card.option("ORIENTATION"):
            axes = orientations.frame(card)
        else:
            card.refuse_turned()
        terms = _along_motions(nodes, axes, values[0])
        values = values[1:]
    card.needs(
        len(values) == 1,
        f"{card.label} needs one {property_name} that does not depend on "
        f"frequency or temperature; it has {len(values)}.",
    )
    value = real_number(values[0].word(0), values[0].place)
    place = values[0].place
    builder.link(card.label, property_name, terms, value, place)


def _along_motions(nodes: list[int], axes: Array, row: Row) -> list[Term]:
    """Terms of the displacement of one node along an axis (row), or of two nodes' difference."""
    dofs = [row.whole(k) - 1 for k in range(len(nodes))]
    is_valid = all(0 <= dof < 6 for dof in dofs)
    row.needs(is_valid, "a spring or a dashpot acts on motions from 1 to 6.")
    ends = zip(nodes, dofs, (1.0, -1.0), strict=False)
    return [t for n, dof, sign in ends for t in axis_terms(n, axes[dof % 3], dof - dof % 3, sign)]
