"""Checks of the cells of a file before they become a mesh: of each cell, and of cells together.

A nonconforming mesh gives a result for another part: overlapping cells double the mass, and cells
that touch without common nodes form a crack. These checks use vertices only, not curved sides.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from antiosc.base._types import Array
from antiosc.base.checks import point_text
from antiosc.base.errors import MeshError, UnmeshableError, warn
from antiosc.fem.mesh.flat_cells import without_flat, without_short_edges
from antiosc.fem.platform import agree, compat
from antiosc.io.neutral import FACETS, CellKind, IntArray, RawMesh
from antiosc.io.reading import keys, piece_of_cells, pieces_error

if TYPE_CHECKING:
    from antiosc.fem.mesh import Mesh

#: Largest distance of a point from a face on which it lies, over the size of the face.
ON_SIDE = 1e-3
#: Barycentric coordinates above this are inside.
INSIDE_FACE = 1e-3
#: A simplex is flat if its Gram determinant over that of orthogonal edges is below this.
FLAT = 1e-12
#: Weights of the vertices of a cell or a face for an inner point on no line of symmetry.
_ASKEW = {2: (0.59, 0.41), 3: (0.46, 0.31, 0.23), 4: (0.37, 0.29, 0.21, 0.13)}
#: Simplices that make up a cell or a face.
_SIMPLICES: dict[str, list[tuple[int, ...]]] = {
    "quadrilateral": [(0, 1, 2), (0, 2, 3)],
    "hexahedron": [
        *((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6)),
        *((0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)),
    ],
}
#: Pairs examined at once; the corners of so many tetrahedra take 19 MB.
_PAIRS = 200_000


def repeated(cells: IntArray) -> IntArray:
    """Numbers of cells (n, vertices) with the same vertices as an earlier cell."""
    order = np.argsort(keys(cells), kind="stable")
    sorted_cells = np.sort(cells[order], axis=1)
    return np.sort(order[1:][(sorted_cells[1:] == sorted_cells[:-1]).all(axis=1)])


def crowded(cells: IntArray, kind: CellKind) -> IntArray:
    """Numbers of cells (n, vertices) with a facet that three or more cells share."""
    facets, owner = _facets(cells, kind)
    _, label, count = np.unique(keys(facets), return_inverse=True, return_counts=True)
    return np.unique(owner[count[label.reshape(-1)] > 2])


def doublets(cells: IntArray, kind: CellKind) -> IntArray:
    """Numbers of cells (n, vertices) that share more than one facet with the same other cell."""
    facets, owner = _facets(cells, kind)
    _, label = np.unique(keys(facets), return_inverse=True)
    shape = len(cells), int(label.max(initial=-1)) + 1
    incidence = csr_matrix(
        (np.ones(len(owner), dtype=np.int32), (owner, label.reshape(-1))), shape=shape
    )
    common = (incidence @ incidence.T).tocoo()
    return np.unique(common.row[(common.data > 1) & (common.row != common.col)])


def unlike_middles(cells: IntArray, between: Sequence[tuple[list[int], int]]) -> IntArray:
    """Numbers of cells (n, nodes) with a mid-side node that contradicts other cells.

    On one side, cells have different mid-side nodes; one node lies in two sides; or it is a corner
    of a cell. `between`: (vertices of an edge, face or cell, node inside it).
    """
    if not len(cells):
        return np.zeros(0, dtype=np.int64)
    side = np.concatenate([keys(cells[:, vertices]) for vertices, _ in between])
    node = np.concatenate([cells[:, node_columns] for _, node_columns in between])
    corners = np.unique(cells[:, sorted({v for vertices, _ in between for v in vertices})])
    is_corner = np.isin(node, corners)
    for first, second in ((side, node), (node, side)):
        order = np.lexsort((second, first))
        is_doublet = (first[order][1:] == first[order][:-1]) & (
            second[order][1:] != second[order][:-1]
        )
        is_corner[order[1:][is_doublet]] = True
    return np.unique(np.flatnonzero(is_corner) % len(cells))


def overlapping(points: Array, cells: IntArray, kind: CellKind) -> IntArray:
    """Numbers of overlapping cells (n, vertices), at least one of each pair.

    For cells that fill their space: facets with both cells on one side, and outer facets inside a
    cell. For sheets or lines in space: cells that lie on another cell.
    """
    if kind.dim < points.shape[1]:
        askew = _inner_points(points, cells)
        hanging, cell = _on_sides(points, cells, kind.shape, askew)
        return np.unique(hanging[hanging != cell])
    facets, owner = _facets(cells, kind)
    first, second, outer = _matched(facets)
    a, b = (_sides_of_cells(points, facets[first], cells[owner[k]]) for k in (first, second))
    folded = owner[first][a * b > 0]
    askew = _inner_points(points, facets[outer])
    numbers = [folded]
    for simplex in _SIMPLICES.get(kind.shape, [tuple(range(kind.vertices))]):
        corners = points[cells[:, list(simplex)]]
        for point, cell in _pairs_near(askew, corners):
            is_foreign = owner[outer[point]] != cell
            point = point[is_foreign]
            cell = cell[is_foreign]
            in_face = _barycentric(corners[cell], askew[point])[0].min(axis=1) > INSIDE_FACE
            numbers.append(owner[outer[point[in_face]]])
    return np.unique(np.concatenate(numbers))


def unjoined(points: Array, cells: IntArray, kind: CellKind) -> IntArray:
    """Nodes that lie on a side of a cell without being its vertex, as at cracks and hanging nodes.

    For cells (n, vertices) that fill their space: outer nodes on outer facets. For sheets and
    lines: nodes at free edges and ends on cells.
    """
    facets, _ = _facets(cells, kind)
    _, _, outer = _matched(facets)
    nodes = np.unique(facets[outer])
    shape = kind.shape
    sides = cells
    if kind.dim == points.shape[1]:
        sides = facets[outer]
        shape = {2: "interval", 3: "triangle", 4: "quadrilateral"}[sides.shape[1]]
    point, side = _on_sides(points, sides, shape, points[nodes])
    foreign = (sides[side] != nodes[point][:, None]).all(axis=1)
    return np.unique(nodes[point[foreign]])


# --- Facets ---------------------------------------------------------------------------------------


def _facets(cells: IntArray, kind: CellKind) -> tuple[IntArray, IntArray]:
    """All facets (n, vertices) of all cells, and the cell of each."""
    sides = FACETS[kind.shape]
    facets = np.stack([cells[:, list(s)] for s in sides], axis=1)
    return facets.reshape(-1, facets.shape[2]), np.repeat(np.arange(len(cells)), len(sides))


def _matched(facets: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """(first, second) of pairs of equal facets, and the facets without an equal one."""
    code = keys(facets)
    order = np.argsort(code, kind="stable")
    equal = code[order][1:] == code[order][:-1]
    is_unmatched = np.ones(len(facets), dtype=bool)
    is_unmatched[order[1:][equal]] = is_unmatched[order[:-1][equal]] = False
    return order[:-1][equal], order[1:][equal], np.flatnonzero(is_unmatched)


def _sides_of_cells(points: Array, facets: IntArray, cells: IntArray) -> Array:
    """Signed number (n,) for each facet and cell: its sign is the side on which the cell lies."""
    x = points[facets]
    if points.shape[1] == 2:
        edge = x[:, 1] - x[:, 0]
        normal = np.column_stack([edge[:, 1], -edge[:, 0]])
    else:  # of a quadrilateral by its diagonals
        normal = np.cross(x[:, 2] - x[:, 0], x[:, -1] - x[:, 1])
    return np.einsum("ni,ni->n", points[cells].mean(axis=1) - x.mean(axis=1), normal)


def _inner_points(points: Array, rows: IntArray) -> Array:
    """A point inside each cell or face that lies on none of its lines of symmetry."""
    weights = np.array(_ASKEW[rows.shape[1]])
    return np.einsum("k,nki->ni", weights, points[rows])


# --- Points on and in simplices -------------------------------------------------------------------


def _on_sides(points: Array, sides: IntArray, shape: str, x: Array) -> tuple[IntArray, IntArray]:
    """Pairs (point of x, side) where the point lies on the side."""
    pairs_found = []
    for simplex in _SIMPLICES.get(shape, [tuple(range(sides.shape[1]))]):
        corners = points[sides[:, list(simplex)]]
        size = np.linalg.norm(np.ptp(corners, axis=1), axis=1)
        normal = _unit_normals(corners)
        for point, side in _pairs_near(x, corners):
            # of 3000 large triangles in disorder: 1.0 s in place of 5.3 s
            height = np.abs(np.einsum("ni,ni->n", x[point] - corners[side, 0], normal[side]))
            flat = height <= 2 * ON_SIDE * size[side]
            point = point[flat]
            side = side[flat]
            b, distance = _barycentric(corners[side], x[point])
            lies_on_side = (b.min(axis=1) > -ON_SIDE) & (distance <= ON_SIDE * size[side])
            pairs_found.append(np.stack([point[lies_on_side], side[lies_on_side]]))
    pairs = np.unique(
        np.concatenate([np.zeros((2, 0), dtype=np.int64), *pairs_found], axis=1), axis=1
    )
    return pairs[0], pairs[1]


def _unit_normals(corners: Array) -> Array:
    """Unit normals of triangles in space; 0 for other simplices and triangles without area."""
    if corners.shape[1:] != (3, 3):
        return np.zeros((len(corners), corners.shape[2]))
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    return np.asarray(normal / np.where(size > 0, size, 1.0))


def _pairs_near(x: Array, corners: Array) -> Iterator[tuple[IntArray, IntArray]]:
    """Yield blocks of pairs (point, simplex) in which the point lies in the ball around the
    simplex.
    """
    centres = corners.mean(axis=1)
    radii = np.linalg.norm(corners - centres[:, None], axis=2).max(axis=1) * (1 + ON_SIDE)
    if not len(x) or not len(radii):
        return
    tree = cKDTree(x)
    octave = np.floor(np.log2(radii)).astype(int)
    for o in np.unique(octave):
        members = np.flatnonzero(octave == o)
        for start in range(0, len(members), _PAIRS):
            simplices = members[start : start + _PAIRS]
            pairs = tree.sparse_distance_matrix(
                cKDTree(centres[simplices]), float(radii[simplices].max()), output_type="ndarray"
            )
            in_ball = pairs["v"] <= radii[simplices[pairs["j"]]]
            point = pairs["i"][in_ball]
            simplex = simplices[pairs["j"][in_ball]]
            for block in range(0, len(point), _PAIRS):
                yield point[block : block + _PAIRS], simplex[block : block + _PAIRS]


def _barycentric(corners: Array, x: Array) -> tuple[Array, Array]:
    """(barycentric coordinates (n, d + 1) of points projected on simplices, distances (n,)).

    The coordinates lie outside and the distance is inf for simplices without measure, such as half
    a quadrilateral with an angle of 180°.
    """
    edges = corners[:, 1:] - corners[:, :1]
    gram = edges @ edges.swapaxes(1, 2)
    sides = np.prod(np.einsum("ndd->nd", gram), axis=1)
    flat = np.linalg.det(gram) <= FLAT * sides
    gram[flat] = np.eye(gram.shape[1])
    offset = x - corners[:, 0]
    coordinates = np.linalg.solve(gram, np.einsum("ndi,ni->nd", edges, offset)[:, :, None])[:, :, 0]
    distance = np.linalg.norm(offset - np.einsum("nd,ndi->ni", coordinates, edges), axis=1)
    distance[flat] = np.inf
    coordinates[flat] = -1.0
    return np.column_stack([1 - coordinates.sum(axis=1), coordinates]), distance


#: Shapes of which two different cells can have two sides in common; dolfinx 0.5 crashes on these.
TWO_SIDES = ("quadrilateral", "hexahedron")


def sound(
    raw: RawMesh, name: str, made_here: bool, pieces: bool = False, by: str = 'cells="its group"'
) -> RawMesh:
    """The mesh after its checks; folded cells are straightened if gmsh made it here.

    `name`: name of the file; `pieces`: whether unconnected pieces are allowed, since constraints
    join them; `by`: arguments that choose a piece, for the message.

    Raises
    ------
    MeshError
        Repeated cells, two cells with two common sides, cells without length, area or volume,
        cells that cross themselves, unconnected pieces, nodes inside sides that neighbours do not
        share.

    Warns
    -----
    AntioscWarning
        Cells that fold over, lock in bending or overlap, cracks and hanging nodes.
    """
    kind = raw.kind
    if made_here:
        raw = without_short_edges(raw, name)
    flat = _collapsed_of(raw)
    if made_here and len(flat):
        raw = without_flat(raw, flat, name)
        flat = _collapsed_of(raw)
    vertices = raw.cells[:, : kind.vertices]
    cells = raw.cells[:, compat.node_order(kind.shape, kind.nodes, raw.convention)]
    fills = kind.dim == raw.points.shape[1]

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
    refuse(
        repeated(vertices),
        "repeat another one, node by node",
        "delete the copies",
    )
    if kind.shape in TWO_SIDES:
        refuse(
            doublets(vertices, kind),
            "share two sides with another one",
            "make one cell of both, or divide them",
        )
    if fills:
        refuse(
            crowded(vertices, kind),
            "share a side with more than one other",
            "they overlap; delete the superfluous ones",
        )
    refuse(
        flat,
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
    if kind.order > 1:  # nodes of a mesh that gmsh made may have been merged
        refuse(
            unlike_middles(cells, compat.nodes_between(kind.shape)),
            "have a node inside a side that is a corner of another cell, or not the node that "
            "another cell has there",
            "merge the nodes that coincide, or mesh it anew",
        )
    if not pieces:
        _refuse_pieces(raw, name, by)
    if made_here and kind.order == 2 and kind.shape in MID_SIDE_EDGES:
        return replace(raw, points=straightened(raw.points, raw.cells, kind.shape))
    if kind.dim > 1:
        bad = folded(raw.points, cells, kind.shape, kind.order)
        if len(bad):
            remedy = (
                "what is computed there is wrong; optimise the mesh (in gmsh: "
                "Mesh.HighOrderOptimize = 2) or read it with order 1"
            )
            warn(message(bad, "fold over themselves", remedy))
    if kind.shape == "hexahedron" and kind.order == 2:
        arc_heights = bends(raw.points, cells)
        locked = np.flatnonzero(arc_heights > MOST_BENT)
        if len(locked):
            high = 1 + LOCKING * float(arc_heights.max()) ** 2
            remedy = (
                f"they are too stiff in bending, by a factor of up to {high:.3g}; divide them "
                "along the curve, or model the part as a Shell"
            )
            fault = f"are one layer, curved by more than {MOST_BENT} of its thickness"
            warn(message(locked, fault, remedy))
    if not made_here:
        overlapping_cells = overlapping(raw.points, vertices, kind)
        if len(overlapping_cells):
            remedy = (
                "mass and stiffness count twice there; mesh the parts as one (in gmsh: "
                "BooleanUnion or BooleanFragments)"
            )
            warn(message(overlapping_cells, "overlap others", remedy))
        if not pieces:
            _tell_cracks(raw, vertices, name)
    return raw


def _collapsed_of(raw: RawMesh) -> IntArray:
    """Numbers of the cells of a mesh without length, area or volume."""
    kind = raw.kind
    cells = raw.cells[:, compat.node_order(kind.shape, kind.nodes, raw.convention)]
    return collapsed(raw.points, cells, kind.shape, kind.order)


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


def _tell_cracks(raw: RawMesh, vertices: IntArray, name: str) -> None:
    """Warn of cracks and hanging nodes of the mesh."""
    loose = unjoined(raw.points, vertices, raw.kind)
    if len(loose):
        warn(
            f"{len(loose)} nodes of {name} lie on cells that they do not belong to, one at "
            f"{point_text(raw.points[loose[0]])}: the mesh has a crack there, by coincident or "
            "hanging nodes; merge them, or mesh the parts as one, unless the crack is intended."
        )


# -- Folded and collapsed cells have a bad Jacobian; they are straightened if gmsh made them.
#
# A curved cell at a tight fillet may have a negative Jacobian at a corner. Integrals over it are
# wrong without any other symptom, and a point in it has two sets of reference coordinates.


#: Least ratio of the smallest to the largest Jacobian determinant of a sound cell.
SOUND = 0.02
#: A cell has collapsed if its measure over its size to the power of its dimension is below this.
LEAST_MEASURE = 1e-7
#: Arc height over thickness of second-order hexahedra above which a warning is given: from there on
#: their bending stiffness is 11 % or more too high.
MOST_BENT = 0.15
#: Relative error of that stiffness over the square of the ratio (4.6 to 5.3 in rings of one layer).
LOCKING = 5.0
#: A cell is a point if its size over that of the mesh is below this.
POINT = 1e-12
#: Mid-side nodes of second-order simplices in gmsh's order, from the third vertex on.
MID_SIDE_EDGES = {
    "triangle": [(0, 1), (1, 2), (2, 0)],
    "tetrahedron": [(0, 1), (1, 2), (2, 0), (3, 0), (3, 2), (3, 1)],
}


def folded(points: Array, cells: IntArray, shape: str, order: int, least: float = 0.0) -> IntArray:
    """Numbers of cells whose smallest Jacobian is at most `least` times the largest.

    The cells are solids, or faces in a plane or in space, with nodes in dolfinx's order.
    """
    slopes = compat.lattice_gradients(shape, order, 3 if order > 1 else 1)
    numbers = []
    for start in range(0, len(cells), 20_000):
        x = points[cells[start : start + 20_000]]
        J = np.einsum("dqn,cni->cqdi", slopes, x, optimize=True)
        det = np.linalg.det(J) if J.shape[2] == J.shape[3] else _along_mean_normal(J)
        det = det * np.sign(det.sum(axis=1))[:, None]
        numbers.append(start + np.flatnonzero(det.min(axis=1) <= least * det.max(axis=1)))
    return np.concatenate([np.zeros(0, dtype=np.int64), *numbers])


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
    if shape == "interval":
        return np.zeros(0, dtype=np.int64)
    slopes = compat.lattice_gradients(shape, order, 3 if order > 1 else 1)
    numbers = []
    for start in range(0, len(cells), 20_000):
        x = points[cells[start : start + 20_000]]
        J = np.einsum("dqn,cni->cqdi", slopes, x, optimize=True)
        if J.shape[2] == J.shape[3]:
            measure = np.linalg.det(J)[..., None]
        else:
            measure = np.cross(J[:, :, 0], J[:, :, 1])
        total = np.linalg.norm(measure.sum(axis=1), axis=1)
        parts = np.linalg.norm(measure, axis=2).sum(axis=1)
        numbers.append(start + np.flatnonzero(total <= CROSSED * parts))
    return np.concatenate([np.zeros(0, dtype=np.int64), *numbers])


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


def bends(points: Array, cells: IntArray) -> Array:
    """Arc height over thickness (n,) of second-order hexahedra; 0 for straight ones.

    `cells` (n, 27): in dolfinx's order. The thickness is between two sides that no other cell has;
    hexahedra in several layers share the bending and lock less.
    """
    lattice = np.zeros((3, 3, 3), dtype=np.int64)
    corners = [([v], v) for v in range(8)]
    for vertices, node in (*corners, *compat.nodes_between("hexahedron")):
        i, j, k = (sum(v >> axis & 1 for v in vertices) * 2 // len(vertices) for axis in range(3))
        lattice[i, j, k] = node
    grids = [np.moveaxis(cells[:, lattice], axis, 1) for axis in (1, 2, 3)]
    sides = np.stack([grid[:, end, ::2, ::2] for grid in grids for end in (0, 2)])
    _, label, count = np.unique(keys(sides.reshape(-1, 4)), return_inverse=True, return_counts=True)
    unshared = (count[label.reshape(3, 2, len(cells))] == 1).all(axis=1)
    ratio = np.zeros(len(cells))
    for grid, free_sides in zip(grids, unshared, strict=True):
        x = points[grid]
        thickness = x[:, 2, 1, 1] - x[:, 0, 1, 1]
        chords = (x[:, 1, [0, 1], [1, 0]] + x[:, 1, [2, 1], [1, 2]]) / 2
        arcs = np.abs(np.einsum("nai,ni->na", x[:, 1, 1, 1, None] - chords, thickness)).max(axis=1)
        ratio = np.maximum(ratio, np.where(free_sides, arcs / np.sum(thickness**2, axis=1), 0.0))
    return ratio


def straightened(points: Array, cells: IntArray, shape: str) -> Array:
    """`points` with the mid-side nodes of folded second-order simplices moved to the midpoints.

    `cells` are in gmsh's order. This is repeated until no cell is folded, since neighbours share
    the nodes.
    """
    points = points.copy()
    edges = np.array(MID_SIDE_EDGES[shape])
    middles = slice(edges.max() + 1, edges.max() + 1 + len(edges))
    reordered = cells[:, compat.node_order(shape, cells.shape[1], "gmsh")]
    bad = folded(points, reordered, shape, 2, SOUND)
    last_count = -1
    straight = np.zeros(len(cells), dtype=bool)
    while len(bad):
        straight[bad] = True
        if straight.sum() == last_count:
            raise UnmeshableError(
                f"gmsh made {len(bad)} cells without volume: choose another element size."
            )
        last_count = int(straight.sum())
        points[cells[straight][:, middles]] = points[cells[straight][:, edges]].mean(axis=2)
        has_moved_node = np.isin(cells, cells[straight][:, middles]).any(axis=1)
        suspects = np.flatnonzero(has_moved_node)
        bad = suspects[folded(points, reordered[suspects], shape, 2, SOUND)]
    return points
