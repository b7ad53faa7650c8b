"""The content of a deck, independent of its program, and its elements as cells of one mesh.

A mesh here has cells of one kind. If a deck has volumes of several shapes, wedges, pyramids or
collapsed hexahedra, all are divided into tetrahedra; triangles and quadrilaterals become triangles,
unless they are joined as two meshes (`mixed`). A cell is divided into pyramids whose apex is its
node of lowest number, over the faces without this node; a quadrilateral is divided from its node of
lowest number. Two neighbours therefore divide their common face in the same way (pulling
triangulation: C. W. Lee, *Subdivisions and triangulations of polytopes*, 1997). The serendipity
functions of the element give the positions of new nodes in the middle of faces, cells and
diagonals, so that curved surfaces keep their shape.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from antiosc.base._types import Array, BoolArray
from antiosc.base.errors import MeshError
from antiosc.io.neutral import (
    CELL_KINDS,
    CELL_TYPES,
    CORNERS,
    DIMENSION,
    EDGES,
    FACES,
    FileMesh,
    IntArray,
    Model,
    Piece,
    quadrilateral_faces,
)

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix


@dataclass
class Block:
    """Elements of one type of a deck, as tables of their nodes."""

    shape: str  # a key of `antiosc.io.neutral.EDGES`
    type: str  # the deck's own name of the type
    corners: IntArray  # (n, corners) rows of `Deck.points`
    #: (n, edges) rows of `Deck.points`, -1 where there is none; (n, 0) for straight elements
    mids: IntArray
    #: (n, k) nodes inside faces and inside the cell, in VTK's order; (n, 0) for most
    inner: IntArray
    role: str = ""  # what the elements are in a model: "solid", "shell", "beam", "rod", …

    def __len__(self) -> int:
        return len(self.corners)

    def __getitem__(self, selection: BoolArray | IntArray) -> Block:
        """The block with the elements selected by a mask or by row numbers."""
        return self.mapped(lambda table: table[selection])

    def mapped(self, new: Callable[[IntArray], IntArray]) -> Block:
        """The block with `new` applied to each of its node tables: corners, mids and inner."""
        corners, mids, inner = map(new, (self.corners, self.mids, self.inner))
        return Block(self.shape, self.type, corners, mids, inner, self.role)

    @property
    def nodes(self) -> IntArray:
        """Numbers of all nodes of its elements, ascending."""
        tables = (self.corners, self.mids, self.inner)
        nodes = np.unique(np.concatenate([table.ravel() for table in tables]))
        return nodes[nodes >= 0]


@dataclass
class Deck:
    """Nodes, elements (numbered through all blocks) and sets of a deck."""

    name: str  # of its file
    #: (n, 3) coordinates of the nodes, in the deck's unit of length
    points: Array = field(default_factory=lambda: np.zeros((0, 3)))
    blocks: list[Block] = field(default_factory=list)
    node_sets: dict[str, IntArray] = field(default_factory=dict)  # name -> rows of `points`
    element_sets: dict[str, IntArray] = field(default_factory=dict)  # name -> numbers of elements
    #: nodes fixed by supports: name of the group for them -> rows of `points`
    fixed: dict[str, IntArray] = field(default_factory=dict)
    #: type of elements that are not cells of a mesh -> their count
    skipped: Counter[str] = field(default_factory=Counter)
    #: warnings about the deck for the caller, one sentence each
    remarks: list[str] = field(default_factory=list)
    #: names of the parts (sets of elements) that a model is made of; None: of all elements
    wanted_parts: list[str] | None = None
    pieces: list[Piece] = field(default_factory=list)  # by rank, at most 40, if one of them is read
    #: rank in size of the only connected piece in the model, 1: the largest; None: all pieces
    piece: int | None = None
    without_supports: bool = False  # whether the supports are left out of a model
    without_contact: bool = False  # whether contact is left out; else the pairs that touch are tied
    #: materials, sections, supports, masses in SI units, if they were requested
    model: Model | None = None
    #: numbers in the file of the first len(labels) nodes
    labels: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    @property
    def n_elements(self) -> int:
        """Number of elements that are cells."""
        return sum(len(block) for block in self.blocks)

    def numbered(self) -> Iterator[tuple[Block, IntArray]]:
        """Yield (block, numbers of its elements); the numbers count through all blocks."""
        start = 0
        for block in self.blocks:
            yield block, np.arange(start, start + len(block))
            start += len(block)

    def blocks_of(self, elements: IntArray) -> Iterator[tuple[Block, BoolArray]]:
        """Yield for each block (the block of its elements in `elements`, mask of them there)."""
        start = 0
        for block in self.blocks:
            in_block = (elements >= start) & (elements < start + len(block))
            if in_block.any():
                yield block[elements[in_block] - start], in_block
            start += len(block)

    def nodes_of(self, elements: IntArray) -> IntArray:
        """Numbers of all nodes of some elements, ascending."""
        tables = [block.nodes for block, _ in self.blocks_of(elements)]
        return np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *tables]))


def counts_text(counts: dict[str, int]) -> str:
    """Counts by element type as text, as "3 C3D8, 2 S4"."""
    words = [f"{count} {kind}" for kind, count in sorted(counts.items())]
    more_text = f" and {len(words) - 8} more" if len(words) > 8 else ""
    return ", ".join(words[:8]) + more_text


class NodeTable:
    """Nodes of a file, and new nodes, whose coordinates are weighted sums of the file's nodes."""

    def __init__(self, points: Array) -> None:
        from scipy.sparse import eye, vstack  # the reading process needs it for few files

        self.points = points
        self._vstack = vstack

        #: weights (count, len(points)) of all nodes
        self.weights = eye(len(points), format="csr")

        #: middle node of each pair that has one
        self.middles = PairTable(len(points))

        #: weights `_placed` that were set for middles of pairs, and the row of each pair in them
        self._places = PairTable(len(points))
        self._placed = self.weights[:0]
        self._faces = PairTable(len(points))  # by the diagonal from the lowest corner

    @property
    def count(self) -> int:
        """Number of all nodes."""
        return int(self.weights.shape[0])

    def all_points(self) -> Array:
        """Coordinates of all nodes, those of the file first."""
        return np.vstack([self.points, self.weights[len(self.points) :] @ self.points])

    def combined_weights(self, nodes: IntArray, weights: Sequence[float]) -> csr_matrix:
        """Weights (n, nodes of the file) of the n points Σ_j weights_j x(nodes_ij)."""
        shares = (w * self.weights[column] for column, w in zip(nodes.T, weights, strict=True))
        return sum(shares).tocsr()

    def new(self, weights: csr_matrix) -> IntArray:
        """Add n nodes with these weights (n, nodes of the file); returns their numbers (n,)."""
        first = self.count
        self.weights = self._vstack([self.weights, weights], format="csr")
        return np.arange(first, self.count)

    def set_middle_weights(self, ends: IntArray, weights: csr_matrix) -> None:
        """Set the weights by which `between` makes the middle nodes of the pairs `ends` (n, 2)."""
        first = self._placed.shape[0]
        self._places.add(ends, np.arange(first, first + len(ends)))
        self._placed = self._vstack([self._placed, weights], format="csr")

    def between(self, ends: IntArray) -> IntArray:
        """Numbers (…,) of the middle nodes of pairs `ends` (…, 2); missing ones are made."""
        flat = ends.reshape(-1, 2)
        absent = flat[self.middles.find(flat) < 0]
        if len(absent):
            pairs = np.unique(np.sort(absent, axis=1), axis=0)
            row = self._places.find(pairs)
            halfway = pairs[row < 0]
            self.middles.add(halfway, self.new(self.combined_weights(halfway, (0.5, 0.5))))
            self.middles.add(pairs[row >= 0], self.new(self._placed[row[row >= 0]]))

        return self.middles.find(flat).reshape(ends.shape[:-1])

    def face_middles(self, corners: IntArray, weights: csr_matrix) -> IntArray:
        """Numbers (n,) of middle nodes of faces (n, 4); missing ones are made by `weights`."""
        opposite = corners.argmin(axis=1)[:, None] + np.array([0, 2])
        ends = np.take_along_axis(corners, opposite % 4, axis=1)  # the same in two cells
        absent = np.flatnonzero(self._faces.find(ends) < 0)
        _, one = np.unique(ends[absent], axis=0, return_index=True)
        self._faces.add(ends[absent[one]], self.new(weights[absent[one]]))
        return self._faces.find(ends)


