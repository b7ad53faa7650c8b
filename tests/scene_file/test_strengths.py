"""Strengths of materials in scene files."""

from __future__ import annotations

import re

import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
from antiosc.app.scene_file.document import read
from antiosc.app.scene_file.scene import compiled
from scene_files import BRACKET, HIT, antiosc, numbers

pytestmark = pytest.mark.fem

PLATE = """
[geometry]
source = "plate.msh"
[[supports]]
where = "left"
"""
SOLID = 'kind = "Solid"\nE = 70e9\nnu = 0.3\nrho = 2700.0\n'
LAYER = "E1=140e9, E2=9e9, nu12=0.3, G12=5e9, G13=5e9, G23=3e9, rho=1600.0, thickness=1e-3"
STRENGTH = "X_t=1.5e9, X_c=1.2e9, Y_t=4e7, Y_c=2e8, S=7e7"


def material(folder, text: str):
    path = folder / "scene.toml"
    path.write_text(f"{PLATE}[material]\n{text}")
    (folder / "plate.msh").touch()
    return compiled(read(path)).structure.arguments["material"].made


def test_materials_of_scene_files_have_strengths(tmp_path):
    assert material(tmp_path, SOLID + "yield_strength = 240e6").yield_strength == 240e6
    text = f'kind = "Laminate"\nlayers = [{{{LAYER}, strength = {{{STRENGTH}}}}}]'
    assert material(tmp_path, text).layers[0].strength == ao.Strengths(1.5e9, 1.2e9, 4e7, 2e8, 7e7)


@pytest.mark.slow
def test_a_run_tells_the_margin_of_safety_and_probes_their_component(tmp_path, capsys):
    path = tmp_path / "scene.toml"
    probe = '[probes.top]\npoint = [0.0, 0.030, 0.086]\nquantity = "acceleration"\n'
    strong = BRACKET.replace("rho = 2700", "rho = 2700\nyield_strength = 240e6")
    path.write_text(strong + HIT.replace("2e-3", "3e-4") + probe)
    assert antiosc("run", path, "--out", tmp_path / "out") == 0
    told = capsys.readouterr().out
    assert re.search(r"probe top +acceleration magnitude: largest \S+ m/s² \(\S+ g\)", told)
    assert "margin of safety" in told
    found = numbers(tmp_path / "out")
    margin = found["stress"]["von_mises"]["margin"]
    assert margin["exposure"] == pytest.approx(found["stress"]["von_mises"]["value"] / 240e6)
    assert margin["reached"] == (margin["exposure"] >= 1) == (margin["margin"] <= 0)
    path.write_text(BRACKET + HIT.replace("2e-3", "3e-4") + '[stress]\nquantity = "stress"\n')
    assert antiosc("run", path, "--out", tmp_path / "out") == 0
    assert list(numbers(tmp_path / "out")["stress"]) == ["stress"]
