"""In a folder from elsewhere, nothing is run or configured by the files that lie there."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from paths import MESHES, ROOT

pytestmark = [pytest.mark.fem, pytest.mark.slow]

SCENE = """\
[geometry]
source = "lever.msh"
order = 1
[material]
kind = "Solid"
plane = "stress"
thickness = 5e-3
E = 70e9
nu = 0.33
rho = 2700
[structure]
order = 1
[[supports]]
where = "clamp"
[sites.end]
point = [0.135, 0.0]
direction = [-1, 0]
radius = 4e-3
[extract]
n = 3
[impactor]
kind = "RigidMass"
mass = 0.05
velocity = 1.0
[contact]
kind = "Hertz"
stiffness = 5e8
[simulate]
duration = 5e-4
[output]
plot = "svg"
fields = true
"""
MODULE = 'open("{here}/{mark}", "w").close()\nraise ImportError("{mark}")\n'
COMMAND = "#!/bin/sh\ntouch {here}/{mark}\nexit 1\n"
WRAPPED = '{{"cffi_extra_compile_args": ["-wrapper", "{here}/wrapper"]}}'
SHOWN = "mpi_show_mca_params = all\nmpi_show_mca_params_file = {here}/{mark}\n"
# What it leaves, a file or a word in the output, has the name {mark}, which is also a colour.
PROBES = {
    # PETSc, SLEPc
    ".petscrc": "-log_view :{here}/{mark}\n",
    "petscrc": "-history {here}/{mark}\n",
    "petsc.cfg": "PETSC_ARCH = {here}/arch\n",
    "slepc.cfg": "PETSC_ARCH = {here}/arch\n",
    "arch/PETSc.py": MODULE,
    "arch/SLEPc.py": MODULE,
    # MPI
    "ucx.conf": "UCX_LOG_LEVEL=trace\nUCX_LOG_FILE={here}/{mark}\n",
    ".openmpi/mca-params.conf": SHOWN,
    "openmpi-mca-params.conf": SHOWN,
    # dolfinx, FFCx and the compiler that they call
    "dolfinx_jit_parameters.json": WRAPPED,
    "dolfinx_jit_options.json": WRAPPED,
    "ffcx_parameters.json": '{{"verbosity": "{mark}"}}',
    "ffcx_options.json": '{{"verbosity": "{mark}"}}',
    "wrapper": COMMAND,
    "gcc": COMMAND,
    "setup.cfg": "[build_ext]\ncompiler = {mark}\n",
    "pyproject.toml": '[tool.distutils.build_ext]\ncompiler = "{mark}"\n',
    ".pydistutils.cfg": "[build_ext]\ncompiler = {mark}\n",
    # matplotlib
    "matplotlibrc": "savefig.facecolor: {mark}\n",
    "evil.mplstyle": "savefig.facecolor: {mark}\n",
    # gmsh
    ".gmshrc": 'SystemCall "touch {here}/{mark}";\n',
    ".gmsh-options": 'SystemCall "touch {here}/{mark}";\n',
    "lever.msh.opt": 'SystemCall "touch {here}/{mark}";\n',
    # Python
    **dict.fromkeys(("numpy.py", "gmsh.py", "scipy.py", "matplotlib.py", "pyvista.py"), MODULE),
    **dict.fromkeys(("mpi4py.py", "dolfinx.py", "tqdm.py", "json.py", "sitecustomize.py"), MODULE),
}
MARKS = {name: f"{0xE71000 + k:06x}" for k, name in enumerate(PROBES)}
SCRIPT = "import sys; from antiosc_app.cli import main; sys.exit(main())"
COMMANDS = {
    "run": ["-c", SCRIPT, "run", "scene.toml", "--report", "r.html"],
    "info": ["-c", SCRIPT, "info"],
    "module": ["-m", "antiosc", "check", "scene.toml"],
}


def antiosc(folder: Path, name: str) -> subprocess.CompletedProcess[str]:
    """A command in the folder, as the script of that name runs it, or by `python -m`."""
    given = COMMANDS[name]
    safe = [] if given[0] == "-m" else ["-P"]  # a script's folder, not the working one, is searched
    environment = {**os.environ, "XDG_CACHE_HOME": f"{folder}-cache", "PYTHONPATH": f"{ROOT}/src"}
    environment["OMPI_MCA_pml"] = "ob1,ucx"  # Debian leaves UCX out, others do not
    return subprocess.run(
        [sys.executable, *safe, *given],
        cwd=folder, env=environment, capture_output=True, text=True, timeout=300,
    )  # fmt: skip


@pytest.fixture(scope="module")
def tried(tmp_path_factory):
    """The folder after all commands, and all that they wrote and printed."""
    folder = tmp_path_factory.mktemp("downloaded")
    (folder / "scene.toml").write_text(SCENE)
    shutil.copy(MESHES / "lever.msh", folder)
    for name, content in PROBES.items():
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(content.format(here=folder, mark=MARKS[name]))
        path.chmod(0o755)
    done = {name: antiosc(folder, name) for name in COMMANDS}
    texts = [one.stdout + one.stderr for one in done.values()]
    texts += [path.read_text() for path in folder.glob("scene_out/*.svg")]
    return folder, done, "".join(texts)


@pytest.mark.parametrize("command", COMMANDS)
def test_the_command_works(tried, command):
    folder, done, _ = tried
    assert done[command].returncode == 0, done[command].stderr
    assert "fails to load" not in done[command].stdout
    assert "not drawn" not in done[command].stderr
    assert (folder / "scene_out" / "force.svg").is_file()


@pytest.mark.parametrize("probe", PROBES)
def test_files_of_the_folder_have_no_effect(tried, probe):
    folder, _, printed = tried
    assert not (folder / MARKS[probe]).exists()
    assert MARKS[probe] not in printed


def test_no_family_is_compiled_as_the_folder_says(tmp_path):
    """The options of a compiler are in the name of what it makes: other ones compile anew.

    Here in the user's cache; an empty one is that of the commands above.
    """
    for name in ("dolfinx_jit_parameters.json", "dolfinx_jit_options.json"):
        (tmp_path / name).write_text(WRAPPED.format(here=tmp_path))
    (tmp_path / "wrapper").write_text(COMMAND.format(here=tmp_path, mark="marker"))
    (tmp_path / "wrapper").chmod(0o755)
    environment = {**os.environ, "PYTHONPATH": f"{ROOT}/src:{ROOT}/tests/support"}
    done = subprocess.run(
        [sys.executable, "-P", str(ROOT / "tests" / "support" / "foreign_families.py")],
        cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert not (tmp_path / "marker").exists()
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) == 9
