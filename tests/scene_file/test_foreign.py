"""`antiosc new` on parts by others: units, densities, pieces, closed surfaces."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import meshio
import numpy as np
import pytest

pytest.importorskip("dolfinx")
pytest.importorskip("jinja2")

import antiosc as ao
from antiosc.io.neutral import UnitSystem
from antiosc_app import new
from antiosc_app.foreign import _with_steel_constants, foreign_part, unit_of_materials
from antiosc_app.inspecting import inspect_part
from parts import gmsh_session
from scene_files import antiosc

pytestmark = pytest.mark.fem
#: Steel by the unit of a deck: metres of its length, E, density.
UNITS = {
    "mm": (1e-3, 210e3, 7.85e-9),
    "m": (1.0, 210e9, 7850.0),
    "mm-kg": (1e-3, 210e6, 7.85e-6),
    "in": (0.0254, 30.46e6, 7.345e-4),
    "ft": (0.3048, 4.386e9, 15.23),
}
#: Stiffness of an orthotropic solid, Pa.
ORTHOTROPIC = "2e11, 8e10, 2e11, 8e10, 8e10, 2e11, 7e10, 7e10,\n7e10\n"
SIDES = (0.3, 0.1, 0.05)
CORNERS = ((0, 0), (1, 0), (1, 1), (0, 1))


def deck(path: Path, unit: str, *, rho: bool = True, model: bool = True, pieces: int = 1) -> Path:
    """Bars of two hexahedra each, of 0.3 x 0.1 x 0.05 m, held at one end, in the given unit."""
    length, E, density = UNITS[unit]
    nodes, cells, held = ["*NODE"], ["*ELEMENT, TYPE=C3D8, ELSET=ALL"], ["*BOUNDARY"]
    for piece in range(pieces):
        start = 12 * piece
        for k in range(3):
            for m, corner in enumerate(CORNERS):
                x = np.array([k / 2 * SIDES[0], corner[0] * SIDES[1], corner[1] * SIDES[2]])
                x[1] += piece * 0.5
                values = ", ".join(f"{c:.9g}" for c in x / length)
                nodes.append(f"{start + 4 * k + m + 1}, {values}")
        for k in range(2):
            around = ", ".join(str(start + 4 * k + m) for m in range(1, 9))
            cells.append(f"{2 * piece + k + 1}, {around}")
    held += [f"{n}, 1, 3" for n in range(1, 5)]
    lines = [*nodes, *cells]
    if model:
        lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", f"{E}, 0.3"]
        lines += ["*DENSITY", f"{density}"] * rho
        lines += ["*SOLID SECTION, ELSET=ALL, MATERIAL=STEEL", *held]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.slow
@pytest.mark.parametrize("unit", ["mm", "in"])
def test_the_unit_of_a_deck_is_that_of_its_materials(tmp_path, unit):
    path = deck(tmp_path / "a.inp", unit)
    found = inspect_part(path)
    assert (found.read_options, found.is_deck) == ({"unit": unit}, True)
    np.testing.assert_allclose(found.box_high - found.box_low, SIDES, rtol=1e-4)
    assert found.mass == pytest.approx(7850 * np.prod(SIDES), rel=1e-3)
    assert "states none" in found.unit_text()
    assert inspect_part(tmp_path / "a.inp", unit=unit).unit_text() == unit


@pytest.mark.slow
def test_pieces_that_meet_at_other_nodes_are_not_joined_at_the_few_that_coincide(tmp_path):
    """A block of 8 cells beside one of a single cell: of the 9 nodes of its side 4 are common."""
    grid = np.array(list(np.ndindex(3, 3, 3)), dtype=float)
    corners = [[9 * i + 3 * j + k for i, j, k in cell] for cell in _cells_of(2)]
    single = 2 * np.array(list(np.ndindex(2, 2, 2)), dtype=float) + [2, 0, 0]
    last = [27 + 4 * i + 2 * j + k for i, j, k in _cells_of(1)[0]]
    mesh = meshio.Mesh(np.vstack([grid, single]), [("hexahedron", np.array([*corners, last]))])
    path = tmp_path / "two.vtk"
    mesh.write(path)
    assert foreign_part(path, unit="m").read_options == {"unit": "m", "piece": 1}


def _cells_of(n: int) -> list[list[tuple[int, int, int]]]:
    """Places of the corners of the n x n x n cells of a block, in meshio's order."""
    base = [(i, j, k) for k in (0, 1) for i, j in CORNERS]
    return [[(i + a, j + b, k + c) for i, j, k in base] for a, b, c in np.ndindex(n, n, n)]


