"""Uniform beams against formulae, the article and identities."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.models.closed_form import UniformBeam
from scenes import BEAM, finely
from struck_beams import (
    ARTICLE,
    SLENDER,
    SOME,
    THICK,
    UNIT,
    StruckBeam,
    cantilever,
    cutoff,
    free_free,
    frequencies,
    hinged_roots,
    modes,
    pinned_free,
    pinned_pinned,
    struck,
)


@pytest.mark.parametrize("beam", [SLENDER, THICK], ids=["slender", "thick"])
def test_static_stiffness_formulae(beam):
    L, EI, kGA = beam.length, beam.EI, beam.kGA
    a, b = 0.3 * L, 0.7 * L
    cases = {
        cantilever(beam): L**3 / (3 * EI) + L / kGA,
        cantilever(beam, a): a**3 / (3 * EI) + a / kGA,
        pinned_pinned(beam): L**3 / (48 * EI) + L / (4 * kGA),
        pinned_pinned(beam, a): (a * b) ** 2 / (3 * EI * L) + a * b / (kGA * L),
        StruckBeam(beam, "clamped", "clamped", L / 2): L**3 / (192 * EI) + L / (4 * kGA),
    }
    for case, compliance in cases.items():
        assert 1 / case.static_stiffness == pytest.approx(compliance, rel=1e-12)


@pytest.mark.parametrize("kind", [cantilever, free_free])
def test_what_a_mode_carries_is_the_integral_of_its_shape(kind):
    """Weight and momenta by Simpson's rule over a beam of 0.8 m without rotary inertia."""
    beam = UniformBeam.euler_bernoulli(**{**ARTICLE, "length": 0.8})
    x = np.linspace(0, 0.8, 401)
    simpson = np.full(401, 2.0)
    simpson[1::2], simpson[[0, -1]] = 4.0, 1.0
    simpson *= beam.rhoA * 0.002 / 3
    body = modes(kind(beam, 0.3), 2, x).modal()
    shapes = body.shape.T
    np.testing.assert_allclose(body.weight, shapes @ simpson, rtol=1e-7, atol=1e-8)
    mass = shapes @ (simpson * shapes).T
    np.testing.assert_allclose(mass, np.eye(len(mass)), rtol=0, atol=1e-6)
    if body.inertia is None:
        return
    about = body.inertia.point[0]
    np.testing.assert_allclose(body.inertia.momentum[:, 1], shapes @ simpson, atol=1e-8)
    turning = (shapes * simpson) @ (x - about)
    np.testing.assert_allclose(np.abs(body.inertia.momentum[:, 5]), np.abs(turning), atol=1e-8)


def test_rigid_body_mass_formulae():
    L, site = THICK.length, 0.3 * THICK.length
    J = THICK.rhoA * L**3 / 12 + THICK.rhoI * L
    expected = 1 / (1 / THICK.mass + (site - L / 2) ** 2 / J)
    assert free_free(THICK, site).static_mass == pytest.approx(expected, rel=1e-13)
    expected = (THICK.rhoA * L**3 / 3 + THICK.rhoI * L) / site**2
    assert pinned_free(THICK, site).static_mass == pytest.approx(expected, rel=1e-13)


@pytest.mark.slow
def test_pinned_free_beam_is_the_articles():
    """(24)-(27) exactly for Euler-Bernoulli; psi_i = c_i sin(i pi x/L)."""
    beam = UniformBeam.euler_bernoulli(**ARTICLE)
    x = np.array([0.2, 0.5, 1.0])
    model = pinned_free(beam).anti_oscillators(60, x)
    i = np.arange(1, 61)
    np.testing.assert_allclose(model.m, 2 * beam.mass / (i * np.pi) ** 2, rtol=1e-9)
    np.testing.assert_allclose(model.omega, (i * np.pi) ** 2 * beam.omega_unit, rtol=1e-10)
    assert model.k0 == 0
    assert model.m_st == pytest.approx(beam.mass / 3, rel=1e-13)
    c = -2 * (-1.0) ** i / (i * np.pi)
    np.testing.assert_allclose(model.shapes[:, 0], x, atol=1e-14)
    np.testing.assert_allclose(
        model.shapes[:, 1:], c * np.sin(np.outer(x, i * np.pi)), rtol=1e-7, atol=1e-9
    )


