"""The triangles of a map's surface."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
import parts
from antiosc.fem.site.map_sites import surface

pytestmark = pytest.mark.fem


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_the_triangles_of_a_body_cover_its_surface_once(cell):
    """Every edge lies in two of them, and their areas add up to that of the box."""
    sides = (0.12, 0.05, 0.04)
    part = ao.Structure(parts.box((3, 2, 2), sides, cell), ao.Solid(**parts.STEEL), order=1)
    found = surface(part.matrices, None)
    triangles = found.elements.tolist()
    edges = Counter(frozenset(pair) for a, b, c in triangles for pair in ((a, b), (b, c), (c, a)))
    assert set(edges.values()) == {2}
    x = found.points[found.elements]
    areas = np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1) / 2
    a, b, c = sides
    assert areas.sum() == pytest.approx(2 * (a * b + b * c + c * a), rel=1e-12)