@pytest.mark.slow
def test_a_deck_without_elasticity_is_of_steel_in_its_scene_and_this_is_told(tmp_path):
    path = deck(tmp_path / "a.inp", "mm", rho=False)
    text = re.sub(r"\*ELASTIC\n.*\n", "*CONDUCTIVITY\n50.\n", path.read_text())
    path.write_text(text)
    scene, _ = new.write_scene(tmp_path / "a.toml", str(path))
    section = tomllib.loads(scene.read_text())["deck"]
    assert section == {"path": "a.inp", "unit": "mm", "density": 7850.0, "modulus": 210e9}
    found = inspect_part(path)
    assert ("modulus", "[deck] modulus") in [
        (what, key) for what, _, key in found.assumption_rows(False)
    ]
    assert antiosc("run", scene, "--out", tmp_path / "out") == 0


@pytest.mark.slow
def test_a_deck_without_elasticity_that_is_refused_says_why(tmp_path):
    path = deck(tmp_path / "a.inp", "mm")
    text = re.sub(r"\*ELASTIC\n.*\n", "", path.read_text())
    path.write_text(text.replace("7.85e-09", "8940."))
    with pytest.raises(ao.InputError, match="density 8940"):
        inspect_part(path)


@pytest.mark.parametrize(("error", "attempts"), [(ao.MeshError, 6), (ao.InputError, 2)])
def test_constants_are_added_to_a_deck_that_is_refused_and_not_to_joints_that_are(error, attempts):
    calls = []

    def reader(**options):
        calls.append(options)
        raise error("no")

    with pytest.raises(error):
        _with_steel_constants(reader, {}, [])
    assert len(calls) == attempts


def test_a_deck_that_steel_makes_complete_is_refused_for_what_is_left():
    def reader(**options):
        raise (
            ao.InputError("nothing can move")
            if "density" in options
            else ao.MeshError("no density")
        )

    with pytest.raises(ao.InputError, match="nothing can move"):
        _with_steel_constants(reader, {}, [])


@pytest.mark.slow
def test_a_node_that_is_held_in_one_direction_is_not_struck(tmp_path):
    path = deck(tmp_path / "a.inp", "mm")
    with path.open("a") as file:
        file.write("".join(f"{n}, 2, 2\n" for n in range(9, 13)))
    found = inspect_part(path)
    assert np.unique(found.points[found.held][:, 0]) == pytest.approx([0.0, SIDES[0]])
    assert found.point[0] < 0.8 * SIDES[0]


@pytest.mark.slow
def test_a_truss_held_in_its_plane_is_struck_in_that_plane(tmp_path):
    path = tmp_path / "truss.inp"
    path.write_text(
        "*NODE, NSET=ALL\n1, 0, 0, 0\n2, 3, 0, 0\n3, 6, 0, 0\n4, 3, 2, 0\n"
        "*ELEMENT, TYPE=T3D2, ELSET=BARS\n1, 1, 2\n2, 2, 3\n3, 1, 4\n4, 4, 3\n5, 2, 4\n"
        "*MATERIAL, NAME=STEEL\n*ELASTIC\n2e11, 0.3\n*DENSITY\n7850\n"
        "*SOLID SECTION, ELSET=BARS, MATERIAL=STEEL\n1e-2\n"
        "*BOUNDARY\n1, 1, 2\n3, 2, 2\nALL, 3, 3\n"
    )
    found = inspect_part(path)
    assert found.direction == [0.0, -1.0, 0.0]


