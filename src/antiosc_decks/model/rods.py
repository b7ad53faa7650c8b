"""Rods of decks (CROD, CONROD, CTUBE, T2D2, T3D2).

Between other elements they are springs along their lines, with masses at their ends; rods alone
make a truss.
"""

from __future__ import annotations

import numpy as np

from antiosc.base._types import BoolArray
from antiosc.base.errors import MeshError
from antiosc.io.deck import Place
from antiosc_decks.model.builder import MOTIONS, Family, ModelBuilder, Rod

#: Component of a rod's direction over the largest below which it is rounding.
FLAT = 1e-8


def join_rods(builder: ModelBuilder, roles: list[str], kept: BoolArray) -> BoolArray:
    """Springs and masses in place of the rods that are kept; which elements are rods."""
    start, rods = 0, np.zeros(builder.deck.n_elements, dtype=bool)
    masses: dict[int, float] = {}
    first: Place | None = None
    for role, block in zip(roles, builder.deck.blocks, strict=True):
        some = np.arange(start, start + len(block))
        start += len(block)
        if role != "rod":
            continue
        rods[some] = True
        for k in np.flatnonzero(kept[some]):
            a, b = map(int, block.corners[k])
            if some[k] not in builder.rods:
                raise MeshError(
                    f"{builder.deck.name} has {block.type} elements without a section, so that "
                    "their material is not known."
                )
            rod = builder.rods[int(some[k])]
            first = first or rod.place
            length = _spring(builder, a, b, rod)
            for node in (a, b):
                masses[node] = masses.get(node, 0.0) + rod.mass * length / 2
        builder.deck.told.append(
            f"the {int(kept[some].sum())} {block.type} of {builder.deck.name} are springs, with "
            "their mass at their ends."
        )
    for node, mass in masses.items():
        if mass and first:
            builder.mass(node, mass, [0.0] * 3, first)
    return rods


def make_truss(builder: ModelBuilder) -> BoolArray:
    """Sections of the family `Truss` for all rods; no element that becomes a spring."""
    units = builder.units
    alike: dict[Rod, list[int]] = {}
    for k in np.flatnonzero(builder.chosen):
        if int(k) in builder.rods:
            rod = builder.rods[int(k)]
            alike.setdefault(rod, []).append(int(k))
    for rod, elements in alike.items():
        arguments = {
            "E": rod.E * units.stress,
            "nu": rod.nu,
            "rho": rod.mass / rod.area * units.density,
            "area": rod.area * units.length**2,
        }
        builder.add("rods", np.array(elements), Family("Truss", arguments, rod.place))
    if any(rod.torsion for rod in alike):
        builder.ignored.append("the torsion of rods, whose ends are hinges in a truss")
    return np.zeros(builder.deck.n_elements, dtype=bool)


def hold_without_stiffness(builder: ModelBuilder) -> None:
    """Hold motions along the axes against which nothing is stiff, as AUTOSPC of Nastran does."""
    stiff = np.zeros((len(builder.used), 3))
    for block in builder.deck.blocks:
        along = np.ptp(builder.deck.points[block.corners], axis=1)
        along /= np.maximum(along.max(axis=1, keepdims=True), np.finfo(float).tiny)
        np.add.at(stiff, block.corners, along[:, None])
    joints = builder.joints
    for terms in (*joints.equations, *(terms for terms, _ in joints.springs)):
        for node, motion, _ in terms:
            if node < len(stiff) and motion < 3:
                stiff[node, motion] = 1.0
    for node, _, stiffness in builder.springs:
        if node < len(stiff):
            stiff[node] += [name in stiffness for name in MOTIONS[:3]]
    for node, _ in joints.alias:  # motions along axes of its own
        if node < len(stiff):
            stiff[node] = 1.0
    loose = builder.used[:, None] & (stiff <= FLAT) & ~builder.fixed[:, :3]
    if loose.any():
        builder.fixed[:, :3] |= loose
        builder.deck.told.append(
            f"{int(loose.sum())} motions of nodes of {builder.deck.name} against which no rod is "
            "stiff are held (AUTOSPC)."
        )


def _spring(builder: ModelBuilder, a: int, b: int, rod: Rod) -> float:
    """Add the springs of a rod between two nodes; its length."""
    terms, length = builder.joints.elongation(a, b, rod.place)
    builder.sprung(terms, rod.EA / length, rod.place)
    if rod.torsion and builder.has_rotations[[a, b]].all():
        twist, _ = builder.joints.elongation(a, b, rod.place, 3)
        builder.sprung(twist, rod.GJ / length, rod.place)
    return length
