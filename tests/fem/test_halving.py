"""Finished meshes and decks with smaller cells: measures, groups, materials, supports, impacts."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.fem.linalg.algebra import multiply
from antiosc.fem.mesh.finer import halved
from antiosc.fem.mesh.reading import sound
from antiosc.fem.platform import compat
from antiosc.fem.structure.structure import on_mesh
from antiosc.io.neutral import CELL_KINDS, RawMesh
from antiosc.reduce.error.division import divided_mesh
from parts import gmsh_cube

pytestmark = pytest.mark.fem
basix = pytest.importorskip("basix")
#: Linear maps of the cells of the tests, with a shear, so that no two directions are alike.
SHEAR = np.array([[1.0, 0.3, 0.1], [0.0, 0.8, 0.2], [0.0, 0.0, 1.3]])


def one_cell(shape: str, order: int, bend: float = 0.0) -> RawMesh:
    """One cell as a mesh, all facets of it a group; its second-order sides are bent by `bend`."""
    kind = next(k for k in CELL_KINDS.values() if (k.shape, k.order) == (shape, order))
    cell = getattr(basix.CellType, shape)
    corners = np.asarray(basix.geometry(cell))
    nodes = [corners[k] for k in range(len(corners))]
    if order == 2:
        between = sorted(compat.nodes_between(shape), key=lambda pair: pair[1])
        nodes += [corners[vertices].mean(axis=0) for vertices, _ in between]
    x = np.array(nodes)
    points = x @ SHEAR[: x.shape[1], : x.shape[1]]
    points[:, 0] += bend * x[:, 1] * (1 - x[:, 1])
    facets = np.array(basix.topology(cell)[kind.dim - 1])
    to_dolfinx = compat.node_order(shape, kind.nodes, "vtk")
    cells = np.arange(kind.nodes)[None, np.argsort(to_dolfinx)]
    of_side = {2: "interval", 3: "triangle", 4: "quadrilateral"}[facets.shape[1]]
    facets = facets[:, np.argsort(compat.node_order(of_side, facets.shape[1], "vtk"))]
    groups = {"skin": {kind.dim - 1: facets}, "all": {kind.dim: cells[:, : kind.vertices]}}
    groups["corner"] = {0: np.array([[0]])}
    return RawMesh(points, cells, kind, groups)


def measure(raw: RawMesh) -> float:
    """Length, area or volume of a mesh, by quadrature on its curved cells."""
    cell = getattr(basix.CellType, raw.kind.shape)
    element = basix.create_element(basix.ElementFamily.P, cell, raw.kind.order)
    X, weights = basix.make_quadrature(cell, 6)
    gradients = element.tabulate(1, X)[1:, :, :, 0]
    nodes = raw.cells[:, compat.node_order(raw.kind.shape, raw.kind.nodes, "vtk")]
    J = np.einsum("dqk,cki->cqid", gradients, raw.points[nodes])
    return float((np.abs(np.linalg.det(J)) @ weights).sum())


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("shape", ["triangle", "quadrilateral", "tetrahedron", "hexahedron"])
def test_halves_fill_their_cell_and_groups_follow(shape, order):
    raw = one_cell(shape, order, 0.2 * (order - 1))
    fine = raw
    for count in (1, 2):
        fine = halved(fine)
        assert len(fine.cells) == 2 ** (raw.kind.dim * count)
        assert measure(fine) == pytest.approx(measure(raw), rel=1e-12)  # bent sides stay
        sound(fine, "cells", made_here=False)  # no cracks, no overlaps
        assert len(np.unique(fine.cells)) == len(fine.points)  # common nodes are one
        sides = fine.groups["skin"][raw.kind.dim - 1]
        assert len(sides) == len(raw.groups["skin"][raw.kind.dim - 1]) * 2 ** (
            (raw.kind.dim - 1) * count
        )
        x = np.linalg.solve(SHEAR[: raw.kind.dim, : raw.kind.dim].T, fine.points.T).T
        if order == 1:  # all vertices of the group lie on the skin
            on_skin = np.minimum(np.abs(x), np.abs(1 - x)).min(axis=1) < 1e-12
            on_skin |= np.abs(1 - x.sum(axis=1)) < 1e-12
            assert on_skin[sides].all()
        assert fine.groups["all"][raw.kind.dim].shape[0] == len(fine.cells)
        assert fine.groups["corner"][0].tolist() == [[0]]


def test_repeated_halves_of_a_tetrahedron_have_three_shapes_at_most():
    raw = one_cell("tetrahedron", 1)
    for _ in range(3):
        raw = halved(raw)
    x = raw.points[raw.cells]
    pairs = np.triu_indices(4, 1)
    edges = np.sort(np.linalg.norm(x[:, pairs[0]] - x[:, pairs[1]], axis=2), axis=1)
    assert len(np.unique(np.round(edges, 9), axis=0)) <= 3


def test_curved_cells_of_a_part_are_divided_with_their_sides(tmp_path):
    """The mesh of an error estimate has the order of the part's."""
    mesh = ao.read_mesh(gmsh_cube(tmp_path / "q.msh", "quadrilateral", 2, bent=True), gdim=3)
    fine = divided_mesh(mesh)
    assert (fine.n_cells, fine.order) == (4 * mesh.n_cells, 2)
    assert set(fine.groups) == set(mesh.groups)


