"""`antiosc new`: it looks at a part, and the scene that it writes runs as it stands."""

from __future__ import annotations

import re
import tomllib
import warnings
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

pytest.importorskip("jinja2")

import abaqus_decks as inp
import antiosc as ao
from antiosc.base import materials, process
from antiosc.base.texts import engineering
from antiosc.extension import Faces, halvings
from antiosc.fem.platform import compat
from antiosc.reduce.site import functional
from antiosc_app import (
    cli,
    guessed_sites,
    guessed_supports,
    inspecting,
    new as template,
)
from antiosc_app.inspecting import inspect_part
from antiosc_app.inspection import BALL_MATERIAL
from mesh_files import write
from parts import gmsh_session
from paths import DEMOS, MESHES
from scene_files import antiosc, numbers

pytestmark = pytest.mark.fem

#: Corners of a box in the order of a hexahedron.
BOX = np.array([(0, 0), (0.2, 0), (0.2, 0.08), (0, 0.08)])
BOX = np.vstack([np.column_stack([BOX, np.full(4, z)]) for z in (0.0, 0.06)])
PARTS = [path for kind in ("msh", "geo", "step") for path in sorted(MESHES.glob(f"*.{kind}"))]
PARTS.append(DEMOS / "scenes/bar.inp")


def test_a_scene_lists_all_groups_and_a_held_plane_names_its_face(tmp_path):
    mesh = ao.box_mesh((0.1, 0.08, 0.06), size=0.02)
    names = [f"face {i} of a body" for i in range(40)]
    groups = {name: mesh.groups["+z"] for name in names} | {"below": mesh.groups["-z"]}
    look = inspecting._inspect_mesh(replace(mesh, groups=groups), {}, None)
    text = template.text("scene.toml", "part.msh", look)
    assert all(f'"{name}"' in text for name in names)
    held = next(value for name, value, _ in look.taken(drop=False) if name == "held")
    assert held == "below: the nodes on the underside, z = 0 mm"
    upside = replace(look, low=look.low - [0, 0, 1.0], high=look.high - [0, 0, 0.06])
    assert upside.plane_text() == "the top, z = 0 mm"


def test_a_material_that_nobody_named_is_told_as_a_guess():
    look = inspecting._inspect_mesh(ao.box_mesh((0.1, 0.08, 0.06), size=0.02), {}, None)
    for asked in (False, True):
        rows = {name: value for name, value, _ in replace(look, asked=asked).taken(drop=False)}
        assert ("a guess" in rows["material"]) == (not asked)


def test_a_plate_is_held_at_an_end_and_not_at_its_underside():
    look = inspecting._inspect_mesh(ao.box_mesh((0.2, 0.1, 0.004), size=0.02), {}, None)
    assert np.ptp(look.points[look.held][:, 0]) == 0.0
    assert look.direction == [0.0, 0.0, -1.0]


def test_the_ball_has_at_most_ten_times_the_mass_of_the_part():
    """A strip of 33 × 6.5 × 0.2 mm has 0.34 g; a thick block keeps the ball of its size."""
    density = materials.record(BALL_MATERIAL).rho
    strip = inspecting._inspect_mesh(ao.box_mesh((0.033, 0.0065), size=1e-3, gdim=3), {}, None)
    block = inspecting._inspect_mesh(ao.box_mesh((0.1, 0.08, 0.06), size=0.02), {}, None)
    light = replace(strip, room=np.inf, radius=None, measure=0.1 * strip.measure)
    for look, by in ((light, "mass"), (block, "size")):
        over = 4 / 3 * np.pi * density * look.ball**3 / look.mass
        assert over <= 10
        assert f"by the part's {by}" in look.ball_text()
    assert over < 1
    heaviest = light.ball * np.array([1.0, 1.1])  # it has two digits
    low, high = 4 / 3 * np.pi * density * heaviest**3 / light.mass
    assert low <= 10 < high
    assert 9 * light.mass < light.heaviest_striker(0.5) <= 10 * light.mass
    assert block.heaviest_striker(0.5) == 0.5


