"""Placements and common polygons: rigid motions, areas by points, exact common parts."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("dolfinx")

from antiosc.fem.structure.placement import Placement, skew

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


def test_skew_is_the_cross_product():
    a, b = RNG.normal(size=(2, 6, 3))
    np.testing.assert_allclose(np.einsum("nij,nj->ni", skew(a), b), np.cross(a, b))
    np.testing.assert_allclose(skew(a[0]) @ b[0], np.cross(a[0], b[0]))
