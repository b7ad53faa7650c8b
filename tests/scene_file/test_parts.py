"""Scenes of parts: assemblies, blows to be found, falls, strengths, and the example scenes."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest

import antiosc as ao
from antiosc.base.texts import engineering
from antiosc_app import cli
from antiosc_app.scene_file.compiled import compile_document
from antiosc_app.scene_file.document import SceneFileError, read_document
from paths import MESHES, ROOT
from scene_files import (
    ASKED,
    BLOW,
    BRACKET,
    FALL,
    HIT,
    MATRICES,
    SCENES,
    antiosc,
    numbers,
    objects,
    written,
)

pytestmark = pytest.mark.fem


#: What a report shows of a map.
MAPPED = ("peak force", "contact time", "static stiffness")


PART = f"""\
[parts.NAME.geometry]
source = "{MESHES}/beam.msh"
[parts.NAME.material]
kind = "Beam"
E = 210e9
nu = 0.3
rho = 7850
section = {{ kind = "Section.rectangle", width = 0.02, height = 0.01 }}
orientation = [0, 0, 1]
"""
#: Two bars of 1 m, welded end to end; the first is clamped.
BARS = f"""\
{PART.replace("NAME", "first")}
[[parts.first.supports]]
near = [[0, 0, 0], 1e-6]
{PART.replace("NAME", "second")}
[at.second]
shift = [1.0, 0, 0]
[[joints]]
kind = "Weld"
a = ["first", [1.0, 0, 0]]
b = ["second", [1.0, 0, 0]]
[sites.tip]
point = [2.0, 0, 0]
direction = [0, 0, -1]
[extract]
n = 6
[impactor]
kind = "RigidMass"
mass = 0.1
velocity = 1
[contact]
kind = "Linear"
stiffness = 1e5
[simulate]
duration = 5e-3
[probes.middle]
point = [1.0, 0, 0]
part = "first"
quantity = "rotation"
"""


@pytest.mark.slow
def test_an_assembly_runs(tmp_path, capsys):
    assert antiosc("run", written(tmp_path, BARS), "--out", tmp_path) == 0
    # a cantilever of 2 m, 3EI/L³
    stiffness = 3 * 210e9 * 0.02 * 0.01**3 / 12 / 2.0**3
    assert numbers(tmp_path)["model"]["k0"] == pytest.approx(stiffness, rel=2e-3)
    assert (tmp_path / "probes.csv").read_text().startswith("time (s),middle x (rad),")
    assert re.search(r"middle: rotation + [\d.e-]+ rad", capsys.readouterr().out)


@pytest.mark.parametrize(
    ("old", "new", "held"),
    [
        ('"Section.rectangle"', '"Section.rectangel"', "'Section.rectangle'"),
        ("[at.second]", "[material]\n[at.second]", "parts.NAME"),
        ("[[parts.first.supports]]", "[[parts.first.suports]]", "[supports]"),
    ],
)
def test_mistakes_in_an_assembly(tmp_path, capsys, old, new, held):
    path = written(tmp_path, BARS.replace(old, new, 1))
    assert antiosc("check", path) == 1
    told = capsys.readouterr().err.splitlines()
    line = BARS[: BARS.index(old)].count("\n") + 1
    assert any(text.startswith(f"{path}:{line}: ") and held in text for text in told), told


@pytest.mark.slow
def test_a_map_of_both_parts_and_a_probe_of_a_group(tmp_path, capsys):
    """`antiosc map` tells the hardest blow on each part; `run` the motion of "second:right"."""
    several = '[map]\nwhere = ["first", "second"]\ndirection = [0, 0, -1]\nn = 3\nmodes = 8\n'
    end = '[probes.end]\npoint = "second:right"\n[probes.middle]'
    path = written(tmp_path, BARS.replace("[probes.middle]", several + end))
    assert antiosc("map", path, "--out", tmp_path, "--report", tmp_path / "map.html") == 0
    told = capsys.readouterr().out
    table = (tmp_path / "map.csv").read_text().splitlines()
    names = [row.split(",")[0] for row in table[1:]]
    assert table[0].startswith("surface,x (m),")
    force = table[0].split(",").index("peak_force (N)")
    for name in ("first", "second"):
        forces = [float(row.split(",")[force]) for row in table[1:] if row.startswith(name)]
        hardest = engineering(max(forces), "N", 4)
        assert f"{names.count(name)} sites, at most {hardest} at (" in told
    page = (tmp_path / "map.html").read_text()
    assert "at most" in page
    assert re.findall("<h3>(.*?)</h3>", page) == [f"Map: {name}" for name in MAPPED]
    assert numbers(tmp_path)["map"]["surface"] == names
    assert antiosc("run", path, "--out", tmp_path) == 0
    end = np.loadtxt(tmp_path / "probes.csv", delimiter=",", skiprows=1)[:, :4]
    struck = np.genfromtxt(tmp_path / "history.csv", delimiter=",", names=True)
    own = struck[next(name for name in struck.dtype.names if name.startswith("displacement"))]
    assert np.diff(end[:, 0]).max() <= 1.001e-3 * end[-1, 0]  # flights too
    end = end[np.isin(end[:, 0], struck["time_s"])]
    np.testing.assert_allclose(-end[:, 3], own, atol=1e-6 * np.abs(own).max())


SKIN = """\
SetFactory("OpenCASCADE"); Rectangle(1) = {0, 0, 0, 0.4, 0.3};
Physical Surface("skin") = {1}; Physical Curve("rim") = {1, 2, 3, 4};
"""


@pytest.fixture
def plate_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "plate.geo").write_text(SKIN)
    values = np.random.default_rng(0).standard_normal((64, 2))
    table = np.column_stack([np.arange(64) / 16e3, values])
    np.savetxt(tmp_path / "signals.csv", table, header="time, left, right", delimiter=",")
    return tmp_path


@pytest.mark.slow
def test_the_blow_is_that_of_find_impact(
    plate_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (plate_folder / "find.toml").write_text(BLOW)
    assert cli.main(["check", "find.toml"]) == 0
    shell = ao.Shell(210e9, 0.3, 7850.0, 4e-3)
    mesh = ao.read_mesh("plate.geo", size=0.15, gdim=3)
    sensors = [
        ao.Sensor((0.07, 0.06, 0.0), (0, 0, 1)),
        ao.Sensor((0.33, 0.08, 0.0), (0, 0, 1), "velocity"),
    ]
    part = ao.Structure(mesh, shell, [ao.Support("rim")])
    with pytest.warns(ao.AccuracyWarning):  # noise has no blow
        found = ao.find_impact(
            part, sensors,
            np.loadtxt("signals.csv", delimiter=",")[:, 1:], 16e3,
            [(0.1, 0.1, 0.0), (0.3, 0.2, 0.0)], ["place"], direction=(0, 0, -1), modes=5,
            impactor=ao.RigidMass(0.3, 2.0), contact=ao.Hertz(4e7),
        )  # fmt: skip
    assert cli.main(["run", "find.toml", "--out", "out", "--report", "page.html"]) == 0
    assert f"{found.peak_force:.5g} N" in capsys.readouterr().out
    told = json.loads((plate_folder / "out/result.json").read_text())["found"]
    assert told["place"] == pytest.approx(found.place.tolist())
    assert told["impulse"] == pytest.approx(found.impulse, rel=1e-9)
    force = np.loadtxt("out/force.csv", delimiter=",", skiprows=1)
    assert force[:, 1] == pytest.approx(found.force)
    assert "<img" in (plate_folder / "page.html").read_text()


BOX = """\
SetFactory("OpenCASCADE"); Box(1) = {0, 0, 0, 0.12, 0.06, 0.03};
Physical Volume("part") = {1};
"""


@pytest.fixture
def box_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "box.geo").write_text(BOX)
    return tmp_path


@pytest.mark.slow
def test_the_stress_of_a_fall_is_brought_to_a_tolerance(box_folder: Path) -> None:
    """By smaller cells of the geometry, whose second-order cells cannot be bisected."""
    (box_folder / "drop.toml").write_text(FALL + "[worst]\ntol = 0.2\n")
    assert cli.main(["run", "drop.toml", "--out", "out", "--report", "page.html"]) == 0
    page = (box_folder / "page.html").read_text()
    assert "rounds of smaller cells" in page
    assert "cannot say" not in page


@pytest.mark.slow
def test_a_fall_is_that_of_drop(box_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (box_folder / "drop.toml").write_text(FALL + ASKED)
    assert cli.main(["check", "drop.toml"]) == 0
    assert cli.main(["run", "drop.toml", "--out", "out", "--report", "page.html", "--verbose"]) == 0
    printed, page = capsys.readouterr().out, (box_folder / "page.html").read_text()
    found = json.loads((box_folder / "out/result.json").read_text())
    part = ao.Structure(ao.read_mesh("box.geo", size=0.06), ao.Solid(70e9, 0.33, 2700.0))
    floor = ao.Floor(ao.Solid(30e9, 0.2, 2400.0), friction=0.3)
    fall = ao.drop(part, 0.2, (10, 5, 0), floor, until=1, modes=3, corner_radius=1e-3)
    peak = fall.peak("acceleration", (0.06, 0.03, 0.03), "CFC1000")
    assert found["fall"]["peak force (N)"] == pytest.approx([fall.peak_force])
    assert found["accelerometers"]["middle"]["g"] == pytest.approx(peak.g)
    assert found["worst"]["von_mises"] == pytest.approx(fall.worst().values.max())
    assert found["fall"]["message"] == "1 impacts"
    row = next(csv.DictReader((box_folder / "out/fall.csv").read_text().splitlines()))
    assert float(row["place x (m)"]) == pytest.approx(0.12)
    raw = fall.peak("acceleration", (0.06, 0.03, 0.03))
    assert f"{raw.g:.4g} g unfiltered" in printed
    for text in (printed, page):
        told = map(float, re.findall(r"([\d.]+) g\b", text))
        assert any(g == pytest.approx(peak.g, rel=1e-3) for g in told)
    assert page.count("<img") >= 2


#: A block of one element of steel.
BLOCK = """*NODE
1, 0, 0, 0
2, 0.1, 0, 0
3, 0.1, 0.1, 0
4, 0, 0.1, 0
5, 0, 0, 0.1
6, 0.1, 0, 0.1
7, 0.1, 0.1, 0.1
8, 0, 0.1, 0.1
*ELEMENT, TYPE=C3D8, ELSET=ALL
1, 1, 2, 3, 4, 5, 6, 7, 8
*MATERIAL, NAME=STEEL
*ELASTIC
210e9, 0.3
*DENSITY
7800
*SOLID SECTION, ELSET=ALL, MATERIAL=STEEL
"""


@pytest.mark.slow
@pytest.mark.parametrize("part", ["box.geo", "deck.inp"])
def test_a_new_fall_has_no_mistakes(
    box_folder: Path, part: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (box_folder / "deck.inp").write_text(BLOCK)
    assert cli.main(["new", "new.toml", part, "--drop"]) == 0
    told = capsys.readouterr().out
    assert not {"struck", "held"} & set(told.split())
    assert "from 1 m, without supports" in told
    found = compile_document(read_document("new.toml"))
    assert found.runnable_commands() == ["antiosc run"]
    assert found.fall is not None
    assert not {"supports", "sites", "simulate"} & set(found.document.data)


PAGE = (ROOT / "docs/scene_files.md").read_text(encoding="utf-8")


@pytest.fixture
def page(tmp_path):
    """The scene of the page, beside the meshes of the repository."""
    pytest.importorskip("dolfinx")
    (tmp_path / "meshes").symlink_to(MESHES)
    (scene,) = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    return written(tmp_path, scene)


@pytest.mark.slow
def test_the_scene_of_the_page_runs(page, tmp_path, capsys):
    assert antiosc("run", page, "--out", tmp_path / "run") == 0
    assert numbers(tmp_path / "run")["result"]["peak_force"] > 0
    told = capsys.readouterr().out
    assert "bracket.msh: 8268 tetrahedron cells" in told


@pytest.mark.slow
def test_the_surface_of_a_model_without_a_mesh_chooses_the_law(tmp_path):
    """As `with_surface` in Python; in a scene of several bodies too; a mesh has its own."""
    ball = '[impactor]\nkind = "Sphere"\nradius = 0.01\nmaterial = "100Cr6"\nvelocity = 0.5\n'
    surface = '[surface]\nmaterial = "6061"\nradius = 0.02\n'
    site = MATRICES + 'dof = "z"\n[extract]\nn = 6\n' + surface
    alone = written(tmp_path, site + ball + "[simulate]\nduration = 1e-3\n")
    hit = objects(alone).history
    struck = objects(alone).model.with_surface("6061", radius=0.02)
    striker = ao.Sphere(0.01, material="100Cr6", velocity=0.5)
    assert hit.law == ao.simulate(struck, striker, duration=1e-3).law
    assert isinstance(hit.law, ao.ElasticPlastic)
    contact = '[[contacts]]\na = "structure:middle"\nb = "ball"\n[run]\nduration = 1e-3\n'
    several = site + ball.replace("impactor", "bodies.ball") + contact
    found = objects(written(tmp_path, several, "several.toml")).history
    assert found["structure:middle", "ball"].law == hit.law
    with pytest.raises(SceneFileError, match="surface"):
        objects(written(tmp_path, BRACKET + surface + HIT, "mesh.toml"))
    with pytest.raises(SceneFileError, match="steel"):
        objects(written(tmp_path, site.replace("6061", "steal S235") + ball, "name.toml"))


@pytest.mark.parametrize("name", ["matrices", "deck"])  # step.toml: tests/docs/test_pages.py
def test_the_example_scenes_run(name, tmp_path, capsys):
    assert antiosc("check", SCENES / f"{name}.toml") == 0
    assert antiosc("run", SCENES / f"{name}.toml", "--out", tmp_path) == 0
    result = numbers(tmp_path)
    assert result["result"]["status"] == 0
    assert result["warnings"] == []
    assert result["result"]["peak_force"] > 100
    assert result["result"]["energy_drift"] < 1e-3
    # closed forms: 48 EI/L³ of a simply supported beam, 3 EI/L³ of a cantilever
    stiffness = {"matrices": 48 * 210e9 * 2.5e-9 / 0.512, "deck": 3 * 210e9 * 8.5333e-10 / 0.027}
    assert result["model"]["k0"] == pytest.approx(stiffness[name], rel=2e-3)


HELD = """
[geometry]
source = "plate.msh"
[[supports]]
where = "left"
"""
SOLID = 'kind = "Solid"\nE = 70e9\nnu = 0.3\nrho = 2700.0\n'


def material(folder, text: str):
    path = folder / "scene.toml"
    path.write_text(f"{HELD}[material]\n{text}")
    (folder / "plate.msh").touch()
    return compile_document(read_document(path)).structure.arguments["material"].result


@pytest.mark.slow
def test_a_run_tells_the_margin_of_safety_and_probes_their_component(tmp_path, capsys):
    path = tmp_path / "scene.toml"
    probe = '[probes.top]\npoint = [0.0, 0.030, 0.086]\nquantity = "acceleration"\n'
    strong = BRACKET.replace("rho = 2700", "rho = 2700\nyield_strength = 240e6")
    path.write_text(strong + HIT.replace("2e-3", "3e-4") + probe)
    assert antiosc("run", path, "--out", tmp_path / "out") == 0
    told = capsys.readouterr().out
    # no bar, as the force has none
    bar = r"no error bar \(anti-oscillators \S+ %\)"
    assert re.search(rf"top: acceleration +\S+ m/s² {bar} \(\S+ g\)", told)
    assert "margin of safety" in told
    found = numbers(tmp_path / "out")
    margin = found["stress"]["von_mises"]["margin"]
    (judged,) = set(re.findall(r"von Mises stress, ([\d.]+) MPa", margin["sentence"]))
    assert margin["exposure"] == pytest.approx(float(judged) / 240, rel=5e-3)
    assert 0 < margin["exposure"] <= found["stress"]["von_mises"]["value"] / 240e6
    assert margin["reached"] == (margin["exposure"] >= 1) == (margin["margin"] <= 0)
    assert margin["scope"] in margin["sentence"]
    path.write_text(BRACKET + HIT.replace("2e-3", "3e-4") + '[stress]\nquantity = "stress"\n')
    assert antiosc("run", path, "--out", tmp_path / "out") == 0
    assert list(numbers(tmp_path / "out")["stress"]) == ["stress"]


@pytest.mark.parametrize(
    "text",
    [
        'material = "6061"\n',
        'material = {all = "6061"}\n',
        '[material]\nname = "6061"\nyield_strength = 255e6\n',
        '[material]\nkind = "material"\nname = "6061"\n',
    ],
)
def test_a_material_by_its_name(tmp_path, text):
    path = tmp_path / "scene.toml"
    path.write_text(text + HELD if text.startswith("material") else HELD + text)
    (tmp_path / "plate.msh").touch()
    made = compile_document(read_document(path)).structure.arguments["material"]
    solid = made["all"].result if isinstance(made, dict) else made.result
    assert solid.name == "aluminium 6061-T6"
    assert solid.yield_strength == (255e6 if "255" in text else 240e6)