class PairTable:
    """A table from unordered pairs of nodes to numbers; a pair keeps its first number."""

    def __init__(self, n: int) -> None:
        self._n = max(n, 1)
        self._keys = np.zeros(0, dtype=np.int64)
        self._values = np.zeros(0, dtype=np.int64)

    def _key(self, ends: IntArray) -> IntArray:
        """A number (n,) for each pair (n, 2), independent of the order in the pair."""
        low = ends.min(axis=1)
        high = ends.max(axis=1)
        return np.asarray(low * self._n + high)

    def add(self, ends: IntArray, values: IntArray) -> None:
        """Enter `values` (n,) for the pairs `ends` (n, 2) that have no value yet."""
        keys = np.concatenate([self._keys, self._key(ends)])
        self._keys, first = np.unique(keys, return_index=True)
        self._values = np.concatenate([self._values, values])[first]

    def find(self, ends: IntArray) -> IntArray:
        """Values (n,) of the pairs `ends` (n, 2); -1 for pairs without a value."""
        if not len(self._keys) or not len(ends):
            return np.full(len(ends), -1, dtype=np.int64)
        key = self._key(ends)
        place = np.minimum(np.searchsorted(self._keys, key), len(self._keys) - 1)
        return np.where(self._keys[place] == key, self._values[place], -1)


