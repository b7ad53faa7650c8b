"""The program in README is run as it stands there."""

from __future__ import annotations

import re
import runpy
import shutil
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.mark.fem
def test_the_program_of_the_readme_runs(tmp_path, monkeypatch, capsys):
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    programs = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert len(programs) == 1
    shutil.copytree(ROOT / "meshes", tmp_path / "meshes")
    (tmp_path / "program.py").write_text(programs[0], encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    names = runpy.run_path("program.py")
    hit, model, sphere = names["hit"], names["model"], names["sphere"]
    lost = sphere.mass * (sphere.velocity - hit.impactor_velocity[-1])
    assert hit.impulse == pytest.approx(lost, rel=1e-6)
    assert 0 < hit.restitution < 1
    assert model.n == 20
    assert (tmp_path / "out" / "bracket.pvd").is_file()
    assert "peak force" in capsys.readouterr().out


def test_every_path_that_the_readme_names_exists():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    paths = re.findall(r"\]\(([^)#]+)\)", text)
    paths += re.findall(r"`((?:src|meshes|demos|tests)/[^`]*)`", text)
    assert paths
    assert [p for p in paths if not p.startswith("http") and not (ROOT / p).exists()] == []
