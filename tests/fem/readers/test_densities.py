"""Densities of decks that are no densities in the units of the deck."""

from __future__ import annotations

import pytest

import abaqus_decks as inp
import antiosc as ao

#: Density in a deck of mm, N and MPa, of steel -> kg/m³, and the unit that is told.
STATED = {
    "7.85e-9": (7850.0, ""),
    "7850.": (7850.0, "kg/m³"),
    "7.85": (7850.0, "g/cm³"),
    "7.85e-6": (7850.0, "kg/mm³"),
    "7.698e-5": (7.698e-5 / 9806.65 * 1e12, "a weight per volume"),
    "1.": (1e12, ""),  # a placeholder, which is no density in any unit
}


@pytest.mark.parametrize("stated", STATED)
def test_a_density_that_no_solid_has_is_read_in_the_unit_that_is_meant(tmp_path, stated):
    text = inp.CUBE + inp.STEEL.replace("8.E-9", stated) + inp.SOLID
    model, deck = inp.read(tmp_path, text)
    density, words = STATED[stated]
    assert model["families"][0][2]["rho"] == pytest.approx(density, rel=1e-9)
    told = [sentence for sentence in deck.remarks if "more than any solid has" in sentence]
    assert len(told) == bool(words)
    assert not words or f"it is taken as {words}, 7850 kg/m³" in told[0]


def test_a_density_is_not_changed_beside_a_modulus_that_is_none_either(tmp_path):
    text = inp.CUBE + inp.STEEL.replace("2E5", "2E11").replace("8.E-9", "7850.") + inp.SOLID
    model, _ = inp.read(tmp_path, text)  # in SI units, read as mm
    assert model["families"][0][2]["rho"] == pytest.approx(7850e12)


@pytest.mark.parametrize(("modulus", "doubted"), [("7377.728", True), ("72350.", False)])
def test_a_modulus_in_kilograms_force_is_told(tmp_path, modulus, doubted):
    """A wing of aluminium in kgf/mm² and kg/mm³: its density was mended, its modulus not."""
    steel = inp.STEEL.replace("2E5", modulus).replace("8.E-9", "2.82e-6")
    _, deck = inp.read(tmp_path, inp.CUBE + steel + inp.SOLID)
    told = [sentence for sentence in deck.remarks if "kgf per area" in sentence]
    assert len(told) == doubted
    assert not doubted or "7.38 GPa" in told[0]
    assert not doubted or "72.4 GPa" in told[0]
    assert not doubted or "'mm-kgf'" in told[0]


@pytest.mark.parametrize(
    ("modulus", "density", "strength", "rate"),
    [
        ("2.1E5", "7.85e-9", 240e6, (6844, 3.91, 430e6 * 240 / 275)),  # as S275, which grows most
        ("2.1E5", "7.85e-9", 700e6, (3200, 5)),  # as S690
        ("7E4", "2.7e-9", 240e6, None),  # the growth of aluminium is not known
    ],
)
def test_a_strength_that_is_given_grows_as_that_of_its_kind(
    tmp_path, modulus, density, strength, rate
):
    """A steel of 235 MPa of a deck had a bar of 6.5 %, S235 by name one of 23 %."""
    path = tmp_path / "cube.inp"
    steel = inp.STEEL.replace("2E5", modulus).replace("8.E-9", density)
    path.write_text(inp.CUBE + steel + inp.SOLID, encoding="utf-8")
    part = ao.read_model(path, unit="mm", yield_strength=strength)
    ((material, _),) = part.matrices.parts
    assert material.rate == (rate and pytest.approx(rate))
