"""The program in README and those of the guide are run as they stand there."""

from __future__ import annotations

import inspect
import re
import runpy
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from paths import ROOT, demo


def programs() -> list[str]:
    """The program of README, then those of the guide that go on from it."""
    pages = ("README.md", "docs/guide.md", "docs/several.md")
    texts = [(ROOT / page).read_text(encoding="utf-8") for page in pages]
    found = [re.findall(r"```python\n(.*?)```", text, re.DOTALL) for text in texts]
    assert found[1][0] == found[0][0]
    return found[1] + found[2]


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
    """The guide shows what the program prints."""
    shown = (ROOT / "docs" / "guide.md").read_text(encoding="utf-8").partition("`make demo`")[2]

    def numbers(name: str, text: str) -> list[float]:
        (line,) = re.findall(rf"^{name}\D*(.*)", text, re.M)[:1]
        return [float(one) for one in re.findall(r"\d+\.?\d*", line)]

    for name in ("peak force", "restitution", "contact time", "site"):
        found, told = numbers(name, said), numbers(name, shown)
        count = 3 if name == "site" else 1
        assert found[:count] == pytest.approx(told[:count], rel=5e-3, abs=0.1 * (name == "site"))
    assert "(time integration; truncation and mesh are not estimated" in said
    assert "(time integration; truncation and mesh are not estimated" in shown


@pytest.mark.fem
@pytest.mark.slow
def test_the_map_of_the_readme_runs(tmp_path, monkeypatch):
    whole, rest = programs()[:2]
    names = run(whole + rest, tmp_path, monkeypatch)  # a warning would be an error
    found, sphere = names["found"], names["sphere"]
    assert len(found) == 25
    # softer the higher above the base, and struck less hard than a half-space that does not move
    height = found.points[:, 2]
    stiffness = [found.models.k0[height == z].mean() for z in np.unique(height)]
    assert (np.diff(stiffness) < 0).all()
    energy = 1.25 * sphere.mass * sphere.velocity**2
    elastic = sphere.hertz(E=69e9, nu=0.33).stiffness ** 0.4 * energy**0.6
    assert (found.peak_force < 0.9 * elastic).all()  # it yields
    assert (found.peak_force > 0.4 * elastic).all()
    assert (tmp_path / "out" / "map.vtu").is_file()
    assert (tmp_path / "out" / "map.png").is_file()


def test_the_scene_of_the_readme_runs(tmp_path, monkeypatch, capsys):
    landing = run(programs()[2], tmp_path, monkeypatch)["landing"]
    assert "Completed" in capsys.readouterr().out
    pushed = sum(landing[f"box:foot{i}", "floor"].impulse for i in range(4))
    gained = landing.bodies["box"].momentum[-1, 2] - landing.bodies["box"].momentum[0, 2]
    assert gained == pytest.approx(pushed - 0.8 * 9.80665 * 8e-3, rel=1e-6)
    for i in range(4):
        contact = landing[f"box:foot{i}", "floor"]
        assert abs(contact.friction).max() <= 0.3 * contact.peak_force * (1 + 1e-9)


@pytest.mark.fem
@pytest.mark.slow
def test_the_sites_of_the_readme_run(tmp_path, monkeypatch, capsys):
    names = run(programs()[0] + programs()[3], tmp_path, monkeypatch)
    both, stopped = names["both"], names["stopped"]
    assert both.k0.shape == both.m0.shape == (2, 2)
    assert both.P.shape == (2, 30)
    assert "Completed" in capsys.readouterr().out
    wall = stopped.bodies["bracket"].displacement("wall")
    pressed = stopped["bracket:wall", "stop"].force > 0
    assert pressed.any()
    assert wall[pressed].max() < -1e-5 * (1 - 1e-9) < wall[0]
    assert names["top"].shape == (len(stopped.time), 3)
