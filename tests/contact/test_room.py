"""The largest ball that touches a site alone: an angle in closed form; a larger one is told."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.models.body import piercing_warning
from antiosc.reduce.site.surface import surface_at
from antiosc_app.headline import caution_of_impact

pytestmark = pytest.mark.fem
#: A base of 60 × 40 × 10 mm with a wall at x < 10 mm, 40 mm high.
ANGLE = """\
SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 0.06, 0.04, 0.01};
Box(2) = {0, 0, 0.01, 0.01, 0.04, 0.03};
BooleanUnion{ Volume{1}; Delete; }{ Volume{2}; Delete; }
"""


@pytest.fixture(scope="module")
def angle(tmp_path_factory):
    path = tmp_path_factory.mktemp("room") / "angle.geo"
    path.write_text(ANGLE, encoding="utf-8")
    mesh = ao.read_mesh(path, size=4e-3)
    bottom = ao.Support(plane=((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)))
    return ao.Structure(mesh, ao.material("steel S235"), [bottom])


@pytest.mark.parametrize("distance", [0.008, 0.015, 0.02])
def test_a_ball_beside_a_wall_is_at_most_as_large_as_its_distance(angle, distance):
    point = np.array([0.01 + distance, 0.02, 0.01])
    surface = surface_at(angle, point, np.array([0.0, 0.0, -1.0]), 1e-3)
    assert distance <= surface.largest_ball <= 1.15 * distance
    assert surface.meets is not None
    assert surface.meets[0] == pytest.approx(0.01, abs=1e-9)


@pytest.mark.slow
def test_a_ball_that_pierces_the_part_is_told(angle):
    site = ao.Site((0.02, 0.02, 0.01), (0, 0, -1), radius=5e-3)
    model = ao.extract(angle, site, n=4)
    sound, large = (
        ao.Sphere(radius=radius, material="steel S235", velocity=0.2) for radius in (8e-3, 0.02)
    )
    assert piercing_warning(model, sound) == ""
    sentence = piercing_warning(model, large)
    assert "20.0 mm, pierces the part at (10, " in sentence
    assert piercing_warning(large, model, ("", "")) == sentence
    hit = ao.simulate(model, large, duration=2e-4)
    assert caution_of_impact(hit, None).startswith(sentence)
