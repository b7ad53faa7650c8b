"""What else than the mesh a budget must tell: the patch's radius, facets of curved surfaces."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
from antiosc.fem.error.facets import faceted
from parts import STEEL, box, plate
from sheets import sheet

pytestmark = [
    pytest.mark.fem,
    pytest.mark.filterwarnings("ignore:the facets at the site:antiosc.errors.AccuracyWarning"),
]


def ring(n: int, cell: str) -> ao.Mesh:
    """A ring of n elements around a quarter turn, plane."""

    def polar(s, t):
        return (1 + s) * np.cos(np.pi / 2 * t), (1 + s) * np.sin(np.pi / 2 * t)

    return sheet((2, n), polar, cell)


@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_straight_cells_of_a_ring_are_facets(cell):
    text = faceted(ring(9, cell))
    assert "angles of up to 10°" in text
    assert "order=2" in text


def test_plane_faces_are_no_facets():
    assert faceted(plate((3, 2))) == ""
    assert faceted(box((2, 2, 2), cell="tetrahedron")) == ""
    assert faceted(box((2, 2, 2))) == ""


def test_facets_of_a_bent_block():
    mesh = box((6, 2, 2), (0.6, 0.1, 0.1), "tetrahedron")
    x = mesh.dolfinx.geometry.x
    x[:, 2] += 0.3 * x[:, 0] ** 2
    assert "curved surface" in faceted(mesh)


def test_second_radius_is_a_second_extraction():
    """The change of the part's compliance between two radii, from two models."""
    part = ao.Structure(box((6, 4, 2), (0.12, 0.08, 0.04)), ao.Solid(**STEEL), [ao.Support("left")])
    at = (0.08, 0.04, 0.04), (0, 0, -1)
    one = ao.extract(part, ao.Site(*at, radius=0.018), n=2, error="estimate")
    other = ao.extract(part, ao.Site(*at, radius=one.info["patch"]["radius"]), n=2)
    change = 1 / other.k0 - other.local_compliance - (1 / one.k0 - one.local_compliance)
    assert one.info["patch"]["radius"] == pytest.approx(0.018 * 2**0.5)
    assert one.info["patch"]["compliance"] == pytest.approx(change, rel=1e-6)


def test_a_patch_near_an_edge_takes_a_smaller_second_radius():
    part = ao.Structure(box((6, 4, 2), (0.12, 0.08, 0.04)), ao.Solid(**STEEL), [ao.Support("left")])
    site = ao.Site((0.08, 0.06, 0.04), (0, 0, -1), radius=0.019)
    assert ao.extract(part, site, n=2, error="estimate").info["patch"]["radius"] < 0.019


def test_plane_parts_have_no_half_space():
    part = ao.Structure(plate(), ao.Solid(**STEEL, plane="stress"), [ao.Support("left")])
    model = ao.extract(part, ao.Site((0.1, 0.06), (0, -1), radius=0.02), n=2, error="estimate")
    assert set(model.info["patch"]) == {"faces"}
    assert model.info["patch"]["faces"] == pytest.approx(0.025)
