"""Places of solids where the stress of linear elasticity has no limit: re-entrant edges and
corners, and rigid supports.

In a corner of more than 180° it is infinite, growing as r^-0.46 at 270° (M. L. Williams, J. Appl.
Mech. 19 (1952) 526); the value on a mesh grows with every refinement.
"""

from __future__ import annotations

from itertools import chain

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.fem.assembly import with_parts
from antiosc.fem.elements.solid import SOLID_EDGES
from antiosc.fem.mesh.walls import wall_thickness
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import Member, MeshedStructure
from antiosc.fem.structure.structure import Structure
from antiosc.recovery.mesh_fields import displacements_of_rank

#: Corners of the edges of plane cells, dolfinx's numbers.
PLANE_EDGES = {
    "triangle": [(0, 1), (0, 2), (1, 2)],
    "quadrilateral": [(0, 1), (2, 3), (0, 2), (1, 3)],
}
#: Distance of equal points over the size of the part.
SAME = 1e-9
#: Angle (rad) that may lack of the full circle around an edge within the solid.
WITHIN = 1e-3
#: Distance of the middle node of a curved edge from that of its ends, over their distance: an arc
#: of 90° has 0.21, one of 60° 0.13.
CURVED = 0.25
#: Interior angle in degrees from which a corner is re-entrant; fillets of three cells have 210.
RE_ENTRANT = 215.0
#: Distance from such a place over the thickness of the walls beyond which a stress is judged. Of
#: five printed parts cells of half the size changed the largest stress beyond it by 2 to 20 % (one:
#: 64 %, by a place that the first mesh did not resolve), the largest of all by 15 to 40 %, without
#: end. Hot spots of welds are read at 0.4 and 1.0 of the thickness (A. Hobbacher, IIW, 2016).
BEYOND = 0.5
#: Points of an edge of a cell, of which both ends are two.
POINTS = 5


def interior_angle(part: MeshedStructure, x: Array) -> float:
    """Largest angle [degree] between outer faces that meet in x (3,), a node of the mesh: at the
    edges that end there, or of a node between two corners at its own edge.

    0 for a point within the solid. To be called on all ranks.
    """
    mesh = part.mesh
    tolerance = SAME * mesh.extent()
    ends, angles = _angles(mesh.cell, _corners(part))
    touching = (np.linalg.norm(ends - x, axis=-1) < tolerance).any(axis=1)
    if not any(mesh.comm.allgather(bool(touching.any()))):
        lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        touching = np.linalg.norm(ends.mean(axis=1) - x, axis=1) < CURVED * lengths
    _, joined = _joined(part, ends[touching], angles[touching])
    return float(np.degrees(joined[joined < 2 * np.pi - WITHIN].max(initial=0.0)))


def corner_at(
    structure: Structure, shapes: Array, x: Array, part: str | None = None
) -> tuple[float, bool]:
    """(interior angle [degree] of the solid at its node x (3,), whether this node is supported)."""
    best = (np.inf, 0.0, False)
    for member, held in _solids(structure, shapes, part):
        mesh = member.part.mesh
        point = member.at.own(x[None])[0]
        distance = np.linalg.norm(mesh.dolfinx.geometry.x - point, axis=1)
        nearest = min(mesh.comm.allgather((float(distance.min()), bool(held[distance.argmin()]))))
        if nearest[0] < best[0]:
            best = (nearest[0], interior_angle(member.part, point), nearest[1])
    return best[1:]


