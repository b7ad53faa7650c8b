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
from antiosc.io.reading import read
from mesh_files import grid, refusal
from paths import MESHES


def write(path: Path, points, *cells, **data) -> Path:
    meshio.Mesh(np.asarray(points, dtype=float), list(cells), **data).write(path)
    return path


@pytest.mark.slow
def test_repeated_cells_are_refused(tmp_path):
    told = refusal(grid(tmp_path / "grid.msh", 19, 1, "twice"))
    assert "40 of 762 cells of grid.msh repeat another one" in told


@pytest.mark.slow
def test_cells_that_use_a_node_twice_or_share_a_side_too_often(tmp_path):
    square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    path = write(tmp_path / "a.vtu", square, ("quad", [[0, 1, 2, 3], [0, 1, 2, 2]]))
    assert "1 of 2 cells of a.vtu use a node twice" in refusal(path)
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1], [1, 1, 1]]
    tetra = [[0, 1, 2, 3], [0, 1, 2, 4], [0, 1, 2, 5]]
    path = write(tmp_path / "b.vtu", points, ("tetra", tetra))
    assert "3 of 3 cells of b.vtu share a side with more than one other" in refusal(path)


ABAQUS_BEAMS = """\
*NODE
1, 0, 0, 0
2, 1, 0.1, 0
3, 2, 0, 0
4, 3, -0.1, 0
5, 4, 0, 0
*ELEMENT, TYPE=B32, ELSET=all
1, 1, 2, 3
2, 3, 4, 5
"""


@pytest.mark.slow
def test_beams_of_three_nodes_in_abaqus_order(tmp_path):
    path = tmp_path / "beam.inp"
    path.write_text(ABAQUS_BEAMS)
    raw = read(path)
    assert raw.points[raw.cells][:, :, 0].tolist() == [[0, 2, 1], [2, 4, 3]]
    assert ao.read_mesh(path).order == 2
    straight = ao.read_mesh(path, order=1)
    assert straight.order == 1
    assert np.ptp(straight.dolfinx.geometry.x, axis=0).tolist() == [4, 0, 0]
    path.write_text(ABAQUS_BEAMS.replace("2, 3, 4, 5", "2, 4, 3, 5"))
    assert "in no known order" in refusal(path)


def solid_with_shell(path: Path) -> Path:
    """Two blocks, a skin on a side of them and a fin that stands off, one edge of it stiffened."""
    points = [[x, y, z] for x in (0, 1, 2) for z in (0, 1) for y in (0, 1)] + [[3, 0, 0], [3, 1, 0]]
    hexahedra = [[0, 4, 5, 1, 2, 6, 7, 3], [4, 8, 9, 5, 6, 10, 11, 7]]
    quads, lines = [[0, 1, 3, 2], [8, 9, 13, 12]], [[0, 1], [12, 13]]
    sets = {
        "blocks": [np.array([0, 1]), None, None], "skin": [None, np.array([0]), None],
        "fin": [None, np.array([1]), None], "both": [None, np.array([0, 1]), None],
        "one": [np.array([1]), None, None],
    }  # fmt: skip
    lists = {
        name: [np.zeros(0, dtype=int) if rows is None else rows for rows in blocks]
        for name, blocks in sets.items()
    }
    cells = [("hexahedron", hexahedra), ("quad", quads), ("line", lines)]
    return write(path, points, *cells, cell_sets=lists)


@pytest.mark.slow
def test_shells_and_beams_that_are_no_sides_of_solids_are_told(tmp_path):
    path = solid_with_shell(tmp_path / "part.inp")
    told = refusal(path)
    assert "holds 2 volumes and besides 1 faces (quad) and 1 lines (line)" in told
    assert "as 3 (their dimension)" in told
    assert ao.read_mesh(path, cells=3).n_cells == 2
    assert len(ao.read_mesh(path, cells=3).group("skin")[2]) == 1
    assert not ao.read_mesh(path, cells=3).groups["fin"]
    assert ao.read_mesh(path, cells="blocks").n_cells == 2
    assert ao.read_mesh(path, cells="one").n_cells == 1
    fin = ao.read_mesh(path, cells="fin")
    assert (fin.n_cells, fin.tdim) == (1, 2)
    assert "2 pieces" in refusal(path, cells=["both"])
    with pytest.raises(ao.InputError, match="cells"):
        ao.read_mesh(path, cells="foot")
    for wrong in (0, 4, True, [], [1], "", 2.5):
        with pytest.raises(ao.InputError, match="cells must"):
            ao.read_mesh(path, cells=wrong)


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


@pytest.mark.slow
def test_sound_meshes_are_told_nothing_of():
    for path in MESHES.glob("*.msh"):
        assert told(path) == []


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
