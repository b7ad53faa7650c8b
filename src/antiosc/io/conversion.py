"""Elements of a deck as cells of one mesh.

A mesh here has cells of one kind. If a deck has volumes of several shapes, wedges, pyramids or
collapsed hexahedra, all are divided into tetrahedra; triangles and quadrilaterals become triangles,
unless they are joined as two meshes (`kept_apart`).
Every cell is divided into the pyramids from its node of lowest number over the faces without this
node, and every rectangle from its node of lowest number. Two cells therefore divide the face
between them in the same way without knowing each other (the pulling triangulation: C. W. Lee,
*Subdivisions and triangulations of polytopes*, 1997). New nodes in the middle of faces, cells and
diagonals lie where the serendipity functions of the element place them, so that curved surfaces
keep their shape.
"""

from __future__ import annotations

import numpy as np

from antiosc.base._types import BoolArray
from antiosc.base.errors import MeshError
from antiosc.io.deck import Array, Block, Deck, IntArray, listed
from antiosc.io.neutral import KINDS, FileMesh, of_kind
from antiosc.io.node_table import DIAGONALS, FixedEntities, NodeTable
from antiosc.io.shapes import CELLS, CORNERS, DIMENSION, EDGES, FACES, rectangles

#: (shape, geometric order) -> name of the kind of cells
CELL_LABELS = {(CELLS[label][0], kind.order): label for label, kind in KINDS.items()}
NO_CELLS = np.zeros(0, dtype=np.int64)


def as_mesh(deck: Deck, *, halve_lines: bool = False) -> FileMesh:
    """The deck's elements as cells, its sets as groups.

    `halve_lines`: second-order lines become two straight ones each, as `Beam` needs them.

    Raises
    ------
    MeshError
        An element whose coincident nodes leave it without volume or area.
    """
    nodes = NodeTable(deck.points)
    cells: dict[str, IntArray] = {}
    owners: dict[str, IntArray] = {}
    every = [(block, own) for block, own in deck.numbered() if len(block)]
    shapes_of: list[tuple[str, str, list[Block]]] = []
    split = False
    for dim in (3, 2, 1, 0):
        some = [one for one in every if DIMENSION[one[0].shape] == dim]
        if dim == 1 and halve_lines:
            some = [_halved(*one) for one in some]
        order = 2 if any(block.mids.shape[1] for block, _ in some) else 1
        for block, _ in some if order == 2 else ():
            _note_middles(block, nodes)
        mixed = dim == 2 and bool(deck.model and deck.model.get("mixed"))
        for alike in _by_shape(some) if mixed else filter(None, [some]):
            shapes = {block.shape for block, _ in alike}
            divided = shapes not in _WHOLE or any(_collapsed(block) for block, _ in alike)
            split = dim > 1 and (split or divided)
            shape = _SIMPLEX[dim] if split else next(iter(shapes))
            label = CELL_LABELS[shape, order]
            cells[label], owners[label] = _of_dimension(deck, alike, split, order, nodes)
            shapes_of.append((label, shape, [block for block, _ in alike]))
    mesh = FileMesh(nodes.all_points(), cells, "vtk")
    for name, elements in deck.element_sets.items():
        inside = np.zeros(deck.n_elements, dtype=bool)
        inside[elements] = True
        rows = {label: np.flatnonzero(inside[owner]) for label, owner in owners.items()}
        mesh.groups[name] = {label: r for label, r in rows.items() if len(r)}
    mesh.node_sets = dict(deck.node_sets)
    joined = bool(deck.model and deck.model["joined"])
    # else those of lower dimension are sides of the first
    for label, shape, blocks in shapes_of[: None if joined else 1] if deck.fixed else ():
        entities = FixedEntities(shape, cells[label], blocks, nodes)
        own = of_kind("", label) if joined else ""
        mesh.fixed |= {name + own: entities.of(rows) for name, rows in deck.fixed.items()}
    mesh.model = deck.model
    if joined and deck.model:
        joints = deck.model["joints"]
        dependent = {terms[0][0] for terms in joints["equations"] if terms[0][0] >= 0}
        joints["among"] = nodes.near(np.array(sorted(dependent), dtype=np.int64))
    mesh.told = list(deck.told)
    if deck.left:
        gone = sum(deck.left.values())
        mesh.told.append(
            f"{deck.name} holds {deck.n_elements + gone} elements; {deck.n_elements} of them are "
            f"cells of the mesh, which leaves out {listed(deck.left)}."
        )
    return mesh