def sharp_edges(
    structure: Structure, shapes: Array, part: str | None = None
) -> tuple[Array, Array]:
    """Balls (n, 4) about re-entrant edges, and about nodes that are held rigidly, as rows x, y, z,
    radius [m].

    The radius is half the thickness of the walls of the part; parts without walls have no balls.
    To be called on all ranks.
    """
    of_edges, of_supports = [np.zeros((0, 4))], [np.zeros((0, 4))]
    for member, held in _solids(structure, shapes, part):
        mesh = member.part.mesh
        radius = BEYOND * wall_thickness(mesh)
        if not radius:
            continue
        share = np.linspace(0.0, 1.0, POINTS)[:, None, None]
        starts, ends = np.moveaxis(_re_entrant(member.part), 1, 0)
        on_edges = (starts + (ends - starts) * share).reshape(-1, 3)
        supported = np.concatenate(mesh.comm.allgather(mesh.dolfinx.geometry.x[held]))
        for balls, points in ((of_edges, on_edges), (of_supports, supported)):
            placed = member.at.placed(np.unique(points, axis=0))
            balls.append(np.column_stack([placed, np.full(len(placed), radius)]))
    return np.concatenate(of_edges), np.concatenate(of_supports)


def _solids(
    structure: Structure, shapes: Array, part: str | None
) -> list[tuple[Member, np.ndarray]]:
    """The solid parts, each with whether the nodes of this rank are held in all shapes."""
    return [
        (member, ~displacements_of_rank(member.part, of_part).any(axis=(1, 2)))
        for member, of_part in with_parts(structure).fields(shapes, part)
        if member.part.kind.name == "solid"
    ]


def _corners(part: MeshedStructure) -> Array:
    """Corners (C, k, 3) of the cells that this rank owns."""
    geometry = part.mesh.geometry
    return geometry.nodes[: compat.cell_map(part.mesh.dolfinx).size_local, : len(geometry.corners)]


def _re_entrant(part: MeshedStructure) -> Array:
    """Ends (E, 2, 3) of the re-entrant edges of the part, on every rank."""
    ends, angles = _angles(part.mesh.cell, _corners(part))
    ends, joined = _joined(part, ends, angles)
    return ends[(joined >= np.radians(RE_ENTRANT)) & (joined < 2 * np.pi - WITHIN)]


def _joined(part: MeshedStructure, ends: Array, angles: Array) -> tuple[Array, Array]:
    """(ends (E, 2, 3), sum of the angles (E,)) of different edges, of the cells of all ranks."""
    tolerance = SAME * part.mesh.extent()

    def summed(ends: Array, angles: Array) -> tuple[Array, Array]:
        middles = np.round(ends.sum(axis=1) / tolerance).astype(np.int64)
        order, starts = _runs(middles)
        total = np.add.reduceat(angles[order], starts) if len(starts) else angles[:0]
        return ends[order[starts]], total

    of_ranks = part.mesh.comm.allgather(summed(ends, angles))
    return summed(*(np.concatenate(rows) for rows in zip(*of_ranks, strict=True)))


def _runs(rows: IntArray) -> tuple[IntArray, IntArray]:
    """(order that brings equal rows together, starts of their runs in it)."""
    order = np.lexsort(rows.T)
    different = (np.diff(rows[order], axis=0) != 0).any(axis=1)
    return order, np.flatnonzero(np.append(len(rows) > 0, different))


def _angles(kind: str, x: Array) -> tuple[Array, Array]:
    """(ends (E, 2, 3), angle (E,) [rad] of the cell around it) of all edges of cells (C, k, 3).

    Plane cells have corners in their place, whose ends are equal.
    """
    edges = {**PLANE_EDGES, **SOLID_EDGES}[kind]
    ends, angles = [], []
    plane = kind in PLANE_EDGES
    for a, b in [(k, k) for k in range(x.shape[1])] if plane else edges:
        others = {*chain(*(edge for edge in edges if a in edge))} - {a, b}
        rays = [x[:, k] - x[:, a] for k in sorted(others)]
        if not plane:
            along = x[:, b] - x[:, a]
            along /= np.linalg.norm(along, axis=1, keepdims=True)
            rays = [ray - (ray * along).sum(axis=1, keepdims=True) * along for ray in rays]
        ends.append(x[:, [a, b]])
        angles.append(_angle_between(*rays))
    return np.concatenate(ends), np.concatenate(angles)


def _angle_between(a: Array, b: Array) -> Array:
    """Angles (n,) [rad] between vectors (n, 3)."""
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1))
