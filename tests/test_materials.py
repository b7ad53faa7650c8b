"""Materials by name: each number with its range and source, wherever a material is taken."""

import pytest

import antiosc as ao
from antiosc.base import materials, plausible
from antiosc.engine.contact.surfaces import Surface, ball

ALL = materials.names()
pytestmark = pytest.mark.fem


@pytest.mark.parametrize("name", ALL)
def test_every_material_is_plausible_and_has_a_source(name):
    one, made = materials.record(name), ao.material(name)
    assert plausible.material_doubt(made) == ""
    assert len(one.source) > 12
    assert one.brittle == (one.yield_strength is None) == (one.yield_range is None)
    if one.yield_range is not None:
        low, high = one.yield_range
        assert low <= one.yield_strength <= high
    assert not one.brittle or one.note or "nitride" in name
    keys = materials._table()["sources"]
    assert not any(f" {key} " in f" {one.source} " for key in keys)  # all are spelled out
    assert "(read at " in one.source or one.typical


def test_a_material_is_found_by_a_part_of_its_name_and_overridden():
    part = ao.material("6061", yield_strength=255e6, E=70e9)
    assert (part.E, part.yield_strength, part.yield_range) == (70e9, 255e6, None)
    assert part.name == "aluminium 6061-T6"
    assert ao.material("6061", yield_range=(200e6, 300e6)).yield_range == (200e6, 300e6)
    assert ao.material("PMMA").loss == 0.0
    assert ao.material("PMMA", loss=True).loss == 0.03


def test_the_family_follows_from_the_section():
    assert isinstance(ao.material("steel S235", thickness=2e-3), ao.Shell)
    bar = ao.material("steel S235", section=ao.Section.circle(0.01))
    assert isinstance(bar, ao.Beam)
    wood = ao.material("wood, Sitka spruce")
    assert isinstance(wood, ao.AnisotropicSolid)
    with pytest.raises(ao.InputError, match="directions"):
        ao.material("wood, Sitka spruce", E=1e9)


def test_a_striker_takes_a_material():
    ball_of = ao.Sphere(radius=0.01, material="bearing steel 100Cr6", velocity=2.0)
    steel = materials.record("100Cr6")
    assert (ball_of.E, ball_of.nu, ball_of.rho) == (steel.E, steel.nu, steel.rho)
    assert ball_of.surface() == ball(ball_of.material, 0.01)
    other = ao.Sphere(0.01, material=ao.Solid(70e9, 0.3, 2700.0, yield_strength=1e8), E=71e9)
    assert (other.E, other.material.yield_strength, other.rho) == (71e9, 1e8, 2700.0)
    tip = ao.RigidMass(0.2, 1.0, tip_radius=0.01, material="PA66 dry")
    assert tip.material.yield_range == materials.record("PA66 dry").yield_range
    assert ao.RigidMass(0.2, 1.0, tip_radius=0.01).surface() is None


@pytest.mark.parametrize(
    "arguments", [{}, {"E": 1e9}, {"material": "wood, Douglas-fir"}, {"material": 7.0}]
)
def test_a_sphere_needs_its_constants(arguments):
    with pytest.raises(ao.InputError):
        ao.Sphere(0.01, velocity=1.0, **arguments)


def test_a_surface_is_the_same_from_a_file():
    one = ao.Sphere(radius=0.01, material="steel S235").surface()
    assert Surface.of(one.as_dict()) == one
    for key, wrong in (("curvatures", [1.0]), ("matter", {"E": -1.0}), ("what", 1)):
        with pytest.raises(ao.InputError, match="damaged"):
            Surface.of(one.as_dict() | {key: wrong})
