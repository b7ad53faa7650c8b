"""The direction of a site on a solid: into the material, or turned and told."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao

pytestmark = pytest.mark.fem
TOP, EDGE = (0.05, 0.04, 0.06), (0.05, 0.0, 0.06)


@pytest.fixture(scope="module")
def block():
    mesh = ao.box_mesh((0.1, 0.08, 0.06), size=0.02)
    return ao.Structure(mesh, ao.material("steel S235"), [ao.Support("-z")])


def displaced(part, direction):
    """The displacement of the site in space at the peak of the force."""
    model = ao.extract(part, ao.Site(TOP, direction, 0.021), n=6)
    hit = ao.simulate(model, ao.Sphere(0.01, material="steel S235", velocity=1.0), duration=1e-4)
    return hit.displacement[np.argmax(hit.force)] * np.array(model.direction)


@pytest.mark.slow
def test_a_direction_that_leaves_the_material_is_turned_and_told(block):
    inward = displaced(block, (0, 0, -1))
    assert inward[2] < 0
    with pytest.warns(ao.AntioscWarning, match="turned") as told:
        np.testing.assert_allclose(displaced(block, (0, 0, 1)), inward, rtol=1e-12)
    assert len(told) == 1


@pytest.mark.parametrize("direction", [(0, 1, 0), (0, 1, -1), (0, 0, -1)])
def test_a_direction_into_an_edge_is_kept(block, direction):
    with pytest.warns(ao.AccuracyWarning, match="point load") as told:
        model = ao.extract(block, ao.Site(EDGE, direction), n=6)
    assert len(told) == 1
    np.testing.assert_allclose(model.direction, np.array(direction) / np.linalg.norm(direction))
