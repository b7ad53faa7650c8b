"""Thickness of the walls of a solid."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import antiosc as ao
from antiosc.fem.mesh.walls import wall_thickness
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
