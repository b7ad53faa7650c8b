"""Closed-form beams against tables, formulae, identities and a spectral discretisation."""

from __future__ import annotations

import re
import runpy

import numpy as np
import pytest

from antiosc.base.errors import InputError
from antiosc.closed_form import (
    StruckBeam,
    UniformBeam,
    cantilever,
    clamped_clamped,
    free_free,
    pinned_free,
    pinned_pinned,
)
from paths import ROOT
from refusals import refused
from spectral_beam import SpectralBeam
from struck_beams import ARTICLE, SLENDER, SOME, SUPPORTS, THICK, UNIT, struck

# ---- masses and stiffness ------------------------------------------------------------------------


@pytest.mark.sample(-1)
@pytest.mark.parametrize("supports", [s for s in SUPPORTS if struck(UNIT, s).rigid_modes == 0])
def test_anti_oscillators_against_the_articles_definitions(supports):
    """M(st, i)²/M(i, i) in polynomials against residues of the transcendental solution."""
    model = struck(THICK, supports).anti_oscillators(15)
    spectral = SpectralBeam(THICK, supports[0], supports[1], supports[2] * THICK.length)
    k0, m_st, m, omega = spectral.anti_oscillators()
    seen = m > 1e-8 * m_st
    assert model.k0 == pytest.approx(k0, rel=1e-9)
    assert model.m_st == pytest.approx(m_st, rel=1e-9)
    np.testing.assert_allclose(model.omega, omega[seen][:15], rtol=1e-8)
    np.testing.assert_allclose(model.m, m[seen][:15], rtol=1e-6)


@pytest.mark.parametrize("beam", [SLENDER, THICK], ids=["slender", "thick"])
def test_static_stiffness_formulae(beam):
    L, EI, kGA = beam.length, beam.EI, beam.kGA
    a, b = 0.3 * L, 0.7 * L
    cases = {
        cantilever(beam): L**3 / (3 * EI) + L / kGA,
        cantilever(beam, a): a**3 / (3 * EI) + a / kGA,
        pinned_pinned(beam): L**3 / (48 * EI) + L / (4 * kGA),
        pinned_pinned(beam, a): (a * b) ** 2 / (3 * EI * L) + a * b / (kGA * L),
        clamped_clamped(beam): L**3 / (192 * EI) + L / (4 * kGA),
    }
    for case, compliance in cases.items():
        assert 1 / case.static_stiffness == pytest.approx(compliance, rel=1e-12)


@pytest.mark.sample
@pytest.mark.parametrize("supports", SOME, ids=str)
def test_dynamic_stiffness_is_the_models(supports):
    """All of Z from k0, m_st, m_i, omega_i; the error left falls as the fourth power of omega."""
    beam = struck(THICK, supports)
    model = beam.anti_oscillators(30)
    # midway between an antiresonance and the natural frequency above, so never near either
    omega = model.omega[:4] * 0.93
    scale = model.k0 + omega**2 * model.m_st
    error = np.abs(model.dynamic_stiffness(omega) - beam.dynamic_stiffness(omega)) / scale
    left = omega**2 / model.omega[-1] ** 2 * model.m0 / model.m_st
    assert np.all(error < 3 * left + 1e-10)
    assert error[0] < 1e-3


# ---- bad input -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: UniformBeam(1, 1, 1, kGA=0), "kGA"),
        (lambda: UniformBeam(1, 1, 1, kGA=-np.inf), "kGA"),  # rigid in shear is +inf alone
        (lambda: UniformBeam.timoshenko(**ARTICLE, nu=0.5), "nu"),
        (lambda: StruckBeam(UNIT, "hinged", "free", 1.0), "left"),
        (lambda: cantilever(UNIT, 1.2), "site"),
        (lambda: pinned_pinned(UNIT, 0.0), "support"),
        (lambda: cantilever(UNIT).anti_oscillators(0), "n"),
        (lambda: cantilever(UNIT).anti_oscillators(2, [1.5]), "x"),
        (lambda: cantilever(UNIT).dynamic_stiffness(0.0), "omega"),
    ],
)
def test_bad_input_is_named(make, word):
    with refused(None, word, InputError):
        make()


@pytest.mark.sample
@pytest.mark.parametrize("kind", [cantilever, free_free])
def test_what_a_mode_carries_is_the_integral_of_its_shape(kind):
    """Weight and momenta by Simpson's rule over a beam of 0.8 m without rotary inertia."""
    beam = UniformBeam.euler_bernoulli(**{**ARTICLE, "length": 0.8})
    x = np.linspace(0, 0.8, 401)
    simpson = np.full(401, 2.0)
    simpson[1::2], simpson[[0, -1]] = 4.0, 1.0
    simpson *= beam.rhoA * 0.002 / 3
    modes = kind(beam, 0.3).modes(2, x)
    np.testing.assert_allclose(modes.weight, modes.shapes @ simpson, rtol=1e-7, atol=1e-9)
    mass = modes.shapes @ (simpson * modes.shapes).T
    np.testing.assert_allclose(mass, np.eye(len(mass)), rtol=0, atol=1e-6)
    if modes.inertia is None:
        return
    about = modes.inertia.point[0]
    both = np.vstack((modes.hidden, modes.shapes)) * simpson
    np.testing.assert_allclose(modes.inertia.momentum[:, 1], both.sum(axis=1), atol=1e-8)
    turning = both @ (x - about)
    np.testing.assert_allclose(np.abs(modes.inertia.momentum[:, 5]), np.abs(turning), atol=1e-8)


# --- The page of the closed forms: its example runs as it stands, and it names all that is publ


PAGE = (ROOT / "docs" / "closed_forms.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_example_runs(tmp_path, capsys):
    (program,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    (tmp_path / "program.py").write_text(program, encoding="utf-8")
    names = runpy.run_path(str(tmp_path / "program.py"))
    assert "peak force" in capsys.readouterr().out
    # shear makes the plate softer, and an isotropic layer is Mindlin's plate
    assert 0.98 * names["thin"] < names["thick"] < names["thin"]
    assert names["same"] == pytest.approx(names["thick"], rel=1e-9)
    plate = names["plate"]
    assert names["under_patch"] == pytest.approx(plate.compliance(0.12, 0.08), rel=0.05)
    # Euler's beam, which shear and rotary inertia slow down the more the higher the mode
    beam, natural = names["beam"], names["natural"]
    euler = (np.arange(1, 5) * np.pi / beam.length) ** 2 * np.sqrt(beam.EI / beam.rhoA)
    assert np.all(np.diff(natural / euler) < 0)
    assert 0.9 < natural[0] / euler[0] < 1
    assert natural[-1] < beam.cutoff
    hit = names["hit"]
    assert hit.impulse == pytest.approx(0.1 * (1.0 - hit.impactor_velocity[-1]), rel=1e-6)


def test_rigid_body_mass_formulae():
    L, site = THICK.length, 0.3 * THICK.length
    J = THICK.rhoA * L**3 / 12 + THICK.rhoI * L
    expected = 1 / (1 / THICK.mass + (site - L / 2) ** 2 / J)
    assert free_free(THICK, site).static_mass == pytest.approx(expected, rel=1e-13)
    expected = (THICK.rhoA * L**3 / 3 + THICK.rhoI * L) / site**2
    assert pinned_free(THICK, site).static_mass == pytest.approx(expected, rel=1e-13)
