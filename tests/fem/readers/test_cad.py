"""CAD files: names of faces and holes, pieces, the second attempt, and the volume of the mesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import antiosc as ao

pytest.importorskip("dolfinx")

from antiosc.base.errors import ChoiceWarning, UnmeshableError
from antiosc.fem.mesh.surface import Faces, face_tags
from antiosc.io import by_gmsh, cad, reading
from antiosc.io.cad import in_order, label_of
from antiosc.io.neutral import KINDS, RawMesh
from antiosc.io.request import AROUND_CLOSELY
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


def test_the_named_faces_divide_the_skin(mesh):
    faces = Faces(mesh, sheet=False)
    names, tags = face_tags(faces)
    assert tags.min() == 0
    assert set(tags) == set(range(len(names)))
    assert sum(len(mesh.groups[name][2]) for name in names) == len(faces)


@pytest.mark.slow
def test_a_face_holds_and_is_struck_by_its_name(mesh):
    part = ao.Structure(mesh, STEEL, [ao.Support("hole 8 mm (1)")])
    faces = Faces(mesh, sheet=False)
    names, tags = face_tags(faces)
    top = max(names, key=lambda name: faces.centres[tags == names.index(name), 2].mean())
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


#: Boxes of 3 and 10 mm, the small one first, as solids or as faces.
SCRIPT = 'SetFactory("OpenCASCADE"); {small}; {large};'
SOLIDS = ("Box(1) = {20, 0, 0, 3, 3, 3}", "Box(2) = {0, 0, 0, 10, 10, 10}")
FACES = ("Rectangle(1) = {20, 0, 0, 3, 3}", "Rectangle(2) = {0, 0, 0, 10, 10}")


@pytest.mark.slow
@pytest.mark.parametrize(("small", "large"), [SOLIDS, FACES])
@pytest.mark.filterwarnings("ignore:.*piece . of 2:antiosc.AntioscWarning")
def test_the_rank_of_a_piece_is_that_of_its_size_however_fine_its_cells_are(tmp_path, small, large):
    path = tmp_path / "two.geo"
    path.write_text(SCRIPT.format(small=small, large=large))
    for refine in ([], [((21e-3, 1e-3, 0), 0.3e-3)]):
        for piece, side in ((1, 10e-3), (2, 3e-3)):
            mesh = ao.read_mesh(path, 2e-3, unit="mm", piece=piece, refine=refine)
            x = mesh.dolfinx.geometry.x
            assert np.ptp(x[:, :2], axis=0) == pytest.approx([side, side], rel=1e-6)


def test_pieces_of_one_size_keep_the_order_of_the_file():
    """Of two cubes of six and five tetrahedra, both of them of volume 1."""
    cube = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], dtype=float)
    five = np.array([[0, 1, 2, 4], [3, 1, 2, 7], [5, 1, 4, 7], [6, 2, 4, 7], [1, 2, 4, 7]])
    six = np.array([[0, a, b, 7] for a, b in ((1, 3), (3, 2), (2, 6), (6, 4), (4, 5), (5, 1))])
    for first, second in ((five, six), (six, five)):
        points = np.vstack([cube, cube + 3])
        raw = RawMesh(points, np.vstack([first, second + 8]), KINDS["tetra"], "vtk")
        assert (reading.piece_of_cells(raw) == np.repeat([0, 1], [len(first), len(second)])).all()


def test_labels_that_programs_write_are_no_names():
    assert label_of("Shapes/as1/rod-assembly_1/nut_1/nut") == "nut"
    assert label_of("Shapes/part/=>[0:1:1:2]/SOLID") == "part"
    assert label_of("Shapes/Open CASCADE STEP translator 7.5 1") == ""
    names = ["face 10", "face 2", "hole 10 mm (1)", "hole 6 mm (2)", "nut"]
    assert in_order(names) == ["hole 6 mm (2)", "hole 10 mm (1)", "nut", "face 2", "face 10"]


@pytest.mark.slow
def test_a_step_file_with_an_analysis_is_told(tmp_path):
    file = tmp_path / "results.step"
    schema = "AP209_MULTIDISCIPLINARY_ANALYSIS_AND_DESIGN_MIM_LF"
    file.write_text(
        "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\n"
        f"FILE_NAME('','',(''),(''),'','','');\nFILE_SCHEMA(('{schema}'));\nENDSEC;\n"
        "DATA;\n#1=CARTESIAN_POINT('',(0.,0.,0.));\nENDSEC;\nEND-ISO-10303-21;\n"
    )
    with pytest.raises(ao.AntioscError, match=r"an analysis \(STEP AP209\), not the shape"):
        ao.read_mesh(file, size=5e-3)


@pytest.mark.slow
def test_a_second_attempt_follows_the_curvature_and_is_told(boxes, monkeypatch):
    asked = []
    content = reading._content

    def once(*arguments, around=0.0, **options):
        asked.append(around)
        if not around:
            raise UnmeshableError("PLC error.")
        return content(*arguments, around=around, **options)

    monkeypatch.setattr(reading, "_content", once)
    with pytest.warns(ChoiceWarning, match=r"follow the curvature, since .*PLC error"):
        ao.read_mesh(boxes, size=5e-3, piece=1)
    assert asked == [0.0, AROUND_CLOSELY]


def test_a_geometry_that_fails_twice_is_refused_once(boxes, monkeypatch):
    asked = []

    def never(*_arguments, **_options):
        asked.append(1)
        raise UnmeshableError("PLC error.")

    monkeypatch.setattr(reading, "_content", never)
    with pytest.raises(ao.MeshError, match=r"PLC error, nor otherwise: repair boxes.step"):
        ao.read_mesh(boxes, size=5e-3)
    assert len(asked) == 2


@pytest.mark.slow
def test_cells_that_joining_spoils_are_no_reason_to_mesh_again(boxes):
    asked = []

    def spoiled(raw: RawMesh) -> RawMesh:
        asked.append(raw)
        raise UnmeshableError("2 of 10 cells use a node twice.")

    with pytest.raises(ao.MeshError, match="node twice"):
        reading.read(boxes, 0.01, piece=1, merge=1e-6, sound=spoiled)
    assert len(asked) == 1


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
        cad.opened(gmsh, str(path))
        gmsh.option.setNumber("Mesh.ElementOrder", 2)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 5e-3)
        gmsh.model.mesh.generate(3)
        held = by_gmsh._volume(gmsh)
        assert held == pytest.approx(exact, rel=1e-9)
        assert by_gmsh._volume_told(gmsh, "rod.step", 1.005 * held) != []
        assert "too small" in by_gmsh._volume_told(gmsh, "rod.step", 1.05 * held)[0]


@pytest.mark.slow
def test_names_in_a_file_are_printed_without_escapes(tmp_path):
    path = tmp_path / "part\x1b[31m.geo"
    path.write_text(
        'SetFactory("OpenCASCADE"); Box(1) = {0, 0, 0, 1, 1, 1};\n'
        'Physical Volume("red \x1b[31m") = {1}; Physical Surface("all") = {1:6};\n'
    )
    mesh = ao.read_mesh(path, size=1.0)
    assert set(mesh.groups) == {"red \\x1b[31m", "all"}
    assert "\x1b" not in repr(mesh)
    with pytest.raises(ao.MeshError) as told:
        ao.read_mesh(path.with_name("none\x1b.geo"), size=1.0)
    assert "\x1b" not in str(told.value)


@pytest.mark.parametrize("name", ["/proc/kmsg", "/dev/kmsg", "part\ud800.msh"])
def test_what_is_no_file_of_a_mesh_is_told(name):
    with pytest.raises(ao.MeshError) as told:
        ao.read_mesh(name, cells=3)
    str(told.value).encode()


@pytest.mark.slow
def test_the_tip_of_a_cone_has_few_cells(tmp_path):
    """Elements by the curvature alone would have no end there."""
    path = tmp_path / "cone.step"
    with gmsh_session() as gmsh:
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        gmsh.model.occ.addCone(0, 0, 0, 0, 0, 40, 20, 0)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
    mesh = ao.read_mesh(path, size=8e-3, timeout=60)
    assert mesh.n_cells < 5000
    assert ao.Structure(mesh, STEEL).mass == pytest.approx(
        7850 * np.pi * 0.02**2 * 0.04 / 3, rel=5e-3
    )
