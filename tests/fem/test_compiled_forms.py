"""Compiled forms: what is damaged is made again; what the system denies is said."""

from __future__ import annotations

import fcntl
import gc
import os
import subprocess
import sys
import warnings
from pathlib import Path

import dolfinx
import pytest
import ufl
from mpi4py import MPI

import antiosc as ao
from antiosc.fem.platform import compat, compiled_forms
from antiosc.fem.platform.compiled_forms import quiet_compiler
from paths import ROOT


@pytest.fixture
def place(tmp_path, monkeypatch):
    """The folder of compiled forms, at first empty."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return compiled_forms.cache_folder()


def length() -> float:
    """Of three elements on a line, by a compiled form."""
    line = dolfinx.mesh.create_unit_interval(MPI.COMM_SELF, 3)
    return compat.integrate(compat.constant(line, 2.0) * ufl.dx(domain=line), line)


def library(place: Path) -> Path:
    return next(path for path in place.glob("libffcx_forms_*.so"))


@pytest.mark.slow
def test_what_one_mesh_has_compiled_serves_the_next(place):
    """The second form of a mesh has the same signature whether the first was compiled or loaded."""
    sizes = []
    for n in range(3):
        for path in place.glob("*.so") if n == 2 else []:  # this process has loaded them
            path.unlink()
        line = ao.read_mesh(dolfinx.mesh.create_unit_interval(MPI.COMM_SELF, 3)).dolfinx
        for power in (1, 2):
            value = compat.constant(line, 2.0) ** power * ufl.dx(domain=line)
            assert compat.integrate(value, line) == pytest.approx(2.0**power)
        sizes.append(len(list(place.glob("libffcx_forms_*.so"))))
    assert sizes == [2, 2, 0]


@pytest.mark.slow
@pytest.mark.parametrize("lost", ["*forms*.cached", "*forms*.c"])
def test_what_an_ended_process_left_is_compiled_again(place, monkeypatch, lost):
    monkeypatch.setattr(compiled_forms, "COMPILE_WAIT", 1)
    assert length() == pytest.approx(2.0)
    made = library(place)
    kept = {path for path in place.glob("*.so") if "elements" in path.name}
    next(place.glob(lost)).unlink()
    compiled_forms._cleared_folders.clear()
    assert length() == pytest.approx(2.0)
    assert library(place) == made
    assert len(list(place.glob("*forms*.cached"))) == 1
    assert kept <= {*place.glob("*.so")}


@pytest.mark.slow
def test_a_form_that_another_process_does_not_end_is_refused(place, monkeypatch):
    monkeypatch.setattr(compiled_forms, "COMPILE_WAIT", 1)
    assert length() == pytest.approx(2.0)
    next(place.glob("*forms*.cached")).unlink()
    with (place / "lock").open() as other:
        fcntl.flock(other, fcntl.LOCK_SH)
        with pytest.raises(ao.InputError, match="delete"):
            length()


def test_no_configuration_is_read_but_the_flags_of_the_environment(place, monkeypatch):
    monkeypatch.setenv("CFLAGS", "-O1 -DNAME='two words'")
    options = {
        "cache_dir": place,
        "timeout": compiled_forms.COMPILE_WAIT,
        "cffi_extra_compile_args": [*compiled_forms.FLAGS, "-O1", "-DNAME=two words"],
    }
    readers = [name for name in compiled_forms.CONFIG_READERS if hasattr(dolfinx.jit, name)]
    usual = [getattr(dolfinx.jit, name) for name in readers]
    assert readers
    with quiet_compiler():
        assert [getattr(dolfinx.jit, name)()[0] for name in readers] == [options]
    assert [getattr(dolfinx.jit, name) for name in readers] == usual


SCRIPT = """
import antiosc as ao
import antiosc.fem  # before dolfinx, as packages of PyPI ask for it
import dolfinx
import numpy as np
from mpi4py import MPI

box = dolfinx.mesh.create_box(MPI.COMM_WORLD, [np.zeros(3), np.ones(3)], [1, 1, 1])
try:
    ao.Structure(ao.read_mesh(box), ao.Solid(70e9, 0.3, 2700.0))
except ao.AntioscError as error:
    print(error)
"""


@pytest.mark.slow
def test_no_file_is_left_open(tmp_path):
    """FFCx 0.5 claims a compilation by a file that it would not close."""
    jit = pytest.importorskip("ffcx.codegeneration.jit")
    with warnings.catch_warnings(record=True, action="always") as told, quiet_compiler():
        jit.get_cached_module("claimed", [], tmp_path, 1)
        gc.collect()
    assert not told
    assert (tmp_path / "claimed.c").read_bytes() == b""


@pytest.mark.slow
@pytest.mark.parametrize("name", ["XDG_CACHE_HOME", "HOME"])
def test_no_place_for_compiled_elements(name, tmp_path):
    (tmp_path / "file").touch()
    environment = {k: v for k, v in os.environ.items() if k != "XDG_CACHE_HOME"}
    environment |= {name: str(tmp_path / "file" / "x"), "PYTHONPATH": str(ROOT / "src")}
    run = subprocess.run(
        [sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True, check=True
    )
    assert "set XDG_CACHE_HOME" in run.stdout
    assert len(run.stdout.splitlines()) == 1
