"""Sizes, measures and sources of meshes against their definitions, written down cell by cell."""

from __future__ import annotations

from itertools import combinations
from math import factorial

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
from antiosc.fem import compat
from antiosc.fem.error.bisection import DIVIDED, divided, gathered, refined
from antiosc.fem.error.cell_sizes import edge_lengths, growth
from antiosc.fem.error.lines import inside, polygon
from antiosc.fem.error.remeshing import (
    LINES,
    graded_sizes,
    largest,
    measures,
    source_of,
    thickness_of,
    wished_sizes,
)
from antiosc.fem.readers.request import GRADING
from parts import box, frame, gmsh_cube, line, plate
from sheets import rectangle

pytestmark = pytest.mark.fem

RNG = np.random.default_rng(11)


def sheared(cell: str) -> ao.Mesh:
    """A box or a rectangle under a random affine map."""
    dim = 3 if cell == "tetrahedron" else 2
    mesh = box((3, 2, 2)[:dim], (0.3, 0.2, 0.2)[:dim], cell)
    x = mesh.dolfinx.geometry.x
    x[:, :dim] = x[:, :dim] @ (np.eye(dim) + 0.3 * RNG.normal(size=(dim, dim)))
    return mesh


def corners(mesh: ao.Mesh) -> np.ndarray:
    return mesh.dolfinx.geometry.x[compat.geometry_nodes(mesh.dolfinx)]


def measure(points: np.ndarray) -> float:
    """Length, area or volume of a simplex by Cayley and Menger's determinant."""
    k = len(points) - 1
    squares = ((points[:, None] - points) ** 2).sum(axis=2)
    bordered = np.ones((k + 2, k + 2))
    bordered[0, 0], bordered[1:, 1:] = 0.0, squares
    return float(np.sqrt((-1) ** (k + 1) * np.linalg.det(bordered) / 2**k) / factorial(k))


@pytest.mark.parametrize("cell", ["triangle", "tetrahedron"])
def test_measures_and_sizes_of_simplices(cell):
    mesh = sheared(cell)
    x, dim = corners(mesh), mesh.tdim
    volume = sum(measure(one) for one in x)
    sides = {}
    for one, nodes in zip(x, compat.geometry_nodes(mesh.dolfinx), strict=True):
        for some in combinations(range(dim + 1), dim):
            key = tuple(sorted(int(nodes[k]) for k in some))
            sides.setdefault(key, []).append(measure(one[list(some)]))
    surface = sum(found[0] for found in sides.values() if len(found) == 1)
    assert measures(mesh) == pytest.approx((volume, surface), rel=1e-9)
    assert thickness_of(mesh) == pytest.approx(2 * volume / surface, rel=1e-9)
    pairs = list(combinations(range(dim + 1), 2))
    edges = [np.mean([np.linalg.norm(one[a] - one[b]) for a, b in pairs]) for one in x]
    assert edge_lengths(mesh) == pytest.approx(np.array(edges), rel=1e-12)
    source = source_of(mesh)
    assert source.fixed == ""
    assert source.thickness() == thickness_of(mesh)
    low, high = x.min(axis=(0, 1)), x.max(axis=(0, 1))
    assert source.extent() == pytest.approx(np.linalg.norm(high - low), rel=1e-12)
    # sizes at corners: the least of those of the cells around
    ratio = RNG.uniform(0.2, 1.5, mesh.n_cells)
    wished = wished_sizes(mesh, ratio)
    points, cells, sizes = (np.array(a) for a in (wished.points, wished.cells, wished.sizes))
    middles = points[cells].mean(axis=1)
    order = [int(np.argmin(np.linalg.norm(middles - c, axis=1))) for c in x.mean(axis=1)]
    assert sorted(order) == list(range(mesh.n_cells))
    least = np.full(len(points), np.inf)
    for cell_number, own in zip(order, ratio * np.array(edges), strict=True):
        for k in cells[cell_number]:
            least[k] = min(least[k], own)
    assert sizes == pytest.approx(least, rel=1e-9)
    assert growth(mesh.comm, ratio, dim) == pytest.approx(np.mean(ratio**-dim), rel=1e-12)


@pytest.mark.parametrize("cell", ["quadrilateral", "hexahedron"])
def test_other_cells_are_used_as_they_are(cell):
    size = (0.3, 0.2, 0.1)[: 2 + (cell == "hexahedron")]
    mesh = box((3, 2, 2)[: len(size)], size, cell)
    source = source_of(mesh)
    assert f"{cell} cells are not divided" in source.fixed
    assert source.thickness() == pytest.approx(min(size))
    assert source.first(1e-3, [((0.1, 0.1, 0.0)[: len(size)], 1e-3)]) is mesh


