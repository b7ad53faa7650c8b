"""Closed surfaces filled, assemblies cut at each other, names of solids, IGES."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("dolfinx")
pytest.importorskip("gmsh")

import gmsh

import antiosc as ao

pytestmark = pytest.mark.fem
STEEL = ao.Solid(210e9, 0.3, 7850.0)


def stl(path: Path, skipped: int = 0) -> Path:
    """A box of 40 × 20 × 10, its first triangles left out."""
    corners = np.array(list(product((0, 40), (0, 20), (0, 10))), dtype=float)
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))][skipped:]
    text = "solid box\n"
    for triangle in triangles:
        text += "facet normal 0 0 0\nouter loop\n"
        for k in triangle:
            text += "vertex {:g} {:g} {:g}\n".format(*corners[k])
        text += "endloop\nendfacet\n"
    path.write_text(text + "endsolid box\n")
    return path


def write_brep(path: Path, axis: bool = False) -> None:
    """A cube of edge 10, with a line through it if `axis`."""
    gmsh.initialize(readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        kernel = gmsh.model.occ
        kernel.addBox(0, 0, 0, 10, 10, 10)
        if axis:
            kernel.addLine(kernel.addPoint(-5, 5, 5), kernel.addPoint(15, 5, 5))
        kernel.synchronize()
        gmsh.write(str(path))
    finally:
        gmsh.finalize()


def test_a_closed_surface_is_filled(tmp_path):
    path = stl(tmp_path / "box.stl")
    mesh = ao.read_mesh(path, solid=True, size=5e-3, unit="mm")
    assert mesh.cell == "tetrahedron"
    assert ao.Structure(mesh, STEEL).mass == pytest.approx(7850 * 8e-6, rel=1e-9)
    sheet = ao.read_mesh(path, unit="mm", merge=1e-6)
    assert (sheet.cell, sheet.n_cells) == ("triangle", 12)


def test_curves_besides_a_solid_are_told_and_left_out(tmp_path):
    """An axis through a box, as sketches leave it in CAD files."""
    path = tmp_path / "box.brep"
    write_brep(path, axis=True)
    with pytest.warns(ao.AntioscWarning, match="volumes"):
        mesh = ao.read_mesh(path, size=5.0)
    assert mesh.cell == "tetrahedron"


@pytest.fixture(scope="module")
def assembly(tmp_path_factory) -> Path:
    """Two boxes that touch on half of a face, in a STEP file in mm."""
    path = tmp_path_factory.mktemp("cad") / "two.step"
    gmsh.initialize(readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")  # OpenCASCADE keeps the last one
        gmsh.model.occ.addBox(0, 0, 0, 40, 20, 10)
        gmsh.model.occ.addBox(0, 0, 10, 20, 20, 10)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    text = path.read_text()
    for k, name in ((1, "base"), (2, "post")):  # the names that the writer gives them
        number = text.index(f".{k}'")
        first = text.rindex("'", 0, number)
        text = text.replace(text[first : number + 3], f"'{name}'")
    path.write_text(text)
    return path


@pytest.mark.slow
def test_solids_of_an_assembly_share_nodes_and_have_their_names(assembly):
    with pytest.raises(ao.MeshError, match="falls into 2 pieces"):
        ao.read_mesh(assembly, size=8e-3)
    mesh = ao.read_mesh(assembly, size=8e-3, fragments=True)
    assert set(mesh.groups) == {"base", "post"}
    both = {"base": STEEL, "post": ao.Solid(70e9, 0.3, 2700.0)}
    mass = 7850 * 8e-6 + 2700 * 4e-6
    assert ao.Structure(mesh, both).mass == pytest.approx(mass, rel=1e-9)
    alone = ao.read_mesh(assembly, size=8e-3, parts=["post"])
    assert ao.Structure(alone, STEEL).mass == pytest.approx(7850 * 4e-6, rel=1e-9)


def test_parts_and_cells_are_one_choice(tmp_path):
    path = stl(tmp_path / "box.stl")
    for options in ({"parts": ["a"], "cells": 2}, {"parts": "a"}, {"parts": 3.5}, {"parts": []}):
        with pytest.raises(ao.InputError, match=r"cells=? (or parts|must be)|parts must be|cells"):
            ao.read_mesh(path, **options)


@pytest.mark.parametrize(("unit", "length"), [("2,2HMM", 0.1), ("6,1HM", 100), ("1,2HIN", 2.54)])
def test_an_iges_curve_is_in_metres(tmp_path, unit, length):
    """A line of 100 of the file's units, in the standard's sections S, G, D, P, T of 80 columns."""
    values = f"1H,,1H;,4Hline,4Hline,4Hnone,4Hnone,32,308,15,308,15,4Hline,1.,{unit},1,0.01,"
    values += "15H20200101.000000,1E-6,100.,4Hnone,4Hnone,11,0,15H20200101.000000;"
    lines = ["line".ljust(72) + "S      1"]
    rows = [values[k : k + 72] for k in range(0, len(values), 72)]
    lines += [row.ljust(72) + f"G{k + 1:7d}" for k, row in enumerate(rows)]
    lines.append(f"{110:8d}{1:8d}" + f"{0:8d}" * 6 + "00000000" + "D      1")
    lines.append(f"{110:8d}{0:8d}{0:8d}{1:8d}{0:8d}" + " " * 32 + "D      2")
    lines.append("110,0.,0.,0.,100.,0.,0.;".ljust(64) + f"{1:8d}" + "P      1")
    lines.append(f"S{1:7d}G{len(rows):7d}D{2:7d}P{1:7d}".ljust(72) + "T      1")
    path = tmp_path / "line.iges"
    path.write_text("\n".join(lines) + "\n")
    mesh = ao.read_mesh(path, size=0.2 * length)
    assert (mesh.cell, mesh.n_cells >= 5) == ("interval", True)
    assert mesh.extent() == pytest.approx(length, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".geo", ".brep"])
def test_geometries_without_a_unit_of_their_own_take_one(tmp_path, suffix):
    """A cube of 10 mm, refined at a corner, in gmsh's script and in OpenCASCADE's own format."""
    path = tmp_path / f"cube{suffix}"
    if suffix == ".geo":
        path.write_text('SetFactory("OpenCASCADE");\nBox(1) = {0, 0, 0, 10, 10, 10};\n')
    else:
        write_brep(path)
    options = {"size": 5e-3, "refine": [((0.01, 0.01, 0.01), 5e-4)], "unit": "mm"}
    mesh = ao.read_mesh(path, **options)
    assert ao.Structure(mesh, STEEL).mass == pytest.approx(7850 * 1e-6, rel=1e-9)
    assert mesh.n_cells > 1.5 * ao.read_mesh(path, size=5e-3, unit="mm").n_cells
    with pytest.raises(ao.MeshError, match=r"is 0\.01 m long: elements of 1e-13 m are below"):
        ao.read_mesh(path, size=1e-13, unit="mm")
    with pytest.raises(ao.MeshError, match=r"at size=1e-06 m, more than"):
        ao.read_mesh(path, size=1e-6, unit="mm")
