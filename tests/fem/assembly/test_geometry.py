"""Placements and common polygons: rigid motions, areas by points, exact common parts."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse

pytest.importorskip("dolfinx")

from antiosc.base.errors import InputError
from antiosc.fem.assembly import ends, overlaps
from antiosc.fem.structure.placement import Placement, placement, skew

pytestmark = pytest.mark.fem

RNG = np.random.default_rng(8)


@pytest.mark.parametrize("scale", [1.0, 1e-3, 40.0])
def test_a_placement_is_a_rigid_motion(scale):
    axis = np.array([0.3, -0.5, 0.7])
    place = Placement((1, 2, 3), tuple(scale * axis), 0.8, (0.1, 0.2, 0.3))
    R = place.rotation
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(R) == pytest.approx(1)
    np.testing.assert_allclose(R @ axis, axis, atol=1e-15)
    assert np.trace(R) == pytest.approx(1 + 2 * np.cos(0.8))
    # by the right hand: the part of a × R a along the axis is positive
    a = np.array([1.0, 0.0, 0.0])
    assert np.cross(a, R @ a) @ axis > 0
    x = RNG.normal(size=(5, 3))
    np.testing.assert_allclose(place.own(place.placed(x)), x, atol=1e-14)
    np.testing.assert_allclose(place.placed(np.array([[0.1, 0.2, 0.3]])), [[1.1, 2.2, 3.3]])
    moved = place.placed(x)
    np.testing.assert_allclose(np.diff(moved, axis=0), np.diff(x, axis=0) @ R.T, atol=1e-14)


@pytest.mark.parametrize("turns", [1, 2, 3, -1])
def test_quarter_turns_are_exact(turns):
    R = Placement(axis=(0, 0, 2), angle=turns * np.pi / 2).rotation
    assert set(np.unique(R)) <= {-1.0, 0.0, 1.0}
    np.testing.assert_allclose(
        R[:2, 0], [np.cos(turns * np.pi / 2), np.sin(turns * np.pi / 2)], atol=1e-15
    )


def test_placements_by_numbers():
    assert placement("a", None) == Placement()
    assert placement("a", (1, 2)) == Placement((1, 2, 0))
    with pytest.raises(InputError, match=r"at\['a'\] must be a translation"):
        placement("a", "here")
    with pytest.raises(InputError, match="axis must not be the zero vector"):
        Placement(axis=(0, 0, 0))


def test_skew_is_the_cross_product():
    a, b = RNG.normal(size=(2, 6, 3))
    np.testing.assert_allclose(np.einsum("nij,nj->ni", skew(a), b), np.cross(a, b))
    np.testing.assert_allclose(skew(a[0]) @ b[0], np.cross(a[0], b[0]))


def area(polygon: np.ndarray) -> float:
    x, y = polygon.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def inside(points: np.ndarray, polygon: np.ndarray) -> np.ndarray:
    edges = np.roll(polygon, -1, axis=0) - polygon
    away = points[:, None] - polygon
    return (edges[:, 0] * away[..., 1] - edges[:, 1] * away[..., 0] >= 0).all(axis=1)


def convex(n: int, corners: int) -> np.ndarray:
    """Convex polygons around points near the origin, counterclockwise."""
    angle = np.sort(RNG.uniform(0, 2 * np.pi, (n, corners)), axis=1)
    radius = RNG.uniform(0.5, 1.5, (n, 1))
    circle = radius[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return circle + RNG.normal(scale=0.5, size=(n, 1, 2))


@pytest.mark.sample
@pytest.mark.parametrize(("v", "w"), [(3, 3), (4, 3), (4, 4)])
def test_common_polygons_have_the_area_of_common_points(v, w):
    first, second = convex(20, v), convex(20, w)
    vertices, count = overlaps.clipped(first, second)
    grid = np.stack(np.meshgrid(*2 * [np.linspace(-3.5, 3.5, 200)]), axis=-1).reshape(-1, 2)
    cell = (7 / 199) ** 2
    for k in range(20):
        exact = cell * (inside(grid, first[k]) & inside(grid, second[k])).sum()
        found = area(vertices[k, : count[k]]) if count[k] > 2 else 0.0
        assert found == pytest.approx(exact, abs=0.05)
    swapped, number = overlaps.clipped(second, first)
    for k in range(20):
        both = [
            area(x[k, : c[k]]) if c[k] > 2 else 0.0
            for x, c in ((vertices, count), (swapped, number))
        ]
        assert both[0] == pytest.approx(both[1], abs=1e-12)


def test_a_square_in_a_larger_one_and_beside_it():
    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    cases = np.stack(
        [square, square + np.array([0.5, 0.25]), square + np.array([3, 0]), 0.5 * square + 0.2]
    )
    vertices, count = overlaps.clipped(cases, np.stack([square] * 4))
    found = [area(vertices[k, :c]) if c > 2 else 0.0 for k, c in enumerate(count)]
    assert found == pytest.approx([1, 0.5 * 0.75, 0, 0.25])


@pytest.mark.parametrize("plane", [False, True])
def test_the_mean_motion_of_points_that_move_as_a_rigid_body_is_that_motion(plane):
    """Of any points and weights: the translation of their centroid, and the rotation."""
    count = 7
    x = RNG.normal(size=(count, 3)) * [1.0, 0.4, 0.0 if plane else 0.2]
    weight = RNG.uniform(0.1, 1.0, count)
    rigid = np.hstack([np.tile(np.eye(3), (count, 1)), -skew(x).reshape(-1, 3)])
    if plane:  # x, y, rz alone
        rigid[:, [2, 3, 4]] = 0.0

    class Rigid:
        """A part whose dofs are its six rigid motions about the origin."""

        has_rotations = False

        def at_points(self, *_):
            return scipy.sparse.csr_matrix(rigid)

    layout = Rigid()
    layout.plane = plane
    points = SimpleNamespace(x=x, weight=weight, cell=None, X=None)
    found = ends.mean(layout, layout, points)
    centre = weight @ x / weight.sum()
    at_centre = np.hstack([np.eye(3), -skew(centre)])
    rotation = np.hstack([np.zeros((3, 3)), np.eye(3)])
    if plane:
        at_centre[:, [2, 3, 4]] = rotation[:, [2, 3, 4]] = 0.0
    np.testing.assert_allclose(found.displacements.toarray(), at_centre, atol=1e-14)
    np.testing.assert_allclose(found.rotations.toarray(), rotation, atol=1e-13)
