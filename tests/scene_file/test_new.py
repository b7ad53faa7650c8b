"""`antiosc new`: it looks at a part, and the scene that it writes runs as it stands."""

from __future__ import annotations

import re
import tomllib

import meshio
import numpy as np
import pytest

pytest.importorskip("jinja2")

import antiosc as ao
from antiosc.base.texts import engineering
from antiosc.fem.platform import compat
from antiosc_app import (
    inspecting,
)
from antiosc_app.inspecting import inspect_part
from paths import DEMOS, MESHES
from scene_files import antiosc, numbers

pytestmark = pytest.mark.fem

#: Numbers in place of "auto", for a run that is short.
SHORT = {"duration": "duration = 2e-3", "n": "n = 20"}
#: Corners of a box in the order of a hexahedron.
BOX = np.array([(0, 0), (0.2, 0), (0.2, 0.08), (0, 0.08)])
BOX = np.vstack([np.column_stack([BOX, np.full(4, z)]) for z in (0.0, 0.06)])
PARTS = [path for kind in ("msh", "geo", "step") for path in sorted(MESHES.glob(f"*.{kind}"))]
PARTS.append(DEMOS / "scenes/bar.inp")


@pytest.mark.slow
def test_a_plate_is_held_at_an_end_and_not_at_its_underside():
    look = inspecting._inspection_of(ao.box_mesh((0.2, 0.1, 0.004), size=0.02), {}, None)
    assert np.ptp(look.points[look.held][:, 0]) == 0.0
    assert look.direction == [0.0, 0.0, -1.0]


def test_a_part_beside_round_numbers_is_held(tmp_path):
    path = tmp_path / "block.vtu"
    meshio.write(path, meshio.Mesh(BOX + 0.12345645, [("hexahedron", [range(8)])]))
    look = inspect_part(path, unit="m")
    assert ao.Support(plane=look.held_plane).where(look.points.T).any()


@pytest.mark.slow
def test_a_new_scene_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert antiosc("new") == 0
    scene = tmp_path / "scene.toml"
    text = re.sub(r"(?m)^size = 0.01 ", "size = 0.04 ", scene.read_text())  # of the plate
    scene.write_text(re.sub(r'(?m)^(duration|n) = "auto" .*', lambda m: SHORT[m[1]], text))
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
        assert longest <= (asked if part.endswith("vtu") else 2.1 * asked)  # gmsh aims at a size
        counts.append(mesh.n_cells)
        finest.append(longest)
    assert counts[1] > 4 * counts[0]
    assert finest[1] < 0.7 * finest[0]


@pytest.mark.slow
def test_the_outside_of_a_box_in_millimetres_is_struck_away_from_its_support(tmp_path):
    """The largest free side, near its middle, from outside."""
    x = np.array(np.meshgrid(*[np.linspace(0, 1, n) for n in (9, 7, 3)], indexing="ij"))
    points = (x.reshape(3, -1).T + 0.1) * [400.0, 300.0, 250.0]
    number = np.arange(9 * 7 * 3).reshape(9, 7, 3)
    low = number[:-1, :-1, :-1].ravel()
    a, b, c = 7 * 3, 3, 1
    cells = np.stack([low + k for k in (0, a, a + b, b, c, a + c, a + b + c, b + c)], axis=1)
    path = tmp_path / "box.vtu"
    meshio.write(path, meshio.Mesh(points, [("hexahedron", cells)]))
    found = inspect_part(path)
    assert found.family == "Solid"
    assert found.read_options["unit"] == "mm"
    np.testing.assert_allclose(found.box_high - found.box_low, [0.4, 0.3, 0.25])
    assert found.held_plane[1] == [0.0, 0.0, 1.0]
    np.testing.assert_allclose(found.direction, [0, 0, -1], atol=1e-9)
    place = (np.array(found.point) - found.box_low) / [0.4, 0.3, 0.25]
    assert place[2] == pytest.approx(1.0)
    assert np.all(np.abs(place[:2] - 0.5) < 0.3)


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
        (MESHES / "bracket.step", "unobtainium", "nearest of the materials"),
        (MESHES / "bracket.step", "Sitka", "orientation"),
        (DEMOS / "scenes/bar.inp", "6061", "--material"),
    ],
)
def test_a_material_that_cannot_be_taken_is_told(part, name, said, tmp_path, capsys):
    assert antiosc("new", tmp_path / "a.toml", part, "--material", name) == 1
    assert said in capsys.readouterr().err
    assert not list(tmp_path.glob("*.toml"))


@pytest.mark.slow
@pytest.mark.parametrize(("side", "unit"), [(3.2, "mm"), (2.0, "m")])
def test_a_geometry_of_more_than_three_units_is_taken_in_millimetres(side, unit, tmp_path):
    script = tmp_path / "block.geo"
    script.write_text(
        f'SetFactory("OpenCASCADE"); Box(1) = {{0, 0, 0, {side}, {side / 2}, {side / 2}}};'
    )
    found = inspect_part(script)
    assert found.read_options["unit"] == unit
    length = {"mm": 1e-3, "m": 1.0}[unit] * side
    assert found.length == pytest.approx(length)
    assert found.read_options["size"] == pytest.approx(length / 20, rel=0.34)
