"""Misfits of cells; meshes of files."""

from __future__ import annotations

import gmsh
import numpy as np
import pytest

import antiosc as ao
import parts
from antiosc.fem.mesh import reading
from antiosc.fem.mesh.reading import SIMPLEX_EDGES, collapsed_cells, folded_cells, straightened
from antiosc.fem.mesh.surface import quadrature
from antiosc.fem.platform import compat
from antiosc.io.neutral import CELL_KINDS
from assemblies import box
from parts import gmsh_session, moments

EVERY_EDGE = [(shape, k) for shape, ends in SIMPLEX_EDGES.items() for k in range(len(ends))]


@pytest.mark.parametrize("name", ["quad", "hexahedron"])
def test_two_cells_with_two_sides_in_common_are_found(name):
    """A node of two cells alone: the side between the ends of both has a bend."""
    lower = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]])
    lower = np.vstack([lower[:3], [[4, 5, 9, 7], [5, 8, 7, 9]]])
    cells = lower if name == "quad" else np.hstack([lower, lower + 10])
    assert not len(reading.misfit_cells(cells[:3], CELL_KINDS[name])[0])
    assert reading.misfit_cells(cells, CELL_KINDS[name])[0].tolist() == [3, 4]


@pytest.mark.parametrize("cell", ["tetrahedron", "hexahedron", "triangle", "quadrilateral"])
def test_cells_and_their_boundary_have_volume_and_centroid(cell):
    """A block (rectangle), sheared: sizes by hand, of all cells and of two opposite sides."""
    plane = cell in ("triangle", "quadrilateral")
    high = (2.0, 1.0) if plane else (2.0, 1.0, 0.5)
    mesh = box((0, 0, 0)[: len(high)], high, (3, 2, 2)[: len(high)], cell)
    x = mesh.dolfinx.geometry.x
    x[:, 0] += 0.3 * x[:, 1]
    cells = np.arange(mesh.dolfinx.topology.index_map(mesh.tdim).size_local)
    whole = quadrature(mesh, mesh.tdim, cells, 2)
    middle = np.array([1.15, 0.5, 0.0 if plane else 0.25])
    assert whole.weight.sum() == pytest.approx(np.prod(high), rel=1e-12)
    assert whole.weight @ whole.x / whole.weight.sum() == pytest.approx(middle, abs=1e-12)
    for name, shift in (("x0", -1.0), ("x1", 1.0)):
        side = quadrature(mesh, mesh.tdim - 1, mesh.group(name)[mesh.tdim - 1], 2)
        slant = np.hypot(1.0, 0.3) * np.prod(high[2:])
        assert side.weight.sum() == pytest.approx(slant, rel=1e-12)
        centroid = side.weight @ side.x / side.weight.sum()
        assert centroid == pytest.approx(middle + shift * np.eye(3)[0], abs=1e-12)


# --- Folded second-order cells: their mid-side nodes move to the midpoints, those of others sta


VERTICES = {
    "triangle": np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]),
    "tetrahedron": np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]),
}


def curved(shape: str) -> np.ndarray:
    """Nodes of one cell in VTK's order, a little off the midpoints."""
    corners = VERTICES[shape]
    middles = [(corners[i] + corners[j]) / 2 + 0.01 for i, j in SIMPLEX_EDGES[shape]]
    nodes = np.vstack([corners, middles])
    if shape == "triangle":
        nodes[:, 2] = 0.0
    return nodes


@pytest.mark.parametrize(("shape", "edge"), EVERY_EDGE)
def test_one_of_two_cells_is_straightened(shape, edge):
    ends = SIMPLEX_EDGES[shape]
    n, corners = len(curved(shape)), len(VERTICES[shape])
    points = np.vstack([curved(shape), curved(shape) + 5.0])
    i, j = ends[edge]
    points[corners + edge] = 1.4 * points[j] - 0.4 * points[i]  # beyond the end of its edge
    if shape == "triangle":
        points = points[:, :2]
    cells = np.arange(2 * n).reshape(2, n)
    order = compat.node_order(shape, n, "vtk")
    assert folded_cells(points, cells[:, order], shape, 2, 0.02).tolist() == [0]
    assert not len(collapsed_cells(points, cells[:, order], shape, 2))
    found = straightened(points, cells, shape)
    np.testing.assert_array_equal(found[n:], points[n:])
    np.testing.assert_array_equal(found[:corners], points[:corners])
    for k, (i, j) in enumerate(ends):
        np.testing.assert_allclose(found[corners + k], (points[i] + points[j]) / 2, atol=1e-15)
    assert not len(folded_cells(found, cells[:, order], shape, 2, 0.02))


def quarter_disc(path):
    """A quarter of a unit disc, 1 thick, written by gmsh as a geometry; lengths in m."""
    with gmsh_session() as gmsh:
        gmsh.option.setString("Geometry.OCCTargetUnit", "M")
        gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 1, 1, angle=np.pi / 2)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
    return path


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["step", "brep"])
def test_solid_geometry_is_meshed_with_curved_cells(tmp_path, suffix):
    path = quarter_disc(tmp_path / f"quarter.{suffix}")
    mesh = ao.read_mesh(path, size=0.5)
    assert (mesh.cell, mesh.order) == ("tetrahedron", 2)
    extent = np.ptp(mesh.dolfinx.geometry.x, axis=0)
    np.testing.assert_allclose(extent, [1, 1, 1], rtol=1e-9)
    # Straight cells of this size miss 0.3 % of the volume.
    assert moments(mesh)[0] == pytest.approx(np.pi / 4, rel=3e-4)
    straight = ao.read_mesh(path, size=0.5, order=1)
    assert straight.order == 1
    assert moments(straight)[0] < 0.998 * np.pi / 4