def test_cells_around_points_have_the_sizes_of_the_points():
    """Of the first mesh: below 1/0.75 of the size asked at the distance of their middle."""
    mesh = plate((4, 3), (0.4, 0.3), "triangle")
    points = [((0.1, 0.1), 0.02), ((0.35, 0.2), 0.03)]
    rise, reach = GRADING

    def asked(one: ao.Mesh) -> np.ndarray:
        sizes = []
        for x in corners(one).mean(axis=1):
            at = [
                local + rise * max(np.hypot(x[0] - p[0], x[1] - p[1]) - reach * local, 0)
                for p, local in points
            ]
            sizes.append(min(at))
        return np.array(sizes)

    assert graded_sizes(mesh, points) == pytest.approx(asked(mesh), rel=1e-12)
    fine = source_of(mesh).first(1.0, points)
    assert fine.n_cells > 4 * mesh.n_cells
    assert (asked(fine) / edge_lengths(fine)).min() >= DIVIDED
    near = np.linalg.norm(corners(fine).mean(axis=1)[:, :2] - (0.1, 0.1), axis=1) < 0.03
    assert edge_lengths(fine)[near].max() < 0.02 / DIVIDED
    far = corners(fine).mean(axis=1)[:, 0] < 0.02
    assert edge_lengths(fine)[far].max() > 0.05
    assert source_of(mesh).first(1.0, []) is mesh
    whole = gathered(fine, edge_lengths(fine))
    assert whole.values == pytest.approx(edge_lengths(fine))
    np.testing.assert_allclose(
        np.sort(whole.points[whole.cells].mean(axis=1), axis=0),
        np.sort(corners(fine).mean(axis=1)[:, :2], axis=0),
    )


@pytest.mark.parametrize("cell", ["triangle", "tetrahedron"])
def test_children_have_the_wishes_of_their_parents(cell):
    """Wish times size is the parent's; cells without one are whole, groups keep their entities."""
    mesh = sheared(cell)
    whole = gathered(mesh, np.where(np.arange(mesh.n_cells) % 3, 1.0, 0.4))
    halves = divided(whole, cell)

    def sizes(pieces) -> np.ndarray:
        x, pairs = pieces.points[pieces.cells], list(combinations(range(mesh.tdim + 1), 2))
        return np.mean([np.linalg.norm(x[:, a] - x[:, b], axis=1) for a, b in pairs], axis=0)

    x, y = (one.points[one.cells] for one in (whole, halves))
    middle = y.mean(axis=1)
    square = np.swapaxes(x[:, 1:] - x[:, :1], 1, 2)
    local = np.linalg.solve(square, np.swapaxes(middle - x[:, :1], 1, 2))
    inside = (local.min(axis=1) > -1e-9) & (local.sum(axis=1) < 1 + 1e-9)
    assert (inside.sum(axis=0) == 1).all()
    parent = inside.argmax(axis=0)
    wished = whole.values * sizes(whole)
    assert halves.values * sizes(halves) == pytest.approx(wished[parent], rel=1e-9)
    for k, value in enumerate(whole.values):
        assert (parent == k).sum() > 1 or value == 1.0
    for name in mesh.groups:
        (rows,) = halves.groups[name].values()
        assert len(np.unique(np.sort(rows, axis=1), axis=0)) == len(rows)
        old = whole.points[np.unique(*whole.groups[name].values())]
        assert np.ptp(halves.points[np.unique(rows)], axis=0) == pytest.approx(np.ptp(old, axis=0))


def test_divided_triangles_in_space_keep_their_sides():
    mesh = rectangle(3, 1.0, 1.0)
    x = mesh.dolfinx.geometry.x
    x[:, 2] = 0.3 * x[:, 0]
    fine = refined(mesh, RNG.uniform(0.3, 1.0, mesh.n_cells))
    assert fine.n_cells > mesh.n_cells
    for one in (mesh, fine):
        p = corners(one)
        side = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]) @ np.array([-0.3, 0.0, 1.0])
        middles = p.mean(axis=1)
        signs = [
            (round(float(s), 12) > 0, tuple(np.floor(3 * m[:2]).astype(int)))
            for s, m in zip(side, middles, strict=True)
        ]
        if one is mesh:
            before = dict((where, sign) for sign, where in signs)
        assert all(before[where] == sign for sign, where in signs)