@pytest.mark.slow
def test_a_size_of_the_cells_changes_neither_site_nor_striker_or_says_so(tmp_path):
    """Cells that are larger than the usual ones say so: to make those may take too long."""
    path = tmp_path / "block.geo"
    path.write_text('SetFactory("OpenCASCADE"); Box(1) = {0, 0, 0, 0.2, 0.08, 0.06};\n')
    scenes, told = [], []
    for size in (None, 0.008, 0.03):
        target, sentences = template.write_scene(tmp_path / f"{size}.toml", str(path), size=size)
        scenes.append(tomllib.loads(target.read_text()))
        told.append("change size in [geometry] of one scene" in " ".join(sentences))
    assert told == [False, False, True]
    usual, finer, _ = scenes
    assert [one["geometry"]["size"] for one in scenes] == [0.01, 0.008, 0.03]
    for section in ("sites", "impactor"):
        assert usual[section] == finer[section]


def test_a_held_face_is_not_struck():
    look = inspecting._inspect_mesh(ao.box_mesh((0.1, 0.08, 0.06), size=0.02), {}, None)
    outer = Faces(ao.box_mesh((0.1, 0.08, 0.06), size=0.02), False)
    size = float(np.linalg.norm(look.high - look.low))
    none = np.zeros(0, dtype=int)
    for held in (look.held, np.ones(len(look.held), dtype=bool)):
        sites = guessed_sites.on_faces(look.points, look.faces, outer, held, none, size)
        free = ~held[look.faces].all(axis=1)
        assert len(list(sites)) == (free.sum() or len(look.faces))


def test_sites_clear_of_edges_come_first_then_those_whose_own_patch_is():
    """10 mm and 1 mm from the edge of a plate whose facets resolve 50 mm; patches of 3 mm."""
    mesh = ao.box_mesh((0.4, 0.4, 0.05), size=0.05)
    outer = Faces(mesh, False)
    x = np.array(mesh.dolfinx.geometry.x)
    rim, near, middle = (
        (np.array([d, 0.21, 0.05]), -np.eye(3)[2], 3e-3) for d in (0.001, 0.01, 0.2)
    )
    for meshed, expected in ((True, [middle, near, rim]), (False, [middle, rim, near])):
        sites = iter([rim, near, middle])
        ranked = guessed_sites.clear_of_edges(
            outer, x, guessed_sites.nodes_around(outer), sites, meshed
        )
        assert [site[0].tolist() for site in ranked] == [site[0].tolist() for site in expected]


def test_faces_that_follow_one_another_are_listed_by_the_first_and_the_last():
    numbers = [n for n in range(1, 707) if n not in (30, 40, 42)]
    lines = template._listed(["hole 6 mm (1)", "side", *(f"face {n}" for n in numbers)])
    assert len(lines) <= 2
    text = " ".join(lines)
    assert text.startswith('"hole 6 mm (1)", "side", "face 1" … "face 29", "face 31" …')
    assert text.endswith('"face 41", "face 43" … "face 706"')


def test_a_part_is_not_held_at_a_small_foot_under_its_end(tmp_path):
    pytest.importorskip("gmsh")
    path = tmp_path / "arm.msh"
    with gmsh_session() as gmsh:
        arm = gmsh.model.occ.addBox(0, 0, 0.005, 0.08, 0.015, 0.01)
        foot = gmsh.model.occ.addBox(0, 0, 0, 0.005, 0.005, 0.005)
        gmsh.model.occ.fuse([(3, arm)], [(3, foot)])
        gmsh.model.occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.005)
        gmsh.model.mesh.generate(3)
        gmsh.write(str(path))
    look = inspecting._inspect_mesh(ao.read_mesh(path), {}, None)
    assert look.plane is not None
    assert look.plane[1] == [1.0, 0.0, 0.0]
    assert not look.foot
    low = np.zeros(3)
    on_foot = low, np.array([0.005, 0.005, 0.0])
    overhang = guessed_supports._overhang(np.array(on_foot), low, np.array([0.08, 0.015, 0.015]), 2)
    assert overhang == pytest.approx(0.0775 / 0.0025)


