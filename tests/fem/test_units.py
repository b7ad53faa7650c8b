"""Numbers in other units than SI are told of first: parts, materials, sizes, patches, blows."""

from __future__ import annotations

import pytest

import antiosc as ao
import parts
from antiosc.base import plausible
from paths import MESHES

CIRCLE = ao.Section.circle(0.02)
FOAM = ao.Layer.isotropic(E=1e5, nu=0.3, rho=48.0, thickness=20e-3)
STEEL, LEFT = ao.Solid(**parts.STEEL), [ao.Support("left")]


def bar(scale: float = 1.0, material: ao.Solid = STEEL, **options: int) -> ao.Structure:
    mesh = parts.box(n=(2, 1, 1), size=(0.2 * scale, 0.05 * scale, 0.04 * scale))
    return ao.Structure(mesh, material, LEFT, **options)


REFUSED = [
    (lambda: plausible.of_material(ao.Beam(210e3, 0.3, 7850.0, CIRCLE)), "E in MPa is probably"),
    (lambda: plausible.of_material(ao.Solid(210, 0.3, 7850.0)), "0.164 m/s.*E in GPa is probably"),
    (lambda: plausible.of_material(ao.Solid(210e9, 0.3, 7.85e-9)), "rho in t/mm³ is probably"),
    (lambda: bar(material=ao.Solid(210e3, 0.3, 7850.0)), "Solid"),
    (lambda: ao.read_mesh(MESHES / "bracket.step", size=5), "larger.*0.08.* m.*size=0.005"),
    (lambda: ao.extract(bar(order=1), ao.Site((0.1, 0.02, 0.04), (0, 0, -1), radius=4.0), n=2),
     "radius 4 m.*larger than the part.*0.004 m"),
    (lambda: plausible.of_blow(soft(), [ball(3e4)]), "30 m/s is probably meant"),
]  # fmt: skip


@pytest.mark.parametrize(("call", "words"), REFUSED)
def test_what_cannot_be_is_refused(call, words):
    with pytest.raises(ao.InputError, match=words):
        call()


def told(material: object) -> None:
    plausible.tell([plausible.of_material(material)])


TOLD = [
    (lambda: told(ao.Shell(210e9, 0.3, 7.85, thickness=1e-3)), r"1.64e\+05.*rho in g/cm³"),
    (lambda: told(ao.Solid(2.5e3, 0.3, 1200.0)), "1.44 m/s.*E in MPa"),  # of plastics, or a gel
    (lambda: told(ao.Solid(210e3, 0.3, 7.85e-9)), "E in MPa and rho in t/mm³"),
    (lambda: told(ao.Laminate([FOAM])), "45.6"),
    (lambda: told(ao.Solid(**parts.STEEL, yield_strength=275.0)), "275e|2.75e"),
    (lambda: bar(1e3), r"210 m long, more than 20 m.*unit="),
    (lambda: plausible.tell([plausible.of_thickness(4.0, 0.2)]), "larger than the part.*0.004"),
    (lambda: ao.Sphere(0.01, 210e9, 0.3, rho=7.85), "g/cm³"),
    (lambda: ao.Sphere(10.0, 210e9, 0.3, rho=7850.0), "10 mm"),
]


@pytest.mark.parametrize(("call", "words"), TOLD)
def test_what_may_be_is_told(call, words):
    with pytest.warns(ao.AntioscWarning, match=words):
        call()


def test_a_mesh_in_millimetres_is_blamed_before_its_facets():
    part = bar(80, order=1)  # not long enough to be told of itself
    with pytest.warns(ao.AntioscWarning) as told:
        ao.extract(part, ao.Site((8.0, 2.0, 3.2), (0, 0, -1), radius=8e-4), n=2)
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
    bodies = {"a": model, "b": impactor}
    speed = "2000 m/s is faster than 100 m/s.*2 m/s is probably meant"
    hit = {
        "simulate": lambda: ao.simulate(model, impactor, law, 1e-4),
        "simulate_many": lambda: ao.simulate_many(model, impactor, law, 1e-4),
        "scene": lambda: ao.Scene(bodies, [ao.Contact("a", "b", law)]).run(1e-4),
    }[run]
    with (
        pytest.warns(ao.AntioscWarning, match=speed) as told,
        pytest.raises(ao.AccuracyError, match=f"the part is odd.*{speed}.*the peak force"),
    ):
        hit()
    assert "odd" not in str(told[0].message)  # it was told when the part was made


def test_stress_against_the_modulus():
    assert "0.39 E" in plausible.of_blow(soft(wave_speed=5.09), [ball(2.0)])
    assert plausible.of_blow(soft(wave_speed=5090.0), [ball(2.0)]) == ""
    assert "7e+10 (70 GPa) or 7e+07 (70 MPa)" in plausible.of_modulus(70.0)