def test_lines_are_halved_until_they_are_short():
    """Eight on the diagonal, a node at the site, then as many halvings as the ratio asks for."""
    mesh = line(1.0, 3)
    source = source_of(mesh)
    assert (source.thickness(), source.fixed) == (0.0, "")
    assert source.extent() == pytest.approx(1.0)
    assert largest(mesh) == pytest.approx(1 / 3)
    first = source.first(0.5, [((0.4, 0.0), 0.01)])
    assert largest(first) <= 1 / LINES < 2 * largest(first)
    x = np.sort(first.dolfinx.geometry.x[:, 0])
    assert np.abs(x - 0.4).min() < 1e-12
    assert not inside(first, np.array([0.4, 0.0, 0.0]))
    assert inside(mesh, np.array([0.4, 0.0, 0.0]))
    assert not inside(mesh, np.array([1 / 3 + 2e-4, 0.0, 0.0]))
    for ratio, times in ((1.0, 1), (0.5, 1), (0.3, 2), (0.26, 2), (0.12, 3)):
        own = np.ones(first.n_cells)
        own[1] = ratio
        assert source.finer(first, own).n_cells == 2**times * first.n_cells
    assert source_of(mesh).first(0.5, []).n_cells == 12


GEOMETRY = """
Point(1) = {0, 0, 0}; Point(2) = {1, 0, 0}; Point(3) = {1, 0.5, 0};
Line(1) = {1, 2}; Line(2) = {2, 3}; Physical Curve("rods") = {1, 2};
"""


def test_geometries_of_lines_are_meshed_more_finely(tmp_path):
    path = tmp_path / "rods.geo"
    path.write_text(GEOMETRY)
    source = source_of(path)
    diagonal = np.hypot(1.0, 0.5)
    assert source.extent() == pytest.approx(diagonal)
    first = source.first(1.0, [((0.41, 0.0), 0.01)])
    assert 0.5 * diagonal / LINES < largest(first) <= 1.001 * diagonal / LINES
    assert not inside(first, np.array([0.41, 0.0, 0.0]))
    finer = source.finer(first, np.full(first.n_cells, 0.3))
    assert largest(finer) <= 1.001 * diagonal / LINES / 4
    assert not inside(finer, np.array([0.41, 0.0, 0.0]))
    assert edge_lengths(finer).sum() == pytest.approx(1.5)


BOXES = {
    2: ('SetFactory("OpenCASCADE"); Rectangle(1) = {0, 0, 0, 0.3, 0.2};', 0.06 * 4 / np.sqrt(3)),
    3: ('SetFactory("OpenCASCADE"); Box(1) = {0, 0, 0, 0.3, 0.2, 0.1};', 0.006 * 6 * np.sqrt(2)),
}


@pytest.mark.parametrize("dim", BOXES)
def test_the_first_mesh_of_a_geometry_has_some_thousand_regular_cells(dim, tmp_path, monkeypatch):
    text, regular = BOXES[dim]
    (tmp_path / "box.geo").write_text(text)
    source = source_of(tmp_path / "box.geo")
    assert source.extent() == pytest.approx(np.linalg.norm([0.3, 0.2, 0.1][:dim]))
    asked = []
    monkeypatch.setattr(source, "_meshed", lambda like, wished, grading: asked.append(wished))
    for size in (0.05, 1e-5):
        source.first(size, [])
    few = (regular / 6000) ** (1 / dim)
    assert asked[0].sizes == pytest.approx([0.05] * len(asked[0].sizes))
    assert asked[1].sizes == pytest.approx([few] * len(asked[1].sizes))


@pytest.mark.parametrize(("cell", "divided"), [("triangle", True), ("quadrilateral", False)])
def test_a_mesh_file_is_a_source(cell, divided, tmp_path):
    source = source_of(gmsh_cube(tmp_path / "cube.msh", cell))
    assert (source.fixed == "") == divided
    assert source.extent() == pytest.approx(np.sqrt(2))
    assert source.thickness() == pytest.approx(2 / 4 if divided else 1.0)


def test_corners_of_lines_that_may_stand_for_a_curve():
    """Sides of a regular polygon are one, corners of frames and straight lines are not."""

    def path(angle: float) -> ao.Mesh:
        turn = np.radians(angle) * np.arange(4)
        steps = np.column_stack([np.cos(turn), np.sin(turn)])
        x = np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])
        return frame(x, [(k, k + 1) for k in range(4)], 1)

    for angle in (0.21, 5.0, 22.9):
        assert f"angles of up to {angle:.2g}°" in polygon(path(angle))
    for angle in (0.0, 0.19, 23.1, 90.0):
        assert polygon(path(angle)) == ""
    star = frame([(0, 0), (1, 0), (-1, 0.1), (0, 1)], [(0, 1), (0, 2), (0, 3)], 1)
    assert polygon(star) == ""  # three at a node are a joint