def kept_apart(deck: Deck) -> bool:
    """Whether sheets are mostly quadrilaterals with some triangles, so that two meshes are smaller.

    Not beside volumes, whose faces may become triangles.
    """
    if any(DIMENSION[block.shape] == 3 for block in deck.blocks):
        return False
    sheets = [b for b in deck.blocks if DIMENSION[b.shape] == 2]
    triangles = sum(len(b) if b.shape == "triangle" else int(_folded(b).sum()) for b in sheets)
    return 0 < 2 * triangles <= sum(map(len, sheets))


def _by_shape(sheets: list[tuple[Block, IntArray]]) -> list[list[tuple[Block, IntArray]]]:
    """The quadrilaterals; the triangles and the quadrilaterals that use a node twice."""
    found: list[list[tuple[Block, IntArray]]] = [[], []]
    for block, elements in sheets:
        flat = _folded(block) | (block.shape == "triangle")
        for own, some in zip(found, (~flat, flat), strict=True):
            if some.any():
                own.append((block[some], elements[some]))
    return found


#: Shapes that are not divided if all elements have one of them.
_WHOLE = [{"point"}, {"line"}, {"triangle"}, {"quad"}, {"tetra"}, {"hexahedron"}]
_SIMPLEX = {0: "point", 1: "line", 2: "triangle", 3: "tetra"}


def _of_dimension(
    deck: Deck, blocks: list[tuple[Block, IntArray]], split: bool, order: int, nodes: NodeTable
) -> tuple[IntArray, IntArray]:
    """(cells with all their nodes, the element of each)."""
    for block, _ in blocks if order == 2 and split else ():
        _note_cuts(block, nodes)
    tables, owners = [], []
    for block, elements in blocks:
        every = np.arange(len(block))
        corners, rows = _simplices(block) if split else (block.corners, every)
        lost = np.setdiff1d(every, rows)
        if len(lost):
            raise MeshError(
                f"{len(lost)} {block.type} elements of {deck.name} use one node several times "
                "so that they have no volume or area; delete them."
            )
        shape = _SIMPLEX[DIMENSION[block.shape]] if split else block.shape
        if order == 2:
            ends = corners[:, np.array(EDGES[shape])]
            mids = nodes.between(ends)
            inner = _inner(block, nodes) if not split else corners[:, :0]
            corners = np.hstack([corners, mids, inner])
        tables.append(corners)
        owners.append(elements[rows])
    return np.vstack(tables), np.concatenate(owners)


def _note_middles(block: Block, nodes: NodeTable) -> None:
    """Enter the middle nodes of the edges in the deck into the table."""
    if block.mids.shape[1]:
        ends = block.corners[:, np.array(EDGES[block.shape])]
        given = (block.mids >= 0) & (ends[..., 0] != ends[..., 1])
        nodes.give(ends[given], block.mids[given])


def _middles(block: Block, nodes: NodeTable, face: tuple[int, ...] = ()) -> tuple[Array, IntArray]:
    """(the middles of a face of four corners, or of hexahedra; the nodes around them).

    −1/4 of the corners and 1/2 of the middles of the edges of a face, 1/4 of those of a hexahedron.
    """
    corners = block.corners[:, list(face)] if face else block.corners
    edges = np.stack([face, np.roll(face, -1)], axis=1) if face else np.array(EDGES[block.shape])
    ends = block.corners[:, edges]
    of_edges = nodes.points_between(ends).sum(axis=1) * (0.5 if face else 0.25)
    centres = of_edges - nodes.points[corners].sum(axis=1) / 4
    return np.asarray(centres), np.hstack([corners, nodes.between(ends)])


