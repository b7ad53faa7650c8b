"""MED files that meshio alone does not read: several meshes, results, old versions."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest

import antiosc as ao

h5py = pytest.importorskip("h5py")
pytestmark = pytest.mark.fem


def squares(n: int) -> meshio.Mesh:
    """A strip of squares of 1 m."""
    points = [(x, y, 0.0) for x in range(n + 1) for y in (0.0, 1.0)]
    cells = [[2 * k, 2 * k + 2, 2 * k + 3, 2 * k + 1] for k in range(n)]
    return meshio.Mesh(np.array(points), [("quad", cells)])


def with_results(file: h5py.File) -> None:
    """Results that meshio cannot place: in the triangles of a mesh without any."""
    step = file.create_group("CHA/T/0")
    step.attrs["PDT"] = 0.0
    step.create_group("MAI.TR3")


def without_space(file: h5py.File) -> None:
    """As of MED 2: a mesh has one dimension."""
    for mesh in file["ENS_MAA"].values():
        del mesh.attrs["ESP"]


@pytest.fixture
def strip(tmp_path: Path) -> Path:
    squares(3).write(tmp_path / "a.med")
    return tmp_path / "a.med"


@pytest.mark.parametrize("change", [with_results, without_space])
def test_what_meshio_refuses_is_left_out(strip, change):
    with h5py.File(strip, "r+") as file:
        change(file)
    with pytest.raises(Exception):  # noqa: B017, PT011
        meshio.read(strip)
    assert ao.read_mesh(strip, gdim=3).n_cells == 3


def test_the_largest_of_several_meshes_is_read_and_told(strip, tmp_path):
    squares(5).write(tmp_path / "b.med")
    with h5py.File(strip, "r+") as file, h5py.File(tmp_path / "b.med") as other:
        other.copy("ENS_MAA/mesh", file["ENS_MAA"], "longer")
        other.copy("FAS/mesh", file["FAS"], "longer")
    with pytest.warns(ao.AntioscWarning, match="holds 2 meshes.*; longer is read"):
        assert ao.read_mesh(strip, gdim=3).n_cells == 5
