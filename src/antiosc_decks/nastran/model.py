"""Nastran decks as whole models: properties, supports, masses, springs, dampers.

The model and the single-point constraints of the first subcase are read (all constraints without
case control). Unsupported entries that would change the result raise an error with their line;
loads are ignored and listed.
"""

from __future__ import annotations

import numpy as np

from antiosc.io.deck import IntArray, Place
from antiosc.io.neutral import Model, UnitSystem
from antiosc_decks.account import lines
from antiosc_decks.model.builder import ModelBuilder
from antiosc_decks.model.finished import finished
from antiosc_decks.model.pieces import separate_copies
from antiosc_decks.model.rods import hold_without_stiffness
from antiosc_decks.nastran import beams
from antiosc_decks.nastran.cards import motions_of
from antiosc_decks.nastran.joints import MASSES, Joints
from antiosc_decks.nastran.mesh import NastranDeck, constraints, grid_defaults, set_groups
from antiosc_decks.nastran.properties import Properties
from antiosc_decks.nastran.table import tell_damping


def model_of(found: NastranDeck, units: UnitSystem, density: float | None) -> Model:
    """The deck's model in SI units; its groups and fixed nodes go into the deck."""
    found.account.refuse()
    tell_damping(found.account, found.bulk.entries)
    given = found.parameter("WTMASS")
    factor = given.real(1, None) if given else 1.0
    ends = beams.divide(found)
    copies = separate_copies(found.deck)
    set_groups(found)
    builder = ModelBuilder(found.deck, units, density, lumped=bool(found.named(*MASSES)))
    Properties(found, builder, factor).read()
    builder.find_nodes()
    _supports(found, builder)
    joints = Joints(found, builder, factor)
    joints.read()
    beams.join(builder, ends)
    builder.join_copies(copies)
    joints.read_masses()
    autospc = found.parameter("AUTOSPC")
    if builder.truss and not (autospc and autospc.text(1).upper() == "NO"):
        hold_without_stiffness(builder)
    found.deck.left.clear()
    builder.ignored += [*found.converted, *found.account.ignored()]
    return finished(builder)


def _supports(found: NastranDeck, builder: ModelBuilder) -> None:
    defaults = grid_defaults(found.bulk.entries)
    for row, grid in enumerate(found.grids):
        permanent = grid.text(6) or defaults.get(grid.place.scope, grid).text(6)
        if permanent:
            _fix(found, builder, np.array([row]), permanent, grid.place)
    moved: list[Place] = []
    for number in sorted(found.used_sets("SPC")):
        for rows, components, entry in constraints(found, number):
            entry.needs(len(rows), f"SPC1 {number} fixes a GRID that there is not.")
            _fix(found, builder, rows, components, entry.place)
            if entry.name == "SPC" and (entry.real(3) or entry.real(6)):
                moved.append(entry.place)
    if moved:
        builder.ignored.append(f"the motion of SPC ({lines(moved)}), fixed instead")


def _fix(
    found: NastranDeck, builder: ModelBuilder, rows: IntArray, components: str, place: Place
) -> None:
    motions = motions_of(components, place)
    scalar, turned = (np.isin(rows, list(some)) for some in (found.scalar, found.systems_of))
    builder.fix(rows[scalar], [0])
    builder.fix(rows[~scalar & ~turned], motions)
    for row in rows[turned]:
        own = np.isin(np.arange(6), motions)
        frame = found.frame(int(row), place)
        builder.fixed[row] |= builder.joints.fixed_along(int(row), own, frame)
