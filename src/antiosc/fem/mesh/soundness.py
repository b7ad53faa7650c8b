"""Checks of the cells of a file before they become a mesh: errors and warnings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from antiosc.base._types import Array
from antiosc.base.checks import in_words
from antiosc.base.errors import MeshError, warn
from antiosc.fem.mesh import conformity
from antiosc.fem.platform import compat
from antiosc.io.neutral import IntArray, RawMesh
from antiosc.io.reading import keys

#: Cells of which two can have two sides in common and differ; dolfinx 0.5 dies of such a pair.
TWO_SIDES = ("quadrilateral", "hexahedron")


def sound(
    raw: RawMesh, name: str, made_here: bool, pieces: bool = False, by: str = 'cells="its group"'
) -> RawMesh:
    """`raw` itself, or without folded cells if gmsh made it here; `name` is that of the file.

    `pieces`: it may fall into pieces, for constraints join them; `by`: what else chooses one.

    Raises
    ------
    MeshError
        Repeated cells, two with two sides in common, cells without length, area or volume, pieces
        that share no node, nodes inside sides that neighbours do not share.

    Warns
    -----
    AntioscWarning
        Cells that fold over, lock in bending or overlap, cracks and hanging nodes.
    """
    kind = raw.kind
    vertices = raw.cells[:, : kind.vertices]
    cells = raw.cells[:, compat.node_order(kind.shape, kind.nodes, raw.convention)]
    fills = kind.dim == raw.points.shape[1]

    def told(some: IntArray, what: str, remedy: str) -> str:
        centre = raw.points[raw.cells[some[0]]].mean(axis=0)
        return (
            f"{len(some)} of {len(cells)} cells of {name} {what}, one at {in_words(centre)}: "
            f"{remedy}."
        )

    def refuse(some: IntArray, what: str, remedy: str) -> None:
        if len(some):
            raise MeshError(told(some, what, remedy))

    ordered = np.sort(raw.cells, axis=1)
    refuse(
        np.flatnonzero((ordered[:, 1:] == ordered[:, :-1]).any(axis=1)),
        "use a node twice", "write them as cells of fewer nodes, or mesh it anew",
    )  # fmt: skip
    refuse(
        conformity.repeated(vertices),
        "repeat another one, node by node", "delete the copies",
    )  # fmt: skip
    if kind.shape in TWO_SIDES:
        refuse(
            conformity.doublets(vertices, kind),
            "share two sides with another one", "make one cell of both, or divide them",
        )  # fmt: skip
    if fills:
        refuse(
            conformity.crowded(vertices, kind),
            "share a side with more than one other",
            "they overlap; delete the superfluous ones",
        )
    refuse(
        collapsed(raw.points, cells, kind.shape, kind.order),
        f"have no {('length', 'area', 'volume')[kind.dim - 1]}",
        "merge the nodes that coincide, or mesh it anew",
    )
    if kind.order > 1 and not made_here:
        refuse(
            conformity.unlike_middles(cells, compat.nodes_between(kind.shape)),
            "have a node inside a side that is a corner of another cell, or not the node that "
            "another cell has there",
            "merge the nodes that coincide, or mesh it anew",
        )
    if not pieces:
        _refuse_pieces(raw, name, by)
    if fills and made_here and kind.order == 2 and kind.shape in MID_SIDE_EDGES:
        return replace(raw, points=straightened(raw.points, raw.cells, kind.shape))
    if kind.dim > 1:
        bad = folded(raw.points, cells, kind.shape, kind.order)
        if len(bad):
            remedy = (
                "what is computed there is wrong; optimise the mesh (in gmsh: "
                "Mesh.HighOrderOptimize = 2) or read it with order=1"
            )
            warn(told(bad, "fold over themselves", remedy))
    if kind.shape == "hexahedron" and kind.order == 2:
        bend = bends(raw.points, cells)
        locked = np.flatnonzero(bend > MOST_BENT)
        if len(locked):
            high = 1 + LOCKING * float(bend.max()) ** 2
            remedy = (
                f"they are too stiff in bending, by a factor of up to {high:.3g}; divide them "
                "along the curve, or model the part as a Shell"
            )
            what = f"are one layer, curved by more than {MOST_BENT} of its thickness"
            warn(told(locked, what, remedy))
    if not made_here:
        over = conformity.overlapping(raw.points, vertices, kind)
        if len(over):
            remedy = (
                "mass and stiffness count twice there; mesh the parts as one (in gmsh: "
                "BooleanUnion or BooleanFragments)"
            )
            warn(told(over, "overlap others", remedy))
        if not pieces:
            _tell_cracks(raw, vertices, name)
    return raw


def _refuse_pieces(raw: RawMesh, name: str, by: str) -> None:
    n = len(raw.points)
    first = np.repeat(raw.cells[:, :1], raw.cells.shape[1] - 1, axis=1)
    graph = coo_matrix(
        (np.ones(first.size, dtype=np.int8), (first.ravel(), raw.cells[:, 1:].ravel())),
        shape=(n, n),
    )
    count, label = connected_components(graph, directed=False)
    if count > 1:
        sizes = np.sort(np.bincount(label[raw.cells[:, 0]], minlength=count))[::-1]
        shown = ", ".join(str(s) for s in sizes[:4]) + (", …" if count > 4 else "")
        raise MeshError(
            f"{name} falls into {count} pieces that share no node ({shown} cells): join them "
            "(nodes that coincide: merge=1e-6; in gmsh: BooleanFragments or Coherence) or read the "
            f"piece of interest ({by})."
        )


def _tell_cracks(raw: RawMesh, vertices: IntArray, name: str) -> None:
    loose = conformity.unjoined(raw.points, vertices, raw.kind)
    if len(loose):
        warn(
            f"{len(loose)} nodes of {name} lie on cells that they do not belong to, one at "
            f"{in_words(raw.points[loose[0]])}: the mesh has a crack there, by coincident or "
            "hanging nodes; merge them, or mesh the parts as one, unless the crack is intended."
        )


# -- Folded and collapsed cells: found by their Jacobian, straightened if gmsh made them.
#
# A curved cell at a tight fillet may have a negative Jacobian at a corner. Integrals over it are
# wrong without any other symptom, and a point in it has two sets of reference coordinates.


#: Smallest Jacobian determinant over the largest in a cell, from which on it counts as sound.
SOUND = 0.02
#: Measure of a cell over its size to the power of its dimension below which it has none.
LEAST_MEASURE = 1e-7
#: Height of the arc over the thickness of second-order hexahedra above which it is told, and the
#: share by which its square raises their stiffness in bending: rings of one layer have 4.6 to 5.3.
MOST_BENT, LOCKING = 0.15, 5.0
#: Size of a cell over that of the mesh below which it is a point.
POINT = 1e-12
#: Mid-side nodes of second-order simplices in gmsh's order, from the third vertex on.
MID_SIDE_EDGES = {
    "triangle": [(0, 1), (1, 2), (2, 0)],
    "tetrahedron": [(0, 1), (1, 2), (2, 0), (3, 0), (3, 2), (3, 1)],
}


def folded(points: Array, cells: IntArray, shape: str, order: int, least: float = 0.0) -> IntArray:
    """Cells whose smallest Jacobian is at most `least` of the largest.

    Solids, or faces in the plane or in space; their nodes are in dolfinx's order.
    """
    slopes = compat.lattice_gradients(shape, order, 3 if order > 1 else 1)
    found = []
    for start in range(0, len(cells), 20_000):
        x = points[cells[start : start + 20_000]]
        J = np.einsum("dqn,cni->cqdi", slopes, x, optimize=True)
        det = np.linalg.det(J) if J.shape[2] == J.shape[3] else _along_mean_normal(J)
        det = det * np.sign(det.sum(axis=1))[:, None]
        found.append(start + np.flatnonzero(det.min(axis=1) <= least * det.max(axis=1)))
    return np.concatenate([np.zeros(0, dtype=np.int64), *found])


def _along_mean_normal(J: Array) -> Array:
    """Areas (cells, q) of faces in space, as seen along the mean normal of each."""
    normals = np.cross(J[:, :, 0], J[:, :, 1])
    mean = normals.sum(axis=1)
    size = np.linalg.norm(mean, axis=1, keepdims=True)
    return np.einsum("cqi,ci->cq", normals, mean / np.where(size > 0, size, 1.0))


def collapsed(points: Array, cells: IntArray, shape: str, order: int) -> IntArray:
    """Cells (nodes in dolfinx's order) without length, area or volume, in any space."""
    slopes = compat.lattice_gradients(shape, order, order)
    J = np.einsum("dqn,cni->cqdi", slopes, points[cells], optimize=True)
    measure = np.sqrt(np.abs(np.linalg.det(J @ J.swapaxes(2, 3)))).max(axis=1)
    size = np.abs(J).max(axis=(1, 2, 3))
    nothing = size <= POINT * np.ptp(points, axis=0).max()
    return np.flatnonzero(nothing | (measure <= LEAST_MEASURE * size ** slopes.shape[0]))


def bends(points: Array, cells: IntArray) -> Array:
    """Height (n,) of the arcs of second-order hexahedra over their thickness; 0 of straight ones.

    `cells` (n, 27): in dolfinx's order. Thickness is between two sides that no other cell has:
    layers share the bending, and lock less.
    """
    lattice = np.zeros((3, 3, 3), dtype=np.int64)
    corners = [([v], v) for v in range(8)]
    for vertices, node in (*corners, *compat.nodes_between("hexahedron")):
        i, j, k = (sum(v >> axis & 1 for v in vertices) * 2 // len(vertices) for axis in range(3))
        lattice[i, j, k] = node
    grids = [np.moveaxis(cells[:, lattice], axis, 1) for axis in (1, 2, 3)]
    sides = np.stack([grid[:, end, ::2, ::2] for grid in grids for end in (0, 2)])
    _, label, count = np.unique(keys(sides.reshape(-1, 4)), return_inverse=True, return_counts=True)
    alone = (count[label.reshape(3, 2, len(cells))] == 1).all(axis=1)
    found = np.zeros(len(cells))
    for grid, outside in zip(grids, alone, strict=True):
        x = points[grid]
        across = x[:, 2, 1, 1] - x[:, 0, 1, 1]
        chords = (x[:, 1, [0, 1], [1, 0]] + x[:, 1, [2, 1], [1, 2]]) / 2
        arcs = np.abs(np.einsum("nai,ni->na", x[:, 1, 1, 1, None] - chords, across)).max(axis=1)
        found = np.maximum(found, np.where(outside, arcs / np.sum(across**2, axis=1), 0.0))
    return found


def straightened(points: Array, cells: IntArray, shape: str) -> Array:
    """`points` with the mid-side nodes of folded second-order simplices moved to the midpoints.

    `cells` are in gmsh's order. Neighbours share those nodes: repeated until no cell is folded.
    """
    points = points.copy()
    edges = np.array(MID_SIDE_EDGES[shape])
    middles = slice(edges.max() + 1, edges.max() + 1 + len(edges))
    reordered = cells[:, compat.node_order(shape, cells.shape[1], "gmsh")]
    bad = folded(points, reordered, shape, 2, SOUND)
    before = -1
    straight = np.zeros(len(cells), dtype=bool)
    while len(bad):
        straight[bad] = True
        if straight.sum() == before:
            raise MeshError(
                f"gmsh made {len(bad)} cells without volume: choose another element size."
            )
        before = int(straight.sum())
        points[cells[straight][:, middles]] = points[cells[straight][:, edges]].mean(axis=2)
        near = np.isin(cells, cells[straight][:, middles]).any(axis=1)
        suspects = np.flatnonzero(near)
        bad = suspects[folded(points, reordered[suspects], shape, 2, SOUND)]
    return points