CUBE = (
    "*NODE, NSET=ALL\n"
    + "".join(f"{k + 1}, {k % 2}, {k // 2 % 2}, {k // 4}\n" for k in range(8))
    + "*ELEMENT, TYPE=C3D8, ELSET=E\n1, 1, 2, 4, 3, 5, 6, 8, 7\n"
    "*SOLID SECTION, ELSET=E, MATERIAL=M\n*MATERIAL, NAME=M\n*DENSITY\n7850\n"
)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("held", "axis"), [("ALL, 3, 3\n", (0, 1)), ("ALL, 2, 3\n", (0,)), ("1, 1, 3\n", (2,))]
)
def test_a_solid_is_struck_where_it_can_move(tmp_path, held, axis):
    path = tmp_path / "cube.inp"
    path.write_text(CUBE + "*ELASTIC\n2e11, 0.3\n*BOUNDARY\n" + held)
    found = inspect_part(path)
    assert np.abs(found.direction)[list(axis)].max() == pytest.approx(1.0)


SHEET = (
    "*NODE, NSET=ALL\n1, 0, 0, 0\n2, 1, 0, 0\n3, 1, 1, 0\n4, 0, 1, 0\n"
    "*ELEMENT, TYPE=S4, ELSET=E\n1, 1, 2, 3, 4\n*SHELL SECTION, ELSET=E, MATERIAL=M\n0.1\n"
    "*MATERIAL, NAME=M\n*DENSITY\n7850\n*ELASTIC\n2e11, 0.3\n"
)


@pytest.mark.slow
def test_a_plane_part_is_struck_on_an_edge_that_can_move(tmp_path):
    path = tmp_path / "plane.inp"
    plane = SHEET.replace("S4", "CPS4").replace("SHELL", "SOLID")
    path.write_text(plane + "*BOUNDARY\nALL, 2\n1, 1\n")
    assert np.abs(inspect_part(path).direction) == pytest.approx([1.0, 0.0, 0.0])


@pytest.mark.slow
def test_a_sheet_held_across_its_plane_is_struck_in_it(tmp_path):
    path = tmp_path / "sheet.inp"
    path.write_text(SHEET + "*BOUNDARY\nALL, 3, 5\n1, 1, 2\n")
    assert inspect_part(path).direction[2] == 0.0


@pytest.mark.slow
@pytest.mark.parametrize(
    "elastic", ["*ELASTIC\n2e11, 0.3\n", "*ELASTIC, TYPE=ORTHO\n" + ORTHOTROPIC]
)
def test_a_part_of_one_cell_runs(tmp_path, capsys, elastic):
    """Its patch is no larger than the part; of an anisotropic one none is known."""
    path = tmp_path / "cube.inp"
    path.write_text(CUBE + elastic + "*BOUNDARY\n1, 1, 3\n2, 1, 3\n3, 1, 3\n4, 1, 3\n")
    scene = str(tmp_path / "scene.toml")
    assert antiosc("new", scene, str(path)) == 0
    assert antiosc("run", scene, "--out", tmp_path) == 0
    assert "largest force" in capsys.readouterr().out


