"""The largest interior angle of a solid at a point of its surface: 270° in a re-entrant corner.

In a corner of more than 180° the stress of linear elasticity is infinite, growing as r^-0.46 at
270° (M. L. Williams, J. Appl. Mech. 19 (1952) 526); what a mesh shows grows with every refinement.
"""

from __future__ import annotations

from itertools import chain

import numpy as np

from antiosc.base._types import Array
from antiosc.fem.elements.solid import SOLID_EDGES
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import MeshedStructure

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
