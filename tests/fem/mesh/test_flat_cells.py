"""Tetrahedra without volume in a column of cubes, at its end and in its middle."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

from antiosc.base.errors import MeshError, UnmeshableError
from antiosc.fem.mesh.soundness import sound
from antiosc.io.neutral import KINDS, RawMesh
from antiosc.io.reading import HOW_MADE

CUBES = 200
CORNERS = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])


def column(*, flat_at: int, mirrored_from: int = CUBES) -> RawMesh:
    """A column of cubes, six tetrahedra each, with a flat one in the plane z = `flat_at`.

    The cubes from `mirrored_from` on are divided along the other diagonals.
    """
    axes = np.meshgrid((0, 1), (0, 1), range(CUBES + 1), indexing="ij")
    points = np.stack(axes, axis=-1).reshape(-1, 3).astype(float)

    def node(x: int, y: int, z: int) -> int:
        return (x * 2 + y) * (CUBES + 1) + z

    cells = []
    for z in range(CUBES):
        for order in permutations(range(3)):
            steps = np.cumsum(np.vstack([np.zeros(3, int), np.eye(3, dtype=int)[list(order)]]), 0)
            if z >= mirrored_from:
                steps[:, 0] = 1 - steps[:, 0]
            cells.append([node(x, y, z + up) for x, y, up in steps])
    flat = [node(x, y, flat_at) for x, y in CORNERS]
    cells.append(flat)
    sides = {2: np.array([[flat[0], flat[1], flat[3]], [flat[1], flat[2], flat[3]]])}
    groups = {"end": sides, "all": {3: np.array(cells)}}
    return RawMesh(points, np.array(cells), KINDS["tetra"], "gmsh", groups)


def volume(raw: RawMesh) -> float:
    edges = raw.points[raw.cells[:, 1:]] - raw.points[raw.cells[:, :1]]
    return float(np.abs(np.linalg.det(edges)).sum() / 6)


def test_a_flat_cell_at_the_surface_is_left_out_and_its_faces_keep_their_group():
    raw = sound(column(flat_at=CUBES), "column.stl", made_here=True)
    assert len(raw.cells) == 6 * CUBES == len(raw.groups["all"][3])
    assert volume(raw) == pytest.approx(CUBES, rel=1e-12)
    end = raw.points[raw.groups["end"][2]]
    assert (end[..., 2] == CUBES).all()
    faces = {tuple(sorted(row)) for row in raw.groups["end"][2].tolist()}
    of_cells = {
        tuple(sorted(cell[[k for k in range(4) if k != out]].tolist()))
        for cell in raw.cells
        for out in range(4)
    }
    assert len(faces) == 2
    assert faces <= of_cells
    assert raw.remarks == ["column.stl: flat cells that gmsh left at the surface are not read: 1."]
    assert any(words in raw.remarks[0] for words in HOW_MADE)  # a note, for the part is the same


def test_a_flat_cell_inside_is_refused():
    raw = column(flat_at=CUBES // 2, mirrored_from=CUBES // 2)
    with pytest.raises(UnmeshableError, match=r"1 of 1201 cells of column\.stl have no volume"):
        sound(raw, "column.stl", made_here=True)


def test_a_flat_cell_of_a_mesh_file_is_refused():
    with pytest.raises(MeshError, match=r"1 of 1201 cells of column\.msh have no volume"):
        sound(column(flat_at=CUBES), "column.msh", made_here=False)


def split(raw: RawMesh, edge: tuple[int, int], share: float) -> RawMesh:
    """The mesh with a node on an edge, at a share of its length from its first end."""
    start, end = edge
    new = len(raw.points)
    middle = raw.points[start] + share * (raw.points[end] - raw.points[start])

    def halves(rows: np.ndarray) -> np.ndarray:
        cut = np.isin(rows, edge).sum(axis=1) == 2
        return np.concatenate([
            rows[~cut],
            np.where(rows[cut] == start, new, rows[cut]),
            np.where(rows[cut] == end, new, rows[cut]),
        ])  # fmt: skip

    groups = {
        name: {dim: halves(rows) for dim, rows in parts.items()}
        for name, parts in raw.groups.items()
    }
    points = np.vstack([raw.points, middle])
    return RawMesh(points, halves(raw.cells), raw.kind, "gmsh", groups)


def test_the_ends_of_a_far_too_short_edge_become_one_node():
    whole = sound(column(flat_at=CUBES), "column.stl", made_here=True)
    first, second, _ = whole.groups["end"][2][0]
    edge = int(first), int(second)
    divided = split(whole, edge, 1e-6)
    assert len(divided.cells) > len(whole.cells)
    assert len(divided.groups["end"][2]) > len(whole.groups["end"][2])
    raw = sound(divided, "column.igs", made_here=True)
    assert len(raw.points) == len(whole.points)
    assert len(raw.cells) == len(whole.cells) == len(raw.groups["all"][3])
    assert volume(raw) == pytest.approx(CUBES, rel=1e-6)
    assert len(raw.groups["end"][2]) == len(whole.groups["end"][2])
    assert raw.remarks == [
        "column.igs: nodes that a far too short edge joined to another are merged: 1."
    ]
    apart = split(whole, edge, 1e-2)
    assert len(sound(apart, "column.igs", made_here=True).points) == len(apart.points)