#: Corners at the ends of the diagonals of a hexahedron.
HEXAHEDRON_DIAGONALS = ((0, 6), (1, 7), (2, 4), (3, 5))


#: (shape, geometric order) -> name of the kind of cells
CELL_LABELS = {(CELL_TYPES[label][0], kind.order): label for label, kind in CELL_KINDS.items()}
NO_CELLS = np.zeros(0, dtype=np.int64)


class Division(NamedTuple):
    """A deck as a mesh, its nodes, and (meshio's name, shape, blocks) of each kind of cells."""

    mesh: FileMesh
    nodes: NodeTable
    kinds: list[tuple[str, str, list[Block]]]


def mesh_of_deck(deck: Deck, *, halve_lines: bool = False, mixed: bool = False) -> Division:
    """The elements of a deck as cells, its sets as groups. `halve_lines`: lines of order 2 are
    halved, for `Beam`; `mixed`: triangles and quadrilaterals are kept apart. MeshError for an
    element without volume or area."""
    nodes = NodeTable(deck.points)
    cells: dict[str, IntArray] = {}
    owners: dict[str, IntArray] = {}
    all_blocks = [(block, mark) for block, mark in deck.numbered() if len(block)]

    kinds: list[tuple[str, str, list[Block]]] = []
    split = False
    for dim in (3, 2, 1, 0):
        of_dimension = [entry for entry in all_blocks if DIMENSION[entry[0].shape] == dim]
        if dim == 1 and halve_lines:
            of_dimension = [_halved_lines(*entry) for entry in of_dimension]
        order = 2 if any(block.mids.shape[1] for block, _ in of_dimension) else 1
        for block in (b for b, _ in of_dimension if b.mids.shape[1]):
            ends = block.corners[:, np.array(EDGES[block.shape])]
            has_middle = (block.mids >= 0) & (ends[..., 0] != ends[..., 1])
            nodes.middles.add(ends[has_middle], block.mids[has_middle])

        apart = mixed and dim == 2
        for of_shape in _by_shape(of_dimension) if apart else filter(None, [of_dimension]):
            shapes = {block.shape for block, _ in of_shape}
            wider = [b for b, _ in of_shape if CORNERS[b.shape] > DIMENSION[b.shape] + 1]
            needed = shapes not in _UNDIVIDED_SHAPES or any(folded(block).any() for block in wider)
            split = dim > 1 and (split or needed)
            shape = _SIMPLEX_OF_DIMENSION[dim] if split else next(iter(shapes))
            label = CELL_LABELS[shape, order]
            cells[label], owners[label] = _cells_of_blocks(deck, of_shape, split, order, nodes)
            kinds.append((label, shape, [block for block, _ in of_shape]))

    mesh = FileMesh(nodes.all_points(), cells)
    for name, elements in deck.element_sets.items():
        in_model = np.zeros(deck.n_elements, dtype=bool)
        in_model[elements] = True
        rows = {label: np.flatnonzero(in_model[owner]) for label, owner in owners.items()}
        mesh.groups[name] = {label: r for label, r in rows.items() if len(r)}

    mesh.node_sets = dict(deck.node_sets)
    mesh.labels = deck.labels
    mesh.remarks = list(deck.remarks)
    mesh.pieces = deck.pieces
    return Division(mesh, nodes, kinds)


