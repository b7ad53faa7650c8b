"""Materials that crack before they yield: the tension of the part."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
import parts
from antiosc.base.stresses import largest_tension, tensors_of_components
from static_loads import held

pytestmark = pytest.mark.fem
LOW, HIGH = 45e6, 69e6


def block(material: ao.Solid) -> ao.Structure:
    """A block of 100 mm that stands on a face."""
    return ao.Structure(parts.box((4, 4, 4), (0.1, 0.1, 0.1)), material, [ao.Support("-z")])


def test_the_tension_is_the_largest_principal_stress():
    six = np.random.default_rng(3).standard_normal((50, 6))
    eigenvalues = np.linalg.eigvalsh(tensors_of_components(six))[:, -1]
    np.testing.assert_allclose(largest_tension(six), np.maximum(eigenvalues, 0), atol=1e-9)
    pressed = np.array([[-1.0, -2, -3, 0, 0, 0]])
    assert largest_tension(pressed) == 0


@pytest.mark.parametrize(
    ("share", "verdict"), [(0.5, "stays elastic"), (1.2, "may break"), (2.0, "breaks")]
)
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
    assert margin.sentence.startswith(f"it {verdict}")
    assert "Cracks are not computed" in margin.sentence
    assert "yield" not in margin.sentence
    with pytest.raises(ao.InputError, match="yield_strength"):
        ao.peak_field(part, hit, body="part").margin()


def test_a_brittle_part_is_judged_by_itself():
    from antiosc.fields.margin import criteria_of

    glass = ao.material("glass, soda-lime")
    assert criteria_of(block(glass)) == ["tension"]
    assert criteria_of(block(ao.material("steel S235"))) == ["von_mises"]
    assert ao.material("glass, soda-lime", yield_strength=1e9).tensile is None
