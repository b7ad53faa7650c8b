"""Checks of the cells of a file before they become a mesh: errors and warnings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from antiosc.errors import MeshError, warn
from antiosc.fem import compat
from antiosc.fem.mesh import conformity, folded_cells
from antiosc.fem.readers import RawMesh
from antiosc.fem.readers.neutral import IntArray

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
        Cells that fold over or overlap, cracks and hanging nodes.
    """
    kind = raw.kind
    vertices = raw.cells[:, : kind.vertices]
    _refuse_repeated(raw, vertices, name)
    cells = raw.cells[:, compat.node_order(kind.shape, kind.nodes, raw.convention)]
    flat = folded_cells.collapsed(raw.points, cells, kind.shape, kind.order)
    if len(flat):
        measure = ("length", "area", "volume")[kind.dim - 1]
        raise MeshError(
            f"{len(flat)} of {len(cells)} cells of {name} have no {measure}, one at "
            f"({_centre(raw, flat[0])}) m: merge the nodes that coincide, or mesh it anew."
        )
    if kind.order > 1 and not made_here:
        unlike = conformity.unlike_middles(cells, compat.nodes_between(kind.shape))
        if len(unlike):
            raise MeshError(
                f"{len(unlike)} of {len(cells)} cells of {name} have a node inside a side that is "
                "a corner of another cell, or not the node that another cell has there, one at "
                f"({_centre(raw, unlike[0])}) m: merge the nodes that coincide, or mesh it anew."
            )
    if not pieces:
        _refuse_pieces(raw, name, by)
    fills = kind.dim == raw.points.shape[1]
    if fills and made_here and kind.order == 2 and kind.shape in folded_cells.MID_SIDE_EDGES:
        return replace(raw, points=folded_cells.straightened(raw.points, raw.cells, kind.shape))
    if kind.dim > 1:
        bad = folded_cells.folded(raw.points, cells, kind.shape, kind.order)
        if len(bad):
            warn(
                f"{len(bad)} of {len(cells)} cells of {name} fold over themselves, one at "
                f"({_centre(raw, bad[0])}) m: what is computed there is wrong; optimise the mesh "
                "(in gmsh: Mesh.HighOrderOptimize = 2) or read it with order=1.",
            )
    if not made_here:
        _tell_unfit(raw, vertices, name, pieces)
    return raw


def _refuse_repeated(raw: RawMesh, vertices: IntArray, name: str) -> None:
    ordered = np.sort(raw.cells, axis=1)
    twice = np.flatnonzero((ordered[:, 1:] == ordered[:, :-1]).any(axis=1))
    if len(twice):
        raise MeshError(
            f"{len(twice)} of {len(vertices)} cells of {name} use a node twice, one at "
            f"({_centre(raw, twice[0])}) m: write them as cells of fewer nodes, or mesh it anew."
        )
    again = conformity.repeated(vertices)
    if len(again):
        raise MeshError(
            f"{len(again)} of {len(vertices)} cells of {name} repeat another one, node by node, "
            f"one at ({_centre(raw, again[0])}) m: delete the copies."
        )
    if raw.kind.shape in TWO_SIDES:
        pairs = conformity.doublets(vertices, raw.kind)
        if len(pairs):
            raise MeshError(
                f"{len(pairs)} of {len(vertices)} cells of {name} share two sides with another "
                f"one, one at ({_centre(raw, pairs[0])}) m: make one cell of both, or divide them."
            )
    if raw.kind.dim == raw.points.shape[1]:
        many = conformity.crowded(vertices, raw.kind)
        if len(many):
            raise MeshError(
                f"{len(many)} of {len(vertices)} cells of {name} share a side with more than one "
                f"other, one at ({_centre(raw, many[0])}) m: they overlap; delete "
                "the superfluous ones."
            )


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


def _tell_unfit(raw: RawMesh, vertices: IntArray, name: str, pieces: bool) -> None:
    over = conformity.overlapping(raw.points, vertices, raw.kind)
    if len(over):
        warn(
            f"{len(over)} of {len(vertices)} cells of {name} overlap others, one at "
            f"({_centre(raw, over[0])}) m: mass and stiffness count twice there; mesh the parts as "
            "one (in gmsh: BooleanUnion or BooleanFragments)."
        )
    if pieces:
        return
    loose = conformity.unjoined(raw.points, vertices, raw.kind)
    if len(loose):
        at = ", ".join(f"{c:.4g}" for c in raw.points[loose[0]])
        warn(
            f"{len(loose)} nodes of {name} lie on cells that they do not belong to, one at ({at}) "
            "m: the mesh has a crack there, by coincident or hanging nodes; merge them, or mesh "
            "the parts as one, unless the crack is intended."
        )


def _centre(raw: RawMesh, cell: int) -> str:
    return ", ".join(f"{c:.4g}" for c in raw.points[raw.cells[cell]].mean(axis=0))