def longest_edges_near(mesh: ao.Mesh, point, radius: float) -> np.ndarray:
    """Longest edge of every cell that has a vertex within `radius` of the point."""
    vertices = mesh.dolfinx.geometry.x[compat.vertex_nodes(mesh.dolfinx, mesh.tdim)]
    near = np.linalg.norm(vertices - np.resize(point, 3), axis=2).min(axis=1) <= radius
    edges = np.linalg.norm(vertices[:, :, None] - vertices[:, None], axis=3)
    return edges.max(axis=(1, 2))[near]


@pytest.mark.slow
@pytest.mark.parametrize("local", [0.1, 0.02])
@pytest.mark.parametrize("point", [(1.0, 0.3, 0.5), (0.31, 0.3, 1.0)])
def test_refined_elements_are_no_larger_than_asked(tmp_path, point, local):
    path = tmp_path / "cube.brep"
    gmsh.initialize(readConfigFiles=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
    gmsh.model.occ.synchronize()
    gmsh.write(str(path))
    gmsh.finalize()
    mesh = ao.read_mesh(path, size=0.5, refine=[(point, local)], order=1)
    near = longest_edges_near(mesh, point, local)
    assert len(near) > 4
    assert near.max() <= local
    # and they grow away from the point
    far = longest_edges_near(mesh, (0.0, 1.0, 0.0), 0.3)
    assert far.max() > 0.25


@pytest.mark.slow
def test_the_space_a_mesh_lives_in(tmp_path):
    square = parts.gmsh_cube(tmp_path / "square.msh", "triangle")
    cube = parts.gmsh_cube(tmp_path / "cube.msh", "tetrahedron")
    assert ao.read_mesh(square).gdim == 2
    assert ao.read_mesh(square, gdim=3).gdim == 3
    assert ao.read_mesh(cube).gdim == 3
    assert ao.read_mesh("meshes/beam.msh").gdim == 3
    assert ao.read_mesh("meshes/beam.msh", gdim=2).gdim == 2
    with pytest.raises(ao.MeshError, match=r"cube.msh is a mesh of volumes.*gdim 2"):
        ao.read_mesh(cube, gdim=2)
    with pytest.raises(ao.MeshError, match=r"frame.msh is not plane \(z spans 1.3 m\)"):
        ao.read_mesh("meshes/frame.msh", gdim=2)


@pytest.mark.slow
def test_the_callers_gmsh_session_survives(tmp_path, capfd):
    path = parts.gmsh_cube(tmp_path / "cube.msh", "tetrahedron")
    geo = tmp_path / "sheet.geo"
    geo.write_text(parts.SHEET_SCRIPT)
    with gmsh_session() as gmsh:
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.123)
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        gmsh.model.add("mine")
        gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.model.add("mine too")
        gmsh.model.setCurrent("mine")
        ao.read_mesh(path)
        ao.read_mesh(geo, size=0.5)
        with pytest.raises(ao.MeshError):
            ao.read_mesh(path, gdim=2)
        assert gmsh.model.getCurrent() == "mine"
        assert len(gmsh.model.getEntities(3)) == 1
        assert gmsh.option.getNumber("Mesh.MeshSizeMax") == 0.123
        assert gmsh.option.getString("Geometry.OCCTargetUnit") == "MM"
        assert [name for name in gmsh.model.list() if name] == ["mine", "mine too"]
    assert ao.read_mesh(path).n_cells  # and one that was ended does not matter
    assert ao.read_mesh(path).n_cells
    assert "initialized" not in "".join(capfd.readouterr())


WRONG = [
    ({"size": 0.0}, "size must be > 0"),
    ({"gdim": 4}, "gdim must be"),
    ({"order": 3}, "order must be"),
    ({"refine": "here"}, "refine must be a list of pairs"),
    ({"refine": [(0, 0, 0.1)]}, "refine lists .point, size."),
    ({"refine": [((0, 0), 0.0)]}, "a size of refine must be > 0"),
    ({"cells": []}, "cells must be a dimension or names of groups"),
    ({"cells": ""}, "cells must be a name"),
    ({"cells": 4}, "cells must be at most 3"),
    ({"cells": 2, "parts": ["a"]}, "which both select cells"),
    ({"parts": "a"}, "parts must be a list of names"),
    ({"trust": "yes"}, "trust must be"),
    ({"timeout": 0}, "timeout must be > 0"),
    ({"comm": "world"}, "comm must be an MPI communicator"),
]


@pytest.mark.parametrize(("options", "words"), WRONG)
def test_wrong_arguments_are_named_before_a_file_is_looked_for(options, words, tmp_path):
    with pytest.raises(ao.InputError, match=words):
        ao.read_mesh(tmp_path / "none.msh", **options)