@pytest.mark.slow
def test_a_closed_surface_is_filled_and_struck_from_outside(tmp_path):
    points = np.array([[x, y, z] for x in (0, 60) for y in (0, 40) for z in (0, 20)], dtype=float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    path = tmp_path / "box.stl"
    meshio.write(path, meshio.Mesh(points, [("triangle", faces[:, ::-1])]))
    found = inspect_part(path)
    assert (found.family, found.read_options["solid"], found.read_options["unit"]) == (
        "Solid",
        True,
        "mm",
    )
    inside = np.array(found.point) + 1e-3 * np.array(found.direction)
    assert (inside > 0).all()
    assert (inside < [0.06, 0.04, 0.02]).all()


@pytest.mark.slow
@pytest.mark.parametrize(("gap", "read"), [(0, {"fragments": True}), (5, {"piece": 1})])
def test_solids_are_joined_where_they_touch_or_the_largest_is_taken(tmp_path, gap, read):
    path = tmp_path / "two.step"
    with gmsh_session() as gmsh:
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        gmsh.model.occ.addBox(0, 0, 0, 40, 20, 20)
        gmsh.model.occ.addBox(40 + gap, 0, 0, 10, 10, 10)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
    found = inspect_part(path)
    assert {k: v for k, v in found.read_options.items() if k != "size"} in (
        read,
        {**read, "fragments": True},
    )
    assert found.length == pytest.approx(50e-3 if "fragments" in read else 40e-3, rel=1e-3)
    assert "2 solids" in found.notes[0]
    assert found.read_options["size"] == pytest.approx(
        found.length / 20, rel=0.3
    )  # of the piece alone
    if "piece" in read:
        with pytest.warns(ao.AntioscWarning, match="piece 1 of 2 is read"):
            ao.read_mesh(path, size=0.01, piece=1)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*piece 1 of 2 is read")
def test_contact_between_the_pieces_of_a_deck_leaves_the_largest(tmp_path, capsys):
    path = deck(tmp_path / "a.inp", "mm", pieces=2)
    sets = "*ELSET, ELSET=LEFT\n1, 2\n*ELSET, ELSET=RIGHT\n3, 4\n*ELSET, ELSET=A1\n1\n"
    path.write_text(f"{path.read_text()}{sets}*CONTACT PAIR, INTERACTION=I\nA, B\n")
    with pytest.raises(ao.MeshError, match="piece 1"):
        ao.read_model(path, unit="mm")
    found = inspect_part(path)
    assert found.read_options == {"unit": "mm", "piece": 1}
    told = "(1 'LEFT': 300 × 100 × 50 mm; 2 'RIGHT': 300 × 100 × 50 mm)"
    assert [told in note for note in found.notes] == [False, True]
    assert "not modelled (1 *CONTACT PAIR (line " in found.notes[0]
    with pytest.warns(ao.AntioscWarning, match="parts that only touch"):
        ao.read_model(path, unit="mm", piece=1)
    assert antiosc("new", tmp_path / "a.toml", path) == 0
    assert capsys.readouterr().out.count("parts that only touch") == 1
    written = "--report", tmp_path / "a.html", "--out", tmp_path / "out"
    assert antiosc("run", tmp_path / "a.toml", *written) == 0
    said = capsys.readouterr()
    assert "piece 1 of 2" in said.out + said.err
    assert (said.out + said.err).count("parts that only touch") == 1
    assert "piece 1 of 2" in (tmp_path / "a.html").read_text()


def sheet(path: Path, *, held: str = "1,4,13,16", plane: bool = False) -> Path:
    """Plates of 0.3 m and 3 x 3 cells, held at their corners: of four layers in inches (Nastran),
    or of steel in plane stress (Abaqus, mm)."""
    rows, cells = [], []
    for n in range(16):
        x, y = 300 * (n % 4) / 3, 300 * (n // 4) / 3
        grid = f"GRID,{n + 1},,{x / 25.4:.5f},{y / 25.4:.5f},0."
        rows.append(f"{n + 1}, {x}, {y}" if plane else grid)
        if n % 4 < 3 and n < 12:
            around = f"{n + 1}, {n + 2}, {n + 6}, {n + 5}"
            cells.append(f"{n + 1}, {around}" if plane else f"CQUAD4,{n + 1},1,{around}")
    if plane:
        lines = ["*NODE", *rows, "*ELEMENT, TYPE=CPS4, ELSET=ALL", *cells]
        lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", "210e3, 0.3", "*DENSITY", "7.85e-9"]
        lines += ["*SOLID SECTION, ELSET=ALL, MATERIAL=STEEL", "5."]
        lines += ["*BOUNDARY", "1, 1, 2", "4, 1, 2"]
    else:
        layers = [f"+,1,.1,{angle}.,,1,.1,{angle + 90}.,,+" for angle in (0, 90)]
        lines = ["BEGIN BULK", "MAT8,1,2.+7,1.5+6,.3,7.+5,3.+5,3.+5,1.5-4", *rows, *cells]
        lines += ["PCOMP,1,,,,,,,,+", *layers, f"SPC1,1,123456,{held}", "ENDDATA"]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.slow
def test_a_surface_of_which_nothing_is_known_is_struck_as_a_flat_face(tmp_path):
    path = sheet(tmp_path / "a.inp", plane=True)
    found = inspect_part(path)
    part = 210e9 / (1 - 0.3**2)  # both of steel: half of it; Hertz: 4/3 E* √R
    expected = 4 / 3 * part / 2 * np.sqrt(found.ball_radius)
    assert found.hertz_stiffness == pytest.approx(expected, rel=1e-2)
    assert antiosc("new", tmp_path / "a.toml", path) == 0
    scene = tomllib.loads((tmp_path / "a.toml").read_text())
    assert scene["contact"] == {"kind": "Hertz", "stiffness": found.hertz_stiffness}
    inside = np.array(found.point) + 1e-3 * np.array(found.direction)
    assert found.point[1] == 0.3  # on the upper edge, not between the faces
    assert inside[1] < 0.3
    part = ao.read_model(path, unit="mm")
    model = ao.extract(part, ao.Site(found.point[:2], found.direction[:2], found.radius), 4)
    with pytest.raises(ao.InputError, match="plane part has no surface"):
        ao.simulate(model, ao.Sphere(0.01, material="steel S235", velocity=1.0), "auto", 1e-4)


@pytest.mark.slow
def test_a_deck_falls_without_its_supports(tmp_path):
    path = deck(tmp_path / "a.inp", "mm")
    part = ao.read_model(path, unit="mm", free=True)
    assert part.rigid_modes.shape[1] == 6
    mass = part.uniform_inertia(np.array([0, 0, 1.0]))[2::3].sum()
    assert mass == pytest.approx(7850 * np.prod(SIDES), rel=1e-6)
    assert antiosc("new", tmp_path / "a.toml", path, "--drop") == 0
    assert tomllib.loads((tmp_path / "a.toml").read_text())["deck"]["free"] is True


@pytest.mark.slow
def test_pieces_have_sizes_and_one_is_chosen(tmp_path, capsys):
    path = deck(tmp_path / "a.inp", "mm", model=False, pieces=3)
    text = path.read_text().splitlines()  # the second is twice as long
    for row in range(1, 37):
        n, x, y, z = (float(c) for c in text[row].split(","))
        text[row] = f"{n:g}, {x * (2 if 12 < n <= 24 else 1)}, {y}, {z}"
    path.write_text("\n".join(text))
    assert antiosc("new", tmp_path / "a.toml", path) == 0
    said = capsys.readouterr().out
    assert "3 pieces (1: 600 × 100 × 50 mm; 2: 300 × 100 × 50 mm; 3:" in said
    scene = (tmp_path / "a.toml").read_text()
    assert tomllib.loads(scene)["geometry"]["piece"] == 1
    with pytest.warns(ao.AntioscWarning, match="piece 2 of 3"):
        second = ao.read_mesh(path, unit="mm", piece=2)
    assert second.extent() == pytest.approx(np.linalg.norm(SIDES), rel=1e-6)


@pytest.mark.slow
def test_numbers_of_nodes_in_a_scene_are_those_points(tmp_path, monkeypatch):
    deck(tmp_path / "a.inp", "mm")
    monkeypatch.chdir(tmp_path)
    peaks = []
    held = "nodes = [1, 2, 3, 4]", "plane = [[0, 0, 0], [1, 0, 0]]"
    places = "node = 12", "point = [0.3, 0.0, 0.05]"
    for name, hold, place in zip("ab", held, places, strict=True):
        (tmp_path / f"{name}.toml").write_text(
            '[deck]\npath = "a.inp"\nunit = "mm"\nfree = true\n'
            f"[[supports]]\n{hold}\n[sites.tip]\n{place}\ndirection = [0, 1, 0]\n"
            f"[probes.end]\n{place}\n[extract]\nn = 4\n"
            '[impactor]\nkind = "RigidMass"\nmass = 0.1\nvelocity = 1.0\n'
            '[contact]\nkind = "Linear"\nstiffness = 1e7\n[simulate]\nduration = 1e-3\n'
            "[output]\njson = true\n"
        )
        assert antiosc("run", f"{name}.toml") == 0
        result = json.loads((tmp_path / f"{name}_out" / "result.json").read_text())
        peaks.append(result["result"]["peak_force"])
    assert peaks[0] == pytest.approx(peaks[1], rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("side", "unit"),
    [(2.95, "m"), (7.86, "mm")],
)
def test_a_file_of_more_than_three_units_is_taken_in_millimetres(tmp_path, side, unit):
    """7.86 and 15.09 mm: a spacer and a belt clamp of a printer."""
    corners = side * np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], dtype=float)
    sheet = meshio.Mesh(corners, [("triangle", np.array([(0, 1, 2), (0, 2, 3)]))])
    for name in ("a.stl", "a.vtu"):
        meshio.write(tmp_path / name, sheet)
        assert foreign_part(tmp_path / name).read_options["unit"] == unit


