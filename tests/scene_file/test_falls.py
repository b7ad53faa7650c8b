"""Falls in scene files: what a run writes, mistakes, and the scene that `antiosc new` writes."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

import antiosc as ao
from antiosc.app import cli
from antiosc.app.scene_file.document import read
from antiosc.app.scene_file.scene import compiled
from scene_files import ASKED, BODIES, FALL, MATRICES

pytestmark = pytest.mark.fem

BOX = """\
SetFactory("OpenCASCADE"); Box(1) = {0, 0, 0, 0.12, 0.06, 0.03};
Physical Volume("part") = {1};
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "box.geo").write_text(BOX)
    return tmp_path


@pytest.mark.slow
def test_a_fall_is_that_of_drop(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "drop.toml").write_text(FALL + ASKED)
    assert cli.main(["check", "drop.toml"]) == 0
    assert cli.main(["run", "drop.toml", "--dry-run"]) == 0
    assert "1.981 m/s" in capsys.readouterr().out
    assert cli.main(["run", "drop.toml", "--out", "out", "--report", "page.html"]) == 0
    printed, page = capsys.readouterr().out, (folder / "page.html").read_text()
    found = json.loads((folder / "out/result.json").read_text())
    part = ao.Structure(ao.read_mesh("box.geo", size=0.06), ao.Solid(70e9, 0.33, 2700.0))
    floor = ao.Floor(ao.Solid(30e9, 0.2, 2400.0), friction=0.3)
    fall = ao.drop(part, 0.2, (10, 5, 0), floor, until=1, modes=3, corner_radius=1e-3)
    peak = fall.peak("acceleration", (0.06, 0.03, 0.03), "CFC1000")
    assert found["fall"]["peak force (N)"] == pytest.approx([fall.peak_force])
    assert found["accelerometers"]["middle"]["g"] == pytest.approx(peak.g)
    assert found["worst"]["von_mises"] == pytest.approx(fall.worst().values.max())
    assert found["fall"]["status"] == "1 impacts"
    row = next(csv.DictReader((folder / "out/fall.csv").read_text().splitlines()))
    assert float(row["place x (m)"]) == pytest.approx(0.12)
    for text in (printed, page):
        assert f"{peak.g:.5g} g" in text
    assert page.count("<img") >= 2


def test_soil_as_a_floor_under_a_part_and_as_a_body(folder: Path) -> None:
    soil = "radius = 0.4, G = 60e6, nu = 0.3, rho = 1800"
    floor = f'floor = {{model = {{kind = "soil_cone", {soil}}}}}'
    footing = '[[attached]]\nkind = "Footing"\nwhere = [0.06, 0.03, 0.0]\n'
    footing += soil.replace(", ", "\n") + "\n"
    (folder / "drop.toml").write_text(FALL[: FALL.index("floor")] + floor + "\n" + footing)
    found = compiled(read("drop.toml"))
    cone = ao.soil_cone(0.4, 60e6, 0.3, 1800.0)
    assert found.fall is not None
    assert found.structure is not None
    assert found.fall.arguments["floor"].made.model == cone
    (carried,) = found.structure.arguments["attached"]
    assert carried.made == ao.Footing((0.06, 0.03, 0.0), 0.4, 60e6, 0.3, 1800.0)
    body = '[bodies.b]\nkind = "soil_cone"\n' + soil.replace(", ", "\n") + "\n"
    ground = BODIES.replace('[bodies.b]\nkind = "Obstacle"\n', body)
    (folder / "ground.toml").write_text(f'{MATRICES}dof = "z"\n{ground}')
    scene = compiled(read("ground.toml")).scene
    assert scene is not None
    assert scene.arguments["bodies"]["b"].made == cone


def test_a_yield_strength_has_its_verdict(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    strong = FALL.replace("rho = 2700\n", "rho = 2700\nyield_strength = 275e6\n")
    (folder / "drop.toml").write_text(strong + ASKED[: ASKED.index("filter")] + "[output]\n")
    assert cli.main(["run", "drop.toml", "--out", "out", "--report", "page.html"]) == 0
    printed, page = capsys.readouterr().out, (folder / "page.html").read_text()
    for text in (printed, page):
        assert "yield is not reached" in text
        assert "margin of safety" in text
        assert "Floor(law=Thornton.from_material(2.236e+10, 0.001, 4.4e+08))" in text
        assert "g (unfiltered), in impact 1" in text
    margin = json.loads((folder / "out/result.json").read_text())["worst"]["margin"]
    assert "the contact itself" in margin["sentence"]
    assert margin["margin"] == pytest.approx(1 / margin["exposure"] - 1)


@pytest.mark.parametrize("part", ["box.geo", "deck.inp"])
def test_a_new_fall_has_no_mistakes(
    folder: Path, part: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "deck.inp").write_text("*NODE\n1, 0, 0, 0\n")
    assert cli.main(["new", "new.toml", part, "--drop"]) == 0
    told = capsys.readouterr().out
    assert not {"struck", "held"} & set(told.split())
    assert ("dropped without supports" in told) == (part == "box.geo")
    found = compiled(read("new.toml"))
    assert found.does() == ["antiosc run"]
    assert found.fall is not None
    assert not {"supports", "sites", "simulate"} & set(found.document.data)
