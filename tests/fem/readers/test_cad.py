"""CAD files: names of faces and holes, pieces, and further attempts where meshing fails."""

from __future__ import annotations

import os
import re
import signal
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import antiosc as ao

pytest.importorskip("dolfinx")

from antiosc.base import progress
from antiosc.base.errors import PiecesError, UnmeshableError
from antiosc.fem.mesh.surface import Faces, face_tags
from antiosc.io import cad, kept_surfaces, reading, remade
from antiosc.io.cad import ATTEMPTS, in_order, label_of
from antiosc.io.facets import volumes
from antiosc.io.isolation import OVERTIME_WORDS
from antiosc.io.neutral import FileMesh, RawMesh, kind_of
from antiosc.io.reading import Asked, _meshed
from antiosc.io.request import Request
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


def test_labels_that_programs_write_are_no_names():
    assert label_of("Shapes/as1/rod-assembly_1/nut_1/nut") == "nut"
    assert label_of("Shapes/part/=>[0:1:1:2]/SOLID") == "part"
    assert label_of("Shapes/Open CASCADE STEP translator 7.5 1") == ""
    names = ["face 10", "face 2", "hole 10 mm (1)", "hole 6 mm (2)", "nut"]
    assert in_order(names) == ["hole 6 mm (2)", "hole 10 mm (1)", "nut", "face 2", "face 10"]


def test_other_ways_to_mesh_are_tried_and_told():
    raw = RawMesh(np.eye(3), np.array([[0, 1, 2]]), kind_of("triangle"), "gmsh")

    tries = []

    def once(attempt: int, *limit: float, told: str = "") -> RawMesh:
        tries.append(told)
        if attempt < 4:
            raise UnmeshableError(f"PLC error {attempt}.")
        return raw

    (sentence,) = _meshed(once, Asked(Path("part.step"))).remarks
    assert "PLC error" not in sentence  # which asks for nothing
    assert sentence.startswith("part.step is meshed in the shape of the file, by another attempt")
    assert sentence.endswith(f"{ATTEMPTS[4].about}.")
    count = sum(attempt.suits(True) for attempt in ATTEMPTS)
    assert tries == ["", f"try 2 of {count}, ", f"try 3 of {count}, "]

    def never(attempt: int, *limit: float, told: str = "") -> RawMesh:
        raise UnmeshableError("PLC error.")

    with pytest.raises(ao.MeshError, match=r"PLC error; nor .* repair part.step"):
        _meshed(never, Asked(Path("part.step")))


def test_the_next_reading_begins_with_the_attempt_that_succeeded(tmp_path):
    (tmp_path / "part.step").write_text("ISO-10303-21;\n")
    made = []

    def fourth(attempt: int, *limit: float, told: str = "") -> RawMesh:
        made.append(attempt)
        if attempt < 4:
            raise UnmeshableError("PLC error.")
        return RawMesh(np.eye(3), np.array([[0, 1, 2]]), kind_of("triangle"), "gmsh")

    asked = Asked(tmp_path / "part.step")
    told = [_meshed(fourth, asked).remarks for _ in range(2)]
    assert made == [0, 1, 4, 4]
    assert told[0] == told[1]
    (tmp_path / "part.step").write_text("ISO-10303-21; changed\n")
    os.utime(tmp_path / "part.step", (0, 0))
    _meshed(fourth, asked)
    assert made[4:] == [0, 1, 4]


def test_cells_that_joining_spoils_are_no_reason_to_mesh_again(tmp_path):
    """Every attempt has nodes that close; before, each of eleven was made."""
    path = tmp_path / "box.step"
    with gmsh_session() as gmsh:
        gmsh.model.occ.addBox(0, 0, 0, 20, 20, 20)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
    asked = []

    def spoiled(raw: RawMesh) -> RawMesh:
        asked.append(raw)
        raise UnmeshableError("2 of 10 cells use a node twice.")

    with pytest.raises(ao.MeshError, match=r"node twice; .* smaller merge"):
        reading.read(path, 0.01, merge=1e-6, sound=spoiled)
    assert len(asked) == 1