@pytest.mark.slow
def test_a_unit_that_is_given_is_that_of_the_file(tmp_path):
    path = deck(tmp_path / "a.inp", "mm", model=False)
    assert inspect_part(path, unit="in").length == pytest.approx(25.4 * SIDES[0])
    path = deck(tmp_path / "b.inp", "m")
    with pytest.raises(ao.InputError, match="density"):  # in mm its steel is none
        inspect_part(path, unit="mm")
    cube = tmp_path / "cube.geo"
    cube.write_text('SetFactory("OpenCASCADE"); Box(1) = {0, 0, 0, 2, 2, 2};')
    found = inspect_part(cube, unit="in")
    assert found.length == pytest.approx(0.0508)
    assert found.read_options["size"] == pytest.approx(0.0508 / 20, rel=0.3)
    scene, _ = new.write_scene(tmp_path / "cube.toml", str(cube), unit="in")
    assert tomllib.loads(scene.read_text())["geometry"]["unit"] == "in"
    with pytest.raises(ao.InputError, match="unit must be"):
        inspect_part(path, unit="ell")


@pytest.mark.parametrize(
    ("E", "rho", "unit"),
    [
        (71e9, 2770.0, "m"),
        (1.44e9, 5.37, "ft"),  # aluminium, lbf/ft² and slug/ft³
        (29e6, 0.29, "in"),  # steel, whose density is a weight
        (70e6, 52.0, "m"),  # foam
        (16e3, 11340e-12, "mm"),  # lead
        (3.6e3, 1300e-12, "mm"),  # a plastic
        (210e9 / 9.80665e6, 7.85e-6, "mm"),  # kgf and kg/mm³: what is refused then, never another
    ],
)
def test_a_unit_is_taken_in_which_the_materials_are_real(E, rho, unit):
    read = UnitSystem.of("mm")
    part = ao.Solid(E * read.stress, 0.3, rho * read.density)
    assert unit_of_materials([part], 2.0) == unit
