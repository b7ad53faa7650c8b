"""Files with several kinds of cells, or with kinds that no mesh here carries, as one kind.

The elements go through a `Deck`, as those of Abaqus and Nastran do: wedges, pyramids and mixed
volumes are cut into tetrahedra, triangles beside quadrilaterals into triangles, and cells of 8 and
20 nodes get the nodes that they lack (`conversion`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from antiosc.base.errors import MeshError
from antiosc.io.conversion import as_mesh
from antiosc.io.deck import Block, Deck
from antiosc.io.neutral import KINDS, SERENDIPITY, FileMesh, IntArray
from antiosc.io.shapes import CELLS, CORNERS, DIMENSION, EDGES, rectangles

#: Corners of the edges in the order of gmsh's middle nodes, where it is not that of VTK.
GMSH_EDGES = {
    "tetra": ((0, 1), (1, 2), (2, 0), (3, 0), (2, 3), (1, 3)),
    "pyramid": ((0, 1), (0, 3), (0, 4), (1, 2), (1, 4), (2, 3), (2, 4), (3, 4)),
    "wedge": ((0, 1), (0, 2), (0, 3), (1, 2), (1, 4), (2, 5), (3, 4), (3, 5), (4, 5)),
    "hexahedron": (
        *((0, 1), (0, 3), (0, 4), (1, 2), (1, 5), (2, 3), (2, 6), (3, 7)),
        *((4, 5), (4, 7), (5, 6), (6, 7)),
    ),
}
#: Corners of the faces in the order of gmsh's nodes within them, likewise.
GMSH_FACES = {
    "hexahedron": (
        *((0, 3, 2, 1), (0, 1, 5, 4), (0, 4, 7, 3)),
        *((1, 2, 6, 5), (2, 3, 7, 6), (4, 5, 6, 7)),
    ),
    "wedge": ((0, 1, 4, 3), (0, 2, 5, 3), (1, 2, 5, 4)),
}


def known(label: str, name: str) -> str:
    """`label` itself; MeshError if such cells of the file `name` can neither be carried nor cut."""
    if label not in CELLS:
        raise MeshError(
            f"{name} holds {label} cells, which no element here can carry; it must be of lines, "
            "triangles, quadrilaterals, tetrahedra, hexahedra, wedges or pyramids of geometric "
            "order 1 or 2."
        )
    return label


def as_carried(mesh: FileMesh, name: str) -> FileMesh:
    """`mesh` itself if its cells of each dimension are of one kind that is carried; else cut."""
    if not _is_mixed(mesh):
        return mesh
    deck = Deck(name, mesh.points)
    labels = [label for label, block in mesh.cells.items() if len(block)]
    for label in labels:
        deck.blocks.append(_block(label, mesh.cells[label], mesh.convention))
    starts = dict(zip(labels, np.cumsum([0, *map(len, deck.blocks)]), strict=False))
    for group, parts in mesh.groups.items():
        rows = [starts[label] + some for label, some in parts.items() if label in starts]
        deck.element_sets[group] = np.concatenate([np.zeros(0, dtype=np.int64), *rows])
    deck.node_sets = mesh.node_sets
    result = as_mesh(deck)
    result.aids = mesh.aids
    result.told = [*mesh.told, *result.told]
    return result


def _is_mixed(mesh: FileMesh) -> bool:
    """Whether some cells of a dimension are of another kind than the rest, or not carried."""
    there = {label for label, block in mesh.cells.items() if len(block)}
    top = max((DIMENSION[CELLS[label][0]] for label in there), default=0)
    if mesh.aids:  # where some cells are in groups, those in none are construction aids
        grouped = {
            label
            for parts in mesh.groups.values()
            for label, rows in parts.items()
            if len(rows) and DIMENSION[CELLS[label][0]] == top
        }
        lower = {label for label in there if DIMENSION[CELLS[label][0]] < top}
        there = grouped | lower if grouped else there
    if any(label not in KINDS and label not in SERENDIPITY for label in there):
        return True
    tops = {label for label in there if DIMENSION[CELLS[label][0]] == top}
    return len(tops) > 1 or any(label in SERENDIPITY for label in tops)


def _block(label: str, cells: IntArray, convention: str) -> Block:
    shape, nodes, _ = CELLS[label]
    corners, edges = CORNERS[shape], len(EDGES[shape])
    has_mids = nodes > corners
    mids, inner = np.arange(corners, corners + edges * has_mids), np.arange(corners, corners)
    if nodes > corners + edges:
        inner = np.arange(corners + edges, nodes)
    if convention == "gmsh" and has_mids:
        mids = corners + _places(EDGES[shape], GMSH_EDGES.get(shape, EDGES[shape]))
        if len(inner) and shape in GMSH_FACES:
            first = corners + edges
            inner = first + _places(rectangles(shape), GMSH_FACES[shape])
            if nodes > first + len(inner):
                inner = np.append(inner, nodes - 1)
    return Block(shape, label, cells[:, :corners], cells[:, mids], cells[:, inner])


def _places(ours: Sequence[Sequence[int]], theirs: Sequence[Sequence[int]]) -> IntArray:
    """The index of each of our edges or faces among theirs."""
    listed = [frozenset(one) for one in theirs]
    return np.array([listed.index(frozenset(one)) for one in ours])
