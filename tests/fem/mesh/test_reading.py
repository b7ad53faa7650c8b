"""Meshes from geometries: sizes, plane meshes, gmsh's session."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("gmsh")

import gmsh
import meshio

import antiosc as ao
import parts
from antiosc.base.errors import AntioscWarning
from antiosc.fem.platform import compat
from parts import moments


def quarter_disc(path):
    """A quarter of a unit disc, 1 thick, written by gmsh as a geometry; lengths in m."""
    gmsh.initialize(readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setString("Geometry.OCCTargetUnit", "M")
        gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 1, 1, angle=np.pi / 2)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    return path


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


def test_folded_cells_of_a_file_are_told(tmp_path):
    path = parts.gmsh_cube(tmp_path / "cube.msh", "tetrahedron", 2)
    cube = meshio.read(path)
    cells = next(b.data for b in cube.cells if b.type == "tetra10")
    cube.points[cells[5, 4]] += 3 * (cube.points[cells[5, 2]] - cube.points[cells[5, 4]])
    meshio.Mesh(cube.points, [("tetra10", cells)]).write(tmp_path / "bad.vtu")
    with pytest.warns(
        AntioscWarning, match=r"of 48 cells of bad.vtu fold over themselves.*order=1"
    ):
        ao.read_mesh(tmp_path / "bad.vtu")
    assert ao.read_mesh(tmp_path / "bad.vtu", order=1).order == 1


def longest_edges_near(mesh: ao.Mesh, point, radius: float) -> np.ndarray:
    """Longest edge of every cell that has a vertex within `radius` of the point."""
    vertices = mesh.dolfinx.geometry.x[compat.entity_vertices(mesh.dolfinx, mesh.tdim)]
    near = np.linalg.norm(vertices - np.resize(point, 3), axis=2).min(axis=1) <= radius
    edges = np.linalg.norm(vertices[:, :, None] - vertices[:, None], axis=3)
    return edges.max(axis=(1, 2))[near]


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


def test_the_space_a_mesh_lives_in(tmp_path):
    square = parts.gmsh_cube(tmp_path / "square.msh", "triangle")
    cube = parts.gmsh_cube(tmp_path / "cube.msh", "tetrahedron")
    assert ao.read_mesh(square).gdim == 2
    assert ao.read_mesh(square, gdim=3).gdim == 3
    assert ao.read_mesh(cube).gdim == 3
    assert ao.read_mesh("meshes/beam.msh").gdim == 3
    assert ao.read_mesh("meshes/beam.msh", gdim=2).gdim == 2
    with pytest.raises(ao.MeshError, match=r"cube.msh is a mesh of volumes.*gdim=2"):
        ao.read_mesh(cube, gdim=2)
    with pytest.raises(ao.MeshError, match=r"frame.msh is not plane \(z spans 1.3 m\)"):
        ao.read_mesh("meshes/frame.msh", gdim=2)


def test_the_callers_gmsh_session_survives(tmp_path, capfd):
    path = parts.gmsh_cube(tmp_path / "cube.msh", "tetrahedron")
    geo = tmp_path / "sheet.geo"
    geo.write_text(parts.SHEET_SCRIPT)
    gmsh.initialize(readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
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
    finally:
        gmsh.finalize()
    assert ao.read_mesh(path).n_cells  # and one that was ended does not matter
    assert ao.read_mesh(path).n_cells
    assert "initialized" not in "".join(capfd.readouterr())


WRONG = [
    ({"size": 0.0}, "size must be > 0"),
    ({"gdim": 4}, "gdim must be"),
    ({"order": 3}, "order must be"),
    ({"refine": "here"}, "refine must be a list of pairs"),
    ({"refine": [(0, 0, 0.1)]}, "refine lists pairs"),
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


def test_geo_uses_its_own_sizes_unless_told(tmp_path):
    path = tmp_path / "sheet.geo"
    path.write_text(parts.SHEET_SCRIPT)
    own, finer = ao.read_mesh(path), ao.read_mesh(path, size=0.1)
    assert (own.cell, own.order, own.gdim) == ("triangle", 2, 2)
    assert finer.n_cells > 3 * own.n_cells
    assert {name: tuple(g) for name, g in finer.groups.items()} == {
        "sheet": (2,), "foot": (1,), "17": (1,)
    }  # fmt: skip
    np.testing.assert_allclose(parts.group_points(finer, "foot", 1)[..., 1], 0, atol=1e-15)
    np.testing.assert_allclose(parts.group_points(finer, "17", 1)[..., 1], 1, rtol=1e-15)