@pytest.mark.slow
def test_pinned_free_timoshenko_masses_of_both_spectra():
    """Masses by M(CR, i)²/M(i, i) of sin and cos; the shear mode at the cut-off holds rhoI/L."""
    beam, n, L = THICK, 150, THICK.length
    i = np.arange(1, 400)
    roots = hinged_roots(beam, i, beam.alpha)
    q = i * np.pi / L
    ratio = q - roots**2 * beam.rhoA / (beam.kGA * q)  # cos amplitude of the rotation
    modal = beam.rhoA * L / 2 + beam.rhoI * L / 2 * ratio**2
    # M(CR, i) = rhoA ∫ x/L sin + rhoI ∫ ratio cos/L, and the second integral vanishes
    masses = (beam.rhoA * L / (i * np.pi)) ** 2 / modal
    omega = np.append(roots, cutoff(beam))
    order = np.argsort(omega)[:n]
    model = pinned_free(beam).anti_oscillators(n)
    assert model.omega[-1] > cutoff(beam)
    np.testing.assert_allclose(model.omega, omega[order], rtol=1e-9)
    np.testing.assert_allclose(model.m, np.append(masses, beam.rhoI / L)[order], rtol=1e-6)
    np.testing.assert_allclose(masses.sum(axis=0), 2 * beam.mass / (i * np.pi) ** 2, rtol=1e-9)
    assert model.m_st == pytest.approx(beam.mass / 3 + beam.rhoI / L, rel=1e-12)