def _by_shape(sheets: list[tuple[Block, IntArray]]) -> list[list[tuple[Block, IntArray]]]:
    """[quadrilaterals, triangles]; a quadrilateral that repeats a node counts as a triangle."""
    by_shape: list[list[tuple[Block, IntArray]]] = [[], []]
    for block, elements in sheets:
        flat = folded(block) | (block.shape == "triangle")
        for blocks, selected in zip(by_shape, (~flat, flat), strict=True):
            if selected.any():
                blocks.append((block[selected], elements[selected]))

    return by_shape


#: Shapes that are not divided if all elements have one of them.
_UNDIVIDED_SHAPES = [{"point"}, {"line"}, {"triangle"}, {"quad"}, {"tetra"}, {"hexahedron"}]
_SIMPLEX_OF_DIMENSION = {0: "point", 1: "line", 2: "triangle", 3: "tetra"}


def _cells_of_blocks(
    deck: Deck, blocks: list[tuple[Block, IntArray]], split: bool, order: int, nodes: NodeTable
) -> tuple[IntArray, IntArray]:
    """(cells (n, nodes) of blocks of one dimension, number (n,) of the element of each cell).
    `split`: whether to divide into simplices; `order`: geometric order of the cells."""
    for block, _ in blocks if order == 2 and split else ():
        _set_diagonal_weights(block, nodes)

    tables = []
    owners = []
    for block, elements in blocks:
        all_rows = np.arange(len(block))
        corners, rows = _simplices(block) if split else (block.corners, all_rows)
        unused = np.setdiff1d(all_rows, rows)
        if len(unused):
            raise MeshError(
                f"{len(unused)} {block.type} elements of {deck.name} have no volume: delete them."
            )
        shape = _SIMPLEX_OF_DIMENSION[DIMENSION[block.shape]] if split else block.shape
        if order == 2:
            ends = corners[:, np.array(EDGES[shape])]
            mids = nodes.between(ends)
            inner = _middle_nodes(block, nodes) if not split else corners[:, :0]
            corners = np.hstack([corners, mids, inner])
        tables.append(corners)
        owners.append(elements[rows])

    return np.vstack(tables), np.concatenate(owners)


def _middle_weights(block: Block, nodes: NodeTable, face: tuple[int, ...] = ()) -> csr_matrix:
    """Weights of the middle of a `face` (four local corners); default: of hexahedra."""
    corners = block.corners[:, list(face)] if face else block.corners
    edges = np.stack([face, np.roll(face, -1)], axis=1) if face else np.array(EDGES[block.shape])
    mids = nodes.between(block.corners[:, edges])
    weights = [-0.25] * corners.shape[1] + [0.5 if face else 0.25] * mids.shape[1]
    return nodes.combined_weights(np.hstack([corners, mids]), weights)


def _middle_nodes(block: Block, nodes: NodeTable) -> IntArray:
    """Middle nodes (n, k) of faces and volume of quadrilaterals and hexahedra, in VTK's order."""
    if block.shape not in ("quad", "hexahedron"):
        return block.corners[:, :0]
    if block.inner.shape[1] and (block.inner >= 0).all():
        return block.inner

    columns = []
    for face in quadrilateral_faces(block.shape):
        middles = _middle_weights(block, nodes, face)
        columns.append(nodes.face_middles(block.corners[:, list(face)], middles))

    if block.shape == "hexahedron":
        columns.append(nodes.new(_middle_weights(block, nodes)))

    return np.stack(columns, axis=1)


def _set_diagonal_weights(block: Block, nodes: NodeTable) -> None:
    """Set the weights of the middles of all diagonals that a division may use."""
    for face in quadrilateral_faces(block.shape):
        # the diagonals of others are edges
        whole = ~_has_repeated_node(block.corners[:, list(face)])
        middles = _middle_weights(block[whole], nodes, face)
        for k in (0, 1):
            nodes.set_middle_weights(block.corners[whole][:, [face[k], face[k + 2]]], middles)

    if block.shape == "hexahedron":
        whole = ~folded(block)
        middles = _middle_weights(block[whole], nodes)
        for ends in HEXAHEDRON_DIAGONALS:
            nodes.set_middle_weights(block.corners[whole][:, list(ends)], middles)


def folded(block: Block) -> BoolArray:
    """Mask (n,) of the elements that have one node at several corners."""
    return _has_repeated_node(block.corners)


