"""The largest ball that touches a site alone: an angle in closed form; a larger one is told."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

import antiosc as ao
from antiosc.fem.mesh.room import largest_ball
from antiosc.models.auto_contact import piercing
from antiosc.reduce.site.surface import surface_at
from antiosc_app.headline import caution_of

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


def test_a_low_post_near_the_patch_is_met():
    """A post of height h at a distance D meets balls of (D² + h²)/2h or more."""
    side = np.linspace(-5e-3, 5e-3, 41)
    x, y = (grid.ravel() for grid in np.meshgrid(side, side))
    height = np.where(x > 2.7e-3, 1.5e-3, 0.0)
    at = np.column_stack((x, y, height))
    mesh = SimpleNamespace(comm=MPI.COMM_SELF)
    faces = SimpleNamespace(samples=at, centres=at, sizes=np.full(len(at), 2.5e-4), mesh=mesh)
    ball, met = largest_ball(faces, np.zeros(3), np.array([0.0, 0.0, 1.0]), 1.9e-3)
    D, h, _ = np.abs(met[[0, 2, 1]])
    assert (D, h) == pytest.approx((2.75e-3, 1.5e-3))
    assert (D**2 + h**2) / (2 * h) <= ball <= 1.15 * (D**2 + h**2) / (2 * h)


def test_any_ball_touches_an_outer_face_alone(angle):
    point, direction = np.array([0.03, 0.02, 0.0]), np.array([0.0, 0.0, 1.0])
    assert surface_at(angle, point, direction, 1e-3).largest_ball == np.inf


@pytest.mark.slow
def test_a_part_of_an_assembly_is_turned(angle):
    turned = ao.Placement(shift=(0.5, 0.0, 0.0), axis=(0, 0, 1), angle=np.pi / 2)
    whole = ao.assemble({"angle": angle}, at={"angle": turned})
    surface = surface_at(whole, np.array([0.48, 0.025, 0.01]), np.array([0.0, 0.0, -1.0]), 1e-3)
    assert surface.largest_ball == pytest.approx(0.0158, rel=0.1)  # to the wall at y = 10 mm
    assert surface.meets == pytest.approx([0.48, 0.01, 0.025], abs=3e-3)


@pytest.mark.slow
def test_a_ball_that_pierces_the_part_is_told(angle):
    site = ao.Site((0.02, 0.02, 0.01), (0, 0, -1), radius=5e-3)
    model = ao.extract(angle, site, n=4)
    sound, large = (
        ao.Sphere(radius=radius, material="steel S235", velocity=0.2) for radius in (8e-3, 0.02)
    )
    assert piercing(model, sound) == ""
    sentence = piercing(model, large)
    assert "20.0 mm, pierces the part at (10, " in sentence
    assert piercing(large, model, ("", "")) == sentence
    hit = ao.simulate(model, large, duration=2e-4)
    assert caution_of(hit, None).startswith(sentence)
