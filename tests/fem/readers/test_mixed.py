"""Several kinds of cells in one mesh, and kinds that are cut: conforming, exact, of full order."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
import pytest

from antiosc.io.conversion import EDGES

pytest.importorskip("dolfinx")
pytest.importorskip("meshio")

import meshio

import antiosc as ao
from antiosc.io.mesh_files import GMSH_EDGES, GMSH_FACES
from antiosc.io.neutral import CELLS, rectangles

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])


pytestmark = pytest.mark.fem
STEEL = ao.Solid(210e9, 0.3, 7850.0)
SIDES = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))


def write(path: Path, points, *blocks) -> Path:
    meshio.write(path, meshio.Mesh(np.asarray(points, dtype=float), list(blocks)))
    return path


def mixed_box(path: Path, n: int, kinds: str) -> Path:
    """A unit cube of n³ bricks: whole, of two wedges, or of six pyramids."""
    number = {p: k for k, p in enumerate(product(range(n + 1), repeat=3))}
    points = [np.array(p) / n for p in number]
    cells: dict[str, list[list[int]]] = {"hexahedron": [], "wedge": [], "pyramid": []}
    for i, j, k in product(range(n), repeat=3):
        around = [(0, 0), (1, 0), (1, 1), (0, 1)]
        c = [number[i + a, j + b, k + d] for d in (0, 1) for a, b in around]
        kind = kinds[(i + j) % len(kinds)]
        if kind == "h":
            cells["hexahedron"].append(c)
        elif kind == "w":
            halves = ((0, 1, 2, 4, 5, 6), (0, 2, 3, 4, 6, 7))
            cells["wedge"] += [[c[v] for v in half] for half in halves]
        else:
            points.append((np.array([i, j, k]) + 0.5) / n)
            middle = len(points) - 1
            for face in SIDES:
                cells["pyramid"].append([*(c[v] for v in face), middle])
    return write(path, points, *((kind, rows) for kind, rows in cells.items() if rows))


def rollers() -> list[ao.Support]:
    """No motion across the sides of the unit cube."""
    return [
        ao.Support(fix="xyz"[axis], plane=(corner, np.eye(3)[axis]))
        for axis in range(3)
        for corner in ((0, 0, 0), (1, 1, 1))
    ]


@pytest.mark.slow
@pytest.mark.parametrize("kinds", ["h", "hw", "wp"])
def test_every_mix_converges_with_order_four(tmp_path, kinds):
    """A cube between rollers: ω² = 2 π² μ/ρ, u = (sin πx cos πy, −cos πx sin πy, 0)."""
    import scipy.sparse as sp
    from scipy.sparse.linalg import eigsh

    exact = 2 * np.pi**2 * STEEL.E / (2 * (1 + STEEL.nu)) / STEEL.rho
    errors = []
    for n in (3, 6):
        mesh = ao.read_mesh(mixed_box(tmp_path / f"{n}.vtu", n, kinds))
        part = ao.Structure(mesh, STEEL, rollers())
        assert part.mass == pytest.approx(STEEL.rho, rel=1e-12)
        K, M = (sp.csr_matrix(A.getValuesCSR()[::-1]) for A in (part.K, part.M))
        free = np.setdiff1d(np.arange(K.shape[0]), part.fixed)
        K, M = (A[free][:, free].tocsc() for A in (K, M))
        found = eigsh(K, 3, M, sigma=0.5 * exact, which="LM")[0]
        errors.append(found.min() / exact - 1)
    assert 0 < errors[1] < errors[0] < 0.1
    order = np.log2(errors[0] / errors[1])
    assert order > 3.4, (order, errors)


@pytest.mark.parametrize("name", ["tetra10", "hexahedron27", "wedge15", "wedge18", "pyramid14"])
def test_gmsh_orders_its_second_order_nodes_as_the_table_says(name):
    gmsh = pytest.importorskip("gmsh")
    shape, nodes, _ = CELLS[name]
    family = {"tetra": "Tetrahedron", "wedge": "Prism", "pyramid": "Pyramid"}
    gmsh.initialize()
    try:
        serendipity = name == "wedge15"
        kind = gmsh.model.mesh.getElementType(family.get(shape, "Hexahedron"), 2, serendipity)
        _, dim, _, n, x, corners = gmsh.model.mesh.getElementProperties(kind)
    finally:
        gmsh.finalize()
    assert n == nodes
    x = np.reshape(x, (n, dim))
    edges = np.array(GMSH_EDGES[shape])
    middles = x[corners : corners + len(edges)]
    np.testing.assert_allclose(x[edges].mean(axis=1), middles, atol=1e-12)
    if n > corners + len(edges):
        for face, node in zip(
            GMSH_FACES.get(shape, rectangles(shape)), x[corners + len(edges) :], strict=False
        ):
            np.testing.assert_allclose(x[list(face)].mean(axis=0), node, atol=1e-12)


def test_wedges_and_pyramids_are_cut_and_fill_the_part(tmp_path):
    mesh = ao.read_mesh(mixed_box(tmp_path / "a.vtu", 2, "hwp"))
    assert mesh.cell == "tetrahedron"
    assert ao.Structure(mesh, STEEL).mass == pytest.approx(7850, rel=1e-12)


def test_triangles_beside_quadrilaterals(tmp_path):
    points = [*SQUARE, [2, 0, 0], [2, 1, 0]]
    path = write(
        tmp_path / "a.vtu", points, ("quad", [[0, 1, 2, 3]]), ("triangle", [[1, 4, 2], [4, 5, 2]])
    )
    sheet = ao.Structure(ao.read_mesh(path, gdim=3), ao.Shell(210e9, 0.3, 7850.0, 1e-2))
    assert sheet.mesh.cell == "triangle"
    assert sheet.mass == pytest.approx(2 * 78.5, rel=1e-12)


def test_serendipity_cells_get_their_nodes(tmp_path):
    bulge = [(SQUARE[a] + SQUARE[b]) / 2 for a, b in EDGES["quad"]]
    bulge[0][1] -= 0.3  # a parabola of 2/3 · 0.3
    path = write(tmp_path / "a.vtu", [*SQUARE, *bulge], ("quad8", [range(8)]))
    mesh = ao.read_mesh(path)
    assert (mesh.cell, mesh.order) == ("quadrilateral", 2)
    part = ao.Structure(mesh, ao.Solid(210e9, 0.3, 1000.0, plane="stress"))
    assert part.mass == pytest.approx(1200, rel=1e-12)
    assert ao.read_mesh(path, order=1).order == 1
