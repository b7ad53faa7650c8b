"""Where a part is held if nobody says it: a group by its name, else its lowest flat side."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.errors import AntioscError
from antiosc_app.guessed_sites import face_areas

if TYPE_CHECKING:
    from antiosc import Mesh, Structure

#: Words in the names of groups that are supports, the likeliest first.
SUPPORT_WORDS = (
    *("clamp", "fix", "held", "hold", "support", "encastre", "mount", "bolt", "feet", "foot"),
    *("base", "ground", "root", "rim", "ends", "left", "bottom", "edges"),
)
#: A side that is held has at most these shares of the nodes, and of the surface of a solid: held on
#: its underside a plate would be a layer on a rigid floor.
LARGEST_PLANE, LARGEST_SIDE = 0.6, 0.3
#: Nodes lie on a plane, and are one node, if their distance is below this share of the size.
ON_PLANE = 1e-6
#: A number of which no two multiples have a common part behind the point.
GOLDEN = 0.6180339887498949
#: Largest rounding of a motion of 1 to 2: 1e-15 at the middles of edges of triangles.
ROUNDING = 1e-9


def groups_with(mesh: Mesh, words: Sequence[str]) -> tuple[str, ...]:
    """Groups of facets, edges or nodes named with one of these words; the first word first."""
    of_sides = [n for n, parts in mesh.groups.items() if min(parts, default=mesh.tdim) < mesh.tdim]
    return tuple(name for word in words for name in of_sides if word in name.lower())


def nodes_of(mesh: Mesh, groups: Sequence[str]) -> IntArray:
    """Nodes of groups."""
    from antiosc.fem.platform import compat

    vertices = [
        compat.entity_vertices(mesh.dolfinx, dim)[entities].ravel()
        for group in groups
        for dim, entities in mesh.groups[group].items()
    ]
    return np.unique(np.concatenate([np.zeros(0, dtype=int), *vertices]))


def groups_on(mesh: Mesh, nodes: BoolArray) -> tuple[str, ...]:
    """Names of the groups of facets or edges with all their vertices among these nodes."""
    names = (name for name, parts in mesh.groups.items() if max(parts, default=3) < mesh.tdim)
    return tuple(name for name in names if nodes[nodes_of(mesh, [name])].all())


def supporting_side(
    x: Array, size: float, faces: IntArray | None
) -> tuple[BoolArray, list[Array] | None]:
    """(mask of the nodes x on the lowest side of the box that is flat and not too large, its point
    and normal); of none an empty mask and None. `faces`: corners (F, k) of the surface of a solid.
    """
    low, high = x.min(axis=0), x.max(axis=0)
    area = None if faces is None else np.linalg.norm(face_areas(x[faces]), axis=1)

    for axis, corner in [(2, low), (0, low), (1, low), (0, high), (1, high)]:
        on_side = np.abs(x[:, axis] - corner[axis]) < ON_PLANE * size
        if not min(3, len(x) // 4) <= on_side.sum() <= max(1.0, LARGEST_PLANE * len(x)):
            continue
        if area is not None and faces is not None:
            share = area[on_side[faces].all(axis=1)].sum() / area.sum()
            if not 0 < share <= LARGEST_SIDE:
                continue
        return on_side, [corner, np.eye(3)[axis]]
    return np.zeros(len(x), dtype=bool), None


def held_nodes(structure: Structure, x: Array, size: float) -> BoolArray:
    """Mask of the nodes x (N, 3) that do not move where all free dofs of a structure do."""
    from antiosc.extension import source

    motion = 1.0 + (np.arange(structure.rows)[:, None] * GOLDEN) % 1.0  # none cancels another
    motion[structure.fixed[structure.fixed < structure.rows]] = 0.0
    try:
        nodes, _, displacements = source(structure).at_nodes(structure, motion)
    except AntioscError:
        return np.zeros(len(x), dtype=bool)

    fixed = ~(np.abs(displacements[:, :, 0]) > ROUNDING).any(axis=1)
    if not fixed.any():
        return np.zeros(len(x), dtype=bool)
    return np.asarray(cKDTree(nodes[fixed]).query(x)[0] < ON_PLANE * size)