def test_no_further_attempt_begins_after_their_time(monkeypatch):
    seconds = [0.0]
    monkeypatch.setattr(reading, "processor_time", lambda: seconds[0])

    def late(attempt: int, *limit: float, told: str = "") -> RawMesh:
        seconds[0] += 0.6 * reading.ATTEMPTS_TIME
        raise UnmeshableError("PLC error.")

    with pytest.raises(ao.MeshError) as refusal:
        _meshed(late, Asked(Path("part.step")))
    assert seconds[0] == pytest.approx(1.2 * reading.ATTEMPTS_TIME)
    assert f"nor {ATTEMPTS[1].about}: repair" in str(refusal.value)


def test_the_volume_of_a_closed_surface():
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    assert volumes(points, faces).sum() == pytest.approx(1 / 6)


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


@pytest.mark.parametrize("name", ["part.stl", "part.step"])
def test_ways_that_unroll_no_side_come_next_and_are_made_late_too(monkeypatch, name):
    """The first way takes longer than all may: of a surface two others are made, of a CAD file
    none.
    """
    seconds = [0.0]
    monkeypatch.setattr(reading, "processor_time", lambda: seconds[0])
    made, told = [], []

    def late(attempt: int, *limit: float, told: str = "") -> RawMesh:
        seconds[0] += 1.1 * reading.ATTEMPTS_TIME
        made.append(ATTEMPTS[attempt])
        raise UnmeshableError("Wrong topology of boundary mesh for parametrization.")

    with pytest.raises(ao.MeshError), progress.following(told.append):
        _meshed(late, Asked(Path(name)))
    others = made[1:]
    assert [not one.cut for one in others] == ([True, False] if name == "part.stl" else [])
    for one, text in zip(made, filter(None, told), strict=True):
        assert one.about in text
    made.clear()

    def early(attempt: int, *limit: float, told: str = "") -> RawMesh:
        made.append(ATTEMPTS[attempt])
        if ATTEMPTS[attempt].cut:
            raise UnmeshableError("Wrong topology of boundary mesh for parametrization.")
        return RawMesh(np.eye(3), np.array([[0, 1, 2]]), kind_of("triangle"), "gmsh")

    seconds[0] = 0.0
    if name == "part.stl":
        assert "facets as they are" in _meshed(early, Asked(Path(name))).remarks[0]
        assert len(made) == 2


