"""Sizes of elements, and damaged files of all kinds."""

from __future__ import annotations

import random
import re
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

from paths import DECKS

pytest.importorskip("dolfinx")
pytest.importorskip("gmsh")

import gmsh
import meshio

import antiosc as ao
import parts
from antiosc.io import by_gmsh, isolation
from antiosc.io.request import Request
from mesh_files import refusal
from paths import MESHES

pytestmark = pytest.mark.fem


def cube(session, path: Path, kernel: str) -> Path:
    if kernel == "occ":
        gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path.with_suffix(".brep")))
        return path.with_suffix(".brep")
    path = path.with_suffix(".geo")
    path.write_text(
        "Point(1) = {0, 0, 0}; Point(2) = {1, 0, 0}; Point(3) = {1, 1, 0}; Point(4) = {0, 1, 0};"
        "Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};"
        "Curve Loop(1) = {1:4}; Plane Surface(1) = {1}; Extrude {0, 0, 1} { Surface{1}; }\n"
        f"Mesh.ElementOrder = {2 if kernel == 'own, order 2' else 1};\n"
    )
    return path


@pytest.mark.parametrize("kernel", ["occ", "own", "own, order 2"])
def test_a_size_that_would_fill_the_machine_is_refused(tmp_path, session, kernel):
    path = cube(session, tmp_path / "cube", kernel)
    for size in (1e-30, 1e-12):
        assert "below what its coordinates resolve" in refusal(path, size=size)
    assert "8.5e+07 cells at size=0.00464 m, more than 1e+07" in refusal(path, size=0.00464)
    assert "1.2e+09 lines at size=1e-08 m" in refusal(path, size=1e-8)
    assert ao.read_mesh(path, size=0.5).n_cells > 10


@pytest.mark.parametrize("kernel", ["occ", "own"])
def test_the_forecast_of_cells_is_right_by_half(tmp_path, session, kernel):
    gmsh.open(str(cube(session, tmp_path / "cube", kernel)))
    ask = Request("cube.brep", "cube.brep", size=0.12)
    told = [by_gmsh.expected_cells(gmsh, ask, dim, 0.12, 1.0) for dim in (1, 2, 3)]
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.12)
    gmsh.model.mesh.generate(3)
    for dim, kind in ((1, 1), (2, 2), (3, 4)):
        made = len(gmsh.model.mesh.getElementsByType(kind)[0])
        assert 0.5 < told[dim - 1] / made < 2


def test_areas_and_volumes_follow_from_the_mesh_of_their_boundaries(tmp_path, session):
    """In gmsh's own kernel, which does not know them: the unit cube has 6 faces of area 1."""
    gmsh.open(str(cube(session, tmp_path / "cube", "own")))
    gmsh.model.mesh.generate(2)
    for dim, count in ((1, 12), (2, 6), (3, 1)):
        measures = [by_gmsh.measure_of(gmsh, d, tag) for d, tag in gmsh.model.getEntities(dim)]
        assert measures == pytest.approx([1.0] * count, rel=1e-9)


def damaged(content: bytes, rng: random.Random) -> bytes:
    """The bytes cut, flipped, with huge counts, or rearranged."""
    b = bytearray(content)
    kind = rng.random()
    i, j = sorted(rng.randrange(len(b)) for _ in range(2))
    if kind < 0.2:
        return bytes(b[:i])
    if kind < 0.5:
        for _ in range(rng.choice([1, 3, 30])):
            b[rng.randrange(len(b))] ^= 1 << rng.randrange(8)
        return bytes(b)
    numbers = list(re.finditer(rb"\d+", bytes(b)))
    if kind < 0.8 and numbers:
        m = rng.choice(numbers[: rng.choice([10, len(numbers)])])
        huge = rng.choice([b"999999999999", b"-1", b"0", b"2147483647", b"nan", b"1e300"])
        return bytes(b[: m.start()]) + huge + bytes(b[m.end() :])
    return bytes(b[:i] + b[j:]) if kind < 0.9 else bytes(b[:j] + b[i:])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_damaged_files_are_refused_or_read(tmp_path, seed):
    rng = random.Random(seed)
    files = [MESHES / "bracket.step", MESHES / "lever.msh"]
    for version in (2.2, 4.1):
        for binary in (False, True):
            name = tmp_path / f"cube{version}{binary}.msh"
            files.append(parts.gmsh_cube(name, "tetrahedron", 1, version=version, binary=binary))
    source = meshio.read(files[2])
    body = meshio.Mesh(source.points, [("tetra", source.get_cells_type("tetra"))])
    for suffix in ("inp", "bdf", "vtu", "vtk", "med", "xdmf"):
        body.write(tmp_path / f"cube.{suffix}")
        files.append(tmp_path / f"cube.{suffix}")
    gmsh.initialize(readConfigFiles=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.open(str(files[2]))
    for suffix in ("unv", "stl"):
        gmsh.write(str(tmp_path / f"cube.{suffix}"))
        files.append(tmp_path / f"cube.{suffix}")
    files += [cube(gmsh, tmp_path / "cube", kernel) for kernel in ("occ", "own")]
    gmsh.finalize()
    told = []
    for k in range(30):
        file = rng.choice(files)
        path = tmp_path / f"damaged{k}{file.suffix}"
        path.write_bytes(damaged(file.read_bytes(), rng))
        geometry = file.suffix in by_gmsh.GEOMETRY
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                ao.read_mesh(path, size=0.5 if geometry else None, timeout=20)
            except ao.InputError as error:
                told.append(str(error))
    assert len(told) > 10
    assert not [t for t in told if "\n" in t or not t.endswith(".")]


def test_the_reading_process_loads_neither_scipy_nor_dolfinx():
    script = """
import runpy, sys
from pathlib import Path
from types import SimpleNamespace
child = runpy.run_path(sys.argv[1])
child["_hollow_package"](Path(sys.argv[1]).parents[1])
from antiosc.io.table import reader_of
print(*(reader_of(name).library for name in ("part.step", "part.inp")))
print(*{"scipy", "dolfinx", "petsc4py", "meshio"} & sys.modules.keys())
"""
    path = Path(isolation.__file__).with_name("child.py")
    arguments = [sys.executable, "-c", script, str(path)]
    done = subprocess.run(arguments, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["gmsh numpy", ""]


def test_bulk_data_by_its_content(tmp_path):
    path = tmp_path / "part.dat"
    path.write_text((DECKS / "bar.bdf").read_text())
    assert ao.read_mesh(path).n_cells == ao.read_mesh(DECKS / "bar.bdf").n_cells
    assert ao.read_model(path).mass == pytest.approx(ao.read_model(DECKS / "bar.bdf").mass)
