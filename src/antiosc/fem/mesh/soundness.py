"""Checks of the cells of a file before they become a mesh, of each cell and of cells together: one
that is there twice doubles the mass.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_matrix

from antiosc.base._types import Array, BoolArray
from antiosc.base.checks import point_text
from antiosc.base.errors import MeshError, UnmeshableError, warn
from antiosc.fem.platform import agree, compat
from antiosc.io.neutral import EDGES, FACETS, CellKind, IntArray, RawMesh
from antiosc.io.reading import keys, piece_of_cells, pieces_error

if TYPE_CHECKING:
    from antiosc.fem.mesh import Mesh


def misfits(cells: IntArray, kind: CellKind) -> tuple[IntArray, IntArray]:
    """Numbers of cells (n, vertices) that share two sides or more with another one, on which
    dolfinx 0.5 crashes, and of those with a side that three or more share.
    """
    sides = FACETS[kind.shape]
    facets = np.vstack([cells[:, list(side)] for side in sides])
    owner = np.tile(np.arange(len(cells)), len(sides))
    _, label, count = np.unique(keys(facets), return_inverse=True, return_counts=True)
    label = label.ravel()

    incidence = csr_matrix((np.ones(len(owner), dtype=np.int32), (owner, label)))
    common = (incidence @ incidence.T).tocoo()
    twice = (common.data > 1) & (common.row != common.col)
    return np.unique(common.row[twice]), np.unique(owner[count[label] > 2])


def sound(
    raw: RawMesh, name: str, made_here: bool, pieces: bool = False, by: str = 'cells="its group"'
) -> RawMesh:
    """The mesh after its checks; folded cells are straightened if gmsh made it here, else told.

    `name`: name of the file; `pieces`: whether unconnected pieces are allowed, since constraints
    join them; `by`: arguments that choose a piece, for the message.

    Raises
    ------
    MeshError
        Repeated cells, two cells with two common sides, cells without length, area or volume,
        cells that cross themselves, unconnected pieces.
    """
    kind = raw.kind
    cells = raw.cells[:, compat.node_order(kind.shape, kind.nodes, "vtk")]

    def message(bad: IntArray, what: str, remedy: str) -> str:
        centre = raw.points[raw.cells[bad[0]]].mean(axis=0)
        return (
            f"{len(bad)} of {len(cells)} cells of {name} {what}, one at {point_text(centre)}: "
            f"{remedy}."
        )

    def refuse(bad: IntArray, what: str, remedy: str) -> None:
        if len(bad):
            raise (UnmeshableError if made_here else MeshError)(message(bad, what, remedy))

    ordered = np.sort(raw.cells, axis=1)
    refuse(
        np.flatnonzero((ordered[:, 1:] == ordered[:, :-1]).any(axis=1)),
        "use a node twice",
        "write them as cells of fewer nodes, or mesh it anew",
    )
    doubles, crowded = misfits(raw.cells[:, : kind.vertices], kind)
    refuse(
        doubles,
        "repeat another one, or share two sides with it",
        "delete the copies, or make one cell of both",
    )
    if kind.dim == raw.points.shape[1]:
        refuse(
            crowded,
            "share a side with more than one other",
            "they overlap; delete the superfluous ones",
        )
    refuse(
        collapsed(raw.points, cells, kind.shape, kind.order),
        f"have no {('length', 'area', 'volume')[kind.dim - 1]}",
        "merge the nodes that coincide, or mesh it anew",
    )
    # gmsh bends a few curved cells too far where a mesh is coarse for its curves
    if not (made_here and kind.order > 1):
        refuse(
            crossed(raw.points, cells, kind.shape, kind.order),
            "cross themselves, as a bowtie does",
            "give their nodes in order around each side, or mesh it anew",
        )
    if not pieces:
        _refuse_pieces(raw, name, by)
    if made_here and kind.order == 2 and kind.shape in SIMPLICES:
        return replace(raw, points=straightened(raw.points, raw.cells, kind.shape))
    if kind.dim > 1:
        bad = folded(raw.points, cells, kind.shape, kind.order)
        if len(bad):
            remedy = (
                "what is computed there is wrong; optimise the mesh (in gmsh: "
                "Mesh.HighOrderOptimize = 2) or read it with order 1"
            )
            warn(message(bad, "fold over themselves", remedy))
    return raw


def _refuse_pieces(raw: RawMesh, name: str, by: str) -> None:
    """MeshError if the mesh has pieces without a common node."""
    count = int(piece_of_cells(raw).max()) + 1
    if count > 1:
        raise pieces_error(
            raw,
            f"{name} falls into {count} pieces that share no node",
            "join them (nodes that coincide: merge; solids of a CAD file: fragments; in gmsh: "
            f"BooleanFragments) or read the piece of interest ({by}).",
        )


# -- Folded and collapsed cells have a bad Jacobian; they are straightened if gmsh made them.
#
# A curved cell at a tight fillet may have a negative Jacobian at a corner. Integrals over it are
# wrong without any other symptom, and a point in it has two sets of reference coordinates.


#: Cells whose Jacobians are computed at a time.
BLOCK = 20_000
#: Least ratio of the smallest to the largest Jacobian determinant of a sound cell.
SOUND = 0.02
#: A cell has collapsed if its measure over its size to the power of its dimension is below this.
LEAST_MEASURE = 1e-7
#: A cell is a point if its size over that of the mesh is below this.
POINT = 1e-12
#: Corners of the edges of second-order simplices, in the order of their middle nodes.
SIMPLICES = {"triangle": EDGES["triangle"], "tetrahedron": EDGES["tetra"]}


def _failing(
    points: Array, cells: IntArray, shape: str, order: int, fails: Callable[[Array], BoolArray]
) -> IntArray:
    """Numbers of cells whose Jacobian determinants (cells, q), of a positive sum in each, fail.

    The cells are solids, or faces in a plane or in space, with nodes in dolfinx's order.
    """
    slopes = compat.lattice_gradients(shape, order, 3 if order > 1 else 1)
    failed = [np.zeros(0, dtype=bool)]
    for start in range(0, len(cells), BLOCK):
        x = points[cells[start : start + BLOCK]]
        J = np.einsum("dqn,cni->cqdi", slopes, x, optimize=True)
        det = np.linalg.det(J) if J.shape[2] == J.shape[3] else _along_mean_normal(J)
        failed.append(fails(det * np.sign(det.sum(axis=1))[:, None]))
    return np.flatnonzero(np.concatenate(failed))


def folded(points: Array, cells: IntArray, shape: str, order: int, least: float = 0.0) -> IntArray:
    """Numbers of cells whose smallest Jacobian is at most `least` times the largest."""

    def fails(det: Array) -> BoolArray:
        return np.asarray(det.min(axis=1) <= least * det.max(axis=1))

    return _failing(points, cells, shape, order, fails)


def _along_mean_normal(J: Array) -> Array:
    """Signed areas (cells, q) of faces in space, projected along the mean normal of each."""
    normals = np.cross(J[:, :, 0], J[:, :, 1])
    mean = normals.sum(axis=1)
    size = np.linalg.norm(mean, axis=1, keepdims=True)
    return np.einsum("cqi,ci->cq", normals, mean / np.where(size > 0, size, 1.0))


def collapsed(points: Array, cells: IntArray, shape: str, order: int) -> IntArray:
    """Numbers of cells (nodes in dolfinx's order) without length, area or volume."""
    slopes = compat.lattice_gradients(shape, order, order)
    J = np.einsum("dqn,cni->cqdi", slopes, points[cells], optimize=True)
    measure = np.sqrt(np.abs(np.linalg.det(J @ J.swapaxes(2, 3)))).max(axis=1)
    size = np.abs(J).max(axis=(1, 2, 3))
    is_point = size <= POINT * np.ptp(points, axis=0).max()
    return np.flatnonzero(is_point | (measure <= LEAST_MEASURE * size ** slopes.shape[0]))


#: A cell crosses itself if its signed area or volume over the unsigned one is below this: bowties
#: have 0 to 0.4; a quadrilateral with a corner beyond its diagonal has 0.6.
CROSSED = 0.5


def crossed(points: Array, cells: IntArray, shape: str, order: int) -> IntArray:
    """Numbers of cells (nodes in dolfinx's order) whose sides cross, as those of a bowtie."""

    def fails(det: Array) -> BoolArray:
        return np.asarray(det.sum(axis=1) <= CROSSED * np.abs(det).sum(axis=1))

    return _failing(points, cells if shape != "interval" else cells[:0], shape, order, fails)


def refuse_degenerate(mesh: Mesh) -> None:
    """MeshError on all ranks if a cell has no area or volume or intersects itself."""
    owned_cells = compat.cell_map(mesh.dolfinx).size_local
    nodes = compat.geometry_nodes(mesh.dolfinx)[:owned_cells].astype(np.int64)
    points = mesh.dolfinx.geometry.x[:, : mesh.gdim]
    size = ("length", "area", "volume")[mesh.tdim - 1]
    for check, fault in ((collapsed, f"have no {size}"), (crossed, "cross themselves")):
        bad = check(points, nodes, mesh.cell, mesh.order) if owned_cells else nodes[:0, 0]
        total = mesh.comm.allreduce(len(bad))
        error = None
        if len(bad):
            error = MeshError(
                f"{total} of {mesh.n_cells} {mesh.cell} cells {fault}, one at "
                f"{point_text(points[nodes[bad[0]]].mean(axis=0))}: mesh the part anew, or remove "
                "these cells."
            )
        agree(mesh.comm, error)


def straightened(points: Array, cells: IntArray, shape: str) -> Array:
    """`points` with the mid-side nodes of folded second-order simplices moved to the midpoints.

    `cells` are in VTK's order. This is repeated until no cell is folded, since neighbours share
    the nodes.
    """
    points = points.copy()
    edges = np.array(SIMPLICES[shape])
    first = int(edges.max()) + 1
    reordered = cells[:, compat.node_order(shape, cells.shape[1], "vtk")]
    bad = folded(points, reordered, shape, 2, SOUND)
    straight = np.zeros(len(cells), dtype=bool)
    while len(bad):
        if straight[bad].all():
            raise UnmeshableError(f"gmsh made {len(bad)} cells without volume: change the size.")
        straight[bad] = True
        middles = cells[straight][:, first : first + len(edges)]
        points[middles] = points[cells[straight][:, edges]].mean(axis=2)
        suspects = np.flatnonzero(np.isin(cells, middles).any(axis=1))
        bad = suspects[folded(points, reordered[suspects], shape, 2, SOUND)]
    return points
