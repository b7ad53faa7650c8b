"""Tables of the numbers of corners, edges and components, against those of Basix and VTK."""

from __future__ import annotations

from math import factorial

import numpy as np
import pytest

from antiosc.fem.mesh import soundness
from antiosc.fem.site import sites


@pytest.mark.parametrize("count", [1, 2, 5, 12])
def test_rules_of_patches_are_exact(count):
    """Moments of Hertz's pressure on a disc, and on a segment (Catalan numbers)."""
    x, w = sites.segment(count)
    assert (x.shape, w.sum()) == ((count, 1), pytest.approx(1))
    for k in range(count):
        exact = factorial(2 * k) / factorial(k) / factorial(k + 1) / 4**k
        assert w @ x[:, 0] ** (2 * k) == pytest.approx(exact)
        assert w @ x[:, 0] ** (2 * k + 1) == pytest.approx(0, abs=1e-14)
    x, w = sites.disc(count)
    assert (x.shape, w.sum()) == ((2 * count**2, 2), pytest.approx(1))
    radial = 1.0  # 3 ∫ (1 - s²)^k s² ds
    for k in range(max(1, count - 1)):
        r = np.linalg.norm(x, axis=1)
        assert w @ r ** (2 * k) == pytest.approx(radial)
        for a in range(k + 1):
            b = k - a
            angular = factorial(2 * a) * factorial(2 * b) / (4**k * factorial(a) * factorial(b))
            angular /= factorial(k)
            assert w @ (x[:, 0] ** (2 * a) * x[:, 1] ** (2 * b)) == pytest.approx(radial * angular)
        assert w @ (x[:, 0] ** (2 * k) * x[:, 1]) == pytest.approx(0, abs=1e-14)
        radial *= (2 * k + 2) / (2 * k + 5)


def test_simplices_fill_their_cells():
    """Corners around the bottom, then around the top: tetrahedra of one orientation."""
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
    cube = np.vstack([np.column_stack([square, np.full(4, z)]) for z in (0.0, 1.0)])
    rng = np.random.default_rng(2)
    for shape, x in (("quadrilateral", square), ("hexahedron", cube)):
        dim = x.shape[1]
        parts = [x[list(some)] for some in soundness._SIMPLICES[shape]]
        sizes = [np.linalg.det(p[1:] - p[0]) / factorial(dim) for p in parts]
        assert min(sizes) > 0
        assert sum(sizes) == pytest.approx(1)
        for point in rng.uniform(size=(20, dim)):
            inside = 0
            for p in parts:
                b = np.linalg.solve((p[1:] - p[0]).T, point - p[0])
                inside += bool(b.min() > 0 and b.sum() < 1)
            assert inside == 1
