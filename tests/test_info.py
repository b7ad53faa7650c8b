"""`antiosc info`: checked against what Debian, the kernel and the packages themselves say."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
import re
import signal
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
    assert row(text, "dolfinx") == importlib.metadata.version("fenics-dolfinx")
    assert row(text, "solvers") == "CHOLMOD, MUMPS"
    assert re.match(r"not called|\d", row(text, "CHOLMOD"))


@pytest.mark.parametrize(
    ("kind", "asked", "never"),
    [
        ("conda", ("conda install", "fenics-dolfinx", "python-gmsh", "real"), ("apt", "pip")),
        ("debian", ("apt install", "python3-dolfinx-real"), ("pip", "conda")),
        ("venv", ("pip install", "apt install", "system-site-packages"), ("conda",)),
        ("pip", ("pip install", "conda", "container"), ("apt",)),
    ],
)
def test_the_remedy_is_one_of_this_installation(kind, asked, never):
    said = info.remedy(info.PACKAGES, kind)
    assert [word for word in asked if word not in said] == []
    assert [word for word in never if word in said] == []
    only_charts = [p for p in info.PACKAGES if p.name == "matplotlib"]
    assert "dolfinx" not in info.remedy(only_charts, kind)


@pytest.mark.slow
def test_a_broken_package_is_reported_and_the_rest_still_shown(tmp_path):
    (tmp_path / "meshio.py").write_text("raise OSError('libfoo.so: wrong ELF class')")
    text = run_info(f"sys.path.insert(0, {str(tmp_path)!r})", code=1)
    assert row(text, "meshio") == "fails to load"
    assert "libfoo.so: wrong ELF class" in text
    assert "BLAS" in text


def test_version_option(capsys):
    with pytest.raises(SystemExit, match="0"):
        cli.main(["--version"])
    assert capsys.readouterr().out == f"antiosc {importlib.metadata.version('antiosc')}\n"


def test_errors_of_antiosc_become_one_line_and_exit_code_1(capsys, monkeypatch):
    def fail() -> str:
        raise InputError("the number must be > 0; got -1.")

    monkeypatch.setattr(info, "report", fail)
    assert cli.main(["info"]) == 1
    assert capsys.readouterr().err == "antiosc: the number must be > 0; got -1.\n"


@pytest.mark.slow
def test_sigterm_leaves_nothing_temporary(tmp_path):
    code = """
    import os, signal, sys, tempfile
    from antiosc_app import cli
    from antiosc_app import info
    def report():
        with tempfile.TemporaryDirectory() as folder:
            print(folder, flush=True)
            os.kill(os.getpid(), signal.SIGTERM)
    info.report = report
    sys.exit(cli.main(["info"]))
    """
    done = ran(code, TMPDIR=str(tmp_path))
    assert done.returncode == 128 + signal.SIGTERM
    assert done.stdout.startswith(str(tmp_path))
    assert done.stderr == ""
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("arguments", [[], ["--help"]])
def test_a_reader_that_has_seen_enough_ends_the_output_in_silence(arguments):
    """Also where all of it is still in Python's buffer when the reader goes."""
    code = f"import sys\nfrom antiosc_app.cli import main\nsys.exit(main({arguments}))"
    given, own = [sys.executable, "-c", code], {**os.environ, "PYTHONUNBUFFERED": ""}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(given, env=own, **pipes) as run:
        run.stdout.close()
        assert run.stderr.read() == ""
    assert run.returncode == 1


@pytest.mark.slow
def test_runs_without_the_finite_element_packages_and_says_how_to_get_them():
    absent = ["dolfinx", "petsc4py", "slepc4py", "gmsh", "meshio", "mpi4py", "h5py", "matplotlib"]
    text = run_info(f"sys.modules.update(dict.fromkeys({absent}))", code=1)
    assert row(text, "dolfinx") == "missing"
    assert row(text, "solvers") == "none of CHOLMOD, MUMPS"
    for module in absent:
        assert re.search(rf"\bpython3-{module}\b", text), module
