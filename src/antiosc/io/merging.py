"""Coincident nodes are merged, which decks of several parts and STL files need."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from antiosc.io.neutral import FileMesh


def merged(mesh: FileMesh, distance: float) -> FileMesh:
    """`mesh` with its nodes merged that are at most `distance` (m) apart."""
    n = len(mesh.points)
    pairs = cKDTree(mesh.points).query_pairs(distance, output_type="ndarray")
    if mesh.model and mesh.model["apart"]:  # the released ends of beams
        pairs = pairs[~np.isin(pairs, mesh.model["apart"]).any(axis=1)]
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    _, first = np.unique(label, return_index=True)
    kept = np.sort(first)  # in the file's order
    new = np.empty(len(first), dtype=np.int64)
    new[label[kept]] = np.arange(len(kept))
    row = new[label]
    return replace(
        mesh,
        model=mesh.model and _renumbered(mesh.model, row),
        points=mesh.points[kept],
        cells={kind: row[block] for kind, block in mesh.cells.items()},
        node_sets={name: np.unique(row[nodes]) for name, nodes in mesh.node_sets.items()},
        fixed={n: {d: row[e] for d, e in parts.items()} for n, parts in mesh.fixed.items()},
    )


def _renumbered(model: dict[str, Any], row: NDArray[Any]) -> dict[str, Any]:
    """The model with other numbers of its nodes; negative ones are points of no element."""
    joints = dict(model.get("joints", {}))

    def new(terms: list[list[Any]]) -> list[list[Any]]:
        return [[int(row[n]) if n >= 0 else n, motion, c] for n, motion, c in terms]

    if joints:
        joints["equations"] = [new(terms) for terms in joints["equations"]]
        for kind in ("springs", "dampers"):
            joints[kind] = [[new(terms), value] for terms, value in joints[kind]]
        joints["among"] = [
            (int(row[n]), [(int(row[m]), w) for m, w in others])
            for n, others in joints.get("among", [])
        ]
        joints["masses"] = [[[*map(new, rows)], M, mass] for rows, M, mass in joints["masses"]]
    return {**model, "joints": joints}