def _inner(block: Block, nodes: NodeTable) -> IntArray:
    """Nodes within the faces and the volume of quadrilaterals and hexahedra, in VTK's order."""
    if block.shape not in ("quad", "hexahedron"):
        return block.corners[:, :0]
    if block.inner.shape[1] and (block.inner >= 0).all():
        return block.inner
    columns = []
    for face in rectangles(block.shape):
        columns.append(nodes.of_face(block.corners[:, list(face)], *_middles(block, nodes, face)))
    if block.shape == "hexahedron":
        columns.append(nodes.new(*_middles(block, nodes)))
    return np.stack(columns, axis=1)


def _note_cuts(block: Block, nodes: NodeTable) -> None:
    """Enter the middles of all diagonals of divided faces and cells into the table."""
    if block.inner.shape[1]:
        _note_inner(block, nodes)
        return
    for face in rectangles(block.shape):
        middles = _middles(block, nodes, face)
        for k in (0, 1):
            nodes.place(block.corners[:, [face[k], face[k + 2]]], *middles)
    if block.shape == "hexahedron":
        middles = _middles(block, nodes)
        for ends in DIAGONALS:
            nodes.place(block.corners[:, list(ends)], *middles)


def _note_inner(block: Block, nodes: NodeTable) -> None:
    """Enter the file's own nodes within faces and cells as the middles of all their diagonals."""
    pairs = [[(face[k], face[k + 2]) for k in (0, 1)] for face in rectangles(block.shape)]
    if block.shape == "hexahedron":
        pairs.append(list(DIAGONALS))
    for column, diagonals in zip(block.inner.T, pairs, strict=True):
        for one, other in diagonals:
            nodes.give(block.corners[:, [one, other]], column)


def _collapsed(block: Block) -> bool:
    """Whether an element with more corners than a simplex uses a node twice."""
    return CORNERS[block.shape] > DIMENSION[block.shape] + 1 and bool(_folded(block).any())


def _folded(block: Block) -> BoolArray:
    """The elements that use a node twice."""
    ordered = np.sort(block.corners, axis=1)
    return np.asarray((ordered[:, 1:] == ordered[:, :-1]).any(axis=1))


def _simplices(block: Block) -> tuple[IntArray, IntArray]:
    """(corners of triangles or tetrahedra, row of the element of each)."""
    if DIMENSION[block.shape] == 2:
        return _triangles(block.corners)
    if block.shape == "tetra":
        return block.corners, np.arange(len(block))
    apex = block.corners.min(axis=1)
    corners, rows = [block.corners[:0, :4]], [NO_CELLS]
    for face in FACES[block.shape]:
        around = block.corners[:, list(face)]
        across = np.flatnonzero((around != apex[:, None]).all(axis=1))
        base, of = _triangles(around[across])
        corners.append(np.column_stack([base, apex[across[of]]]))
        rows.append(across[of])
    return np.vstack(corners), np.concatenate(rows)


def _triangles(around: IntArray) -> tuple[IntArray, IntArray]:
    """Triangles from the lowest node of each face, and the row of the face of each."""
    rows = np.arange(len(around))
    if around.shape[1] == 4:
        turn = (np.argmin(around, axis=1)[:, None] + np.arange(4)) % 4
        a, b, c, d = np.take_along_axis(around, turn, axis=1).T
        around = np.vstack([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
        rows = np.concatenate([rows, rows])
    ordered = np.sort(around, axis=1)
    sound = (ordered[:, 1:] != ordered[:, :-1]).all(axis=1)
    return around[sound], rows[sound]


def _halved(block: Block, elements: IntArray) -> tuple[Block, IntArray]:
    """Two straight lines for each line with a middle node."""
    if not block.mids.shape[1] or (block.mids < 0).any():
        return block, elements
    ends = np.column_stack([block.corners[:, 0], block.mids[:, 0], block.corners[:, 1]])
    lines = np.vstack([ends[:, :2], ends[:, 1:]])
    halves = Block("line", block.type, lines, lines[:, :0], lines[:, :0])
    return halves, np.concatenate([elements, elements])
