"""CAD files: names of faces and holes, pieces, the second attempt, and the volume of the mesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import antiosc as ao

pytest.importorskip("dolfinx")

from antiosc.fem.mesh.surface import Faces
from antiosc.io import by_gmsh
from parts import gmsh_session

pytestmark = pytest.mark.fem
STEEL = ao.Solid(210e9, 0.3, 7850.0)


@pytest.fixture(scope="module")
def plate(tmp_path_factory) -> Path:
    """A plate of 60 x 40 x 10 mm: a hole of 8 mm, one of 6 mm in two halves, a boss, a fillet."""
    path = tmp_path_factory.mktemp("cad") / "plate.step"
    with gmsh_session() as gmsh:
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        occ = gmsh.model.occ
        plate = occ.addBox(0, 0, 0, 60, 40, 10)
        holes = [(3, occ.addCylinder(15, 12, 0, 0, 0, 10, 4))]
        for start in (0.0, np.pi):
            half = occ.addCylinder(45, 12, 0, 0, 0, 10, 3, angle=np.pi)
            occ.rotate([(3, half)], 45, 12, 0, 0, 0, 1, start)
            holes.append((3, half))
        cut, _ = occ.cut([(3, plate)], holes)
        boss = (3, occ.addCylinder(30, 28, 10, 0, 0, 8, 5))
        occ.fuse(cut, [boss])
        occ.synchronize()
        gmsh.write(str(path))
    return path


@pytest.fixture(scope="module")
def mesh(plate):
    return ao.read_mesh(plate, size=6e-3, refine=[((0.03, 0.028, 0.018), 2e-3)])


def test_holes_are_named_by_diameter_and_bosses_are_none(mesh):
    holes = [name for name in mesh.groups if name.startswith("hole")]
    assert holes == ["hole 6 mm (1)", "hole 8 mm (1)"]
    tagged = mesh.groups["hole 8 mm (1)"][2]
    x = Faces(mesh, sheet=False)
    middles = x.centres[np.isin(x.facets, tagged)]
    assert np.hypot(middles[:, 0] - 15e-3, middles[:, 1] - 12e-3) == pytest.approx(4e-3, rel=0.1)


@pytest.mark.slow
def test_a_face_holds_and_is_struck_by_its_name(mesh):
    part = ao.Structure(mesh, STEEL, [ao.Support("hole 8 mm (1)")])
    faces = Faces(mesh, sheet=False)
    names = [name for name in mesh.groups if name.startswith("face ")]
    facets = {name: np.isin(faces.facets, mesh.groups[name][2]) for name in names}
    top = max(names, key=lambda name: faces.centres[facets[name], 2].mean())
    model = ao.extract(part, ao.Site(face=top, radius=2e-3), n=3)
    there = ao.Site((30e-3, 28e-3, 18e-3), (0, 0, -1), radius=2e-3, snap=True)
    assert model.direction == pytest.approx([0, 0, -1], abs=1e-9)
    assert model.k0 == pytest.approx(ao.extract(part, there, n=3).k0, rel=0.2)
    for wrong in ({"face": top, "point": (0, 0, 0)}, {"face": 3}):
        with pytest.raises(ao.InputError, match="face"):
            ao.Site(**wrong)
    with pytest.raises(ao.InputError, match="no group"):
        ao.extract(part, ao.Site(face="face 99"))


@pytest.fixture(scope="module")
def boxes(tmp_path_factory) -> Path:
    """Two boxes apart, of 10 and 20 mm, in a STEP file of 0.5 mm fragments' distance."""
    path = tmp_path_factory.mktemp("cad") / "boxes.step"
    with gmsh_session() as gmsh:
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        gmsh.model.occ.addBox(0, 0, 0, 10, 10, 10)
        gmsh.model.occ.addBox(30, 0, 0, 20, 20, 20)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
    return path


@pytest.mark.slow
def test_one_of_several_pieces_is_read(boxes):
    with pytest.raises(ao.MeshError, match=r"2 pieces.*20 × 20 × 20 mm.*10 × 10 × 10 mm"):
        ao.read_mesh(boxes, size=5e-3)
    for piece, side in ((1, 20e-3), (2, 10e-3)):
        with pytest.warns(ao.AntioscWarning, match=f"piece {piece} of 2 is read"):
            mesh = ao.read_mesh(boxes, size=5e-3, piece=piece)
        assert ao.Structure(mesh, STEEL).mass == pytest.approx(7850 * side**3, rel=1e-9)
        assert len([name for name in mesh.groups if name.startswith("face")]) == 6
    with pytest.raises(ao.MeshError, match="no piece 3"):
        ao.read_mesh(boxes, size=5e-3, piece=3)


@pytest.mark.slow
def test_a_volume_that_differs_from_cad_is_told(tmp_path):
    """A cylinder of flat cells has less; curved cells around a full turn have its volume."""
    path = tmp_path / "rod.step"
    with gmsh_session() as gmsh:
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 40, 10)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
    exact = np.pi * 10e-3**2 * 40e-3
    mesh = ao.read_mesh(path, size=5e-3)
    assert ao.Structure(mesh, STEEL).mass == pytest.approx(7850 * exact, rel=5e-3)
    with gmsh_session() as gmsh:
        by_gmsh.open_cad(gmsh, str(path))
        gmsh.option.setNumber("Mesh.ElementOrder", 2)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 5e-3)
        gmsh.model.mesh.generate(3)
        held = by_gmsh._measure(gmsh, 3, 1)
        assert held == pytest.approx(exact, rel=1e-9)
        assert by_gmsh._volume_remarks(gmsh, "rod.step", 1.005 * held) != []
        assert "too small" in by_gmsh._volume_remarks(gmsh, "rod.step", 1.05 * held)[0]


@pytest.mark.parametrize("name", ["/proc/kmsg", "/dev/kmsg", "part\ud800.msh"])
def test_what_is_no_file_of_a_mesh_is_told(name):
    with pytest.raises(ao.MeshError) as told:
        ao.read_mesh(name, cells=3)
    str(told.value).encode()