def test_the_box_of_a_solid_among_others_is_tight(tmp_path):
    """A tilted torus, whose surface is one of splines once it is in a file."""
    path = tmp_path / "two.step"
    tilt = 0.7
    with gmsh_session() as gmsh:
        torus = gmsh.model.occ.addTorus(0, 0, 0, 10, 3)
        gmsh.model.occ.rotate([(3, torus)], 0, 0, 0, 0, 1, 0, tilt)
        gmsh.model.occ.addBox(30, 0, 0, 1, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
    outline = reading.outline(path)
    low, high = 1e3 * outline.points[outline.cells["line"][0]]
    extents = 20 * np.cos(tilt) + 6, 26.0, 20 * np.sin(tilt) + 6
    assert high - low == pytest.approx(extents, rel=1e-2)
    low, high = 1e3 * outline.points[outline.cells["line"][1]]  # of planes it is not padded
    assert high - low == pytest.approx(np.ones(3), rel=1e-3)


def test_the_box_of_flat_faces_has_no_padding_by_the_tolerance_of_its_file(tmp_path):
    """It reached to z = -0.16 mm, and the mesh of the same plate to 0."""
    path = tmp_path / "plate.step"
    with gmsh_session() as gmsh:
        gmsh.model.occ.addBox(0, -50, 0, 354, 354, 6.35)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
    rough = re.sub(r"LENGTH_MEASURE\(1\.E-07\)", "LENGTH_MEASURE(1.E-02)", path.read_text())
    assert rough != path.read_text()
    path.write_text(rough)
    low, high = 1e3 * reading.outline(path).points
    assert low == pytest.approx([0, -50, 0], abs=1e-9)
    assert high == pytest.approx([354, 304, 6.35], abs=1e-9)


def test_triangles_that_pierce_each_other_are_told_as_the_fault():
    made = []

    def never(attempt: int, *limit: float, told: str = "") -> RawMesh:
        made.append(attempt)
        pierced = "Invalid boundary mesh (overlapping facets)"
        unrolled = "Wrong topology of boundary mesh for parametrization"
        raise UnmeshableError(f"{unrolled if ATTEMPTS[attempt].cut else pierced}.")

    with pytest.raises(ao.MeshError, match=r"overlapping facets.*pierce each other: repair part"):
        _meshed(never, Asked(Path("part.stl")))
    assert len(made) == 3  # the first, the facets, and the patches, which are no sides of the file


def test_after_an_attempt_that_does_not_end_the_faces_are_meshed_otherwise(monkeypatch):
    made: list[tuple[str, tuple[float, ...]]] = []

    def endless(attempt: int, *limit: float, told: str = "") -> RawMesh:
        made.append((ATTEMPTS[attempt].about, limit))
        raise UnmeshableError(f"reading part.step {OVERTIME_WORDS} than it may.")

    with pytest.raises(ao.MeshError):
        _meshed(endless, Asked(Path("part.step")))
    first, *others = made
    assert first == (ATTEMPTS[0].about, ())
    assert others
    assert all("MeshAdapt" in about and limit for about, limit in others)


def test_what_can_be_done_names_the_size_and_the_files_beside(tmp_path):
    def never(attempt: int, *limit: float, told: str = "") -> RawMesh:
        raise UnmeshableError("PLC error.")

    (tmp_path / "part.stl").write_text("solid\n")
    with pytest.raises(ao.MeshError, match=r"read part.stl instead.*than 0.003 m \(--size"):
        _meshed(never, Asked(tmp_path / "part.step", 0.003))


def test_a_surface_that_cannot_be_made_anew_either_is_told_with_the_time_it_had(
    tmp_path, monkeypatch
):
    def endless(*_arguments: object, **_options: object) -> None:
        raise ao.MeshError("reading part.step took longer than it may.")

    monkeypatch.setattr(remade, "installed", lambda: True)
    monkeypatch.setattr(reading, "read_apart", endless)
    with pytest.raises(UnmeshableError, match=r"PLC error\. Nor .* 600 s .* took longer"):
        reading._made_anew(Asked(tmp_path / "part.step"), UnmeshableError("PLC error."))


@pytest.mark.parametrize("left", [0, 1])
def test_repairs_that_open_a_solid_are_not_taken(left):
    """The faces that are left would be a sheet."""
    counts = iter([1, left])
    option = SimpleNamespace(setNumber=lambda *_: None, setString=lambda *_: None)
    model = SimpleNamespace(getEntities=lambda dim: next(counts) * [(dim, 1)])
    gmsh = SimpleNamespace(option=option, model=model, open=lambda _: None, clear=lambda: None)
    opened = partial(cad.opened, gmsh, "part.step", cad.HEALING)
    if left:
        assert opened() == 1.0
    else:
        with pytest.raises(UnmeshableError, match="open its solids"):
            opened()


def test_what_other_code_has_kept_is_not_taken(tmp_path, monkeypatch):
    """Its sentences, as "8.4e-05 units of the file", are those of the code that wrote them."""
    keys = []
    for number, text in enumerate(("told = 'units'", "told = 'mm'", "told = 'units'")):
        code = tmp_path / str(number)
        code.mkdir()
        (code / "reader.py").write_text(text)
        monkeypatch.setattr(kept_surfaces, "CODE", code)
        keys.append(kept_surfaces.key_of(tmp_path / "part.stl", 1.0))
    assert keys[0] == keys[2] != keys[1]


def only_anew() -> FileMesh:
    """A surface made anew without that of its file."""
    groups = {remade.ANEW: {"triangle": np.array([0])}}
    cells = {"triangle": np.array([[0, 1, 2]])}
    return FileMesh(np.eye(3), cells, "vtk", groups, remarks=["anew."])


def test_a_surface_made_anew_that_encloses_several_pieces_is_told_of_them(tmp_path, monkeypatch):
    """The pieces are kept, from which `new` and the page choose the largest."""
    triangle = only_anew()
    monkeypatch.setattr(reading, "_made_anew", lambda *_: (triangle, "PLC error"))
    monkeypatch.setattr(kept_surfaces, "_folder", lambda: tmp_path / "kept")
    in_pieces = PiecesError("part.stl falls into 2 pieces.")
    in_pieces.pieces = (1, 2)

    def meshed(_: object, asked: Asked) -> None:
        raise in_pieces if asked.anew else UnmeshableError("PLC error.")

    monkeypatch.setattr(reading, "_meshed", meshed)
    monkeypatch.setattr(reading, "_anew", {})
    (tmp_path / "part.stl").write_text("")
    with pytest.raises(PiecesError, match=r"PLC error; nor .* 2 pieces") as told:
        reading._filled(lambda *_: None, Asked(tmp_path / "part.stl"))
    assert told.value.pieces == (1, 2)


def test_a_surface_made_anew_that_cannot_be_filled_is_told_after_the_first_reason(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(kept_surfaces, "_folder", lambda: tmp_path / "kept")
    triangle = only_anew()
    monkeypatch.setattr(reading, "_made_anew", lambda *_: (triangle, "PLC error"))

    def never(_: object, asked: Asked) -> None:
        if asked.anew:
            raise ao.MeshError("part.stl is not closed.")
        raise UnmeshableError("PLC error.")

    monkeypatch.setattr(reading, "_meshed", never)
    monkeypatch.setattr(reading, "_anew", {})
    asked = Asked(tmp_path / "part.step")
    (tmp_path / "part.step").write_text("")
    for _ in range(2):
        with pytest.raises(UnmeshableError, match=r"PLC error; nor .* part.step is not closed"):
            reading._filled(lambda *_: None, asked)
    assert not (tmp_path / "kept").exists()


@pytest.mark.slow
def test_a_solid_that_gmsh_cannot_mesh_is_filled_within_its_surface_made_anew(
    tmp_path, monkeypatch
):
    """A plate with a hole: volume, names of its faces, and what is kept for the next process."""
    pytest.importorskip("pytetwild")
    monkeypatch.setattr(kept_surfaces, "_folder", lambda: tmp_path / "kept")
    path = tmp_path / "plate.step"
    with gmsh_session() as gmsh:
        box = gmsh.model.occ.addBox(0, 0, 0, 60, 40, 10)
        hole = gmsh.model.occ.addCylinder(20, 20, -1, 0, 0, 12, 5)
        gmsh.model.occ.cut([(3, box)], [(3, hole)])
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
    meshed = reading._meshed

    def refused(once: object, asked: Asked) -> RawMesh:
        if asked.is_cad:
            raise UnmeshableError("PLC error; nor otherwise.")
        return meshed(once, asked)  # type: ignore[arg-type]

    monkeypatch.setattr(reading, "_meshed", refused)
    for installed in (True, False):  # the second time the surface is kept in a file
        monkeypatch.setattr(reading, "_anew", {})
        monkeypatch.setattr(remade, "installed", lambda installed=installed: installed)
        raw = reading.read(path, 5e-3)
        told = "gmsh cannot mesh plate.step as it is; the surface of plate.step is made"
        assert raw.remarks[0].startswith(told)
        sides = raw.points[raw.cells[:, 1:4]] - raw.points[raw.cells[:, :1]]
        volume = (60 * 40 - np.pi * 5**2) * 10e-9
        assert np.abs(np.linalg.det(sides)).sum() / 6 == pytest.approx(volume, rel=4e-3)
        below = raw.points[np.unique(raw.cells[:, :4])][:, 2]
        assert ((below == below.min()) | (below > 1e-4)).all()  # its flat sides are flat
        rim = raw.points[raw.groups["hole 10 mm (1)"][2]]
        across = np.cross(rim[:, 1] - rim[:, 0], rim[:, 2] - rim[:, 0])
        area = np.linalg.norm(across, axis=1).sum() / 2
        assert area == pytest.approx(2 * np.pi * 5e-3 * 10e-3, rel=0.1)
        middle = rim.mean(axis=1)
        radius = np.hypot(middle[:, 0] - 0.02, middle[:, 1] - 0.02)
        assert (np.abs(radius - 5e-3) < 5e-4).mean() > 0.9
        assert sum(name.startswith("face ") for name in raw.groups) == 7


@pytest.mark.slow
def test_solids_that_gmsh_cannot_mesh_together_become_one_surface(tmp_path, monkeypatch):
    """A box, one that stands on it, and a pin that pierces it, with names of their faces, as some
    programs give them: one solid of the volume of their union.
    """
    pytest.importorskip("pytetwild")
    monkeypatch.setattr(kept_surfaces, "_folder", lambda: tmp_path / "kept")
    path = tmp_path / "pinned.step"
    with gmsh_session() as gmsh:
        gmsh.model.occ.addBox(0, 0, 0, 40, 20, 6)
        gmsh.model.occ.addBox(0, 0, 6, 10, 20, 14)
        gmsh.model.occ.addCylinder(25, 10, -4, 0, 0, 14, 3)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
    path.write_text(path.read_text().replace("ADVANCED_FACE('',", "ADVANCED_FACE('side',"))
    meshed = reading._meshed

    def refused(once: object, asked: Asked) -> RawMesh:
        if asked.is_cad:
            raise UnmeshableError("PLC error; nor otherwise.")
        return meshed(once, asked)  # type: ignore[arg-type]

    monkeypatch.setattr(reading, "_meshed", refused)
    monkeypatch.setattr(reading, "_anew", {})
    raw = reading.read(path, 5e-3, fragments=True)
    assert int(reading.piece_of_cells(raw).max()) == 0
    sides = raw.points[raw.cells[:, 1:4]] - raw.points[raw.cells[:, :1]]
    volume = (40 * 20 * 6 + 10 * 20 * 14 + np.pi * 9 * 8) * 1e-9  # 8 mm of the pin are outside
    assert np.abs(np.linalg.det(sides)).sum() / 6 == pytest.approx(volume, rel=0.01)


@pytest.mark.parametrize("installed", [True, False])
def test_later_attempts_take_less_time_where_the_surface_can_be_made_anew(monkeypatch, installed):
    monkeypatch.setattr(remade, "installed", lambda: installed)
    limits: list[tuple[float, ...]] = []

    def never(attempt: int, *limit: float, told: str = "") -> RawMesh:
        limits.append(limit)
        raise UnmeshableError("PLC error.")

    with pytest.raises(ao.MeshError):
        _meshed(never, Asked(Path("part.stl")))
    assert limits[0] == ()
    assert all(limit == ((reading.NEARER_TIME,) if installed else ()) for limit in limits[1:])
    timers = {}
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    monkeypatch.setattr(signal, "setitimer", lambda which, seconds: timers.update({which: seconds}))
    Request("part.stl", "part.stl", most=limits[1][0] if installed else None).allow(150.0)
    assert timers[signal.ITIMER_PROF] == (reading.NEARER_TIME if installed else 150.0)
