"""Materials that crack before they yield: the tension beside the contact, and that of the part."""

from __future__ import annotations

import re

import numpy as np
import pytest

import antiosc as ao
import parts
from antiosc.base.stresses import tension, tensors_of
from static_loads import held

pytestmark = pytest.mark.fem
LOW, HIGH = 45e6, 69e6


def block(material: ao.Solid) -> ao.Structure:
    """A block of 100 mm that stands on a face."""
    return ao.Structure(parts.box((4, 4, 4), (0.1, 0.1, 0.1)), material, [ao.Support("-z")])


def struck(part: ao.Structure, speed: float) -> ao.History:
    model = ao.extract(part, ao.Site((0.05, 0.05, 0.1), (0, 0, -1), radius=0.026), n=6)
    ball = ao.Sphere(0.01, material="bearing steel 100Cr6", velocity=speed)
    return ao.simulate(model, ball, duration=2e-4)


@pytest.mark.parametrize(("speed", "verdict"), [(1.0, "may crack there"), (1e-3, "no crack is")])
def test_a_brittle_part_has_hertz_s_tension_at_the_rim_of_the_contact(speed, verdict):
    """(1 - 2 nu)/3 of the largest pressure, which `contact_stress` finds from E and nu."""
    glass = ao.material("glass, soda-lime")
    hit = struck(block(glass), speed)
    pressure = ao.contact_stress(hit.impactor, hit.peak_force, glass.E, glass.nu).pressure
    told = re.search(r"the rim of the contact is ([\d.]+) (MPa|kPa)", hit.verdict)
    found = float(told[1]) * {"MPa": 1e6, "kPa": 1e3}[told[2]]
    assert found == pytest.approx((1 - 2 * glass.nu) / 3 * pressure, rel=0.01)
    assert verdict in hit.verdict
    assert "45.0 MPa to 69.0 MPa" in hit.verdict
    assert "cracks are not computed" in hit.verdict
    assert "stays elastic" in hit.verdict  # the ball


def test_a_ball_that_yields_on_alumina_has_the_tension_of_its_dent():
    """F / (pi a^2) (1 - 2 nu)/2 with the dent's radius a."""
    alumina = ao.material("alumina 99.9 %")
    part = block(alumina)
    model = ao.extract(part, ao.Site((0.05, 0.05, 0.1), (0, 0, -1), radius=0.026), n=6)
    ball = ao.Sphere(0.01, material="steel S235", velocity=5.0)
    hit = ao.simulate(model, ball, duration=2e-4)
    told = float(re.search(r"rim of the contact is ([\d.]+) MPa", hit.verdict)[1])
    mean = hit.peak_force / (np.pi * hit.dent.radius**2)
    assert told == pytest.approx(1e-6 * (1 - 2 * alumina.nu) / 2 * mean, rel=0.01)


def test_a_part_of_metal_has_no_word_on_cracks():
    hit = struck(block(ao.material("steel S235")), 1.0)
    assert "crack" not in hit.verdict


def test_the_tension_is_the_largest_principal_stress():
    six = np.random.default_rng(3).standard_normal((50, 6))
    eigenvalues = np.linalg.eigvalsh(tensors_of(six))[:, -1]
    np.testing.assert_allclose(tension(six), np.maximum(eigenvalues, 0), atol=1e-9)
    pressed = np.array([[-1.0, -2, -3, 0, 0, 0]])
    assert tension(pressed) == 0


@pytest.mark.parametrize(("share", "verdict"), [(0.5, "is not"), (1.2, "may be"), (2.0, "is")])
def test_the_bending_tension_of_a_strip_is_judged_by_its_strength_in_bending(share, verdict):
    """F L / W at the clamp, over the range of the strength."""
    solid = ao.Solid(
        70e9, 0.0, 2500.0, plane="stress", thickness=0.01, brittle=True, tensile=(LOW, HIGH)
    )
    part = ao.Structure(parts.plate((20, 4), (0.2, 0.02)), solid, [ao.Support("left")])
    force = share * LOW * 0.01 * 0.02**2 / (6 * 0.2)
    part, hit = held(part, ao.Site((0.2, 0.01), (0, -1), radius=6e-3), force)
    peak = ao.peak_field(part, hit, "tension", body="part")
    margin = peak.margin()
    assert margin.value == pytest.approx(share * LOW, rel=0.02)
    assert (margin.criterion, margin.strength) == ("tension", LOW)
    assert margin.strength_range == (LOW, HIGH)
    assert margin.sentence.startswith(f"the strength in tension {verdict} reached")
    assert "Cracks are not computed" in margin.sentence
    assert "yield" not in margin.sentence
    with pytest.raises(ao.InputError, match="yield_strength"):
        ao.peak_field(part, hit, "yield", body="part")


def test_a_brittle_part_is_judged_by_itself():
    from antiosc.extension import criteria_of

    glass = ao.material("glass, soda-lime")
    assert criteria_of(block(glass)) == ["tension"]
    assert criteria_of(block(ao.material("steel S235"))) == ["von_mises"]
    assert ao.material("glass, soda-lime", yield_strength=1e9).tensile is None


def test_a_fall_on_a_corner_of_glass_tells_the_tension_there():
    """The mean pressure of its Hertz contact of a ball of the corner's radius on a rigid floor."""
    glass = ao.material("glass, soda-lime")
    part = ao.Structure(ao.box_mesh((0.06, 0.04, 0.02), size=0.01), glass)
    fall = ao.drop(part, height=0.05, tilt=(10, 5, 0), until=1, modes=10, corner_radius=2e-3)
    told = float(re.search(r"rim of the contact is ([\d.]+) GPa", fall.summary())[1])
    ball = ao.RigidMass(1.0, 1.0, tip_radius=2e-3, E=glass.E, nu=glass.nu)
    force = float(fall.impacts.column("peak_force")[0])
    pressure = ao.contact_stress(ball, force, 1e20, 0.3).pressure
    assert told == pytest.approx(1e-9 * (1 - 2 * glass.nu) / 3 * pressure, rel=0.02)
    assert "(45.0 MPa to 69.0 MPa): it may crack there" in fall.summary()
