"""Frequencies of beams in closed form against textbooks and a spectral discretisation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from antiosc.closed_form import (
    UniformBeam,
    free_free,
    pinned_pinned,
)
from spectral_beam import SpectralBeam
from struck_beams import SLENDER, SUPPORTS, THICK, UNIT, hinged_roots, struck


@pytest.mark.sample
@pytest.mark.parametrize(
    ("ends", "equation"),
    [
        (("clamped", "free"), lambda z: np.cos(z) + 1 / np.cosh(z)),
        (("pinned", "free"), lambda z: np.sin(z) - np.cos(z) * np.tanh(z)),
        (("free", "free"), lambda z: np.cos(z) - 1 / np.cosh(z)),
        (("clamped", "clamped"), lambda z: np.cos(z) - 1 / np.cosh(z)),
        (("clamped", "pinned"), lambda z: np.sin(z) - np.cos(z) * np.tanh(z)),
        (("pinned", "pinned"), np.sin),
    ],
)
def test_slender_beams_have_the_textbook_frequencies(ends, equation):
    z = np.linspace(1.0, 100.0, 9901)
    f = equation(z)
    brackets = np.nonzero(f[1:] * f[:-1] < 0)[0]
    betas = np.array([brentq(equation, z[i], z[i + 1], xtol=1e-13) for i in brackets])[:30]
    place = 0.29 if ends[0] == ends[1] else 0.61
    found = np.sqrt(struck(UNIT, (*ends, place)).natural_frequencies(30))
    np.testing.assert_allclose(found, betas, rtol=1e-10)


@pytest.mark.parametrize("beam", [SLENDER, THICK], ids=["slender", "thick"])
def test_hinged_beam_fulfils_the_articles_equation_in_both_spectra(beam):
    """None of 200 is missed, above the cut-off either (where the pure shear mode joins)."""
    roots = hinged_roots(beam, np.arange(1, 400), beam.alpha)
    expected = np.sort(np.append(roots, beam.cutoff))[:200]
    assert expected[-1] > beam.cutoff
    found = pinned_pinned(beam, 0.41 * beam.length).natural_frequencies(200)
    np.testing.assert_allclose(found, expected, rtol=1e-9)


@pytest.mark.slow
def test_slender_limit_is_euler_bernoulli_with_order_two():
    errors = []
    exact = free_free(UNIT, 0.3).anti_oscillators(5)
    for slenderness in (400.0, 800.0, 1600.0):
        rhoI = slenderness**-2.0
        found = free_free(UniformBeam(1.0, 1.0, 1.0, 1 / (3 * rhoI), rhoI), 0.3).anti_oscillators(5)
        errors.append(
            [np.abs(found.omega / exact.omega - 1).max(), np.abs(found.m / exact.m - 1).max()]
        )
    order = np.log2(np.divide(errors[:-1], errors[1:]))
    np.testing.assert_allclose(order, 2, atol=0.1)


@pytest.mark.sample
@pytest.mark.parametrize("supports", SUPPORTS, ids=str)
def test_frequencies_against_the_spectral_beam(supports):
    exact = struck(THICK, supports)
    spectral = SpectralBeam(THICK, supports[0], supports[1], supports[2] * THICK.length)
    rigid = exact.rigid_modes
    np.testing.assert_allclose(
        exact.natural_frequencies(25),
        spectral.natural_frequencies()[rigid : rigid + 25],
        rtol=1e-8,
    )
