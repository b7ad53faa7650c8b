"""`antiosc info`: checked against what Debian, the kernel and the packages themselves say."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
import re
import subprocess
import sys
import textwrap

import pytest

from antiosc.base.errors import InputError
from antiosc_app import cli, info


def ran(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """A fresh Python that runs the code."""
    own = {**os.environ, **environment}
    given = [sys.executable, "-c", textwrap.dedent(code)]
    return subprocess.run(given, env=own, capture_output=True, text=True, timeout=600)


def run_info(before: str = "", code: int = 0, **environment: str) -> str:
    """Output of `antiosc info` in a fresh Python that runs the statement `before` first."""
    program = f"import sys\n{before}\nfrom antiosc_app.cli import main\nsys.exit(main(['info']))"
    done = ran(program, **environment)
    assert done.returncode == code, done.stderr
    return done.stdout


def row(text: str, name: str) -> str:
    return re.search(rf"^{name} +(.+)$", text, re.MULTILINE)[1]


@pytest.mark.fem
@pytest.mark.slow
def test_nothing_is_missing_after_set_up():
    text = run_info()
    assert "missing" not in text
    assert "fails" not in text
    for package in info.PACKAGES:
        assert re.search(r"\d+\.\d+", row(text, package.name)), package.name
    of_pypi = importlib.util.find_spec("dolfinx_solver") is not None
    distribution = info.SOLVER_WHEEL if of_pypi else "fenics-dolfinx"
    assert row(text, "dolfinx") == importlib.metadata.version(distribution)
    assert row(text, "solvers") == ("MUMPS" if of_pypi else "CHOLMOD, MUMPS")
    assert re.match(r"not called|\d", row(text, "CHOLMOD"))


def test_version_option(capsys):
    with pytest.raises(SystemExit, match="0"):
        cli.main(["--version"])
    assert capsys.readouterr().out == f"antiosc {importlib.metadata.version('antiosc')}\n"


def test_errors_of_antiosc_become_one_line_and_exit_code_1(capsys, monkeypatch):
    def fail() -> str:
        raise InputError("the number must be > 0; got -1.")

    monkeypatch.setattr(info, "info_text", fail)
    assert cli.main(["info"]) == 1
    assert capsys.readouterr().err == "antiosc: the number must be > 0; got -1.\n"


@pytest.mark.slow
def test_runs_without_the_finite_element_packages_and_says_how_to_get_them():
    absent = ["dolfinx", "petsc4py", "slepc4py", "gmsh", "meshio", "mpi4py", "h5py", "matplotlib"]
    text = run_info(f"sys.modules.update(dict.fromkeys({absent}))", code=1)
    assert row(text, "dolfinx") == "missing"
    assert row(text, "solvers") == "none of CHOLMOD, MUMPS"
    missing = [package for package in info.PACKAGES if package.module in absent]
    assert info.install_command(missing, info.installation_kind()) in text


@pytest.mark.fem
def test_meshes_need_a_compiler(monkeypatch):
    monkeypatch.setenv("CC", "no-compiler")
    text = info.info_text()
    assert "meshes cannot be read or simulated here" in row(text, "works")
    assert "Missing: C compiler" in text


def test_pip_brings_all_where_pypi_has_wheels():
    asked = info.install_command(info.PACKAGES, "wheels")
    assert all(name in asked for name in ("pip install", "dolfinx-solver-real", "gmsh"))
    assert "dolfinx" not in info.install_command(info.PACKAGES, "venv").partition(";")[0]


@pytest.mark.fem
def test_a_process_of_the_mpirun_of_another_mpi_is_refused():
    name = "OMPI_COMM_WORLD_SIZE" if importlib.util.find_spec("dolfinx_solver") else "PMI_SIZE"
    done = ran("import antiosc.fem", **{name: "2"})
    assert done.returncode == 1
    assert "the mpirun of another MPI" in done.stderr.splitlines()[-1]
    done = ran(
        "import sys; from antiosc_app.cli import main; sys.exit(main(['info']))", **{name: "2"}
    )
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("antiosc: this process was started by the mpirun of another MPI")


@pytest.mark.fem
@pytest.mark.slow
def test_packages_that_need_no_trial_are_not_loaded():
    names = ["matplotlib", "meshio", "jinja2"]
    done = ran(f"""
        import sys
        from antiosc_app.cli import main
        code = main(["info"])
        assert not {{*{names}}} & sys.modules.keys()
        sys.exit(code)
        """)
    assert done.returncode == 0, done.stderr
    assert not set(names) & set(row(done.stdout, "loaded").partition(";")[0].split(", "))
