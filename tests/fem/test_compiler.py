"""The compiler of finite elements: what the system denies it is said, with the remedy."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import warnings
from types import SimpleNamespace

import pytest

from paths import ROOT

SCRIPT = """
import dolfinx
import numpy as np
from mpi4py import MPI
import antiosc as ao

box = dolfinx.mesh.create_box(MPI.COMM_WORLD, [np.zeros(3), np.ones(3)], [1, 1, 1])
try:
    ao.Structure(ao.read_mesh(box), ao.Solid(70e9, 0.3, 2700.0))
except ao.AntioscError as error:
    print(error)
"""


def test_derivatives_are_counted_by_the_directions_of_the_cell(monkeypatch):
    """FFCx up to 0.5 would count x, y and z of a shell in space; newer ones stay as they are."""
    compiler = pytest.importorskip("antiosc.fem.platform.compiled_forms")
    tables = pytest.importorskip("ffcx.ir.elementtables")
    asked = []
    monkeypatch.setattr(tables, "get_ffcx_table_values", lambda *a: asked.append(a), raising=False)
    own = tables.get_ffcx_table_values
    shell = SimpleNamespace(topological_dimension=lambda: 2)
    given = ("points", shell, "type", "element", "average", "entity", (1, 2, 3), "component")
    with compiler.compiler():
        tables.get_ffcx_table_values(*given)
    counts = (1, 2) if compiler.FFCX < (0, 6) else (1, 2, 3)
    assert asked == [(*given[:6], counts, "component")]
    assert tables.get_ffcx_table_values is own


@pytest.mark.slow
def test_no_file_is_left_open(tmp_path):
    """FFCx 0.5 claims a compilation by a file that it would not close."""
    compiler = pytest.importorskip("antiosc.fem.platform.compiled_forms").compiler
    jit = pytest.importorskip("ffcx.codegeneration.jit")
    with warnings.catch_warnings(record=True) as told, compiler():
        warnings.simplefilter("always")
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
