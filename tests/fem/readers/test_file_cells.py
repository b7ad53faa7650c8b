"""Cells of files that cannot be carried, are not meant, or do not fit; the order of their nodes.

Nodes are put through (x, y, z) → (x + a y² + b z², y + c z², z), which keeps volumes and which
second-order elements reproduce: with every node in its place the volume of the mesh is that of the
straight element, and all nodes lie at halves or quarters of its edges before the map.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import meshio
import numpy as np
import pytest

import antiosc as ao
from antiosc.fem.elements.weak_form import measure
from antiosc.fem.platform import compat
from mesh_files import grid, refusal


def write(path: Path, points, *cells, **data) -> Path:
    meshio.Mesh(np.asarray(points, dtype=float), list(cells), **data).write(path)
    return path


@pytest.mark.slow
def test_repeated_cells_are_refused(tmp_path):
    told = refusal(grid(tmp_path / "grid.msh", 19, 1, "twice"))
    assert "80 of 762 cells of grid.msh repeat another one" in told


def told(path: Path) -> list[str]:
    with warnings.catch_warnings(record=True, action="always") as caught:
        ao.read_mesh(path)
    return [str(w.message) for w in caught if issubclass(w.category, ao.AntioscWarning)]


A, B, C = 0.15, -0.1, 0.2

TRIANGLE = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]


def upright(base):
    return [*base, *((x, y, 1) for x, y, _ in base)]


#: shape -> (corners, volume)
SHAPES = {
    "tetra": ([*TRIANGLE, (0, 0, 1)], 1 / 6),
    "pyramid": ([*SQUARE, (0, 0, 1)], 1 / 3),
    "wedge": (upright(TRIANGLE), 1 / 2),
    "hexahedron": (upright(SQUARE), 1.0),
    "triangle": (TRIANGLE, 1 / 2),
    "quad": (SQUARE, 1.0),
}
BASE3, BASE4 = [(1, 2), (2, 3), (3, 1)], [(1, 2), (2, 3), (3, 4), (4, 1)]
TOP3, TOP4 = [(4, 5), (5, 6), (6, 4)], [(5, 6), (6, 7), (7, 8), (8, 5)]
RISING3, RISING4 = [(1, 4), (2, 5), (3, 6)], [(1, 5), (2, 6), (3, 7), (4, 8)]
TETRA = [*BASE3, (1, 4), (2, 4), (3, 4)]
PYRAMID = [*BASE4, (1, 5), (2, 5), (3, 5), (4, 5)]

#: type -> (shape, ends of the edges whose middles follow the corners)
NASTRAN = {
    "CTETRA": ("tetra", TETRA),
    "CPYRAM": ("pyramid", PYRAMID),
    "CPYRA": ("pyramid", PYRAMID),
    "CPENTA": ("wedge", [*BASE3, *RISING3, *TOP3]),
    "CHEXA": ("hexahedron", [*BASE4, *RISING4, *TOP4]),
    "CTRIA6": ("triangle", BASE3),
    "CQUAD8": ("quad", BASE4),
}
ABAQUS = {
    "C3D10": ("tetra", TETRA),
    "C3D13": ("pyramid", PYRAMID),
    "C3D15": ("wedge", [*BASE3, *TOP3, *RISING3]),
    "C3D20": ("hexahedron", [*BASE4, *TOP4, *RISING4]),
    "STRI65": ("triangle", BASE3),
    "S8R": ("quad", BASE4),
    "CPS6": ("triangle", BASE3),
    "CPE8": ("quad", BASE4),
}


def nodes(shape, edges):
    corners = np.array(SHAPES[shape][0], dtype=float)
    middles = [(corners[i - 1] + corners[j - 1]) / 2 for i, j in edges]
    x, y, z = np.vstack([corners, *middles]).T
    return np.stack([x + A * y**2 + B * z**2, y + C * z**2, z], axis=1)


def check(mesh, shape, straight=False):
    one = compat.constant(mesh.dolfinx, 1.0)
    size = compat.integrate(one * measure(mesh, 7), mesh.dolfinx)
    assert size == pytest.approx(SHAPES[shape][1], rel=1e-9)
    if straight:
        return
    x, y, z = mesh.dolfinx.geometry.x.T
    y = y - C * z**2
    quarters = 4 * np.stack([x - A * y**2 - B * z**2, y, z])
    np.testing.assert_allclose(quarters, quarters.round(), atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("kind", NASTRAN)
@pytest.mark.parametrize("second", [True, False], ids=["curved", "straight"])
def test_nastran(tmp_path, kind, second):
    shape, edges = NASTRAN[kind]
    if not second and kind in ("CTRIA6", "CQUAD8"):
        kind = kind.replace("6", "3").replace("8", "4")
    edges = edges if second else []
    points = nodes(shape, edges)
    if not second:
        points = np.array(SHAPES[shape][0], dtype=float)
    text = "".join(f"GRID,{k},,{x},{y},{z}\n" for k, (x, y, z) in enumerate(points.tolist(), 1))
    fields = [kind, "1", "1", *map(str, range(1, len(points) + 1))]
    text += ",".join(fields[:9]) + "\n"
    for start in range(9, len(fields), 8):
        text += "," + ",".join(fields[start : start + 8]) + "\n"
    (tmp_path / "part.bdf").write_text(f"BEGIN BULK\n{text}ENDDATA\n")
    check(ao.read_mesh(tmp_path / "part.bdf"), shape, straight=not second)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ABAQUS)
def test_abaqus(tmp_path, kind):
    shape, edges = ABAQUS[kind]
    points = nodes(shape, edges)
    text = "".join(f"{k},{x},{y},{z}\n" for k, (x, y, z) in enumerate(points.tolist(), 1))
    labels = [1, *range(1, len(points) + 1)]
    element = ",".join(map(str, labels[:16])) + (",\n" if labels[16:] else "\n")
    element += ",".join(map(str, labels[16:])) + ("\n" if labels[16:] else "")
    (tmp_path / "part.inp").write_text(f"*NODE\n{text}*ELEMENT,TYPE={kind}\n{element}")
    check(ao.read_mesh(tmp_path / "part.inp"), shape)
