"""Nodes by their numbers in the file, for sites, supports and probes."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao

pytestmark = [
    pytest.mark.fem,
    pytest.mark.filterwarnings("ignore:the compliance under a point load"),
]
STEEL = ao.Solid(210e9, 0.3, 7850.0)
#: Number of the node (i, j, k) of a grid of a bar.
FIRST, SHAPE = 1000, (5, 3, 3)


def number(i: int, j: int, k: int) -> int:
    return FIRST + 7 * int(np.ravel_multi_index((i, j, k), SHAPE))


def bar() -> tuple[np.ndarray, np.ndarray]:
    """Points of a bar of 0.4 x 0.1 x 0.1 m and its hexahedra, by rows."""
    grids = [np.linspace(0, side, n) for side, n in zip((0.4, 0.1, 0.1), SHAPE, strict=True)]
    points = np.stack(np.meshgrid(*grids, indexing="ij"), axis=-1).reshape(-1, 3)
    at = np.arange(len(points)).reshape(SHAPE)
    low = at[:-1, :-1, :-1].ravel()
    a, b, c = SHAPE[1] * SHAPE[2], SHAPE[2], 1
    around = (0, a, a + b, b, c, a + c, a + b + c, b + c)
    return points, np.stack([low + step for step in around], axis=1)


def abaqus(path):
    points, cells = bar()
    lines = ["*NODE"]
    for row, x in enumerate(points):
        lines.append(f"{FIRST + 7 * row}, {x[0]:.9g}, {x[1]:.9g}, {x[2]:.9g}")
    lines.append("*ELEMENT, TYPE=C3D8, ELSET=BAR")
    lines += [f"{k + 1}, " + ", ".join(str(FIRST + 7 * n) for n in c) for k, c in enumerate(cells)]
    path.write_text("\n".join(lines) + "\n")


def nastran(path):
    points, cells = bar()
    lines = ["BEGIN BULK"]
    for row, x in enumerate(points):
        lines.append(f"GRID,{FIRST + 7 * row},,{x[0]:.5f},{x[1]:.5f},{x[2]:.5f}")
    for k, c in enumerate(cells):
        n = [str(FIRST + 7 * one) for one in c]
        lines.append(f"CHEXA,{k + 1},1," + ",".join(n[:6]) + ",+\n+," + ",".join(n[6:]))
    path.write_text("\n".join([*lines, "ENDDATA"]) + "\n")


def gmsh4(path):
    points, cells = bar()
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", str(len(points))]
    for row, x in enumerate(points):
        lines.append(f"{FIRST + 7 * row} " + " ".join(f"{c:.9g}" for c in x))
    lines += ["$EndNodes", "$Elements", str(len(cells))]
    for k, c in enumerate(cells):
        lines.append(f"{k + 1} 5 2 0 1 " + " ".join(str(FIRST + 7 * n) for n in c))
    path.write_text("\n".join([*lines, "$EndElements"]) + "\n")


WRITERS = {"a.inp": abaqus, "a.bdf": nastran, "a.msh": gmsh4}


@pytest.mark.slow
@pytest.mark.parametrize("name", WRITERS)
def test_nodes_have_the_numbers_of_their_file(tmp_path, name):
    WRITERS[name](tmp_path / name)
    mesh = ao.read_mesh(tmp_path / name)
    for i, j, k in ((0, 0, 0), (4, 2, 2), (2, 1, 0)):
        expected = [0.1 * i, 0.05 * j, 0.05 * k]
        assert mesh.node(number(i, j, k)) == pytest.approx(expected, abs=1e-9)
    assert mesh.node(3) is None


@pytest.fixture(scope="module")
def mesh(tmp_path_factory):
    path = tmp_path_factory.mktemp("numbers") / "bar.inp"
    abaqus(path)
    return ao.read_mesh(path)


@pytest.mark.slow
def test_a_support_on_numbered_nodes_is_that_on_their_face(mesh):
    nodes = [number(0, j, k) for j in range(3) for k in range(3)]
    tip = {"direction": (0, 0, -1)}
    supports = [
        ao.Support(nodes=nodes),
        ao.Support(plane=((0, 0, 0), (1, 0, 0))),
    ]
    found = []
    for support in supports:
        part = ao.Structure(mesh, STEEL, [support])
        for site in (ao.Site((0.4, 0.1, 0.1), **tip), ao.Site(node=number(4, 2, 2), **tip)):
            found.append(ao.extract(part, site, n=4).k0)
    np.testing.assert_allclose(found, found[0], rtol=1e-9)


@pytest.mark.slow
def test_numbers_that_a_mesh_does_not_have(mesh):
    part = ao.Structure(mesh, STEEL, [ao.Support(plane=((0, 0, 0), (1, 0, 0)))])
    with pytest.raises(ao.InputError, match="no node 3"):
        ao.extract(part, ao.Site(node=3, direction=(0, 0, -1)))
    with pytest.raises(ao.InputError, match="fixes nothing"):
        ao.Structure(mesh, STEEL, [ao.Support(nodes=[3])])
    for wrong in ([], "1", [1.5], 3):
        with pytest.raises(ao.InputError, match="number"):
            ao.Support(nodes=wrong)
    made = ao.box_mesh((0.1, 0.1, 0.1), 0.1)
    with pytest.raises(ao.InputError, match="have no numbers"):
        ao.Structure(made, STEEL, [ao.Support(nodes=[3])])
