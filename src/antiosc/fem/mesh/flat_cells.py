"""Tetrahedra without volume that gmsh leaves at the surface of a part.

Four nodes in the plane of a face, or on one of its edges, make such a cell. The part is the same
without it: its inner faces become the surface in place of its outer ones.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from antiosc.io.neutral import FACETS, IntArray, RawMesh
from antiosc.io.reading import compact, keys

#: Largest share of such cells in a mesh. A sound part has few (2 of 13 902 cells of a bracket by
#: others); where surfaces cross each other there are more.
MOST = 1e-3


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
    sentence = f"{name}: flat cells that gmsh left at the surface are not read: {removed}."
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
