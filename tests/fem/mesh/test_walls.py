"""Thickness of the walls of a solid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

import antiosc as ao
from antiosc.fem.mesh.walls import _Skin, wall_thickness
from antiosc.fem.platform import compat


def plates(gap: float) -> ao.Mesh:
    """Two plates of 100 x 100 x 10 mm in one mesh, the second above the first at a distance [m]."""
    steps = np.linspace(0.0, 0.1, 9)
    x, y, z = np.meshgrid(steps, steps, [0.0, 0.01], indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    number = np.arange(len(points)).reshape(x.shape)
    corners = [number[a : a + 8, b : b + 8, c] for c in (0, 1) for b in (0, 1) for a in (0, 1)]
    cells = np.column_stack([corner.ravel() for corner in corners])
    above = points + np.array([0.0, 0.0, 0.01 + gap])
    both = np.concatenate([points, above]), np.concatenate([cells, cells + len(points)])
    mesh = compat.create_mesh(MPI.COMM_SELF, both[1].astype(np.int64), both[0], "hexahedron", 1)
    return ao.read_mesh(mesh)


@pytest.mark.parametrize("gap", [1e-3, 0.0, -2e-4], ids=["apart", "touching", "overlapping"])
def test_the_walls_of_two_plates_are_those_of_each(gap):
    """A face of one is no wall of the other, where the plates overlap either."""
    assert wall_thickness(plates(gap)) == pytest.approx(0.01, rel=1e-9)


FIN = """SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 0.04, 0.04, 0.01}; Box(2) = {0, 0.019, 0.01, 0.04, 0.002, 0.0257};
BooleanUnion(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; };
"""


@pytest.mark.slow
@pytest.mark.parametrize("size", [5e-3, 4e-3, 2.5e-3])
def test_the_walls_do_not_depend_on_the_cells(size, tmp_path):
    """Both sides of the fin of 2 mm are 0.3 of the surface, more than the quarter that decides."""
    (tmp_path / "fin.geo").write_text(FIN)
    mesh = ao.read_mesh(tmp_path / "fin.geo", size=size)
    assert wall_thickness(mesh) == pytest.approx(0.002, rel=1e-9)


def test_no_wall_is_thinner_than_nothing():
    """A face whose inner side does not look at the point is not opposite to it."""
    corners = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 2.0, 0.0]])
    centres = np.array([[0.0, 0.0, 0.0], [-1.0, 0.0, -0.5]])
    normals = np.array([[0.0, 0.0, 1.0], [0.8, 0.0, -0.6]])
    skin = _Skin(corners + centres[:, None], normals, np.zeros(2, dtype=int))
    assert skin.depth(centres[0], 0) == np.inf
    flat = replace(skin, normals=np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]))
    assert flat.depth(centres[0], 0) == pytest.approx(0.5)
