"""The files of a scene."""

from __future__ import annotations

from antiosc.scene_file.read import read
from scene_files import MATRICES


def test_the_files_of_a_scene_lie_beside_it(tmp_path):
    (tmp_path / "scene.toml").write_text(f"{MATRICES}dof = 1\n")
    found = read(tmp_path / "scene.toml")
    assert found.file("../part.msh") == str(tmp_path.parent / "part.msh")
