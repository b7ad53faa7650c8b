"""The scene of docs/scene_files.md and those of demos/scenes run as they stand there."""

from __future__ import annotations

import importlib.util
import re

import numpy as np
import pytest

import antiosc as ao
from paths import MESHES, ROOT
from scene_files import SCENES, antiosc, numbers, written

PAGE = (ROOT / "docs/scene_files.md").read_text(encoding="utf-8")
pytestmark = pytest.mark.fem


@pytest.fixture
def page(tmp_path):
    """The scene of the page, beside the meshes of the repository."""
    pytest.importorskip("dolfinx")
    (tmp_path / "meshes").symlink_to(MESHES)
    (scene,) = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    return written(tmp_path, scene)


@pytest.mark.slow
def test_the_scene_of_the_page_runs(page, tmp_path, capsys):
    for command in ("run", "sweep", "map"):
        assert antiosc(command, page, "--out", tmp_path / command) == 0
    peak = numbers(tmp_path / "run")["result"]["peak_force"]
    swept = numbers(tmp_path / "sweep")["sweep"]
    assert swept["impactor.velocity"][-1] == 2.0
    assert swept["peak force (N)"][-1] == pytest.approx(peak, rel=2e-3)
    assert len(numbers(tmp_path / "map")["map"]["peak_force"]) == 2
    told = capsys.readouterr().out
    assert "bracket.msh: 8268 tetrahedron cells" in told
    mesh = ao.read_mesh(MESHES / "bracket.msh")
    part = ao.Structure(mesh, ao.Solid(70e9, 0.33, 2700.0), [ao.Support("clamp")])
    site = ao.Site((0.020, 0.040, 0.075), (-0.2, -0.6, -0.8), radius=4e-3, snap=True)
    ball = ao.Sphere(0.010, 210e9, 0.3, 7850.0, velocity=2.0)
    law = ball.hertz(70e9, 0.33, radii=(0.018, float("inf")))
    hit = ao.simulate(ao.extract(part, site, n=20), ball, law, duration=1e-3)
    assert hit.peak_force == pytest.approx(peak, rel=1e-9)


@pytest.mark.parametrize(
    "name", ["matrices", *(pytest.param(n, marks=pytest.mark.slow) for n in ("deck", "step"))]
)
def test_the_example_scenes_run(name, tmp_path, capsys):
    pytest.importorskip("dolfinx")
    assert antiosc("check", SCENES / f"{name}.toml") == 0
    assert antiosc("run", SCENES / f"{name}.toml", "--out", tmp_path) == 0
    result = numbers(tmp_path)
    assert result["result"]["status"] == 0
    assert result["warnings"] == []
    assert result["result"]["peak_force"] > 100
    assert result["result"]["energy_drift"] < 1e-3
    # closed forms: 48 EI/L³ of a simply supported beam, 3 EI/L³ of a cantilever
    stiffness = {"matrices": 48 * 210e9 * 2.5e-9 / 0.512, "deck": 3 * 210e9 * 8.5333e-10 / 0.027}
    if name in stiffness:
        assert result["model"]["k0"] == pytest.approx(stiffness[name], rel=2e-3)


def test_the_matrices_are_those_of_their_script(tmp_path):
    spec = importlib.util.spec_from_file_location("make_matrices", SCENES / "make_matrices.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.main(tmp_path)
    K, M, rows = module.matrices()
    for name in ("beam_K.mtx", "beam_M.mtx", "beam_nodes.txt"):
        assert (tmp_path / name).read_text() == (SCENES / name).read_text()
    # first bending frequency of a simply supported beam, (π/L)² √(EI/ρA)
    omega = np.sqrt(np.min(np.linalg.eigvals(np.linalg.solve(M, K)).real))
    exact = (np.pi / 0.8) ** 2 * np.sqrt(210e9 * 0.01**2 / 12 / 7850)
    assert omega == pytest.approx(exact, rel=1e-5)
    assert len(rows) == 32
