"""What needs numbers alone runs with NumPy and SciPy; what needs the finite elements says which."""

from __future__ import annotations

import shutil
import subprocess
import sys

import pytest

from scene_files import BEAM, PROBE, SCENES, STRIKE, numbers, written

#: An interpreter in which none of these packages can be imported.
BARE = """
import sys

BLOCKED = ("dolfinx ffcx mpi4py ufl basix petsc4py slepc4py gmsh meshio " + MORE).split()

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in BLOCKED:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Blocked())
import antiosc as ao
from antiosc_app.cli import main
"""


def run_bare(script: str, more: str = "") -> subprocess.CompletedProcess[str]:
    """Run a script without the finite elements, nor the packages named `more`."""
    command = [sys.executable, "-c", f"MORE = {more!r}\n{BARE}{script}"]
    return subprocess.run(command, capture_output=True, text=True, timeout=300)


@pytest.mark.slow
def test_scenes_of_matrices_run_and_others_name_the_line_that_needs_more(tmp_path):
    matrices = written(tmp_path, BEAM + PROBE + "[output]\nplot = 'svg'\n")
    mesh = written(tmp_path, STRIKE, "mesh.toml")
    script = f"""
assert main(["run", {str(matrices)!r}, "--out", {str(tmp_path)!r}]) == 0
assert main(["check", {str(mesh)!r}]) == 1
"""
    done = run_bare(script, more="matplotlib")
    assert done.returncode == 0, done.stderr
    assert "force.svg is not drawn" in done.stderr
    assert numbers(tmp_path)["result"]["peak_force"] > 100
    told = [line for line in done.stderr.splitlines() if line.startswith(str(mesh))]
    assert any("cannot be used here" in line for line in told), done.stderr


@pytest.mark.slow
def test_the_demonstration_of_matrices_has_a_report(tmp_path):
    for file in SCENES.glob("*"):
        if file.name == "matrices.toml" or file.name.startswith("beam_"):
            shutil.copy(file, tmp_path)
    scene, page = tmp_path / "matrices.toml", tmp_path / "page.html"
    given = ["run", str(scene), "--report", str(page), "--out", str(tmp_path / "out")]
    done = run_bare(f"assert main({given!r}) == 0")
    assert done.returncode == 0, done.stderr
    assert page.stat().st_size > 50_000


@pytest.mark.slow
def test_materials_and_laws_are_numbers():
    done = run_bare("""
steel = ao.material("steel S235")
ao.Solid(210e9, 0.3, 7850.0), ao.Shell(210e9, 0.3, 7850.0, 1e-3)
ao.Beam(210e9, 0.3, 7850.0, ao.Section.circle(0.01)), ao.Floor(steel)
ball = ao.Sphere(0.01, material="steel S235", velocity=1.0)
law = ao.contact_between(ball, "steel S235")
wall = ao.AntiOscillators(m0=1e6, k0=0.0, m=[], omega=[])
assert ao.simulate(wall, ball, law, 1e-4).peak_force > 100
""")
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("command", ["open", "new"])
def test_a_command_on_a_part_says_what_is_missing(command, tmp_path):
    (tmp_path / "a.stl").write_text("solid a\nendsolid a\n")
    options = ["--no-browser"] if command == "open" else []
    given = [command, *options, str(tmp_path / "a.stl")]
    done = run_bare(f"sys.exit(main({given!r}))")
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert "not installed" in done.stderr
