"""Divided meshes keep their part and its groups; sizes of cells ask for what they promise."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

import antiosc as ao
from antiosc.fem.error.bisection import (
    COARSEST,
    FINEST,
    POWER,
    edge_lengths,
    growth,
    ratios,
    refined,
)
from antiosc.fem.error.remeshing import measures, source_of, wished_sizes
from antiosc.fem.platform import compat
from mpi import run_ranks
from parts import STEEL, box, plate


def some(cell: str) -> ao.Mesh:
    """A small mesh with groups of its sides, and of half of its cells and one corner."""
    if cell == "triangle":
        mesh = plate((3, 2), (0.3, 0.2), cell)
    else:
        mesh = box((3, 2, 2), (0.3, 0.2, 0.2), cell)
    x = centres(mesh)
    corner = np.flatnonzero(np.linalg.norm(mesh.dolfinx.geometry.x, axis=1) < 1e-12)
    nodes = compat.entity_vertices(mesh.dolfinx, 0)[:, 0]
    more = {
        "half": {mesh.tdim: np.flatnonzero(x[:, 0] < 0.15).astype(np.int32)},
        "corner": {0: np.flatnonzero(nodes == corner[0]).astype(np.int32)},
    }
    return ao.Mesh(mesh.dolfinx, {**mesh.groups, **more}, mesh.name)


def centres(mesh: ao.Mesh) -> np.ndarray:
    return mesh.dolfinx.geometry.x[compat.geometry_nodes(mesh.dolfinx)].mean(axis=1)


def content(mesh: ao.Mesh, name: str, dim: int) -> float:
    """Length, area or volume of a group."""
    rows = compat.entity_vertices(mesh.dolfinx, dim)[mesh.group(name)[dim]]
    corners = mesh.dolfinx.geometry.x[rows]
    sides = corners[:, 1:] - corners[:, :1]
    gram = np.linalg.det(sides @ sides.transpose(0, 2, 1))
    return float(np.sqrt(gram).sum() / (1, 1, 2, 6)[dim])


@pytest.mark.parametrize("cell", ["triangle", "tetrahedron"])
def test_divided_cells_keep_part_and_groups(cell):
    mesh = some(cell)
    fine = refined(mesh, np.where(centres(mesh)[:, 0] < 0.12, 0.3, 1.0))
    assert fine.n_cells > 3 * mesh.n_cells
    assert measures(fine) == pytest.approx(measures(mesh), rel=1e-12)
    side = mesh.tdim - 1
    for name, dim in (("left", side), ("right", side), ("half", mesh.tdim)):
        assert content(fine, name, dim) == pytest.approx(content(mesh, name, dim), rel=1e-12)
    assert len(fine.group("corner")[0]) == 1
    left = edge_lengths(fine)[centres(fine)[:, 0] < 0.05]
    assert left.max() < 0.5 * edge_lengths(mesh).max()


@pytest.mark.parametrize(("order", "dim"), [(1, 2), (2, 2), (1, 3), (2, 3)])
def test_ratios_promise_the_goal_with_fewer_cells(order, dim):
    energies = np.random.default_rng(0).uniform(0.5, 2.0, 500)
    s = ratios(MPI.COMM_SELF, energies, 0.1, order, dim)
    new = energies * s ** (2 * order)
    assert new.sum() == pytest.approx(0.1 * energies.sum(), rel=1e-9)
    # equal errors of the new cells, if those fall with this power of the size
    each = energies * s ** (POWER[dim] + dim)
    np.testing.assert_allclose(each, each[0], rtol=1e-9)
    uniform = 0.1 ** (1 / (2 * order))
    assert growth(MPI.COMM_SELF, s, dim) < uniform**-dim


def test_ratios_have_bounds():
    s = ratios(MPI.COMM_SELF, np.array([1.0, 1e-30, 0.0]), 1e-9, 1, 2)
    assert s.min() == FINEST
    assert s.max() == COARSEST
    few = ratios(MPI.COMM_SELF, np.array([1.0, 2.0]), 100.0, 2, 3)
    assert np.all(few == COARSEST)
    assert np.all(ratios(MPI.COMM_SELF, np.zeros(3), 0.5, 2, 3) == 1.0)


GEO = """
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 0.3, 0.1};
Physical Surface("sheet") = {1};
Physical Curve("left") = {4};
"""


def test_gmsh_follows_a_field_of_sizes(tmp_path):
    (tmp_path / "sheet.geo").write_text(GEO)
    source = source_of(tmp_path / "sheet.geo")
    assert source.thickness() == pytest.approx(2 * 0.03 / 0.8)
    mesh = source.first(0.03, [((0.3, 0.1), 0.01)])
    ratio = np.where(centres(mesh)[:, 0] < 0.1, 0.25, 1.0)
    wished = wished_sizes(mesh, ratio)
    fine = source.finer(mesh, ratio)
    assert 0.6 < fine.n_cells / wished.expected() < 1.7
    left = centres(fine)[:, 0] < 0.05
    assert edge_lengths(fine)[left].mean() < 0.5 * edge_lengths(mesh).mean()
    assert "left" in fine.groups
    near = np.linalg.norm(centres(fine) - [0.3, 0.1, 0], axis=1) < 0.01
    assert edge_lengths(fine)[near].max() < 0.012


@pytest.mark.slow
def test_coarse_curved_cells_do_not_cut_cylinders_off():
    bracket = Path(__file__).parents[3] / "meshes" / "bracket.geo"
    source = source_of(bracket)
    mesh = source.first(2 * source.thickness(), [((0.02, 0.04, 0.075), 0.002)])
    masses = [ao.Structure(m, ao.Solid(**STEEL)).total_mass for m in (mesh, ao.read_mesh(bracket))]
    assert masses[0] == pytest.approx(masses[1], rel=5e-4)


SCRIPT = """
    import json, numpy as np
    from antiosc.fem.platform import compat
    from antiosc.fem.error.bisection import refined
    from antiosc.fem.error.remeshing import measures
    from parts import box
    mesh = box((3, 2, 2), (0.3, 0.2, 0.2), "tetrahedron")
    x = mesh.dolfinx.geometry.x[compat.geometry_nodes(mesh.dolfinx)].mean(axis=1)
    x = x[: compat.cell_map(mesh.dolfinx).size_local]
    fine = refined(mesh, np.where(x[:, 0] < 0.12, 0.3, 1.0))
    groups = sorted(fine.groups)
    print(json.dumps([*np.round(measures(fine), 12).tolist(), groups]))
"""


@pytest.mark.mpi
def test_two_ranks_refine_too():
    for line in run_ranks(2, SCRIPT):
        assert json.loads(line) == [0.012, 0.32, ["left", "right"]]
