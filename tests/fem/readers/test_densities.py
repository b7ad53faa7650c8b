"""Densities of decks that are no densities in the units of the deck."""

from __future__ import annotations

import pytest

import abaqus_decks as inp
import antiosc as ao
from refusals import refused


@pytest.mark.parametrize("stated", ["7850.", "7.85", "7.698e-5"])
def test_a_density_that_no_solid_has_is_refused_with_its_number(tmp_path, stated):
    """In kg/m³, in g/cm³, or a weight, in a deck of mm, N and t."""
    text = inp.CUBE + inp.STEEL.replace("8.E-9", stated) + inp.SOLID
    with refused(None, f"{float(stated) * 1e12:.3g}", ao.MeshError):
        inp.read(tmp_path, text)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("modulus", "strength", "rate"),
    [("2.1E5", 275e6, (6844, 3.91, 430e6)), ("2.1E5", "S690", (3200, 5)), ("7E4", 240e6, None)],
)
def test_a_strength_of_a_steel_grows_with_the_strain_rate(tmp_path, modulus, strength, rate):
    """A steel of 235 MPa of a deck had a bar of 6.5 %, S235 by name one of 23 %."""
    path = tmp_path / "cube.inp"
    path.write_text(inp.CUBE + inp.STEEL.replace("2E5", modulus) + inp.SOLID, encoding="utf-8")
    part = ao.read_model(path, unit="mm", yield_strength=strength)
    ((material, _),) = part.matrices.parts
    assert material.rate == rate
