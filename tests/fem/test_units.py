"""Numbers in other units than SI are told of first: parts, materials, sizes, patches, blows."""

from __future__ import annotations

import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
import parts
from antiosc.base import plausible
from antiosc.base.errors import AntioscWarning
from paths import MESHES

pytestmark = pytest.mark.fem

CIRCLE = ao.Section.circle(0.02)
FOAM = ao.Layer.isotropic(E=1e5, nu=0.3, rho=48.0, thickness=20e-3)


@pytest.mark.parametrize(
    ("material", "held"),
    [
        (ao.Beam(E=210e3, nu=0.3, rho=7850.0, section=CIRCLE), "5.17 m/s.*E in MPa is probably"),
        (ao.Solid(E=210, nu=0.3, rho=7850.0), "0.164 m/s.*E in GPa is probably"),
        (ao.Solid(E=210e9, nu=0.3, rho=7.85e-9), r"5.17e\+09 m/s.*rho in t/mm³ is probably"),
    ],
)
def test_materials_that_cannot_be_are_refused(material, held):
    with pytest.raises(ao.InputError, match=held):
        plausible.of_material(material)


@pytest.mark.parametrize(
    ("material", "held"),
    [
        (ao.Shell(E=210e9, nu=0.3, rho=7.85, thickness=1e-3), r"1.64e\+05.*rho in g/cm³"),
        (ao.Solid(E=2.5e3, nu=0.3, rho=1200.0), "1.44 m/s.*E in MPa"),  # of plastics, or a gel
        (ao.Solid(E=210e3, nu=0.3, rho=7.85e-9), "E in MPa and rho in t/mm³"),
        (ao.Laminate([FOAM]), "45.6"),
    ],
)
def test_materials_that_may_be_are_told_of(material, held):
    with pytest.warns(AntioscWarning, match=rf"√\(E/ρ\) = .*{held}"):
        plausible.warn_each([plausible.of_material(material)])


def test_a_structure_in_other_units_is_told_of():
    with pytest.warns(AntioscWarning, match=r"210 m long, more than 20 m.*unit="):
        ao.Structure(
            parts.box(n=(2, 1, 1), size=(200.0, 50.0, 40.0)),
            ao.Solid(**parts.STEEL),
            [ao.Support("left")],
        )
    with pytest.raises(ao.InputError, match="Solid"):
        ao.Structure(parts.box(n=(2, 1, 1)), ao.Solid(210e3, 0.3, 7850.0), [ao.Support("left")])


def test_sizes_and_patches_larger_than_the_part_are_refused():
    with pytest.raises(ao.MeshError, match=r"size=5 m is larger.*0.08.* m.*size=0.005"):
        ao.read_mesh(MESHES / "bracket.step", size=5)
    part = ao.Structure(
        parts.box(n=(2, 1, 1)), ao.Solid(**parts.STEEL), [ao.Support("left")], order=1
    )
    site = ao.Site((0.1, 0.02, 0.04), (0, 0, -1), radius=4.0)
    with pytest.raises(ao.InputError, match=r"radius 4 m.*larger than the part.*0.004 m"):
        ao.extract(part, site, n=2)


def test_a_mesh_in_millimetres_is_blamed_before_its_facets():
    far = parts.box(n=(2, 1, 1), size=(16.0, 4.0, 4.0))  # not long enough to be told of itself
    part = ao.Structure(far, ao.Solid(**parts.STEEL), [ao.Support("left")], order=1)
    site = ao.Site((8.0, 2.0, 4.0), (0, 0, -1), radius=8e-4)
    with pytest.warns(AntioscWarning) as told:
        ao.extract(part, site, n=2)
    assert 'unit="mm"' in str(told[0].message)
    assert "facets" in str(told[1].message)


def soft(**info) -> ao.AntiOscillators:
    """A model whose patch is far too small for a hard blow."""
    return ao.AntiOscillators(
        m0=0.1, k0=1e7, m=[0.2], omega=[5e3], local_compliance=2e-9, radius=4e-3, info=info
    )


def ball(velocity: float) -> ao.Sphere:
    return ao.Sphere(0.01, 210e9, 0.3, 7850.0, velocity)


@pytest.mark.parametrize("run", ["simulate", "simulate_many", "scene"])
def test_what_is_implausible_is_blamed_before_the_patch(run):
    model, impactor = soft(doubts=["the part is odd."]), ball(2000.0)
    law = impactor.hertz(70e9, 0.33)

    def hit() -> object:
        if run == "scene":
            bodies = {"part": model, "ball": impactor}
            return ao.Scene(bodies, [ao.Contact("part", "ball", law)]).run(1e-4)
        return getattr(ao, run)(model, impactor, law, 1e-4)

    speed = "2000 m/s is faster than 100 m/s.*2 m/s is probably meant"
    with (
        pytest.warns(AntioscWarning, match=speed) as told,
        pytest.raises(ao.AccuracyError, match=f"the part is odd.*{speed}.*the peak force"),
    ):
        hit()
    assert "odd" not in str(told[0].message)  # it was told when the part was made


def test_stress_against_the_modulus():
    assert "0.39 E" in plausible.of_blow(soft(wave_speed=5.09), [ball(2.0)])
    assert plausible.of_blow(soft(wave_speed=5090.0), [ball(2.0)]) == ""
    with pytest.raises(ao.InputError, match="30 m/s is probably meant"):
        plausible.of_blow(soft(), [ball(3e4)])


def test_strengths_thicknesses_and_spheres_in_other_units_are_told_of():
    with pytest.warns(AntioscWarning, match="275e|2.75e"):
        plausible.warn_each([plausible.of_material(ao.Solid(**parts.STEEL, yield_strength=275.0))])
    with pytest.warns(AntioscWarning, match="larger than the part.*0.004"):
        plausible.warn_each([plausible.of_thickness(4.0, 0.2)])
    with pytest.warns(AntioscWarning, match="g/cm³"):
        ao.Sphere(0.01, 210e9, 0.3, rho=7.85)
    with pytest.warns(AntioscWarning, match="10 mm"):
        ao.Sphere(10.0, 210e9, 0.3, rho=7850.0)
    assert "7e+10 (70 GPa) or 7e+07 (70 MPa)" in plausible.of_modulus(70.0)
