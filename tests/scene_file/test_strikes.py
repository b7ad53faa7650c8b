"""Scene files of strikes: mesh, model and step for a tolerance."""

from __future__ import annotations

import pytest

from antiosc.app.scene_file.document import read
from antiosc.app.scene_file.scene import compiled
from paths import MESHES
from scene_files import STRIKE, antiosc, written


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
    assert "[strike] chooses what [simulate] says" in capsys.readouterr().err