def _has_repeated_node(nodes: IntArray) -> BoolArray:
    """Mask (n,) of the rows of `nodes` (n, k) in which a number occurs twice."""
    ordered = np.sort(nodes, axis=1)
    return np.asarray((ordered[:, 1:] == ordered[:, :-1]).any(axis=1))


def _simplices(block: Block) -> tuple[IntArray, IntArray]:
    """(corners (n, k) of a block's triangles or tetrahedra, row (n,) of the element of each)."""
    if DIMENSION[block.shape] == 2:
        return _triangles(block.corners)
    if block.shape == "tetra":
        return block.corners, np.arange(len(block))
    apex = block.corners.min(axis=1)
    corners = [block.corners[:0, :4]]
    rows = [NO_CELLS]
    for face in FACES[block.shape]:
        face_corners = block.corners[:, list(face)]
        opposite = np.flatnonzero((face_corners != apex[:, None]).all(axis=1))
        base, faces = _triangles(face_corners[opposite])
        corners.append(np.column_stack([base, apex[opposite[faces]]]))
        rows.append(opposite[faces])

    return np.vstack(corners), np.concatenate(rows)


def _triangles(corners: IntArray) -> tuple[IntArray, IntArray]:
    """(triangles (n, 3) of faces (m, 3 or 4), divided at the lowest node; face (n,) of each)."""
    rows = np.arange(len(corners))

    if corners.shape[1] == 4:
        order = (np.argmin(corners, axis=1)[:, None] + np.arange(4)) % 4
        a, b, c, d = np.take_along_axis(corners, order, axis=1).T
        corners = np.vstack([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
        rows = np.concatenate([rows, rows])

    sound = ~_has_repeated_node(corners)
    return corners[sound], rows[sound]


def _halved_lines(block: Block, elements: IntArray) -> tuple[Block, IntArray]:
    """(two straight lines for each line with a middle node, number of the element of each)."""
    if not block.mids.shape[1] or (block.mids < 0).any():
        return block, elements
    ends = np.column_stack([block.corners[:, 0], block.mids[:, 0], block.corners[:, 1]])
    lines = np.vstack([ends[:, :2], ends[:, 1:]])
    halves = Block("line", block.type, lines, lines[:, :0], lines[:, :0])
    return halves, np.concatenate([elements, elements])


# --- Files with cells of several kinds ---


def checked_kind(label: str, name: str) -> str:
    """Returns `label`; MeshError if cells of this kind can neither be used nor divided."""
    if label not in CELL_TYPES:
        raise MeshError(
            f"{name} holds {label} cells; it must be of lines, triangles, quadrilaterals, "
            "tetrahedra, hexahedra, wedges or pyramids of geometric order 1 or 2."
        )

    return label


def with_supported_kinds(mesh: FileMesh, name: str) -> FileMesh:
    """The mesh with one supported kind of cells for each dimension; others are divided."""
    labels = [label for label, block in mesh.cells.items() if len(block)]
    dims = {label: DIMENSION[CELL_TYPES[label][0]] for label in labels}
    tops = [label for label in labels if dims[label] == max(dims.values())]
    if len(tops) < 2 and CELL_KINDS.keys() >= set(tops):
        return mesh

    deck = Deck(name, mesh.points, labels=mesh.labels)
    deck.blocks = [_block(label, mesh.cells[label]) for label in labels]
    starts = dict(zip(labels, np.cumsum([0, *map(len, deck.blocks)]), strict=False))
    for group, parts in mesh.groups.items():
        rows = [starts[label] + own for label, own in parts.items() if label in starts]
        deck.element_sets[group] = np.concatenate([np.zeros(0, dtype=np.int64), *rows])

    deck.node_sets = mesh.node_sets
    result = mesh_of_deck(deck).mesh
    result.of_gmsh, result.has_construction_aids = mesh.of_gmsh, mesh.has_construction_aids
    result.remarks = [*mesh.remarks, *result.remarks]
    return result


def _block(label: str, cells: IntArray) -> Block:
    """A block of cells (n, nodes) of the kind `label`."""
    shape = CELL_TYPES[label][0]
    first = CORNERS[shape]
    inner = min(first + len(EDGES[shape]), cells.shape[1])
    return Block(shape, label, cells[:, :first], cells[:, first:inner], cells[:, inner:])