@pytest.mark.parametrize("supports", SOME, ids=str)
def test_modes_and_anti_oscillators_are_one_beam(supports):
    """Σ b²/(ω_j² - ω²) + r from the zeros of Z against 1/Z from its poles."""
    beam = struck(THICK, supports)
    model = beam.anti_oscillators(60)
    body = modes(beam, 60, [beam.site], static_correction=True).modal()
    omega = 0.8 * body.omega[body.b > 0][1:4]
    H = 1 / model.dynamic_stiffness(omega)
    np.testing.assert_allclose(body.receptance(omega).real, H, atol=2e-4 * np.abs(H).max())
    assert body.r > 0
    # what the modes left out deflect per unit force, at the site and as a shape, is one thing
    np.testing.assert_allclose(body.residual, body.r, rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("supports", SOME, ids=str)
def test_shapes_expand_the_static_shape(supports):
    """phi_st - Σ psi_i → 0 away from the site, and every psi_i vanishes at the site."""
    beam = struck(THICK, supports)
    x = np.array([0.11, 0.52, 0.83]) * THICK.length
    model = beam.anti_oscillators(40, np.append(x, beam.site))
    np.testing.assert_allclose(model.shapes[-1, 1:], 0, atol=1e-8)
    rest = model.shapes[:-1, 0] - model.shapes[:-1, 1:].sum(axis=1)
    near = np.abs(x - beam.site) < 0.12 * THICK.length
    assert np.all(np.abs(rest[~near]) < 0.05)


@pytest.mark.slow
def test_participation_is_the_mass_moved():
    """A unit uniform acceleration of a free beam: phi_0 and psi_i together feel M(CR, 1)."""
    beam = free_free(THICK, 0.3 * THICK.length)
    model = beam.anti_oscillators(60)
    # M-orthogonality of phi_CR to the rigid motion about the site: M(CR, 1) = m_CR
    assert model.participation.sum() == pytest.approx(model.m_st, rel=1e-12)
    # constraint modes are orthogonal to phi_0, and 1 = phi_CR + (rotation about the site)
    np.testing.assert_allclose(model.participation[1:], model.m, rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("beam", "orders"), [(UNIT, (3, 5, 7)), (THICK, (1, 3, 3))])
def test_orders_of_what_truncation_leaves_out(beam, orders):
    """Where bending governs, and where the short waves are shear waves (omega_j ~ j).

    Left out of H by n modes: Σ b²/ω². Left out of Z/ω⁴ by n anti-oscillators: Σ m/ω². Left out of
    H/ω² in spite of static correction: Σ b²/ω⁴.
    """
    case, top = pinned_pinned(beam), 50
    body, model = modes(case, top).modal(), case.anti_oscillators(top)
    sums = ((body.b / body.omega) ** 2, model.m / model.omega**2, body.b**2 / body.omega**4)
    wholes = (1 / case.static_stiffness, sums[1].sum(), sums[2].sum())
    for terms, whole, order in zip(sums, wholes, orders, strict=True):
        left = whole - np.cumsum(terms)
        assert np.log2(left[9] / left[19]) == pytest.approx(order, abs=0.3)


@pytest.mark.sample(-1)
@pytest.mark.parametrize("site", [2 / 3, 1.0])
def test_a_pinned_beam_turns_even_struck_at_its_centre_of_percussion(site):
    """There the translation gives the site its own velocity, but the pin allows it not."""
    beam = pinned_free(BEAM, site)
    model = beam.anti_oscillators(5, [1.0])
    hit = ao.simulate(model, ao.Obstacle(gap=1e-2), ao.Hertz(1e9), 1e-3, initial_velocity=3.0)
    spin = -3.0 / site
    assert hit.field(1e-3) == pytest.approx(1e-3 * spin)
    tensor = BEAM.mass * (1 / 3 + BEAM.alpha)
    assert hit.energy.kinetic[0] == pytest.approx(tensor * spin**2 / 2, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "site"), [("anti-oscillators", 0.3), ("modes", 1.0), ("corrected", 0.5)]
)
def test_a_free_beam_falls_and_spins_as_a_whole(kind, site):
    """Momentum, energy and field of the struck free beam against rigid-body mechanics."""
    beam = free_free(BEAM, site)
    length, mass = BEAM.length, BEAM.mass
    x = np.linspace(0, length, 5)
    model = {
        "anti-oscillators": lambda: beam.anti_oscillators(6, x),
        "modes": lambda: modes(beam, 6, x),
        "corrected": lambda: modes(beam, 6, x, static_correction=True),
    }[kind]()
    V, W, g = -0.4, 2.0, -9.81
    tensor = mass * length**2 * (1 / 12 + BEAM.alpha)
    hit = ao.simulate(
        model, ao.RigidMass(0.3 * mass, 1.0), ao.Hertz(1e9), 4e-3, gap=1e-4, gravity=(0, g, 0),
        initial_velocity=ao.Motion((0, V, 0), (0, 0, W)),
    )  # fmt: skip
    energy = mass * V**2 / 2 + tensor * W**2 / 2 + 0.15 * mass
    assert hit.energy.kinetic[0] == pytest.approx(energy, rel=1e-9)
    start = hit.contacts[0][0]
    times = start * np.linspace(0.2, 1, 4)
    fallen = V * times + g * times**2 / 2
    expected = fallen[:, None] + W * times[:, None] * (x - length / 2)
    found = hit.field(times)
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())
    t = hit.time
    parts = 32
    close, F = finely(hit, parts)
    J = np.concatenate(([0], np.cumsum(np.diff(close) * (F[1:] + F[:-1]) / 2)))[::parts]
    np.testing.assert_allclose(hit.cumulative_impulse, J, atol=1e-6 * J.max())
    P = mass * (V + g * t) + J
    L = tensor * W + (beam.site - length / 2) * J
    np.testing.assert_allclose(hit.momentum[:, 1], P, atol=1e-6 * np.abs(P).max())
    np.testing.assert_allclose(hit.angular_momentum[:, 2], L, atol=1e-6 * np.abs(L).max())
    # a number translates the whole beam; nothing is held at its centre of percussion
    number = ao.simulate(model, ao.Obstacle(gap=0.1), ao.Hertz(1e9), 1e-3, initial_velocity=1.5)
    assert number.energy.kinetic[0] == pytest.approx(mass * 1.5**2 / 2, rel=1e-9)
    motion = ao.Motion(velocity=(1, 0, 0))
    with pytest.raises(ao.InputError, match="along x"):
        ao.simulate(model, ao.Obstacle(), ao.Hertz(1e9), 1e-3, initial_velocity=motion)


@pytest.mark.slow
def test_unobservable_modes_are_left_out():
    """At mid-span of a symmetric beam every second mode has a node there."""
    beam = pinned_pinned(SLENDER)
    model, constrained = beam.anti_oscillators(5), frequencies(beam, 10, held=True)
    np.testing.assert_allclose(model.omega, constrained[1::2], rtol=1e-10)
    omega = modes(beam, 5).modal().omega
    np.testing.assert_allclose(omega, frequencies(beam, 10)[::2], rtol=1e-10)
