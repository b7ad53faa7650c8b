"""Overlaps and misfits of cells are found wherever they are; rules on groups have their sizes."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("dolfinx")

from antiosc.fem.mesh import soundness
from antiosc.fem.mesh.surface import quadrature
from antiosc.fem.platform import compat
from antiosc.io.neutral import KINDS
from assemblies import box

pytestmark = pytest.mark.fem

RNG = np.random.default_rng(3)
SQUARE = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=float)
#: Corners of the cells.
CELLS = {
    "triangle": SQUARE[[0, 1, 3]],
    "quad": SQUARE,
    "tetra": np.vstack([np.zeros(3), np.eye(3)]),
    "hexahedron": np.vstack([np.pad(SQUARE, ((0, 0), (0, 1)), constant_values=z) for z in (0, 1)]),
}


@pytest.mark.sample
@pytest.mark.parametrize("name", CELLS)
def test_a_cell_inside_another_overlaps_it_wherever_it_is(name):
    x = CELLS[name]
    cells = np.arange(2 * len(x)).reshape(2, -1)
    shape = np.array([[0.9, 0.2, 0.1], [-0.1, 1.1, 0.3], [0.2, 0.1, 0.8]])[: x.shape[1]]
    small = 0.03 * (x - x.mean(axis=0))
    for _ in range(60):
        inside = RNG.dirichlet(np.full(len(x), 0.7)) @ x
        at = x.mean(axis=0) + 0.9 * (inside - x.mean(axis=0))
        for place, count in ((at, 1), (at + 1.2, 0)):
            points = np.vstack([x, small + place]) @ shape[:, : x.shape[1]]
            found = soundness.overlapping(points, cells, KINDS[name])
            assert len(found) >= count
            assert count or not len(found)


@pytest.mark.parametrize("name", ["quad", "hexahedron"])
def test_two_cells_with_two_sides_in_common_are_found(name):
    """A node of two cells alone: the side between the ends of both has a bend."""
    lower = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]])
    lower = np.vstack([lower[:3], [[4, 5, 9, 7], [5, 8, 7, 9]]])
    cells = lower if name == "quad" else np.hstack([lower, lower + 10])
    assert soundness.doublets(cells[:3], KINDS[name]).tolist() == []
    assert soundness.doublets(cells, KINDS[name]).tolist() == [3, 4]


#: Two cells of second order beside each other: (shape, points of the vertices, cells by these).
PAIRS = {
    "interval": (np.array([[0.0], [1], [2]]), [[0, 1], [1, 2]]),
    "triangle": (SQUARE, [[0, 1, 2], [0, 2, 3]]),
    "quadrilateral": (np.array([(x, y) for y in (0, 1) for x in (0, 1, 2.0)]),
                      [[0, 1, 3, 4], [1, 2, 4, 5]]),
    "tetrahedron": (np.vstack([np.zeros(3), np.eye(3), np.ones((1, 3))]),
                    [[0, 1, 2, 3], [1, 2, 3, 4]]),
    "hexahedron": (np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1, 2.0)]),
                   [[0, 1, 3, 4, 6, 7, 9, 10], [1, 2, 4, 5, 7, 8, 10, 11]]),
}  # fmt: skip


@pytest.mark.parametrize("shape", PAIRS)
def test_nodes_inside_sides_are_those_of_the_neighbours(shape):
    """Numbered by their places; then one node of a cell is a copy, a corner, or of another side."""
    x, cells = PAIRS[shape]
    between = compat.nodes_between(shape)
    corners = len(cells[0])
    places: dict[tuple[float, ...], int] = {tuple(p): k for k, p in enumerate(x)}
    whole = np.zeros((2, corners + len(between)), dtype=np.int64)
    whole[:, :corners] = cells
    for k, cell in enumerate(cells):
        for vertices, inside in between:
            middle = tuple(x[[cell[v] for v in vertices]].mean(axis=0))
            whole[k, inside] = places.setdefault(middle, len(places))
    assert not len(soundness.unlike_middles(whole, between))
    assert not len(soundness.unlike_middles(whole[:0], between))
    shared = [n for _, n in between if whole[0, n] in whole[1, corners:]]
    assert len(shared) == {"interval": 0, "triangle": 1, "quadrilateral": 1, "tetrahedron": 3,
                           "hexahedron": 5}[shape]  # fmt: skip
    for node in range(corners, whole.shape[1]):
        wrong = [whole[1, 0], whole[1, -1]] + [len(places)] * (node in shared)
        for other in wrong:
            if other == whole[0, node]:
                continue
            broken = whole.copy()
            broken[0, node] = other
            assert len(soundness.unlike_middles(broken, between)), (node, other)


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
