"""Abaqus and CalculiX decks as whole models, with the supports of the first step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from antiosc.base.errors import MeshError
from antiosc.io.conversion import Array
from antiosc.io.neutral import Model, MotionTerm, UnitSystem
from antiosc_decks.abaqus_assembly import AbaqusDeck
from antiosc_decks.abaqus_cards import Card, Row
from antiosc_decks.abaqus_joints import read_joints
from antiosc_decks.abaqus_sections import Orientations, Sections
from antiosc_decks.builder import MaterialDefaults, ModelBuilder
from antiosc_decks.constraints import axis_terms
from antiosc_decks.entries import real_number
from antiosc_decks.finished import complete_model
from antiosc_decks.properties import axes_of

#: Cards with the values of elements that are not cells -> what they give, types of the elements.
POINT_ELEMENTS = {
    **dict.fromkeys(("MASS", "ROTARYINERTIA"), ("mass", ("MASS", "ROTARYI"))),
    "SPRING": ("stiffness", ("SPRINGA", "SPRING1", "SPRING2")),
    "DASHPOT": ("damping coefficient", ("DASHPOTA", "DASHPOT1", "DASHPOT2")),
}
#: Names of supports -> the motions (0 to 5) that they fix.
NAMED_SUPPORTS = {"ENCASTRE": (0, 1, 2, 3, 4, 5), "PINNED": (0, 1, 2)}
NAMED_SUPPORTS |= {"XSYMM": (0, 4, 5), "YSYMM": (1, 3, 5), "ZSYMM": (2, 3, 4)}
NAMED_SUPPORTS |= {"XASYMM": (1, 2, 3), "YASYMM": (0, 2, 4), "ZASYMM": (0, 1, 5)}


def model_of(assembly: AbaqusDeck, units: UnitSystem, defaults: MaterialDefaults) -> Model:
    """The deck's model in SI units; its groups and fixed nodes are added to the deck."""
    top = assembly.instances[""]
    first = [card.in_scope(top) for card in (assembly.steps[0] if assembly.steps else [])]
    assembly.account.refuse(("*CONTACT",), assembly.deck)

    builder = ModelBuilder(assembly.deck, units, defaults, bool(assembly.cards_named("MASS")))
    sections = Sections(assembly, builder)
    builder.mark_nodes()
    for card in assembly.cards_named("TRANSFORM"):
        _set_motion_axes(builder, card)

    for card in assembly.cards_named("BOUNDARY"):
        _fix_boundary(builder, card)

    boundaries = [card for card in first if card.keyword == "BOUNDARY"]
    if any(card.option("OP").upper() == "NEW" for card in boundaries):
        builder.fixed[:] = False  # those of the model end
    for card in boundaries:
        _fix_boundary(builder, card)

    builder.apply_local_supports()
    for block in assembly.deck.blocks:
        if block.type.startswith("T2D2"):  # bars of the plane
            builder.fix(np.unique(block.corners), [2])
    read_joints(assembly, builder.joints, [*assembly.cards, *first])
    _add_points_and_links(assembly, builder, sections.orientations)
    builder.ignored += assembly.account.ignored()

    return complete_model(builder)


def _fix_boundary(builder: ModelBuilder, card: Card) -> None:
    """*BOUNDARY: fix the motions of nodes; prescribed values other than 0 are reported."""
    card.refuse_rotated()
    prescribed = no_motion = False
    for row in card.rows():
        row.needs(row.word(1), "*BOUNDARY names no motion from 1 to 6.")
        nodes = row.nodes()
        row.needs(len(nodes), f"the set of nodes {row.word(0)} has no nodes.")
        motions: Sequence[int] | None = NAMED_SUPPORTS.get(row.word(1).upper())
        if motions is None:
            first = row.integer(1)
            last = row.integer(2, first)
            if min(first, last) > 6 or first == last == 0:  # temperatures, pressures, …
                no_motion = True
                continue
            message = f"*BOUNDARY fixes motions {first} to {last}; they are counted from 1 to 6."
            row.needs(1 <= first <= last <= 6, message)
            prescribed |= row.real(3) != 0
            motions = range(first - 1, last)
        builder.fix(nodes, motions)

    if prescribed:
        builder.ignored.append(f"the motion of *BOUNDARY ({card.place}), fixed instead")
    if no_motion:
        builder.ignored.append(f"what is no motion of *BOUNDARY ({card.place})")


