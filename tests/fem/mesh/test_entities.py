"""Rules on groups of points, edges, faces and cells: their sizes and centroids."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("dolfinx")

from antiosc.fem.mesh.entities import quadrature
from assemblies import box

pytestmark = pytest.mark.fem


@pytest.mark.parametrize("cell", ["tetrahedron", "hexahedron", "triangle", "quadrilateral"])
def test_cells_and_their_boundary_have_volume_and_centroid(cell):
    """A block (rectangle), sheared: sizes by hand, of all cells and of two opposite sides."""
    plane = cell in ("triangle", "quadrilateral")
    high = (2.0, 1.0) if plane else (2.0, 1.0, 0.5)
    mesh = box((0, 0, 0)[: len(high)], high, (3, 2, 2)[: len(high)], cell)
    x = mesh.dolfinx.geometry.x
    x[:, 0] += 0.3 * x[:, 1]
    cells = np.arange(mesh.dolfinx.topology.index_map(mesh.tdim).size_local)
    whole = quadrature(mesh, mesh.tdim, cells, 2)
    middle = np.array([1.15, 0.5, 0.0 if plane else 0.25])
    assert whole.weight.sum() == pytest.approx(np.prod(high), rel=1e-12)
    assert whole.weight @ whole.x / whole.weight.sum() == pytest.approx(middle, abs=1e-12)
    for name, shift in (("x0", -1.0), ("x1", 1.0)):
        side = quadrature(mesh, mesh.tdim - 1, mesh.group(name)[mesh.tdim - 1], 2)
        slant = np.hypot(1.0, 0.3) * np.prod(high[2:])
        assert side.weight.sum() == pytest.approx(slant, rel=1e-12)
        centroid = side.weight @ side.x / side.weight.sum()
        assert centroid == pytest.approx(middle + shift * np.eye(3)[0], abs=1e-12)
