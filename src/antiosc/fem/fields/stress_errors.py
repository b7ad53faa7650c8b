"""Errors of the stresses of solids at their nodes, and the corners in which they are infinite.

In a corner of more than 180° the stress of linear elasticity is infinite, growing as r^-0.46 at
270° (M. L. Williams, J. Appl. Mech. 19 (1952) 526); what a mesh shows grows with every refinement.
"""

from __future__ import annotations

from itertools import chain

import numpy as np

from antiosc.base._types import Array
from antiosc.fem.assembly import with_parts
from antiosc.fem.elements.solid import SOLID_EDGES
from antiosc.fem.fields.mesh_fields import displacements_of_rank
from antiosc.fem.platform import compat
from antiosc.fem.recovery import at_nodes as nodal
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.structure import Structure

#: Corners of the edges of plane cells, dolfinx's numbers.
PLANE_EDGES = {
    "triangle": [(0, 1), (0, 2), (1, 2)],
    "quadrilateral": [(0, 1), (2, 3), (0, 2), (1, 3)],
}
#: Distance of equal points over the size of the part.
SAME = 1e-9
#: Angle (rad) that may lack of the full circle around an edge within the solid.
WITHIN = 1e-3


def interior_angle(part: MeshedStructure, x: Array) -> float:
    """Largest angle [degree] between outer faces that meet at the corner of a cell next to x (3,).

    0 for a point within the solid. To be called on all ranks.
    """
    mesh = part.mesh
    owned = compat.cell_map(mesh.dolfinx).size_local
    cells = mesh.geometry.nodes[:owned, : len(mesh.geometry.corners)]
    distance = np.linalg.norm(cells - x, axis=-1)
    nearest = np.unravel_index(distance.argmin(), distance.shape) if owned else None
    own = [] if nearest is None else [(float(distance[nearest]), cells[nearest])]
    vertex = min(chain(*mesh.comm.allgather(own)), key=lambda pair: pair[0])[1]
    tolerance = SAME * mesh.extent()
    found: list[tuple[Array, float]] = []
    for cell, at in np.argwhere(np.linalg.norm(cells - vertex, axis=-1) < tolerance):
        found += _angles(mesh.cell, cells[cell], int(at))
    every: list[tuple[Array, float]] = list(chain(*mesh.comm.allgather(found)))
    keys = np.round(np.array([end for end, _ in every]) / tolerance)
    _, edge = np.unique(keys, axis=0, return_inverse=True)
    angles = np.bincount(edge.ravel(), [angle for _, angle in every])
    return float(np.degrees(angles[angles < 2 * np.pi - WITHIN].max(initial=0.0)))


def _angles(kind: str, x: Array, corner: int) -> list[tuple[Array, float]]:
    """(other end of an edge, angle [rad] of the cell around it) of a corner; in the plane (the
    corner itself, angle between its edges)."""
    edges = {**PLANE_EDGES, **SOLID_EDGES}[kind]
    ends = [x[b if a == corner else a] for a, b in edges if corner in (a, b)]
    along = [(end - x[corner]) / np.linalg.norm(end - x[corner]) for end in ends]
    if len(ends) == 2:
        return [(x[corner], _between(*along))]
    found = []
    for k, end in enumerate(ends):
        across = [a - (a @ along[k]) * along[k] for i, a in enumerate(along) if i != k]
        found.append((end, _between(*across)))
    return found


def _between(a: Array, b: Array) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


def stress_jumps(
    structure: Structure, shapes: Array, factors: Array, part: str | None = None
) -> Array | None:
    """Estimated errors [Pa] of the von Mises stress at the points of `at_nodes`, on rank 0.

    `factors` (P, columns) of the shapes at each point. 0 in sheets and beams; None without solids.
    """
    if "solid" not in families(structure, shapes, part):
        return None
    parts = with_parts(structure).fields(shapes, part)
    found, start = [], 0
    for member, own in parts:
        comm = member.part.mesh.comm
        sizes = comm.allgather(len(member.part.mesh.dolfinx.geometry.x))
        first = start + sum(sizes[: comm.rank])
        here = np.zeros(sizes[comm.rank])
        if member.part.kind.name == "solid":
            here = nodal.jumps(member.part, own, factors[first : first + len(here)])
        found += comm.gather(here, root=0) or []
        start += sum(sizes)
    return np.concatenate(found) if found else np.zeros(0)


def families(structure: Structure, shapes: Array, part: str | None = None) -> set[str]:
    """Kinds of the parts that are looked at: "solid", "sheet", "beam", "truss"."""
    fields = with_parts(structure).fields(shapes, part)
    return {member.part.kind.name for member, _ in fields}


def corner_at(
    structure: Structure, shapes: Array, x: Array, part: str | None = None
) -> tuple[float, bool]:
    """(interior angle [degree] of the solid at its node x (3,), whether this node is held)."""
    parts = with_parts(structure).fields(shapes, part)
    best = (np.inf, 0.0, False)
    for member, own in parts:
        if member.part.kind.name != "solid":
            continue
        mesh, point = member.part.mesh, member.at.own(x[None])[0]
        distance = np.linalg.norm(mesh.dolfinx.geometry.x - point, axis=1)
        moves = np.abs(displacements_of_rank(member.part, own)[distance.argmin()]).max(initial=0)
        nearest = min(mesh.comm.allgather((float(distance.min()), bool(moves == 0))))
        if nearest[0] < best[0]:
            best = (nearest[0], interior_angle(member.part, point), nearest[1])
    return best[1:]
