"""Guesses of where a part is held: groups by their names, or the nodes on a plane."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.errors import AntioscError
from antiosc_app.guessed_sites import face_areas
from antiosc_app.inspection import SAME_PLACE, rounded_to

if TYPE_CHECKING:
    from antiosc import Mesh, Structure

#: Words in the names of groups that are supports, the likeliest first.
SUPPORT_WORDS = (
    *("clamp", "fix", "held", "hold", "support", "encastre", "mount", "bolt", "feet", "foot"),
    *("base", "ground", "root", "rim", "ends", "left", "bottom", "edges"),
)
#: A name that the reader of CAD files gives to a hole: its diameter and its number.
HOLE = re.compile(r"hole \S+ mm \(\d+\)")
#: A supporting plane contains at most these shares of the nodes, and of the surface of a solid. A
#: side of a cube has 1/6, the underside of a plate 1/2: held there a plate is a layer on a rigid
#: floor, and one of 599 x 639 x 4.76 mm had its first antiresonance at 168 kHz.
LARGEST_PLANE, LARGEST_SIDE = 0.6, 0.3
#: A plane with less of the surface of a solid than this, or from which the solid reaches farther to
#: a side than this many times what is held to that side, is a small foot. A mount of 83 mm on one
#: of 6 mm at its end had 75 N +- 180 % and 54 contacts.
SMALLEST_SIDE, LARGEST_OVERHANG = 0.002, 4.0
#: Nodes lie on a plane if their distance is below this share of the part's size.
ON_PLANE = 1e-6


#: A number of which no two multiples have a common part behind the point.
GOLDEN = 0.6180339887498949
#: Largest rounding of a motion of 1 to 2: 1e-15 at the middles of edges of triangles.
ROUNDING = 1e-9


def held_motions(structure: Structure) -> tuple[Array, Array]:
    """(nodes (N, 3) of a structure, motion (N, 3) of each if all free dofs move, each by another
    number: 0 where it is held); empty for matrices alone.
    """
    from antiosc.extension import source

    motion = 1.0 + (np.arange(structure.rows)[:, None] * GOLDEN) % 1.0  # none cancels another
    motion[structure.fixed[structure.fixed < structure.rows]] = 0.0
    try:
        nodes, _, displacements = source(structure).at_nodes(structure, motion)
    except AntioscError:
        return np.zeros((0, 3)), np.zeros((0, 3))
    moved = displacements[:, :, 0]
    return nodes, np.where(np.abs(moved) > ROUNDING, moved, 0.0)


def held_nodes(structure: Structure, x: Array, size: float) -> BoolArray:
    """Mask of the nodes x (N, 3) that do not move where all free dofs of a structure do."""
    nodes, motion = held_motions(structure)
    fixed = ~motion.any(axis=1)
    if not fixed.any():
        return np.zeros(len(x), dtype=bool)
    distance = cKDTree(nodes[fixed]).query(x)[0]
    return np.asarray(distance < SAME_PLACE * size)


def groups_with(mesh: Mesh, words: Sequence[str]) -> tuple[str, ...]:
    """Groups of facets, edges or nodes named with one of these words; the first word first."""
    lower = {
        n: n.lower()
        for n, parts in mesh.groups.items()
        if min(parts, default=mesh.tdim) < mesh.tdim
    }
    return tuple(n for word in words for n, low in lower.items() if word in low)


def equal_holes(mesh: Mesh) -> tuple[str, ...]:
    """The holes of the diameter of which there are most, two or more: bolts hold the part there."""
    holes = [name for name in mesh.groups if HOLE.fullmatch(name)]
    counts = Counter(name.rpartition(" ")[0] for name in holes)
    common_diameter, count = counts.most_common(1)[0] if counts else ("", 0)
    return tuple(name for name in holes if count > 1 and name.rpartition(" ")[0] == common_diameter)


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


def supporting_plane(
    x: Array, low: Array, high: Array, size: float, faces: IntArray | None
) -> tuple[BoolArray, list[list[float]] | None, bool]:
    """(mask of nodes on a side of the box, plane, whether it is a small foot of the part).

    An empty mask and None where no side serves. `faces`: corners (F, k) of the surface of a solid,
    None of another part. The first side that is no small foot; else that with the least overhang.
    """
    sides = [(2, low), (0, low), (1, low), (0, high), (1, high)]
    feet: list[tuple[float, int, BoolArray, list[list[float]]]] = []
    sides += [(2, high)] if faces is not None else []
    for axis, corner in sides:
        on_plane = np.abs(x[:, axis] - corner[axis]) < ON_PLANE * size
        is_plausible = min(3, len(x) // 4) <= on_plane.sum() <= max(1.0, LARGEST_PLANE * len(x))
        share = 1.0 if faces is None else _share(x[faces], on_plane[faces])
        plane = [rounded_to(corner, size), np.eye(3)[axis].tolist()]
        if not is_plausible or (faces is not None and not 0 < share <= LARGEST_SIDE):
            continue
        overhang = 0.0 if faces is None else _overhang(x[on_plane], low, high, axis)
        if share >= SMALLEST_SIDE and overhang <= LARGEST_OVERHANG:
            return on_plane, plane, False
        feet.append((overhang, len(feet), on_plane, plane))
    if feet:
        least = min(feet, key=lambda foot: foot[:2])
        return least[2], least[3], least[0] > LARGEST_OVERHANG
    return np.zeros(len(x), dtype=bool), None, False


def _overhang(held: Array, low: Array, high: Array, axis: int) -> float:
    """Largest distance of the part from the middle of held nodes, along their plane, over how far
    these reach to either side.
    """
    across = [k for k in range(3) if k != axis]
    middle = (held.max(axis=0) + held.min(axis=0))[across] / 2
    reach = np.maximum(high[across] - middle, middle - low[across])
    half = np.ptp(held, axis=0)[across] / 2
    return float((reach / np.maximum(half, 1e-9 * reach.max())).max())


def _share(corners: Array, chosen: BoolArray) -> float:
    """Share of the area of faces (F, k, 3) all of whose corners are chosen (F, k)."""
    area = np.linalg.norm(face_areas(corners), axis=1)
    return float(area[chosen.all(axis=1)].sum() / area.sum())
