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
from mpi4py import MPI

import antiosc as ao
import parts
from antiosc.fem.elements.weak_form import measure
from antiosc.fem.platform import compat
from mesh_files import grid, refusal


def write(path: Path, points, *cells, **data) -> Path:
    meshio.Mesh(np.asarray(points, dtype=float), list(cells), **data).write(path)
    return path


@pytest.mark.slow
def test_repeated_cells_are_refused(tmp_path):
    told = refusal(grid(tmp_path / "grid.msh", 19, 1, "twice"))
    assert "40 of 762 cells of grid.msh repeat another one" in told


def told(path: Path) -> list[str]:
    with warnings.catch_warnings(record=True, action="always") as caught:
        ao.read_mesh(path)
    return [str(w.message) for w in caught if issubclass(w.category, ao.AntioscWarning)]


def blocks(n: int, shift: float, shape: str) -> tuple[np.ndarray, np.ndarray, str]:
    """Two unit squares or cubes of n cells a side, the second `shift` along x; not joined."""
    dim = 2 if shape in ("triangle", "quad") else 3
    make = {"quad": "quadrilateral", "tetra": "tetrahedron"}.get(shape, shape)
    nodes = 2**dim if shape in ("quad", "hexahedron") else dim + 1
    part = parts.box([n] * dim, [1.0] * dim, make, comm=MPI.COMM_SELF, groups={}).dolfinx
    order = np.argsort(compat.node_order(make, nodes, "vtk"))
    x, cells = part.geometry.x, compat.geometry_nodes(part)[:, order]
    return np.vstack([x, x + np.array([shift, 0, 0])]), np.vstack([cells, cells + len(x)]), shape


def bridged(points, cells, shape):
    """The same with one node of both blocks made one, so that they are one piece."""
    x = points.copy()
    half = len(x) // 2
    a = np.flatnonzero(np.isclose(x[:half], x[:half].max(axis=0)).all(axis=1))[0]
    b = half + np.argmin(np.linalg.norm(x[half:] - x[a], axis=1))
    x[b] = x[a]
    cells = np.where(cells == b, a, cells)
    return x, cells, shape


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["triangle", "quad", "tetra", "hexahedron"])
def test_cracks_are_told(tmp_path, shape):
    path = tmp_path / "part.vtu"
    points, cells, _ = bridged(*blocks(2, 1.0, shape))  # coincident nodes but for one
    write(path, points, (shape, cells))
    (crack,) = told(path)
    expected = 4 if shape in ("triangle", "quad") else 16
    assert f"{expected} nodes of part.vtu lie where others lie" in crack


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
