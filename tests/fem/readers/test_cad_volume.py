"""The volume of a mesh of CAD: as in CAD at tight holes and bends, or told with both volumes."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from math import pi
from pathlib import Path

import numpy as np
import pytest

import antiosc as ao

pytest.importorskip("dolfinx")

from antiosc.base.errors import MeshError, warnings_to
from antiosc.fem.mesh.soundness import MID_SIDE_EDGES
from antiosc.io import cad_volume, reading
from antiosc.io.cad_volume import CUT, FOLLOW, of_mesh
from antiosc.io.neutral import FACETS
from antiosc.reduce.error.remeshing import source_of
from antiosc_app.foreign import foreign_part
from mpi import START, run_ranks
from parts import gmsh_session

pytestmark = pytest.mark.fem
STEEL = ao.Solid(210e9, 0.3, 7850.0)
#: Holes in a row and in a column of the plate; their diameter, distance and depth, mm.
HOLES, DIAMETER, PITCH, DEPTH = 4, 2.0, 2.5, 4.0
#: Width, length, thickness and inner radius of the profile, mm.
WIDTH, LENGTH, THICKNESS, BEND = 10.0, 10.0, 1.0, 1.0
Build = Callable[..., int]


@pytest.fixture(autouse=True)
def nothing_known():
    """No file is known to need elements by its curvature."""
    cad_volume._known.clear()
    yield
    cad_volume._known.clear()


@pytest.fixture
def readings(monkeypatch) -> list[float]:
    """The elements around a full turn of each reading."""
    seen: list[float] = []
    content = reading._content

    def counted(*arguments, **options):
        seen.append(options.get("around", 0.0))
        return content(*arguments, **options)

    monkeypatch.setattr(reading, "_content", counted)
    return seen


def plate(occ, bottom: float = 0.0) -> int:
    """A plate with holes."""
    side = HOLES * PITCH
    holes = [
        (
            3,
            occ.addCylinder(
                (i + 0.5) * PITCH, (j + 0.5) * PITCH, bottom, 0, 0, DEPTH, DIAMETER / 2
            ),
        )
        for i in range(HOLES)
        for j in range(HOLES)
    ]
    cut, _ = occ.cut([(3, occ.addBox(0, 0, bottom, side, side, DEPTH))], holes)
    return int(cut[0][1])


def profile(occ) -> int:
    """A square profile with round edges."""
    outer = occ.addRectangle(0, 0, 0, WIDTH, WIDTH, roundedRadius=BEND + THICKNESS)
    inner = WIDTH - 2 * THICKNESS
    hole = occ.addRectangle(THICKNESS, THICKNESS, 0, inner, inner, roundedRadius=BEND)
    section, _ = occ.cut([(2, outer)], [(2, hole)])
    return int(occ.extrude(section, 0, 0, LENGTH)[1][1])


def rounded(width: float, radius: float) -> float:
    """Area of a square with round corners."""
    return width**2 - (4 - pi) * radius**2


#: Exact volumes, m³.
OF_PLATE = 1e-9 * DEPTH * HOLES**2 * (PITCH**2 - pi * DIAMETER**2 / 4)
OF_PROFILE = (
    1e-9 * LENGTH * (rounded(WIDTH, BEND + THICKNESS) - rounded(WIDTH - 2 * THICKNESS, BEND))
)
PARTS = {"plate": (plate, OF_PLATE, 4e-3), "profile": (profile, OF_PROFILE, 5e-3)}


def written(path: Path, *builds: Build) -> Path:
    """A file of the solids, in mm."""
    with gmsh_session() as gmsh:
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        for build in builds:
            build(gmsh.model.occ)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
    return path


def read(path: Path, **options) -> tuple[ao.Mesh, float, list[str]]:
    """(mesh, its volume by finite elements, warnings)."""
    told: list[str] = []
    with warnings_to(told.append):
        mesh = ao.read_mesh(path, **options)
    return mesh, ao.Structure(mesh, STEEL).mass / 7850, told


@pytest.mark.parametrize("side", range(6))
def test_a_tetrahedron_with_a_bent_side(side):
    """The middle of a side moves by d: the volume grows by d·A/3 of both faces at that side."""
    rng = np.random.default_rng(side)
    corners = np.eye(4, 3) + 0.1 * rng.random((4, 3))
    ends = np.array(MID_SIDE_EDGES["tetrahedron"])
    middles = corners[ends].mean(axis=1)
    moved = 0.05 * (rng.random(3) - 0.5)
    middles[side] += moved
    straight = abs(np.linalg.det(corners[1:] - corners[0])) / 6
    bent = straight
    for face in FACETS["tetrahedron"]:
        if set(ends[side]) <= set(face):
            a, b, c = corners[list(face)]
            area = np.cross(b - a, c - a) / 2
            area *= np.sign(area @ (a - corners.mean(axis=0)))
            bent += moved @ area / 3
    points = np.vstack([corners, middles])
    assert of_mesh(points, np.arange(10)[None]) == pytest.approx(bent, rel=1e-12)
    assert of_mesh(points, np.arange(4)[None]) == pytest.approx(straight, rel=1e-12)


@pytest.mark.parametrize("name", PARTS)
@pytest.mark.slow
def test_tight_holes_and_bends_keep_their_volume(tmp_path, name):
    build, exact, size = PARTS[name]
    path = written(tmp_path / f"{name}.step", build)
    _, volume, told = read(path, size=size)
    assert volume == pytest.approx(exact, rel=5e-3)
    assert len(told) == 1
    assert FOLLOW in told[0]


@pytest.mark.parametrize("name", PARTS)
@pytest.mark.parametrize("ending", ["step", "brep"])
def test_a_difference_that_remains_is_told_with_both_volumes(tmp_path, monkeypatch, name, ending):
    build, exact, size = PARTS[name]
    path = written(tmp_path / f"{name}.{ending}", build)
    monkeypatch.setattr(cad_volume, "MOST_TIMES", 0.0)
    unit = {"unit": "mm"} if ending == "brep" else {}
    mesh, volume, told = read(path, size=size, **unit)
    assert volume > 1.005 * exact
    assert len(told) == 1
    assert CUT in told[0]
    assert "smaller size" in told[0]
    volumes = [1e-6 * float(number) for number in re.findall(r"([\d.]+) cm³", told[0])]
    assert volumes == pytest.approx([volume, exact], rel=1e-3)
    share = float(re.search(r"([\d.]+) % too large", told[0])[1])
    assert share == pytest.approx(100 * (volume / exact - 1), rel=0.05)
    assert mesh.order == 2


def block(occ) -> int:
    """A block under the plate, of twice its volume."""
    side = HOLES * PITCH
    return int(
        occ.addBox(0, 0, -2 * OF_PLATE * 1e9 / side**2, side, side, 2 * OF_PLATE * 1e9 / side**2)
    )


@pytest.mark.parametrize(
    ("options", "exact"),
    [
        ({"fragments": True}, 3 * OF_PLATE),
        ({"piece": 1}, 2 * OF_PLATE),
        ({"piece": 2}, OF_PLATE),
        ({"piece": 2, "refine": [((0.0, 0.0, 0.004), 5e-4)]}, OF_PLATE),
        ({"fragments": True, "parts": ["plate"]}, OF_PLATE),
    ],
)
@pytest.mark.slow
def test_the_solids_that_are_read_count(tmp_path, options, exact):
    path = written(tmp_path / "two.step", plate, block)
    text = path.read_text()
    for k, name in ((1, "plate"), (2, "block")):  # the names that the writer gives them
        number = text.index(f".{k}'")
        first = text.rindex("'", 0, number)
        text = text.replace(text[first : number + 3], f"'{name}'")
    path.write_text(text)
    _, volume, told = read(path, size=4e-3, **options)
    assert volume == pytest.approx(exact, rel=5e-3)
    assert not any(CUT in sentence for sentence in told)
    follows = options != {"piece": 1}
    assert any(FOLLOW in sentence for sentence in told) == follows


@pytest.mark.slow
def test_a_piece_of_solids_that_do_not_touch_is_compared_with_its_own_volume(tmp_path):
    path = written(tmp_path / "two.step", lambda occ: plate(occ, 1.0), block)
    for piece, exact in ((1, OF_PLATE), (2, 2 * OF_PLATE)):  # the block has fewer cells
        _, volume, told = read(path, size=4e-3, fragments=True, piece=piece)
        assert volume == pytest.approx(exact, rel=5e-3)
        assert not any(CUT in sentence for sentence in told)


def test_straight_elements_are_as_many_as_the_size_makes(tmp_path, readings):
    """A rod of order 1 is a prism with fewer sides: it stays so, since that was asked for."""
    path = written(tmp_path / "rod.step", lambda occ: occ.addCylinder(0, 0, 0, 0, 0, 20, 5))
    _, volume, told = read(path, size=5e-3, order=1)
    exact = 1e-9 * 20 * pi * 5**2
    assert volume < 0.98 * exact
    assert told == []
    assert readings == [0.0]
    _, volume, told = read(path, size=5e-3)
    assert volume == pytest.approx(exact, rel=5e-3)
    assert told == []


def test_a_usual_part_is_meshed_once(tmp_path, readings):
    path = written(tmp_path / "profile.step", profile)
    _, volume, told = read(path, size=1e-3)
    assert volume == pytest.approx(OF_PROFILE, rel=5e-3)
    assert told == []
    assert readings == [0.0]


@pytest.mark.slow
def test_edges_of_many_small_holes_do_not_set_the_size_of_the_whole_plate(tmp_path):
    """Its volume is L² t - N π r² t; faces in edges as short as those of the holes would have
    4/√3 A/h² triangles each.
    """
    length, thickness, count, radius = 60.0, 2.0, 12, 0.5

    def sieve(occ) -> int:
        body = (3, occ.addBox(0, 0, 0, length, length, thickness))
        places = length * (np.arange(count) + 0.5) / count
        holes = [
            (3, occ.addCylinder(x, y, 0, 0, 0, thickness, radius)) for x in places for y in places
        ]
        return int(occ.cut([body], holes)[0][0][1])

    mesh, volume, _ = read(written(tmp_path / "sieve.step", sieve), size=10e-3)
    area = length**2 - count**2 * pi * radius**2
    assert volume == pytest.approx(1e-9 * thickness * area, rel=5e-3)
    edge = pi * radius / 3  # gmsh's own: of six around a hole
    assert mesh.n_cells < 2 * (4 / 3**0.5) * area / edge**2 / 2


@pytest.mark.slow
def test_the_next_reading_begins_with_the_elements_that_helped(tmp_path, readings):
    path = written(tmp_path / "plate.step", plate)
    first = read(path, size=4e-3)[2]
    assert readings == [0.0, 6.0, 8.0]
    refined = read(path, size=4e-3, refine=[((0.0, 0.0, 0.004), 5e-4)])[2]
    assert readings[3:] == [8.0]
    assert refined == first
    read(path, size=2e-3)  # another size is another question
    assert readings[4] == 0.0


@pytest.mark.slow
def test_what_does_not_help_is_tried_once(tmp_path, readings, monkeypatch):
    path = written(tmp_path / "plate.step", plate)
    monkeypatch.setattr(cad_volume, "MOST_TIMES", 0.0)
    read(path, size=4e-3)
    assert readings == [0.0, 6.0]
    read(path, size=4e-3)
    assert readings[2:] == [0.0]


def test_a_mesh_by_the_curvature_that_cannot_be_made_leaves_the_first(tmp_path, monkeypatch):
    path = written(tmp_path / "plate.step", plate)
    content = reading._content

    def failing(*arguments, **options):
        if options.get("around"):
            raise MeshError("no")
        return content(*arguments, **options)

    monkeypatch.setattr(reading, "_content", failing)
    _, volume, told = read(path, size=4e-3)
    assert volume > 1.005 * OF_PLATE
    assert [CUT in sentence for sentence in told] == [True]


@pytest.mark.slow
def test_a_new_scene_tells_what_its_part_needs(tmp_path, monkeypatch):
    path = written(tmp_path / "plate.step", plate)
    assert [FOLLOW in note for note in foreign_part(path, size=4e-3).notes] == [True]
    cad_volume._known.clear()
    monkeypatch.setattr(cad_volume, "MOST_TIMES", 0.0)
    assert [CUT in note for note in foreign_part(path, size=4e-3).notes] == [True]


@pytest.mark.slow
def test_a_mesh_for_an_error_keeps_its_volume_or_tells_the_difference(
    tmp_path, readings, monkeypatch
):
    told: list[str] = []
    path = written(tmp_path / "plate.step", plate)
    with warnings_to(told.append):
        source = source_of(path)
        mesh = source.first(4e-3, [])
        assert ao.Structure(mesh, STEEL).mass / 7850 == pytest.approx(OF_PLATE, rel=5e-3)
        assert readings[:3] == [0.0, 0.0, 8.0]  # it has 6 already
        assert told == []  # of the coarsest mesh, which has no results
        cad_volume._known.clear()
        monkeypatch.setattr(cad_volume, "MOST_TIMES", 0.0)
        mesh = source.first(4e-3, [])
    volume = ao.Structure(mesh, STEEL).mass / 7850
    assert abs(volume / OF_PLATE - 1) > 5e-3
    assert [CUT in sentence for sentence in told] == [True]


RANKS = """
warnings.simplefilter("ignore")
from antiosc.base.errors import warnings_to
told = []
with warnings_to(told.append):
    mesh = ao.read_mesh(sys.argv[1], size=4e-3)
mass = ao.Structure(mesh, ao.Solid(210e9, 0.3, 7850.0)).mass
print(json.dumps([mass / 7850, mesh.n_cells, told]))
"""


@pytest.mark.mpi
def test_two_ranks_have_one_mesh_and_one_warning(tmp_path):
    path = written(tmp_path / "plate.step", plate)
    printed = [json.loads(text) for text in run_ranks(2, START + RANKS, str(path))]
    for volume, _, _ in printed:
        assert volume == pytest.approx(OF_PLATE, rel=5e-3)
    assert printed[0][1] == printed[1][1]
    assert [FOLLOW in sentence for _, _, told in printed for sentence in told] == [True]
