"""Scene files of strikes: mesh, model and step for a tolerance."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from antiosc.app.scene_file.document import read
from antiosc.app.scene_file.scene import compiled
from paths import MESHES
from scene_files import STRIKE, antiosc, objects, table, written

STRIKE_PLATE = """\
[geometry]
source = "plate.geo"
gdim = 2
[material]
kind = "Solid"
E = 70e9
nu = 0.33
rho = 2700.0
plane = "stress"
thickness = 0.01
[[supports]]
where = "left"
[sites.tip]
point = [0.15, 0.05]
direction = [0, -1]
radius = 0.02
[impactor]
kind = "RigidMass"
mass = 0.1
velocity = 1.0
[contact]
kind = "Linear"
stiffness = 1e7
[strike]
duration = 1e-3
tol = 0.2
[probes.tip]
point = [0.15, 0.05]
[probes.root]
point = [0.02, 0.049]
quantity = "stress"
"""


PLATE = """\
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 0.2, 0.05};
Physical Surface("plate") = {1};
Physical Curve("left") = {4};
"""


@pytest.mark.fem
def test_a_strike_takes_what_the_scene_says(tmp_path, capsys):
    """Its mesh is chosen where nothing but a mesh says what is struck; else the structure is."""
    pytest.importorskip("dolfinx")

    def struck(text: str) -> dict:
        found = compiled(read(written(tmp_path, text))).history
        assert found.name == "strike"
        return found.arguments

    assert struck(STRIKE)["source"].name == "Structure"
    meshed = STRIKE.replace("order = 1\n", "").replace("[structure]\n", "")
    assert antiosc("check", written(tmp_path, meshed.replace('"clamp"', '"klamp"'))) == 1
    assert "did you mean 'clamp'" in capsys.readouterr().err
    given = struck(meshed)
    assert given["source"] == f"{MESHES}/bracket.msh"
    assert given["material"].name == "Solid"
    assert [one.arguments["where"] for one in given["supports"]] == ["clamp"]
    assert antiosc("check", written(tmp_path, f"{STRIKE}[simulate]\nduration = 1e-3\n")) == 1
    assert "[simulate] has no place beside [strike]" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.fem
def test_probes_of_a_strike_are_those_of_its_last_mesh(tmp_path, capsys):
    pytest.importorskip("dolfinx")
    (tmp_path / "plate.geo").write_text(PLATE)
    path = written(tmp_path, STRIKE_PLATE)
    assert antiosc("run", path, "--out", tmp_path / "out") == 0
    capsys.readouterr()
    found = objects(path)
    hit, probes = found.history, found.probes
    assert hit.structure.dofs == hit.model.info["strike"][-1]["dofs"]
    rows = table(tmp_path / "out" / "probes.csv")
    site = -probes["tip"][np.isin(rows["time (s)"], hit.time), 1]  # one point of the patch
    assert np.abs(site - hit.displacement).max() < 0.05 * np.abs(hit.displacement).max()
    np.testing.assert_array_equal(rows["root xx (Pa)"], probes["root"][:, 0, 0])
    assert pickle.loads(pickle.dumps(hit)).structure is None
