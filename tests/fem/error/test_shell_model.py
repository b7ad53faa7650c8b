"""The share "model" of shells on meshes: their data, and bars that hold a plate in space."""

from __future__ import annotations

from dataclasses import replace
from math import sqrt

import pytest

import antiosc as ao
from antiosc.impact.histories.bars import QUANTITIES
from antiosc.models.closed_form import plate_patch
from exact_plates import Plate, layer

pytestmark = pytest.mark.fem
GLASS = {"E": 70e9, "nu": 0.22, "rho": 2500.0}
SIDES, H = (0.3, 0.2), 8e-3
BALL = ao.Sphere(0.01, 210e9, 0.3, 7850.0, velocity=1.0)
RIM = "".join(f'Physical Curve("{n}") = {{{n}}};' for n in (1, 2, 3, 4))


@pytest.fixture(scope="module")
def mesh(tmp_path_factory):
    path = tmp_path_factory.mktemp("plate") / "plate.geo"
    path.write_text(
        f'SetFactory("OpenCASCADE"); Rectangle(1) = {{0, 0, 0, {SIDES[0]}, {SIDES[1]}}};\n'
        'Physical Surface("plate") = {1}; Physical Curve("rim") = {1, 2, 3, 4};\n'
    )
    return ao.read_mesh(path, size=0.014, gdim=3)


def supported(mesh, material) -> ao.Structure:
    return ao.Structure(mesh, material, [ao.Support("rim", ("x", "y", "z"))])


def site(direction=(0, 0, -1), **more) -> ao.Site:
    return ao.Site((SIDES[0] / 2, SIDES[1] / 2, 0), direction, **more)


@pytest.mark.slow
def test_a_blow_on_a_glass_plate_is_within_its_bars(mesh):
    """A shell makes a ball of 10 mm rebound too fast, beyond the error of its mesh."""
    part = supported(mesh, ao.Shell(**GLASS, thickness=H))
    model = ao.extract(part, site(), n=60, error="estimate")
    modulus = 1 / ((1 - 0.22**2) / 70e9 + (1 - 0.3**2) / 210e9)
    law = ao.Hertz(4 / 3 * modulus * sqrt(0.01))
    hit = ao.simulate(model, BALL, law, 2e-4)
    plate = Plate(*GLASS.values(), H, *SIDES, SIDES[0] / 2, SIDES[1] / 2)
    exact = ao.simulate(layer(plate), BALL, law, 2e-4)
    budget = hit.error_budget
    for name in QUANTITIES:
        off = abs(getattr(exact, name) / getattr(hit, name) - 1)
        bar = budget[name]
        assert bar.total - bar.model < off < bar.total < 4 * off
    assert "mesh" not in budget.unknown
    assert not any("radius" in note for note in budget.notes)  # of the disc: in the model's share
    off = hit.restitution - exact.restitution
    below, above = budget.restitution_sides
    assert 0 < off < below == above < 4 * off

    patch = plate_patch(GLASS["E"], GLASS["nu"], H)
    narrow = ao.extract(part, site(radius=patch.radius), n=60, error="estimate")
    hit = ao.simulate(replace(narrow, local_compliance=patch.local_compliance), BALL, law, 2e-4)
    for name in QUANTITIES:
        off = abs(getattr(exact, name) / getattr(hit, name) - 1)
        assert off < hit.error_budget[name].total < 0.5 * budget[name].total


@pytest.mark.slow
def test_shells_without_a_figure_say_so(mesh):
    ply = ao.Layer(130e9, 9e9, 0.3, 5e9, 5e9, 3.5e9, 1600.0, H / 2)
    laminate = supported(mesh, ao.Laminate([ply, ply], axis=(1, 0, 0)))
    model = ao.extract(laminate, site(), n=3, error="estimate")
    assert "isotropic" in model.info.model
    shell = supported(mesh, ao.Shell(**GLASS, thickness=H))
    slanted = ao.extract(shell, site((0.6, 0, -0.8)), n=3, error="estimate")
    assert "across" in slanted.info.model
    straight = ao.extract(shell, site(radius=0.01), n=3, error="estimate")
    assert straight.info.model["disc"] == pytest.approx(0.01 / H)