# -- smaller cells around a point


def test_nodes_of_the_file_keep_their_numbers(tmp_path):
    path = tmp_path / "square.inp"
    nodes = "7, 0., 0.\n3, 1., 0.\n11, 1., 1.\n5, 0., 1."
    path.write_text(f"*NODE\n{nodes}\n*ELEMENT, TYPE=CPS3\n1, 7, 3, 11\n2, 7, 11, 5\n")
    mesh = ao.read_mesh(path, refine=[((1.0, 1.0), 0.1)])
    assert mesh.n_cells > 20
    assert mesh.node(11).tolist() == [1.0, 1.0, 0.0]
    assert mesh.node(5).tolist() == [0.0, 1.0, 0.0]
    assert mesh.node(4) is None


@pytest.mark.slow
def test_constant_strains_and_curvatures_pass_through_cells_of_unlike_size(tmp_path):
    """No forces inside a plate in any of the six states, over the forces at its edges."""
    path = tmp_path / "plate.inp"
    i, j = (c.ravel() for c in np.meshgrid(range(9), range(5)))
    inside = (i % 8 > 0) & (j % 4 > 0)
    nodes = (
        np.stack([i, j], axis=1) / 20
        + 0.01 * np.stack([np.sin(7 * j), np.cos(5 * i)]).T * (inside[:, None])
    )
    first = np.flatnonzero((i < 8) & (j < 4)) + 1
    cells = np.stack([first, first + 1, first + 10, first + 9], axis=1)
    cells = np.vstack([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])
    rows = [f"{k + 1}, {a!r}, {b!r}, 0." for k, (a, b) in enumerate(nodes.tolist())]
    elements = [f"{k + 1}, {', '.join(map(str, cell))}" for k, cell in enumerate(cells.tolist())]
    card = f"*ELEMENT, TYPE=S{cells.shape[1]}, ELSET=ALL"
    path.write_text("\n".join(["*NODE", *rows, card, *elements]) + "\n")
    shell = ao.Shell(E=70e9, nu=0.33, rho=2700.0, thickness=0.02)
    mesh = ao.read_mesh(path, gdim=3, refine=[((0.23, 0.09, 0.0), 0.006)])
    part = on_mesh(ao.Structure(mesh, shell))
    x, y, _ = part.form.space.tabulate_dof_coordinates().T
    on_edge = (np.abs(x - 0.2) > 0.2 - 1e-9) | (np.abs(y - 0.1) > 0.1 - 1e-9)
    zero = np.zeros_like(x)
    bent = [  # w, its derivatives by y and minus by x: the rotations
        (x * x / 2, zero, -x),
        (y * y / 2, y, zero),
        (x * y, x, -y),
    ]
    states = [(zero, zero, w, *turns, zero) for w, *turns in bent]
    states += [(x, zero, *4 * [zero]), (zero, y, *4 * [zero]), (y, x, *4 * [zero])]
    assert mesh.n_cells > 200
    for state in states:
        forces = multiply(part.K, np.stack(state, axis=1).reshape(-1, 1)).reshape(-1, 6)
        assert np.abs(forces[~on_edge]).max() < 1e-7 * np.abs(forces[on_edge]).max()
