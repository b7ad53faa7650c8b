"""Nastran decks as whole models: properties, supports, masses, springs, dampers.

The model and the single-point constraints of the first subcase are read (all constraints without
case control). Unsupported entries that would change the result raise an error with their line;
loads are ignored and listed.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from antiosc.base._types import BoolArray
from antiosc.io.deck import IntArray, Place, real_number
from antiosc.io.unit_system import UnitSystem
from antiosc_decks.account import lines
from antiosc_decks.model import copies
from antiosc_decks.model.builder import ModelBuilder
from antiosc_decks.model.constraints import Term
from antiosc_decks.model.finished import finished
from antiosc_decks.model.nonstructural import add_mass, add_total
from antiosc_decks.model.rods import hold_without_stiffness
from antiosc_decks.nastran import beams
from antiosc_decks.nastran.cards import Entry, motions_of, through
from antiosc_decks.nastran.joints import read_joints, read_springs
from antiosc_decks.nastran.materials import materials_of
from antiosc_decks.nastran.mesh import (
    NastranDeck,
    constraints,
    grid_defaults,
    its_property,
    property_of,
    set_groups,
)
from antiosc_decks.nastran.sections import Properties
from antiosc_decks.nastran.table import CELLS, tell_damping

#: Share of the largest moment of inertia that a negative one may have by rounding.
INERTIA_ROUNDING = 1e-6
#: Entries that give masses.
MASSES = ("CONM1", "CONM2", "CMASS1", "CMASS2", "CMASS3", "CMASS4")


def read_masses(found: NastranDeck, builder: ModelBuilder, factor: float) -> None:
    """Give the builder the masses, times `factor` (PARAM,WTMASS)."""
    for entry in found.named("CONM2"):
        _at_a_point(found, builder, entry, factor)
    for entry in found.named("CONM1"):
        _matrix(found, builder, entry, factor)
    own = found.properties("PMASS", 2)
    for entry in found.named(*MASSES[2:]):
        _scalar(found, builder, entry, own, factor)
    used = found.used_sets("NSM")
    for entry in found.named("NSM", "NSM1", "NSML", "NSML1"):
        if entry.whole(0) in used:
            _nonstructural(found, builder, entry, factor)


def _nonstructural(found: NastranDeck, builder: ModelBuilder, entry: Entry, factor: float) -> None:
    """NSM and NSML: pairs of a number and a mass; NSM1 and NSML1: one mass of several numbers."""
    words = [entry.text(k).upper() for k in range(2, len(entry.fields))]
    shared: list[tuple[list[str], str]] = []
    if entry.name in ("NSM1", "NSML1"):
        shared = [([word for word in words[1:] if word], words[0])]
    else:
        shared = [([words[k]], words[k + 1]) for k in range(0, len(words) - 1, 2) if words[k]]
    for numbers, mass in shared:
        elements = np.flatnonzero(_named(found, entry, numbers))
        value = real_number(mass, entry.place) * factor
        if entry.name.startswith("NSML"):
            add_total(builder, elements, value, entry.place, "measure")
        else:
            add_mass(builder, elements, value, 0, entry.place)


def _named(found: NastranDeck, entry: Entry, words: list[str]) -> BoolArray:
    """The elements that a list of numbers of elements or properties names."""
    kind = entry.text(1).upper()
    if kind in ("ELEMENT", "CONROD"):
        own = np.array([one.whole(0) for one in found.elements], dtype=np.int64)
    elif kind.startswith("P"):
        own = np.array([property_of(one) for one in found.elements], dtype=np.int64)
    else:
        raise entry.place.error(f"{entry.name} is read of properties and elements; got {kind!r}.")
    if words == ["ALL"]:
        given = {one.whole(0) for one in found.named(kind)}
        return np.isin(own, list(given)) if kind.startswith("P") else np.ones(len(own), dtype=bool)
    if "BY" in words:
        raise entry.place.error(f"{entry.name} is read without BY; list the numbers.")
    chosen = np.zeros(len(own), dtype=bool)
    for first, last in through(words, entry.place):
        some = (own >= first) & (own <= last)
        if not some.any():
            raise entry.place.error(f"{entry.name} names {kind} {first}, of no element.")
        chosen |= some
    return chosen


def _at_a_point(found: NastranDeck, builder: ModelBuilder, entry: Entry, factor: float) -> None:
    """CONM2: a rigid body, whose centre of mass may lie beside its node."""
    row = found.row(entry.whole(1), entry.place)
    mass = entry.real(3) * factor
    offset = np.array([entry.real(k) for k in (4, 5, 6)])
    I11, I21, I22, I31, I32, I33 = (entry.real(k) * factor for k in range(8, 14))
    J = np.array([[I11, -I21, -I31], [-I21, I22, -I32], [-I31, -I32, I33]])
    number = entry.whole(2, 0)
    if number == -1:  # the place of the mass
        given = any(entry.text(k) for k in (4, 5, 6))
        offset = offset - found.deck.points[row] if given else np.zeros(3)
    elif number:
        axes = found.axes(entry, number)
        offset, J = offset @ axes, axes.T @ J @ axes
    if mass < 0 or np.linalg.eigvalsh(J).min() < -INERTIA_ROUNDING * np.abs(J).max():
        raise entry.place.error("the mass or the inertia of CONM2 is negative.")
    plain = not offset.any() and not (J - np.diag(np.diag(J))).any()
    if plain and (builder.has_rotations[row] or not J.any()):
        if mass or J.any():
            builder.mass(row, mass, np.diag(J).tolist(), entry.place)
        return
    x, y, z = offset
    arm = np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])  # θ × r = arm θ
    moved = np.hstack([np.eye(3), arm])
    M = mass * moved.T @ moved
    M[3:, 3:] += J
    builder.body(row, M, mass, entry.place)


def _matrix(found: NastranDeck, builder: ModelBuilder, entry: Entry, factor: float) -> None:
    """CONM1: a mass matrix of one node."""
    row = found.row(entry.whole(1), entry.place)
    M = np.zeros((6, 6))
    M[np.tril_indices(6)] = [entry.real(k) * factor for k in range(3, 24)]
    M = M + M.T - np.diag(np.diag(M))
    if entry.whole(2, 0):
        six = np.kron(np.eye(2), found.axes(entry, entry.whole(2)))
        M = six.T @ M @ six
    if np.linalg.eigvalsh(M).min() < -INERTIA_ROUNDING * np.abs(M).max():
        raise entry.place.error("the matrix of CONM1 is not that of a mass: it has a "
                        "negative eigenvalue.")  # fmt: skip
    builder.body(row, M, float(np.trace(M[:3, :3])) / 3, entry.place)


def _scalar(
    found: NastranDeck,
    builder: ModelBuilder,
    entry: Entry,
    own: dict[int, tuple[Entry, int]],
    factor: float,
) -> None:
    """CMASS: a mass on the difference of two motions, or on one."""
    if entry.name in ("CMASS2", "CMASS4"):
        mass = entry.real(1, None)
    else:
        shared, k = its_property(entry, "PMASS", own)
        mass = shared.real(k + 1, None)
    if mass < 0:
        raise entry.place.error(f"{entry.name} has a negative mass.")
    terms: list[Term] = []
    ends = found.scalar_ends(entry)
    length = builder.units.length
    for (row, motion), sign in zip(ends, (1.0, -1.0), strict=False):
        direction = found.frame(row, entry.place)[motion % 3]
        first = 3 * (motion // 3)
        scale = sign * (length if first else 1.0)
        terms += [(row, first + c, scale * float(direction[c])) for c in range(3) if direction[c]]
    if not terms:
        raise entry.place.error(f"{entry.name} acts on no node.")
    if mass:
        # three of them, one along each axis, are one mass
        share = mass / 3 if len(ends) == 1 and ends[0][1] < 3 else 0.0
        builder.scalar_mass(terms, mass * factor, share * factor)


def model_of(found: NastranDeck, units: UnitSystem, density: float | None) -> dict[str, Any]:
    """The deck's model in SI units; its groups and fixed nodes go into the deck."""
    found.account.refuse()
    tell_damping(found.account, found.bulk.entries)
    materials, ignored = materials_of(found)
    ends = beams.divide(found)
    doubled = copies.separate(found.deck, [CELLS[block.type].role for block in found.deck.blocks])
    set_groups(found)
    builder = ModelBuilder(found.deck, units, density, lumped=bool(found.named(*MASSES)))
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
    copies.join(builder, doubled)
    read_masses(found, builder, factor)
    if builder.truss and not _without_autospc(found):
        hold_without_stiffness(builder)
    found.deck.left.clear()
    builder.ignored += [*ignored, *found.converted, *properties.ignored]
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
    defaults = grid_defaults(found.bulk.entries)
    for row, grid in enumerate(found.grids):
        permanent = grid.text(6) or defaults.get(grid.place.scope, grid).text(6)
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
