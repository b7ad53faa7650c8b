"""Places of solids where an elastic stress has no limit: sharp inner edges and rigid supports.

In a corner of more than 180° it grows as r^-0.46 at 270° (M. L. Williams, J. Appl. Mech. 19 (1952)
526); the value on a mesh grows with every refinement.
"""

from __future__ import annotations

from itertools import chain

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.fem.assembly import with_parts
from antiosc.fem.elements.solid import SOLID_EDGES
from antiosc.fem.mesh import Mesh
from antiosc.fem.mesh.surface import Faces, quadrature
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.structure import Structure
from antiosc.recovery.mesh_fields import displacements_of_rank

#: Distance of equal points over the size of the part.
SAME = 1e-9
#: Angle (rad) that may lack of the full circle around an edge within the solid.
WITHIN = 1e-3
#: Interior angle in degrees from which a corner is re-entrant; fillets of three cells have 210.
RE_ENTRANT = 215.0
#: Points of an edge of a cell, of which both ends are two.
POINTS = 5


def sharp_edges(
    structure: Structure, shapes: Array, part: str | None = None
) -> tuple[Array, Array]:
    """Balls (n, 4) about re-entrant edges, and about nodes that are held rigidly, as rows x, y, z,
    radius [m], of the solids of a part in space.

    The radius is half the mean thickness of the part, its volume over its surface. To be called on
    all ranks.
    """
    of_edges, of_supports = [np.zeros((0, 4))], [np.zeros((0, 4))]
    for member, of_part in with_parts(structure).fields(shapes, part):
        mesh = member.part.mesh
        if member.part.kind.name != "solid" or mesh.tdim != 3:
            continue
        radius = half_thickness(mesh)
        held = ~displacements_of_rank(member.part, of_part).any(axis=(1, 2))
        supported = np.concatenate(mesh.comm.allgather(mesh.dolfinx.geometry.x[held]))
        share = np.linspace(0.0, 1.0, POINTS)[:, None, None]
        starts, ends = np.moveaxis(re_entrant(member.part), 1, 0)
        on_edges = (starts + (ends - starts) * share).reshape(-1, 3)

        for balls, points in ((of_edges, on_edges), (of_supports, supported)):
            placed = member.at.placed(np.unique(points, axis=0))
            balls.append(np.column_stack([placed, np.full(len(placed), radius)]))
    return np.concatenate(of_edges), np.concatenate(of_supports)


def half_thickness(mesh: Mesh) -> float:
    """Volume over surface [m] of a solid: half the thickness of a plate."""
    faces = Faces(mesh, sheet=False)
    points = quadrature(mesh, 2, faces.facets, 2)
    heights = np.einsum("qd,qd->q", points.x, faces.normals[points.entity])
    sums = np.array([points.weight @ heights / 3, points.weight.sum()])
    volume, surface = np.sum(mesh.comm.allgather(sums), axis=0)
    return float(abs(volume) / surface)


def re_entrant(part: MeshedStructure) -> Array:
    """Ends (E, 2, 3) of the re-entrant edges of the part, on every rank."""
    geometry = part.mesh.geometry
    owned = compat.cell_map(part.mesh.dolfinx).size_local
    corners = geometry.nodes[:owned, : len(geometry.corners)]
    ends, angles = _angles(part.mesh.cell, corners)
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
    """(ends (E, 2, 3), angle (E,) [rad] of the cell around it) of all edges of cells (C, k, 3)."""
    ends, angles = [], []
    for a, b in SOLID_EDGES[kind]:
        others = {*chain(*(edge for edge in SOLID_EDGES[kind] if a in edge))} - {a, b}
        along = x[:, b] - x[:, a]
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        rays = [x[:, k] - x[:, a] for k in sorted(others)]
        one, other = (ray - (ray * along).sum(axis=1, keepdims=True) * along for ray in rays)

        ends.append(x[:, [a, b]])
        sines = np.linalg.norm(np.cross(one, other), axis=1)
        angles.append(np.arctan2(sines, (one * other).sum(axis=1)))
    return np.concatenate(ends), np.concatenate(angles)
