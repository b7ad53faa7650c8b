"""Tables of the numbers of corners, edges and components, against those of Basix and VTK."""

from __future__ import annotations

from math import factorial

import meshio
import numpy as np
import pytest

pytest.importorskip("dolfinx")

import basix

from antiosc.fem.elements import anisotropic, material_axes, shell_strains
from antiosc.fem.error import gaps, projection, smooth_pieces
from antiosc.fem.mesh import conformity
from antiosc.fem.series import TYPES
from antiosc.fem.site import patches
from antiosc.fem.structure import attachments

pytestmark = pytest.mark.fem

SHAPES = {2: "interval", 3: "triangle", 4: "quadrilateral"}


def edges(shape: str) -> list[list[int]]:
    """Corners of the edges of a cell, in Basix's order."""
    return basix.topology(getattr(basix.CellType, shape))[1]


def test_edges_of_cells():
    for shape, own in attachments.SHEET_EDGES.items():
        assert [list(pair) for pair in own] == edges(shape)
    assert edges("triangle") == smooth_pieces.ENDS
    assert len(smooth_pieces.ENDS) == smooth_pieces.EDGES
    for corners in (3, 4):
        own = sorted(sorted(pair) for pair in gaps.FACET_SIDES[corners])
        assert own == sorted(sorted(pair) for pair in edges(SHAPES[corners]))
    assert gaps.FACET_SIDES[2] == [(0,), (1,)]


def test_corners_around_cells():
    """Neighbours in turn are the ends of an edge, and all edges are gone along once."""
    around = [*material_axes.CORNERS_IN_TURN.items()]
    around += [(SHAPES[n], turn) for n, turn in gaps.AROUND.items() if n > 2]
    for shape, turn in around:
        pairs = [sorted(pair) for pair in zip(turn, np.roll(turn, -1).tolist(), strict=True)]
        assert sorted(pairs) == sorted(edges(shape))
    assert gaps.AROUND[2] == [0, 1]


def test_simplices_fill_their_cells():
    """Corners around the bottom, then around the top: tetrahedra of one orientation."""
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
    cube = np.vstack([np.column_stack([square, np.full(4, z)]) for z in (0.0, 1.0)])
    rng = np.random.default_rng(2)
    for shape, x in (("quadrilateral", square), ("hexahedron", cube)):
        dim = x.shape[1]
        parts = [x[list(some)] for some in conformity._SIMPLICES[shape]]
        sizes = [np.linalg.det(p[1:] - p[0]) / factorial(dim) for p in parts]
        assert min(sizes) > 0
        assert sum(sizes) == pytest.approx(1)
        for point in rng.uniform(size=(20, dim)):
            inside = 0
            for p in parts:
                b = np.linalg.solve((p[1:] - p[0]).T, point - p[0])
                inside += bool(b.min() > 0 and b.sum() < 1)
            assert inside == 1


def test_components_of_strains():
    assert projection.STRAIN_PLACES[3] == list(anisotropic.VOIGT)
    voigt = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]
    assert list(anisotropic.VOIGT) == voigt
    assert projection.STRAIN_PLACES[2] == [pair for pair in voigt if 2 not in pair]


def test_exponents_of_polynomials():
    assert sorted(shell_strains.CUBIC) == [(r, 3 - r) for r in range(4)]
    assert sorted(shell_strains.QUADRATIC) == sorted((r, s) for r in range(3) for s in range(3 - r))


def test_kinds_of_cells_have_their_numbers_in_vtk():
    known = meshio._vtk_common.meshio_to_vtk_type
    for name, number in TYPES.items():
        assert number == known[name]


@pytest.mark.parametrize("count", [1, 2, 5, 12])
def test_rules_of_patches_are_exact(count):
    """Moments of Hertz's pressure on a disc, and on a segment (Catalan numbers)."""
    x, w = patches.segment(count)
    assert (x.shape, w.sum()) == ((count, 1), pytest.approx(1))
    for k in range(count):
        exact = factorial(2 * k) / factorial(k) / factorial(k + 1) / 4**k
        assert w @ x[:, 0] ** (2 * k) == pytest.approx(exact)
        assert w @ x[:, 0] ** (2 * k + 1) == pytest.approx(0, abs=1e-14)
    x, w = patches.disc(count)
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
