"""Frequencies of uniform beams against textbooks and characteristic equations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from antiosc.models.closed_form import UniformBeam
from struck_beams import (
    SLENDER,
    THICK,
    UNIT,
    cutoff,
    free_free,
    frequencies,
    hinged_roots,
    pinned_pinned,
    struck,
)


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
    found = np.sqrt(frequencies(struck(UNIT, (*ends, place)), 30))
    np.testing.assert_allclose(found, betas, rtol=1e-10)


@pytest.mark.parametrize("beam", [SLENDER, THICK], ids=["slender", "thick"])
def test_hinged_beam_fulfils_the_articles_equation_in_both_spectra(beam):
    """None of 200 is missed, above the cut-off either (where the pure shear mode joins)."""
    roots = hinged_roots(beam, np.arange(1, 400), beam.alpha)
    expected = np.sort(np.append(roots, cutoff(beam)))[:200]
    assert expected[-1] > cutoff(beam)
    found = frequencies(pinned_pinned(beam, 0.41 * beam.length), 200)
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


def test_shear_beam_limit():
    """Without rotary inertia and rigid in bending, the hinged beam is a string: order 1/EI."""
    errors = []
    for EI in (1e2, 1e3, 1e4):
        found = frequencies(pinned_pinned(UniformBeam(EI, 1.0, 1.0, kGA=1.0), 0.3), 3)
        errors.append(np.abs(found / (np.pi * np.arange(1, 4)) - 1).max())
    assert errors[-1] < 1e-5
    np.testing.assert_allclose(np.log10(np.divide(errors[:-1], errors[1:])), 1, atol=0.02)


def test_printed_alpha_is_wrong_and_its_correction_right():
    """Short waves: E/rho and k'G/rho are speeds that cannot depend on the section's size."""
    i = np.array([20000.0])
    alpha = THICK.rhoI / (THICK.rhoA * THICK.length**2)
    assert alpha == pytest.approx(8e-6 / 1e-2 / 0.3**2)
    bar, shear = math.sqrt(70e9 / 2700), math.sqrt(5 / 6 * 70e9 / 2.6 / 2700)
    speed = hinged_roots(THICK, i, alpha)[:, 0] * THICK.length / (i[0] * np.pi)
    np.testing.assert_allclose(np.sort(speed), [shear, bar], rtol=1e-6)
    printed = (8e-6 / 1e-2) ** 2 / 0.3**2
    speed = hinged_roots(THICK, i, printed)[:, 0] * THICK.length / (i[0] * np.pi)
    assert speed.max() > 10 * bar
    # The library's own spectra have these asymptotes.
    top = frequencies(pinned_pinned(THICK, 0.41 * THICK.length), 200)
    within = top[-1] * THICK.length / np.pi
    assert within / bar + within / shear == pytest.approx(200, rel=0.02)
