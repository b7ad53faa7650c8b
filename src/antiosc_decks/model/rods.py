"""Rods of decks (CROD, CONROD, CTUBE, T2D2, T3D2) and shear panels.

Between other elements they are springs, with masses at their nodes; rods alone make a truss.
"""

from __future__ import annotations

import numpy as np

from antiosc.base._types import BoolArray
from antiosc.base.errors import MeshError
from antiosc.io.deck import Place
from antiosc_decks.model.builder import MOTIONS, SPRINGS, Family, ModelBuilder, Rod
from antiosc_decks.model.panels import Panel, shear_spring, side_areas

#: Component of a rod's direction over the largest below which it is rounding.
FLAT = 1e-8


def join_rods(builder: ModelBuilder, roles: list[str], kept: BoolArray) -> BoolArray:
    """Springs and masses in place of the rods and panels that are kept; which elements they are.

    The rods of a truss stay elements.
    """
    start, rods = 0, np.zeros(builder.deck.n_elements, dtype=bool)
    masses: dict[int, float] = {}
    first: Place | None = None
    for role, block in zip(roles, builder.deck.blocks, strict=True):
        some = np.arange(start, start + len(block))
        start += len(block)
        if role not in SPRINGS or (role == "rod" and builder.truss):
            continue
        rods[some] = True
        for k in np.flatnonzero(kept[some]):
            nodes = list(map(int, block.corners[k]))
            if some[k] not in builder.rods:
                raise MeshError(
                    f"{builder.deck.name} has {block.type} elements without a section, so that "
                    "their material is not known."
                )
            rod = builder.rods[int(some[k])]
            first = first or rod.place
            if isinstance(rod, Panel):
                size = _panel(builder, nodes, rod)
            else:
                size = _spring(builder, nodes, rod)
            for node in nodes:
                masses[node] = masses.get(node, 0.0) + rod.mass * size / len(nodes)
        builder.deck.told.append(
            f"the {int(kept[some].sum())} {block.type} of {builder.deck.name} are springs, with "
            f"their mass at their {'ends' if role == 'rod' else 'corners'}."
        )
    for node, mass in masses.items():
        if mass and first:
            builder.mass(node, mass, [0.0] * 3, first)
    return rods


def _panel(builder: ModelBuilder, nodes: list[int], panel: Panel) -> float:
    """Add the springs of a shear panel between its corners; its area."""
    x = builder.deck.points[nodes]
    builder.sprung(*shear_spring(panel, nodes, x), panel.place)
    for k, area in enumerate(side_areas(panel, x)):
        if area:
            rod = Rod(panel.E, panel.nu, area, 0.0, 0.0, panel.place)
            _spring(builder, [nodes[k], nodes[(k + 1) % 4]], rod)
    return float(np.linalg.norm(np.cross(x[2] - x[0], x[3] - x[1]))) / 2


def make_truss(builder: ModelBuilder) -> None:
    """Sections of the family `Truss` for all rods."""
    units = builder.units
    alike: dict[Rod, list[int]] = {}
    for k in np.flatnonzero(builder.chosen):
        rod = builder.rods.get(int(k))
        if isinstance(rod, Rod):
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


def _spring(builder: ModelBuilder, nodes: list[int], rod: Rod) -> float:
    """Add the springs of a rod between two nodes; its length."""
    a, b = nodes
    terms, length = builder.joints.elongation(a, b, rod.place)
    builder.sprung(terms, rod.EA / length, rod.place)
    if rod.torsion and builder.has_rotations[[a, b]].all():
        twist, _ = builder.joints.elongation(a, b, rod.place, 3)
        builder.sprung(twist, rod.GJ / length, rod.place)
    return length
