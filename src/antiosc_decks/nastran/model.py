"""Nastran decks as whole models: properties, supports, masses, springs, dampers.

The model and the single-point constraints of the first subcase are read (all constraints without
case control). Unsupported entries that would change the result raise an error with their line;
loads are ignored and listed.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from antiosc.fem.readers.deck import IntArray, Place
from antiosc.fem.readers.unit_system import UnitSystem
from antiosc_decks.account import lines
from antiosc_decks.model.builder import ModelBuilder
from antiosc_decks.model.finished import finished
from antiosc_decks.model.rods import hold_without_stiffness
from antiosc_decks.nastran import beams
from antiosc_decks.nastran.cards import motions_of
from antiosc_decks.nastran.joints import read_joints, read_springs
from antiosc_decks.nastran.masses import read_masses
from antiosc_decks.nastran.materials import materials_of
from antiosc_decks.nastran.mesh import (
    NastranDeck,
    constraints,
    set_groups,
)
from antiosc_decks.nastran.sections import Properties
from antiosc_decks.nastran.table import tell_damping


def model_of(found: NastranDeck, units: UnitSystem, density: float | None) -> dict[str, Any]:
    """The deck's model in SI units; its groups and fixed nodes go into the deck."""
    found.account.refuse()
    tell_damping(found.account, found.bulk.entries)
    materials, ignored = materials_of(found)
    ends = beams.divide(found)
    set_groups(found)
    builder = ModelBuilder(found.deck, units, density)
    factor = _mass_factor(found)
    for material in materials.values():
        material.density = material.density and material.density * factor
    properties = Properties(found, builder, materials, factor)
    properties.read()
    builder.with_roles(properties.roles)
    _supports(found, builder)
    read_joints(found, builder)
    read_springs(found, builder)
    beams.join(builder, ends)
    read_masses(found, builder, factor)
    if builder.truss and not _without_autospc(found):
        hold_without_stiffness(builder)
    found.deck.left.clear()
    builder.ignored += [*ignored, *found.converted, *properties.ignored, *builder.joint_told]
    builder.ignored += found.account.ignored()
    return finished(builder, properties.roles)


def _mass_factor(found: NastranDeck) -> float:
    """PARAM,WTMASS: the factor of the deck's masses."""
    for entry in found.named("PARAM"):
        if entry.text(0).upper() == "WTMASS":
            return entry.real(1, None)
    return 1.0


def _without_autospc(found: NastranDeck) -> bool:
    """PARAM,AUTOSPC,NO."""
    entries = [e for e in found.named("PARAM") if e.text(0).upper() == "AUTOSPC"]
    return any(entry.text(1).upper() == "NO" for entry in entries)


# --- Supports -------------------------------------------------------------------------------------


def _supports(found: NastranDeck, builder: ModelBuilder) -> None:
    default = next(iter(found.named("GRDSET")), None)
    for row, grid in enumerate(found.grids):
        permanent = grid.text(6) or (default.text(6) if default else "")
        if permanent:
            _fix(found, builder, np.array([row]), permanent, grid.place)
    moved: list[Place] = []
    for number in sorted(found.used_sets("SPC")):
        for rows, components, entry in constraints(found, number):
            if not len(rows):
                raise entry.place.error(f"SPC1 {number} fixes a GRID that there is not.")
            _fix(found, builder, rows, components, entry.place)
            if entry.name == "SPC" and (entry.real(3) or entry.real(6)):
                moved.append(entry.place)
    if moved:
        builder.ignored.append(f"the motion of SPC ({lines(moved)}), fixed instead")


def _fix(
    found: NastranDeck, builder: ModelBuilder, rows: IntArray, components: str, place: Place
) -> None:
    motions = motions_of(components, place)
    scalar = np.array([row for row in rows if int(row) in found.scalar], dtype=np.int64)
    builder.fix(scalar, [0])
    plain = [row for row in rows if int(row) not in (found.systems_of | found.scalar)]
    builder.fix(np.array(plain, dtype=np.int64), motions)
    for row in rows:
        if int(row) in found.systems_of:
            frame = found.frame(int(row), place)
            for first in (0, 3):
                own = np.isin(np.arange(first, first + 3), motions)
                along = builder.joints.fixed_along(int(row), own, frame, first)
                builder.fix(np.array([row]), [first + int(k) for k in np.flatnonzero(along)])
