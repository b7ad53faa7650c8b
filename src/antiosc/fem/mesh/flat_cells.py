"""Cells that gmsh should not have made: flat tetrahedra at the surface of a part, short edges.

Four nodes in the plane of a face, or on one of its edges, make a tetrahedron without volume. The
part is the same without it: its inner faces become the surface in place of its outer ones.

A CAD file has edges far shorter than its faces where they do not meet exactly. A cell there spoils
the stiffness matrix; the part is the same if the ends of such an edge are one node.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from antiosc.base._types import Array, BoolArray
from antiosc.io.neutral import FACETS, IntArray, RawMesh
from antiosc.io.reading import NOT_READ, compact, keys

#: Largest share of such cells in a mesh. A sound part has few (2 of 13 902 cells of a bracket by
#: others); where surfaces cross each other there are more.
MOST = 1e-3
#: An edge is short below this share of the mean length of the mesh's edges. surf114.igs of
#: pythonocc-demos has seven at 3e-6 to 8e-6, with which its stiffness matrix cannot be factored,
#: then none below 8e-3.
SHORT = 1e-4


def without_flat(raw: RawMesh, flat: IntArray, name: str) -> RawMesh:
    """The mesh without its `flat` cells at the surface, and with a note of their number.

    A flat cell inside the part stays: without it the mesh would be cracked there.
    """
    if raw.kind.shape != "tetrahedron" or not 0 < len(flat) <= MOST * len(raw.cells):
        return raw
    sides = [list(side) for side in FACETS["tetrahedron"]]
    faces = raw.cells[:, sides]
    code = keys(faces.reshape(-1, 3)).reshape(-1, len(sides))
    kept_cells = np.ones(len(code), dtype=bool)
    groups = {label: dict(parts) for label, parts in raw.groups.items()}
    waiting = flat
    while len(waiting):
        values, count = np.unique(code[kept_cells], return_counts=True)
        outer = np.isin(code[waiting], values[count == 1])
        at_surface = outer.any(axis=1)
        if not at_surface.any():
            break
        for cell, sides_out in zip(waiting[at_surface], outer[at_surface], strict=True):
            _hand_on(groups, faces[cell][sides_out], faces[cell][~sides_out])
        kept_cells[waiting[at_surface]] = False
        waiting = waiting[~at_surface]
    removed = int(len(kept_cells) - kept_cells.sum())
    if not removed:
        return raw
    removed_cells = keys(raw.cells[~kept_cells, :4])
    for parts in groups.values():
        if 3 in parts:
            parts[3] = parts[3][~np.isin(keys(parts[3]), removed_cells)]
    sentence = f"{name}: {NOT_READ}: {removed}."
    notes = [*raw.remarks, sentence]
    return compact(replace(raw, cells=raw.cells[kept_cells], groups=groups, remarks=notes))


def _hand_on(groups: dict[str, dict[int, IntArray]], outer: IntArray, inner: IntArray) -> None:
    """Replace the outer faces (n, 3) of a removed cell by its inner faces in the groups."""
    removed_faces = keys(outer)
    for parts in groups.values():
        if 2 in parts:
            matched = np.isin(keys(parts[2]), removed_faces)
            if matched.any():
                parts[2] = np.concatenate([parts[2][~matched], inner])


def without_short_edges(raw: RawMesh, name: str) -> RawMesh:
    """The mesh of simplices whose short edges are one node each, and a note of their number."""
    if raw.kind.vertices != raw.kind.dim + 1:
        return raw
    vertices = raw.cells[:, : raw.kind.vertices]
    length = _lengths(raw.points, vertices)
    limit = SHORT * length.mean()
    beside = raw.cells[(length < limit).any(axis=1)]
    if not len(beside):
        return raw
    short = _lengths(raw.points, beside) < limit
    ends = [beside[:, k][short] for k in np.triu_indices(beside.shape[1], 1)]
    count = len(raw.points)
    joined = coo_matrix((np.ones(len(ends[0])), tuple(ends)), shape=(count, count))
    component = connected_components(joined, directed=False)[1]
    lowest = np.unique(component, return_index=True)[1]
    node = lowest[component]
    cells = node[raw.cells]
    groups = {
        label: {dim: _of_distinct_nodes(node[entities]) for dim, entities in parts.items()}
        for label, parts in raw.groups.items()
    }
    is_cell = _are_distinct(node[vertices])
    merged = count - len(lowest)
    sentence = f"{name}: nodes that a far too short edge joined to another are merged: {merged}."
    remarks = [*raw.remarks, sentence]
    return compact(replace(raw, cells=cells[is_cell], groups=groups, remarks=remarks))


def _lengths(points: Array, nodes: IntArray) -> Array:
    """Distances (n, k(k − 1)/2) [m] between all nodes of each row (n, k)."""
    pairs = zip(*np.triu_indices(nodes.shape[1], 1), strict=True)
    return np.stack(
        [np.linalg.norm(points[nodes[:, i]] - points[nodes[:, j]], axis=1) for i, j in pairs],
        axis=1,
    )


def _are_distinct(nodes: IntArray) -> BoolArray:
    """Mask (n,) of the rows of numbers (n, k) in which none is repeated."""
    ordered = np.sort(nodes, axis=1)
    return np.asarray((ordered[:, 1:] != ordered[:, :-1]).all(axis=1))


def _of_distinct_nodes(entities: IntArray) -> IntArray:
    """The entities (n, k) without those that repeat a node or another entity."""
    distinct = entities[_are_distinct(entities)]
    first = np.unique(keys(distinct), return_index=True)[1]
    return distinct[np.sort(first)]