def _set_motion_axes(builder: ModelBuilder, card: Card) -> None:
    """*TRANSFORM: the axes of the motions of nodes."""
    nodes = card.nodes("NSET")
    values = card.numbers()[:6]
    card.needs(len(values) == 6, "*TRANSFORM needs six coordinates.")

    axes = axes_of(*np.reshape(values, (2, 3)) @ card.scope.rotation.T)
    card.needs(axes.any(axis=1).all(), "*TRANSFORM gives no axes.")
    builder.joints.motion_axes.update(dict.fromkeys(nodes.tolist(), axes))


def _add_points_and_links(
    assembly: AbaqusDeck, builder: ModelBuilder, orientations: Orientations
) -> None:
    """Add masses, springs and dashpots; each of their elements needs a card."""
    counts = dict.fromkeys(POINT_ELEMENTS, 0)
    for card in assembly.cards_named(*POINT_ELEMENTS):
        rows = card.rows()
        card.needs(rows, f"{card.label} without a value: a mass, stiffness or damping.")
        for kind, nodes in assembly.non_cells_of(card):
            counts[card.keyword] += 1
            if card.keyword == "MASS":
                builder.add_mass(nodes[0], rows[0].real(0), [0.0] * 3, card.place)
            elif card.keyword == "ROTARYINERTIA":
                builder.add_mass(nodes[0], 0.0, _moments_of_inertia(card, rows[0]), card.place)
            else:
                _add_link(builder, orientations, card, kind, nodes)

    counts["MASS"] += counts.pop("ROTARYINERTIA")
    skipped = assembly.deck.skipped
    for keyword, number in counts.items():
        kinds = [kind for kind in POINT_ELEMENTS[keyword][1] if kind in skipped]
        count = sum(skipped.pop(kind) for kind in kinds)
        if count != number:
            names = " and ".join(kinds or POINT_ELEMENTS[keyword][1])
            given = f"*{keyword} cards give values to {number} of them."
            raise MeshError(f"{assembly.deck.name} has {count} {names} elements, but {given}")

    for kind, count in skipped.items():
        fault = "which are not supported here and would change the result."
        raise MeshError(f"{assembly.deck.name} has {count} {kind} elements, {fault}")


def _moments_of_inertia(card: Card, row: Row) -> list[float]:
    """Moments of inertia (3) of *ROTARY INERTIA about the axes of the deck."""
    values = row.reals(6)
    card.needs(not any(values[3:]), "products of inertia are not supported.")
    if len({*values[:3]}) > 1:
        card.refuse_rotated()
        card.needs(not card.option("ORIENTATION"), "give *ROTARY INERTIA in the axes of the deck.")
    return values[:3]


def _add_link(
    builder: ModelBuilder, orientations: Orientations, card: Card, card_kind: str, nodes: list[int]
) -> None:
    """Add a spring or a dashpot."""
    rows = card.rows()
    quantity = POINT_ELEMENTS[card.keyword][0]
    if card_kind.endswith("A"):
        terms, _ = builder.joints.elongation_terms(nodes[0], nodes[1], card.place)
    else:
        axes = orientations.card_axes(card) if card.option("ORIENTATION") else np.eye(3)
        if not card.option("ORIENTATION"):
            card.refuse_rotated()
        terms = _motion_terms(nodes, axes, rows.pop(0))
    card.needs(len(rows) == 1, f"{card.label} needs one constant {quantity}; it has {len(rows)}.")
    place = rows[0].place
    builder.add_link(card.label, quantity, terms, real_number(rows[0].word(0), place), place)


def _motion_terms(nodes: list[int], axes: Array, row: Row) -> list[MotionTerm]:
    """Terms of a node's motion along `axes`, with the number in `row`, or a difference of two."""
    dofs = [row.integer(k) - 1 for k in range(len(nodes))]
    is_valid = all(0 <= dof < 6 for dof in dofs)
    row.needs(is_valid, "a spring or a dashpot acts on motions from 1 to 6.")
    ends = zip(nodes, dofs, (1.0, -1.0), strict=False)
    return [t for n, dof, sign in ends for t in axis_terms(n, axes[dof % 3], dof - dof % 3, sign)]