def test_a_part_without_a_flat_side_is_held_at_the_holes_of_which_there_are_most():
    mesh = ao.box_mesh((0.2, 0.1, 0.1), size=0.05)
    inclined = Rotation.from_euler("xyz", (0.3, 0.4, 0.5)).as_matrix()
    mesh.dolfinx.geometry.x[:] = mesh.dolfinx.geometry.x @ inclined.T
    assert inspecting._inspect_mesh(mesh, {}, None).held.sum() == 0
    names = {"+z": "hole 8 mm (1)", "-x": "hole 6 mm (1)", "+x": "hole 6 mm (2)"}
    groups = {names.get(name, name): parts for name, parts in mesh.groups.items()}
    look = inspecting._inspect_mesh(replace(mesh, groups=groups), {}, None)
    assert look.where == ("hole 6 mm (1)", "hole 6 mm (2)")
    written = tomllib.loads(template.text("scene.toml", "part.step", look))
    assert [support["where"] for support in written["supports"]] == list(look.where)
    along = look.points[look.held] @ inclined[:, 0]
    np.testing.assert_allclose(np.abs(along - 0.1), 0.1)


@pytest.mark.parametrize("name", ["steel S235", "ABS", "PE-HD"])
def test_the_first_ball_is_small_enough_for_the_patch_to_carry_it(name):
    """A contact of 0.58 times the radius of the patch is the widest that a law with it takes."""
    mesh = ao.box_mesh((0.2, 0.2, 0.1), size=0.02)
    look = replace(inspecting._inspect_mesh(mesh, {}, None), material=name, radius=5e-4, room=1.0)
    ball = ao.Sphere(look.ball, material=BALL_MATERIAL, velocity=1.0)
    part = materials.record(name)
    law = ball.hertz(part.E, part.nu)
    depth = (1.25 * ball.mass / law.stiffness) ** 0.4  # of a rigid half-space's energy
    assert 0.3 < np.sqrt(look.ball * depth) / look.radius < 0.58


