"""The program in README and those of the guide are run as they stand there."""

from __future__ import annotations

import inspect
import re
import runpy
import shutil
from pathlib import Path
from typing import Any

import pytest

from paths import ROOT, demo


def programs() -> list[str]:
    """The program of README."""
    return re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text("utf-8"), re.DOTALL)


def run(program: str, folder: Path, monkeypatch) -> dict[str, Any]:
    shutil.copytree(ROOT / "meshes", folder / "meshes")
    (folder / "program.py").write_text(program, encoding="utf-8")
    monkeypatch.chdir(folder)
    return runpy.run_path("program.py")


@pytest.mark.slow
@pytest.mark.fem
def test_the_program_of_the_readme_runs(tmp_path, monkeypatch, capsys):
    names = run(programs()[0], tmp_path, monkeypatch)
    hit, model, sphere = names["hit"], names["model"], names["sphere"]
    lost = sphere.mass * (sphere.velocity - hit.impactor_velocity[-1])
    assert hit.impulse == pytest.approx(lost, rel=1e-6)
    assert 0 < hit.restitution < 1
    assert model.n == 20
    assert (tmp_path / "out" / "bracket.pvd").is_file()
    same_blow(names)
    said = capsys.readouterr().out
    same_numbers(said)
    outputs = demo("page_outputs")
    told = "\n".join(map(outputs.wrapped, said.strip().splitlines()))
    assert outputs.differences(outputs.shown("README")[0], told) == []


def same_blow(names: dict[str, Any]) -> None:
    """The script that draws the pictures, and the page for beginners, have README's blow."""
    script, site, sphere = demo("impact_on_bracket"), names["site"], names["sphere"]
    given = {name: one.default for name, one in inspect.signature(script.main).parameters.items()}
    assert (site.point, site.direction) == (script.POINT, script.STRIKE)
    assert (given["radius"], given["n"]) == (site.radius, names["model"].n)
    assert (given["sphere"], given["velocity"]) == (sphere.radius, sphere.velocity)
    assert given["duration"] == names["hit"].time[-1]
    program = programs()[0]
    assert f"size={given['size']:.0e}".replace("e-0", "e-") in program
    first = (ROOT / "docs" / "first_impact.md").read_text(encoding="utf-8")
    same = ("eye = ", "ao.read_mesh(", "ao.Structure(", "site = ", "ao.extract(", "ao.Sphere(")
    for line in program.splitlines():
        if any(word in line for word in same):
            assert line.split("= ", 1)[1] in first


def same_numbers(said: str) -> None:
    """README shows what the program prints."""
    shown = (ROOT / "README.md").read_text(encoding="utf-8").partition("```text")[2]

    def numbers(name: str, text: str) -> list[float]:
        (line,) = re.findall(rf"^{name}\D*(.*)", text, re.M)[:1]
        return [float(one) for one in re.findall(r"\d+\.?\d*", line)]

    for name in ("peak force", "restitution", "contact time", "site"):
        found, told = numbers(name, said), numbers(name, shown)
        count = 3 if name == "site" else 1
        assert found[:count] == pytest.approx(told[:count], rel=5e-3, abs=0.1 * (name == "site"))
    assert "(time integration; truncation and mesh are not estimated" in said
    assert "(time integration; truncation and mesh are not estimated" in " ".join(shown.split())
