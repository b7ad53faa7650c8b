"""Rods of decks (CROD, CONROD, CTUBE, T2D2, T3D2) and shear panels (CSHEAR).

Between other elements they are springs, with masses at their nodes; rods alone make a truss. The
forces along the four sides of a panel that are in equilibrium with each other are known but for a
factor: it is one spring in the motion on which they do work, whose compliance is the energy of that
shear (S. J. Garvey, *The quadrilateral shear panel*, Aircraft Engineering 23, 1951), exact for
parallelograms.
"""

from __future__ import annotations

import numpy as np

from antiosc.base._types import BoolArray
from antiosc.base.errors import MeshError
from antiosc.io.deck import Array, Place
from antiosc.io.neutral import Term
from antiosc_decks.model.builder import Family, ModelBuilder, Rod
from antiosc_decks.model.pieces import SPRINGS

#: Component of a rod's direction over the largest below which it is rounding.
FLAT = 1e-8


def join_rods(builder: ModelBuilder) -> BoolArray:
    """Springs and masses in place of the chosen rods and panels; which elements they are.

    The rods of a truss stay elements.
    """
    rods, deck = np.zeros(builder.deck.n_elements, dtype=bool), builder.deck
    masses: dict[int, tuple[float, Place]] = {}
    for block, some in deck.numbered():
        if block.role not in SPRINGS or (block.role == "rod" and builder.truss):
            continue
        rods[some] = True
        kept = np.flatnonzero(builder.chosen[some])
        for k in kept:
            nodes = list(map(int, block.corners[k]))
            rod = builder.rods.get(int(some[k]))
            if rod is None:
                raise MeshError(
                    f"{deck.name} has {block.type} elements without a section, so that their "
                    "material is not known."
                )
            size = (_spring if rod.effective is None else _panel)(builder, nodes, rod)
            for node in nodes:
                before = masses.get(node, (0.0,))[0]
                masses[node] = before + rod.mass * size / len(nodes), rod.place
        deck.told.append(
            f"the {len(kept)} {block.type} of {deck.name} are springs, with their mass at their "
            f"{'ends' if block.role == 'rod' else 'corners'}."
        )
    for node, (mass, place) in masses.items():
        if mass:
            builder.mass(node, mass, [0.0] * 3, place)
    return rods


def make_truss(builder: ModelBuilder) -> None:
    """Sections of the family `Truss` for all rods."""
    units = builder.units
    alike: dict[Rod, list[int]] = {}
    for k in np.flatnonzero(builder.chosen):
        rod = builder.rods.get(int(k))
        if rod is not None and rod.effective is None:
            alike.setdefault(rod, []).append(int(k))
    for rod, elements in alike.items():
        arguments = {
            "E": rod.E * units.stress,
            "nu": rod.nu,
            "rho": rod.mass / rod.across * units.density,
            "area": rod.across * units.length**2,
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
    builder.sprung(terms, rod.E * rod.across / length)
    if rod.torsion and builder.has_rotations[[a, b]].all():
        twist, _ = builder.joints.elongation(a, b, rod.place, 3)
        builder.sprung(twist, rod.E / (2 * (1 + rod.nu)) * rod.torsion / length)
    return length


def _panel(builder: ModelBuilder, nodes: list[int], panel: Rod) -> float:
    """Add the springs of a shear panel between its corners, and along its sides; its area."""
    x = builder.deck.points[nodes]
    normal = np.cross(x[2] - x[0], x[3] - x[1])
    size = float(np.linalg.norm(normal))
    if not size > 1e-12 * float(np.ptp(x, axis=0).max()) ** 2:
        raise panel.place.error("the corners of a shear panel lie on one line.")
    sides, area = np.roll(x, -1, axis=0) - x, size / 2
    builder.sprung(*_shear(panel, nodes, x, sides, normal / size))
    length, t = np.linalg.norm(sides, axis=1), panel.across
    for k, factor in enumerate((panel.effective or ()) * 2):
        width = area / (length[k] + length[(k + 2) % 4])
        if across := factor * t * (width if factor <= 1.01 else t / 2):
            rod = Rod(panel.E, panel.nu, across, 0.0, panel.place)
            _spring(builder, [nodes[k], nodes[(k + 1) % 4]], rod)
    return area


def _shear(
    panel: Rod, nodes: list[int], x: Array, sides: Array, normal: Array
) -> tuple[list[Term], float]:
    """(motion of the corners at x (4, 3), in one plane or nearly so, stiffness against it)."""
    plane = np.linalg.svd(normal[None])[2][1:]
    flat, along = (x - x.mean(axis=0)) @ plane.T, sides @ plane.T
    length = np.linalg.norm(along, axis=1)
    unit = along / length[:, None]
    arms = flat[:, 0] * unit[:, 1] - flat[:, 1] * unit[:, 0]
    forces = np.linalg.svd(np.vstack([unit.T, arms / length.max()]))[2][-1]
    flow = forces / length
    if not np.abs(flow).min() > 1e-6 * np.abs(flow).max():
        raise panel.place.error("a shear panel needs four corners of less than 180°.")
    pair = int(np.argmax([abs(unit[k] @ unit[k + 2]) for k in (0, 1)]))
    upright = np.array([-unit[pair, 1], unit[pair, 0]])
    s, c = ((unit[k] @ unit[pair]) / (unit[k] @ upright) for k in (1 - pair, 3 - pair))
    skew = 1 + 2 / (3 * (1 + panel.nu)) * (s * s + s * c + c * c)
    shear = float(np.sqrt(np.abs(np.prod(flow))))
    area = float(np.linalg.norm(np.cross(x[2] - x[0], x[3] - x[1]))) / 2
    G = panel.E / (2 * (1 + panel.nu))
    loads = (forces[:, None] * unit + np.roll(forces[:, None] * unit, 1, axis=0)) / 2 @ plane
    terms = [(n, k, float(load[k])) for n, load in zip(nodes, loads, strict=True) for k in range(3)]
    return terms, G * panel.across / (area * shear * skew)