@pytest.mark.slow
@pytest.mark.parametrize("part", [None, "bracket.msh", "frame.msh"])
def test_a_new_scene_runs(part, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert antiosc("new", *([MESHES / part] if part else [])) == 0
    (scene,) = tmp_path.glob("*.toml")
    assert scene.name == (f"{part.partition('.')[0]}.toml" if part else "scene.toml")
    text = re.sub(r"(?m)^size = 0.01 ", "size = 0.03 ", scene.read_text())  # of the plate
    scene.write_text(re.sub(r"(?m)^duration = 0.08 ", "duration = 0.02 ", text))
    assert antiosc("run", scene, "--out", tmp_path / "out") == 0
    assert numbers(tmp_path / "out")["result"]["peak_force"] > 0


@pytest.mark.parametrize(("part", "size"), [("block.vtu", 6e-2), ("block.geo", 1e-2)])
@pytest.mark.slow
def test_a_size_is_that_of_the_cells_and_of_the_scene(part, size, tmp_path):
    path = tmp_path / part
    if part == "block.vtu":
        meshio.write(path, meshio.Mesh(BOX / 2, [("hexahedron", [range(8)])]))
    else:
        path.write_text('SetFactory("OpenCASCADE"); Box(1) = {0, 0, 0, 100, 60, 40};')
    counts, finest = [], []
    for k, asked in enumerate((size, size / 2)):
        scene = tmp_path / f"{k}.toml"
        assert antiosc("new", scene, path, "--size", asked) == 0
        table = tomllib.loads(scene.read_text())["geometry"]
        assert table["size"] == asked
        mesh = ao.read_mesh(path, unit=table["unit"], size=asked)
        assert inspect_part(path, size=asked).size == asked
        x = mesh.dolfinx.geometry.x[compat.geometry_nodes(mesh.dolfinx)]
        longest = np.linalg.norm(x[:, :, None] - x[:, None], axis=-1).max()
        assert longest <= (asked if part.endswith("vtu") else 2 * asked)  # gmsh aims at a size
        counts.append(mesh.n_cells)
        finest.append(longest)
    assert counts[1] > 4 * counts[0]
    assert finest[1] < 0.7 * finest[0]


def test_a_structure_is_struck_away_from_what_holds_it():
    mesh = ao.box_mesh((0.1, 0.08, 0.01), size=0.01)
    below = [0.05, 0.04, 0.0]  # the middle of the face that is not struck
    part = ao.Structure(mesh, ao.material("steel S235"), [ao.Support(near=(below, 0.012))])
    point = inspecting.inspect_structure(part).point
    assert np.linalg.norm(np.subtract(point, below)) > 0.03


@pytest.mark.parametrize("side", [0.0, 0.1])
def test_the_outside_of_a_box_in_millimetres_is_struck_away_from_its_support(side, tmp_path):
    """The largest free side, near its middle, from outside."""
    x = np.array(np.meshgrid(*[np.linspace(0, 1, n) for n in (9, 7, 3)], indexing="ij"))
    points = (x.reshape(3, -1).T + side) * [400.0, 300.0, 250.0]
    number = np.arange(9 * 7 * 3).reshape(9, 7, 3)
    low = number[:-1, :-1, :-1].ravel()
    a, b, c = 7 * 3, 3, 1
    cells = np.stack([low + k for k in (0, a, a + b, b, c, a + c, a + b + c, b + c)], axis=1)
    path = tmp_path / "box.vtu"
    meshio.write(path, meshio.Mesh(points, [("hexahedron", cells)]))
    found = inspect_part(path)
    assert found.family == "Solid"
    assert found.read["unit"] == "mm"
    np.testing.assert_allclose(found.high - found.low, [0.4, 0.3, 0.25])
    assert found.plane[1] == [0.0, 0.0, 1.0]
    np.testing.assert_allclose(found.direction, [0, 0, -1], atol=1e-9)
    place = (np.array(found.point) - found.low) / [0.4, 0.3, 0.25]
    assert place[2] == pytest.approx(1.0)
    assert np.all(np.abs(place[:2] - 0.5) < 0.3)
    assert 0 < found.radius < 0.1


def test_nothing_is_overwritten_and_a_part_that_cannot_be_read_is_told(tmp_path, capsys):
    scene, part = tmp_path / "a.toml", tmp_path / "a.geo"
    part.write_text("// mine")
    assert antiosc("new", scene) == 1
    assert "exists already" in capsys.readouterr().err
    assert part.read_text() == "// mine"
    assert antiosc("new", scene, tmp_path / "none.msh") == 1
    said = capsys.readouterr()
    assert "no such file" in said.err.lower()
    assert "next:" not in said.out
    assert not scene.exists()


@pytest.mark.slow
def test_a_picture_that_exists_is_kept_and_told(tmp_path, capsys):
    picture = tmp_path / "a.png"
    picture.write_text("mine")
    assert antiosc("new", tmp_path / "a.toml", MESHES / "bracket.msh") == 0
    assert f"{picture} exists already" in capsys.readouterr().out.replace("\n", " ")
    assert picture.read_text() == "mine"


@pytest.mark.parametrize("cell", ["triangle", "quad"])
def test_a_new_scene_of_a_sheet_has_error_bars(cell, tmp_path):
    x = np.array(np.meshgrid(np.linspace(0, 0.3, 7), np.linspace(0, 0.2, 5), [0.0], indexing="ij"))
    low = (np.arange(6)[:, None] * 5 + np.arange(4)).ravel()
    quads = np.stack([low, low + 5, low + 6, low + 1], axis=1)
    cells = quads if cell == "quad" else np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    meshio.write(tmp_path / "sheet.vtu", meshio.Mesh(x.reshape(3, -1).T, [(cell, cells)]))
    assert antiosc("new", tmp_path / "a.toml", tmp_path / "sheet.vtu") == 0
    extract = tomllib.loads((tmp_path / "a.toml").read_text())["extract"]
    assert extract["error"] == "estimate"


@pytest.mark.parametrize(
    ("kind", "corners", "wanted"),
    [
        ("hexahedron", BOX, 0.2 * 0.08 * 0.06),
        ("quad", BOX[:4], 0.2 * 0.08 * 1e-3),  # sheets are 0.5 % of their length thick,
        ("line", BOX[:2], 0.2 * np.pi / 4 * 0.006**2),  # and bars 3 %
    ],
)
def test_the_mass_of_a_part_is_that_of_its_material(kind, corners, wanted, tmp_path, capsys):
    """Density times volume: in what `new` tells, and of the structure that is run."""
    blocks = 4  # along x
    x = np.concatenate([np.add(corners, (0.2 * k, 0, 0)) / (blocks, 1, 1) for k in range(blocks)])
    x, nodes = np.unique(x.round(9), axis=0, return_inverse=True)
    cells = nodes.reshape(blocks, -1)
    meshio.write(tmp_path / "a.vtu", meshio.Mesh(x, [(kind, cells)]))
    assert antiosc("new", tmp_path / "a.toml", tmp_path / "a.vtu", "--unit", "m") == 0
    told = f"mass {engineering(7850 * wanted, 'kg', 4)}"
    row = next(line for line in capsys.readouterr().out.splitlines() if " mass " in line)
    assert " ".join(row.split()).startswith(f"{told}, if it is of steel S235")


@pytest.mark.parametrize("given", [[], ["--drop"]])
@pytest.mark.slow
def test_a_material_is_taken_by_name(given, tmp_path, capsys):
    part = MESHES / "bracket.step"
    assert antiosc("new", tmp_path / "a.toml", part, "--material", "6061", *given) == 0
    said = capsys.readouterr().out
    assert "aluminium 6061-T6" in said
    written = tomllib.loads((tmp_path / "a.toml").read_text())
    assert written["material"]["name"] == "aluminium 6061-T6"
    floor = written["drop"]["floor"] if given else {}
    told = f"{floor.get('material')}, coefficient of friction {floor.get('friction')} "
    assert (told in said and "[drop.floor] material, friction" in said) == bool(given)
    assert ("refine" in written["geometry"]) == (not given)


@pytest.mark.parametrize(
    ("part", "name", "said"),
    [
        (MESHES / "bracket.step", "unobtainium", "did you mean"),
        (MESHES / "bracket.step", "Sitka", "orientation"),
        (DEMOS / "scenes/bar.inp", "6061", "--material"),
    ],
)
def test_a_material_that_cannot_be_taken_is_told(part, name, said, tmp_path, capsys):
    assert antiosc("new", tmp_path / "a.toml", part, "--material", name) == 1
    assert said in capsys.readouterr().err
    assert not list(tmp_path.glob("*.toml"))


def test_a_sheet_gets_the_anti_oscillators_that_its_waves_need(tmp_path):
    """Twenty gave 245 N where Zv = 98 N is the most that a sheet can bear; 1 ms cut the rebound."""
    sheet = tmp_path / "sheet.geo"
    sheet.write_text('SetFactory("OpenCASCADE"); Rectangle(1) = {0, 0, 0, 0.2, 0.1};')
    scene = tomllib.loads(template.text("s.toml", "sheet.geo", inspect_part(sheet)))
    assert scene["extract"]["n"] == "auto"  # by its impacts: tests/scene_file/test_settled.py
    assert scene["simulate"]["duration"] > 0.02  # half a period of 22 Hz


def test_a_large_sheet_is_fine_at_its_site_and_its_run_can_be_looked_at(tmp_path):
    """6 m of 30 mm: cells of 0.3 m where a contact of 0.1 ms sends out waves of 0.24 m, for 2 s."""
    sheet = tmp_path / "sheet.geo"
    sheet.write_text('SetFactory("OpenCASCADE"); Rectangle(1) = {0, 0, 0, 6e3, 400};')
    scene = tmp_path / "s.toml"
    assert antiosc("new", scene, sheet) == 0
    written = tomllib.loads(scene.read_text())
    ((point, size),) = written["geometry"]["refine"]
    assert point == written["sites"]["tip"]["point"]
    assert size < 0.25 * written["geometry"]["size"]
    # a ball of 10 mm has a limit of 0.15 s, and contacts are as long as the ball is wide; one digit
    assert written["simulate"]["duration"] <= 0.2 * written["impactor"]["radius"] / 0.01


@pytest.mark.parametrize(("side", "unit"), [(60.0, "mm"), (3.2, "mm"), (2.0, "m")])
def test_a_geometry_of_more_than_three_units_is_taken_in_millimetres(side, unit, tmp_path):
    script = tmp_path / "block.geo"
    script.write_text(
        f'SetFactory("OpenCASCADE"); Box(1) = {{0, 0, 0, {side}, {side / 2}, {side / 2}}};'
    )
    found = inspect_part(script)
    assert found.read["unit"] == unit
    length = {"mm": 1e-3, "m": 1.0}[unit] * side
    assert found.length == pytest.approx(length)
    assert found.read["size"] == pytest.approx(length / 20, rel=0.34)


@pytest.mark.parametrize(
    ("thickness", "count"), [(20.0, inspecting.COUNTS["Solid"]), (1.0, inspecting.COUNTS["Shell"])]
)
def test_a_solid_as_thin_as_a_plate_has_the_anti_oscillators_of_a_shell(thickness, count, tmp_path):
    """Mean thickness 2 V/A: of a plate a b t it is t/(1 + t/a + t/b)."""
    script = tmp_path / "plate.geo"
    script.write_text(f'SetFactory("OpenCASCADE"); Box(1) = {{0, 0, 0, 100, 80, {thickness}}};')
    found = inspect_part(script)
    assert (found.family, found.count) == ("Solid", count)
    mesh = ao.read_mesh(script, unit="mm", size=0.02)
    outer = Faces(mesh, False)
    corners = mesh.dolfinx.geometry.x[guessed_sites.nodes_around(outer)]
    mean = thickness / (1 + thickness / 100 + thickness / 80)
    assert inspecting._mean_thickness(corners, outer.normals) == pytest.approx(
        1e-3 * mean, rel=1e-9
    )


@pytest.mark.parametrize("given", [["{n}"], ["{n}.toml"], ["{n}.msh"], ["x.toml", "{n}.msh"]])
def test_a_name_that_no_system_takes_is_told(given, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    cli.main(["new", *(each.format(n=300 * "n") for each in given)])
    assert "too long" in "".join(capsys.readouterr())


@pytest.mark.slow
def test_a_sheet_whose_model_does_not_fit_is_refused_before_it_is_made(
    tmp_path, monkeypatch, capsys
):
    """By `new`, and by `run`, each with the need, the free memory and a remedy."""
    monkeypatch.chdir(tmp_path)
    points = np.array([[0, 0, 0], [0.3, 0, 0], [0.3, 0.2, 0], [0, 0.2, 0]], dtype=float)
    meshio.Mesh(points, [("triangle", np.array([[0, 1, 2], [0, 2, 3]]))]).write("sheet.stl")
    assert cli.main(["new", "a.toml", "sheet.stl", "--size", "0.05", "--unit", "m"]) == 0
    capsys.readouterr()
    for module in (process, inspecting):
        monkeypatch.setattr(module, "free_memory", lambda: 1e6)
    assert cli.main(["new", "b.toml", "sheet.stl", "--size", "0.05", "--unit", "m"]) == 1
    said = capsys.readouterr().err
    assert ("0.001 GB are free" in said, "larger elements" in said) == (True, True)
    assert not Path("b.toml").exists()
    assert cli.main(["run", "a.toml"]) == 1
    said = capsys.readouterr().err
    assert ("a factor of" in said, "0.001 GB are free" in said) == (True, True)


@pytest.mark.slow
def test_the_patch_of_a_new_scene_is_one_that_its_mesh_resolves():
    """Facets next to the struck one are larger: the radius is that of all under the patch."""
    look = inspect_part(MESHES / "bracket.msh")
    part = ao.Structure(ao.read_mesh(MESHES / "bracket.msh"), ao.Solid(E=7e10, nu=0.3, rho=2700.0))
    with warnings.catch_warnings(record=True, action="always") as told:
        functional(part, ao.Site(look.point, look.direction, look.radius))
    assert [str(one.message) for one in told] == []


def _sheet_with_a_tied_cell(path: Path) -> None:
    """A deck of a strip of 1 x 2 m, 0.1 m thick, with a cell that is tied to its end."""
    across, along = 8, 16
    numbers_of = np.arange(1, 1 + (across + 1) * (along + 1)).reshape(along + 1, across + 1)
    nodes = [f"{n}, {i / across}, {2 * j / along}" for (j, i), n in np.ndenumerate(numbers_of)]
    corners = numbers_of[:-1, :-1], numbers_of[:-1, 1:], numbers_of[1:, 1:], numbers_of[1:, :-1]
    cells = np.column_stack([np.arange(1, 1 + across * along), *(c.ravel() for c in corners)])
    rows = [", ".join(map(str, row)) for row in cells]
    foot = ", ".join(map(str, numbers_of[0]))
    lines = ["*NODE", *nodes, "*ELEMENT, TYPE=S4, ELSET=ALL", *rows]
    lines += ["*SHELL SECTION, ELSET=ALL, MATERIAL=M", ".1", "*MATERIAL, NAME=M"]
    lines += ["*ELASTIC", "2.E11, .3", "*DENSITY", "7800.", "*NSET, NSET=FOOT", foot]
    a, b = numbers_of[-1, :2].tolist()
    lines.append(inp.tied_cell({b: (1 / across, 2.0), a: (0.0, 2.0)}, (0.0, 0.25), "ALL"))
    path.write_text("\n".join([*lines, "*BOUNDARY", "FOOT, 1, 6", ""]))


def test_a_deck_of_a_solid_with_a_rigid_body_has_a_bar_of_the_mesh(tmp_path, capsys):
    deck = Path(__file__).parents[1] / "decks/rigid_body.inp"
    scene = tmp_path / "a.toml"
    assert cli.main(["new", str(scene), str(deck)]) == 0
    scene.write_text(scene.read_text().replace("radius = 0.04 ", "radius = 0.2 "))
    assert cli.main(["run", str(scene), "--out", str(tmp_path / "out")]) == 0
    told = capsys.readouterr().out
    assert "The mesh's error" not in told
    assert re.search(r"N \(no error bar\): patch \d", told)  # the law's error is not known


def test_a_deck_that_its_supports_hold_altogether_is_read_without_them(tmp_path, capsys):
    deck = tmp_path / "cube.inp"
    deck.write_text(inp.CUBE + inp.SOLID + inp.STEEL + "*BOUNDARY\nN, 1, 3\n")
    scene = tmp_path / "a.toml"
    assert cli.main(["new", str(scene), str(deck)]) == 0
    assert "its supports hold all of it" in capsys.readouterr().out
    assert re.search(r"^free = true", scene.read_text(), re.M)
    assert cli.main(["run", str(scene), "--out", str(tmp_path / "out")]) == 0


@pytest.mark.slow
def test_the_cells_of_a_finer_mesh_are_forecast_within_two_thirds():
    look = inspect_part(MESHES / "bracket.step")
    size = look.size / 2
    cells = ao.read_mesh(MESHES / "bracket.step", **{**look.read, "size": size}).n_cells
    assert cells / 1.2 < look.forecast(size).cells < 1.67 * cells


def test_the_dofs_of_a_slender_part_are_forecast_by_those_of_its_mesh(tmp_path):
    ring = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    points = 0.01 * np.vstack([np.insert(ring, 0, x, axis=1) for x in range(21)])
    cells = np.arange(8) + 4 * np.arange(20)[:, None]  # 20 x 1 x 1 hexahedra
    look = inspect_part(write(tmp_path / "bar.vtk", points, ("hexahedron", cells)))
    assert look.n_cells == 20
    assert look.forecast().dofs == pytest.approx(3 * 41 * 3 * 3)


def test_the_dofs_of_a_part_that_is_built_are_forecast_as_counted():
    mesh = ao.box_mesh((0.2, 0.1, 0.004), size=0.02)
    solid = ao.Structure(mesh, ao.Solid(210e9, 0.3, 7850.0), [ao.Support("-x")])
    assert inspecting._inspect_mesh(mesh, {}, solid).forecast().dofs == pytest.approx(solid.dofs)


def test_a_new_scene_says_that_its_law_is_a_choice_and_what_changes_it():
    look = inspecting._inspect_mesh(ao.box_mesh((0.1, 0.08, 0.06), size=0.02), {}, None)
    law, key = next(row[1:] for row in look.taken(drop=False) if row[0] == "contact")
    assert "ElasticPlastic" in law
    assert key == "[contact] kind"


def test_the_size_that_a_scene_proposes_halves_the_cells_of_a_deck_once(tmp_path):
    """Half of 1.664 mm with two digits, 0.83 mm, halved them twice: 64 times as many."""
    path = tmp_path / "block.inp"
    path.write_text(inp.CUBE + inp.STEEL + inp.SOLID)
    look = replace(inspect_part(path, unit="mm"), largest=1.664e-3)
    (size,) = re.findall(r"# size = (\S+)", template.text("block.toml", "block.inp", look))
    assert halvings(look.largest, float(size)) == 1
