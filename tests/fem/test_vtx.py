"""Series in one `.bp` folder: what ADIOS2 reads there is what `.vtu` files hold."""

from __future__ import annotations

import os

import numpy as np
import pytest

import antiosc as ao
import parts
from antiosc.fem.platform import compat
from assemblies import box
from mpi import run_ranks

pytestmark = pytest.mark.filterwarnings("ignore:the compliance under a point load")

installed = pytest.mark.skipif(not compat.writes_vtx(), reason="dolfinx without ADIOS2")
TIMES = [0.0, 1e-4, 3e-4]
PROGRAM = """
import sys
import antiosc as ao
held = [ao.Support("clamp")]
part = ao.Structure(ao.read_mesh(sys.argv[2]), ao.Solid(E=210e9, nu=0.3, rho=7850.0), held)
site = ao.Site((1.2, 1.0, 1.0), (0.2, -1, 0.3), snap=True)
hit = ao.simulate(ao.extract(part, site, 4), ao.RigidMass(0.1, 1.0), ao.Hertz(1e8), duration=3e-4)
times = [0.0, 1e-4, 3e-4]
for _ in range(2):  # the second takes the place of the first
    print(ao.write_series(part, hit, sys.argv[1] + "/run.bp", times).name)
ao.write_series(part, hit, sys.argv[1] + "/run.pvd", times)
"""


def struck(part):
    site = ao.Site((0.13, 0.06), (0.2, -1), radius=0.035)
    return ao.simulate(ao.extract(part, site, 4), ao.RigidMass(0.1, 1.0), ao.Hertz(1e8), 3e-4)


def sheet():
    return ao.Structure(
        parts.plate((6, 3), (0.2, 0.06)),
        ao.Solid(**parts.STEEL, plane="stress", thickness=0.01),
        [ao.Support("left")],
    )


def read(path) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """(times, points, displacements at each time) of a `.bp` folder."""
    os.environ["ADIOS2_ALWAYS_USE_MPI"] = "1"  # the library that dolfinx has loaded
    adios2 = pytest.importorskip("adios2")
    with adios2.FileReader(str(path)) as file:
        steps = file.num_steps()
        blocks = range(len(file.all_blocks_info("geometry")[0]))
        time = file.read("step", step_selection=[0, steps])
        points = np.vstack([file.read("geometry", block_id=b) for b in blocks])
        fields = [
            np.vstack(
                [
                    file.read("displacement", block_id=b, step_selection=[k, 1]).reshape(-1, 3)
                    for b in blocks
                ]
            )
            for k in range(steps)
        ]
    return time.ravel(), points, fields


def compare(folder) -> None:
    meshio = pytest.importorskip("meshio")
    time, points, fields = read(folder / "run.bp")
    np.testing.assert_allclose(time, TIMES, atol=1e-12)
    scale = np.abs(fields[-1]).max()
    assert scale > 0
    for k, field in enumerate(fields):
        frame = meshio.read(folder / f"run_{k:04d}.vtu")
        for x, moved in zip(points, field, strict=True):
            nearest = np.argmin(((frame.points - x) ** 2).sum(axis=1))
            expected = frame.point_data["displacement"][nearest]
            np.testing.assert_allclose(moved, expected, atol=1e-9 * scale)


@installed
@pytest.mark.mpi
@pytest.mark.parametrize("ranks", [1, 2])
def test_a_folder_holds_what_the_frames_hold(ranks, tmp_path):
    """Curved cells: their nodes inside edges have an order of their own."""
    cube = parts.gmsh_cube(tmp_path / "cube.msh", "tetrahedron", 2, bent=True)
    assert run_ranks(ranks, PROGRAM, str(tmp_path), str(cube)) == ["run.bp\nrun.bp\n"] * ranks
    assert not list(tmp_path.glob(".antiosc*"))
    compare(tmp_path)


@installed
def test_a_plane_part_and_a_name_that_is_taken(tmp_path):
    part = sheet()
    hit = struck(part)
    ao.write_series(part, hit, tmp_path / "run.bp", TIMES)
    ao.write_series(part, hit, tmp_path / "run.pvd", TIMES)
    compare(tmp_path)
    for name, make in (("file.bp", lambda path: path.write_text("mine")), ("folder.bp", mkdir)):
        make(tmp_path / name)
        with pytest.raises(ao.InputError, match="no series of ADIOS2; choose another name"):
            ao.write_series(part, hit, tmp_path / name, TIMES)
        assert (tmp_path / name).exists()
    assert not list(tmp_path.glob(".antiosc*"))


def mkdir(path) -> None:
    path.mkdir()


def test_where_it_cannot_be_written_it_says_so(tmp_path, monkeypatch):
    part = sheet()
    hit = struck(part)
    monkeypatch.setattr(compat, "writes_vtx", lambda: False)
    with pytest.raises(ao.MissingDependencyError, match=r"needs dolfinx with ADIOS2.*\.pvd"):
        ao.write_series(part, hit, tmp_path / "run.bp", TIMES)
    block = ao.Structure(box((0, 0, 0), (0.1, 0.1, 0.1), (1, 1, 1)), ao.Solid(**parts.STEEL))
    pair = ao.assemble({"a": block, "b": block}, [ao.Tie("a:x1", "b:x0")], at={"b": (0.1, 0, 0)})
    site = ao.Site((0.0, 0.0, 0.0), (1, 1, 1), part="a")
    both = ao.simulate(ao.extract(pair, site, 2), ao.RigidMass(0.1, 1.0), ao.Hertz(1e8), 1e-4)
    with pytest.raises(ao.InputError, match="holds one mesh"):
        ao.write_series(pair, both, tmp_path / "run.bp", TIMES[:2])
    assert not list(tmp_path.iterdir())
