"""Sizes of elements for a tolerance, the meshes that they make, and errors on two ranks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

import antiosc as ao
from antiosc.fem.elements.weak_form import measure
from antiosc.fem.mesh.finer import (
    DIVIDED_RATIO,
    edge_lengths,
    gathered,
    graded_sizes,
    refined,
)
from antiosc.fem.platform import compat
from antiosc.io.isolation import SIZE_GRADING
from antiosc.reduce.error.division import (
    ERROR_POWER,
    LEAST_LINES,
    cell_growth,
    longest_line,
    mesh_source,
    size_ratios,
    volume_and_surface,
    wished_sizes,
)
from mpi import one_and_several
from parts import box, plate


def some(cell: str) -> ao.Mesh:
    """A small mesh with groups of its sides, and of half of its cells and one corner."""
    if cell == "triangle":
        mesh = plate((3, 2), (0.3, 0.2), cell)
    else:
        mesh = box((3, 2, 2), (0.3, 0.2, 0.2), cell)
    x = centres(mesh)
    corner = np.flatnonzero(np.linalg.norm(mesh.dolfinx.geometry.x, axis=1) < 1e-12)
    nodes = compat.vertex_nodes(mesh.dolfinx, 0)[:, 0]
    more = {
        "half": {mesh.tdim: np.flatnonzero(x[:, 0] < 0.15).astype(np.int32)},
        "corner": {0: np.flatnonzero(nodes == corner[0]).astype(np.int32)},
    }
    return ao.Mesh(mesh.dolfinx, {**mesh.groups, **more}, mesh.name)


def centres(mesh: ao.Mesh) -> np.ndarray:
    return mesh.dolfinx.geometry.x[compat.geometry_nodes(mesh.dolfinx)].mean(axis=1)


def content(mesh: ao.Mesh, name: str, dim: int) -> float:
    """Length, area or volume of a group."""
    rows = compat.vertex_nodes(mesh.dolfinx, dim)[mesh.group(name)[dim]]
    corners = mesh.dolfinx.geometry.x[rows]
    sides = corners[:, 1:] - corners[:, :1]
    gram = np.linalg.det(sides @ sides.transpose(0, 2, 1))
    return float(np.sqrt(gram).sum() / (1, 1, 2, 6)[dim])


@pytest.mark.parametrize("cell", ["triangle", "tetrahedron"])
def test_divided_cells_keep_part_and_groups(cell):
    mesh = some(cell)
    fine = refined(mesh, np.where(centres(mesh)[:, 0] < 0.12, 0.3, 1.0))
    assert fine.n_cells > 3 * mesh.n_cells
    assert volume_and_surface(fine) == pytest.approx(volume_and_surface(mesh), rel=1e-12)
    side = mesh.tdim - 1
    for name, dim in (("left", side), ("right", side), ("half", mesh.tdim)):
        assert content(fine, name, dim) == pytest.approx(content(mesh, name, dim), rel=1e-12)
    assert len(fine.group("corner")[0]) == 1
    left = edge_lengths(fine)[centres(fine)[:, 0] < 0.05]
    assert left.max() < 0.5 * edge_lengths(mesh).max()


@pytest.mark.parametrize(("order", "dim"), [(1, 2), (2, 2), (1, 3), (2, 3)])
def test_ratios_promise_the_goal_with_fewer_cells(order, dim):
    energies = np.random.default_rng(0).uniform(0.5, 2.0, 500)
    s = size_ratios(MPI.COMM_SELF, energies, 0.1, order, dim)
    new = energies * s ** (2 * order)
    assert new.sum() == pytest.approx(0.1 * energies.sum(), rel=1e-9)
    # equal errors of the new cells, if those fall with this power of the size
    each = energies * s ** (ERROR_POWER[dim] + dim)
    np.testing.assert_allclose(each, each[0], rtol=1e-9)
    uniform = 0.1 ** (1 / (2 * order))
    assert cell_growth(MPI.COMM_SELF, s, dim) < uniform**-dim


GEO = """
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 0.3, 0.1};
Physical Surface("sheet") = {1};
Physical Curve("left") = {4};
"""


@pytest.mark.slow
def test_gmsh_follows_a_field_of_sizes(tmp_path):
    (tmp_path / "sheet.geo").write_text(GEO)
    source = mesh_source(tmp_path / "sheet.geo")
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
    source = mesh_source(bracket)
    mesh = source.first(2 * source.thickness(), [((0.02, 0.04, 0.075), 0.002)])
    coarse, fine = (
        compat.integrate(1 * measure(each, None), each.dolfinx)
        for each in (mesh, ao.read_mesh(bracket))
    )
    assert coarse == pytest.approx(fine, rel=5e-4)


def corners(mesh: ao.Mesh) -> np.ndarray:
    return mesh.dolfinx.geometry.x[compat.geometry_nodes(mesh.dolfinx)]


def test_cells_around_points_have_the_sizes_of_the_points():
    """Of the first mesh: below 1/0.75 of the size asked at the distance of their middle."""
    mesh = plate((4, 3), (0.4, 0.3), "triangle")
    points = [((0.1, 0.1), 0.02), ((0.35, 0.2), 0.03)]
    rise, reach = SIZE_GRADING

    def asked(one: ao.Mesh) -> np.ndarray:
        sizes = []
        for x in corners(one).mean(axis=1):
            at = [
                local + rise * max(np.hypot(x[0] - p[0], x[1] - p[1]) - reach * local, 0)
                for p, local in points
            ]
            sizes.append(min(at))
        return np.array(sizes)

    assert graded_sizes(mesh, points) == pytest.approx(asked(mesh), rel=1e-12)
    fine = mesh_source(mesh).first(1.0, points)
    assert fine.n_cells > 4 * mesh.n_cells
    assert (asked(fine) / edge_lengths(fine)).min() >= DIVIDED_RATIO
    near = np.linalg.norm(corners(fine).mean(axis=1)[:, :2] - (0.1, 0.1), axis=1) < 0.03
    assert edge_lengths(fine)[near].max() < 0.02 / DIVIDED_RATIO
    far = corners(fine).mean(axis=1)[:, 0] < 0.02
    assert edge_lengths(fine)[far].max() > 0.05
    assert mesh_source(mesh).first(1.0, []) is mesh
    whole = gathered(fine, edge_lengths(fine))
    assert whole is not None
    raw, values = whole
    assert values == pytest.approx(edge_lengths(fine))
    np.testing.assert_allclose(
        np.sort(raw.points[raw.cells].mean(axis=1), axis=0),
        np.sort(corners(fine).mean(axis=1)[:, :2], axis=0),
    )


GEOMETRY = """
Point(1) = {0, 0, 0}; Point(2) = {1, 0, 0}; Point(3) = {1, 0.5, 0};
Line(1) = {1, 2}; Line(2) = {2, 3}; Physical Curve("rods") = {1, 2};
"""


@pytest.mark.slow
def test_geometries_of_lines_are_meshed_more_finely(tmp_path):
    path = tmp_path / "rods.geo"
    path.write_text(GEOMETRY)
    source = mesh_source(path)
    diagonal = np.hypot(1.0, 0.5)
    assert source.extent() == pytest.approx(diagonal)
    first = source.first(1.0, [((0.41, 0.0), 0.01)])
    assert 0.5 * diagonal / LEAST_LINES < longest_line(first) <= 1.001 * diagonal / LEAST_LINES
    finer = source.finer(first, np.full(first.n_cells, 0.3))
    assert longest_line(finer) <= 1.001 * diagonal / LEAST_LINES / 4
    assert edge_lengths(finer).sum() == pytest.approx(1.5)


ERRORS = """
    import json, warnings, numpy as np
    import antiosc as ao
    from antiosc.reduce.error.model_errors import ModelErrors
    from mpi4py import MPI
    from parts import STEEL, box, plate
    from sheets import sheet
    warnings.simplefilter("ignore")
    solid = ao.Solid(**STEEL)
    plane = ao.Solid(**STEEL, plane="stress", thickness=0.01)
    found = []
    for order in (1, 2):
        for mesh, material, site in (
            (box((6, 3, 2), (0.12, 0.06, 0.04), "tetrahedron"), solid,
             ao.Site((0.08, 0.03, 0.04), (0, 0, -1), radius=0.015)),
            (box((6, 3, 2), (0.12, 0.06, 0.04)), solid,
             ao.Site((0.08, 0.03, 0.04), (0, 0, -1), radius=0.015)),
            (plate((8, 4)), plane, ao.Site((0.15, 0.06), (0, -1), radius=0.02)),
        ):
            part = ao.Structure(mesh, material, [ao.Support("left")], order=order)
            model = ao.extract(part, site, n=4, error="estimate")
            errors = ModelErrors(part)
            cells = errors.of_cells(model, np.eye(5)).sum()
            patch = model.info["patch"]
            found.append([
                *np.linalg.norm(model.strain_error, axis=0).tolist(),
                part.comm.allreduce(float(cells)),
                patch["faces"], patch.get("compliance", 0.0),
            ])
    def polar(s, t):
        return (1 + s) * np.cos(np.pi / 2 * t), (1 + s) * np.sin(np.pi / 2 * t)
    low = ao.Support(plane=((0, 0), (0, 1)))
    part = ao.Structure(sheet((2, 9), polar, "triangle"), plane, [low], order=1)
    top = ao.Site((2**0.5, 2**0.5), (-1, -1), radius=0.2, snap=True)
    model = ao.extract(part, top, n=3, error="estimate")
    found.append([float("angles of up to 10" in model.info["not_included"])])
    print(json.dumps(found))
"""


@pytest.mark.mpi
def test_two_ranks_find_what_one_finds():
    one, two = one_and_several(ERRORS)
    for some, whole in zip(two, one, strict=True):
        np.testing.assert_allclose(some, whole, rtol=1e-6)
