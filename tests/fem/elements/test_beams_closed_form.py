"""Beams against closed forms of Timoshenko, and slender ones that lose digits."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
import parts
from antiosc import closed_form
from marks import FREE_ON_PURPOSE
from struck_beams import free_free

pytestmark = FREE_ON_PURPOSE


LENGTH = 1.0
WIDTH = 0.0141421356237  # the article's case 2: 2 cm², 0.33 cm⁴
SECTION = ao.Section.rectangle(WIDTH, WIDTH)
BEAM = ao.Beam(E=67e9, nu=0.33, rho=2400.0, section=SECTION)
EXACT = closed_form.UniformBeam.timoshenko(
    E=67e9, nu=0.33, rho=2400.0, area=SECTION.A, inertia=SECTION.I, length=LENGTH
)
PIN, CLAMP = ("x", "y"), "all"
# ends held, site, closed form
CASES = {
    "cantilever, tip": ([("left", CLAMP)], 1.0, closed_form.cantilever(EXACT)),
    "pinned-pinned, mid-span": (
        [("left", PIN), ("right", "y")], 0.5, closed_form.pinned_pinned(EXACT)
    ),
    "pinned-free, tip": ([("left", PIN)], 1.0, closed_form.pinned_free(EXACT)),
    "free-free, at 0.3 L": ([], 0.3, free_free(EXACT, 0.3)),
}  # fmt: skip
N = 5


def meshed(name: str, elements: int, order: int, n: int = N) -> ao.AntiOscillators:
    ends, site, _ = CASES[name]
    supports = [ao.Support(*end) for end in ends]
    structure = ao.Structure(parts.line(LENGTH, elements), BEAM, supports, order=order)
    return ao.extract(structure, ao.Site((site * LENGTH, 0), (0, 1)), n=n, method="modes")


def errors(model: ao.AntiOscillators, exact: ao.AntiOscillators) -> dict[str, np.ndarray]:
    return {
        "omega": np.abs(model.omega / exact.omega - 1),
        "m": np.abs(model.m / exact.m - 1),
    }


@pytest.mark.parametrize(("order", "rate"), [(2, 4.0), (1, 2.0)])
@pytest.mark.parametrize("name", CASES)
@pytest.mark.slow
def test_order_of_convergence(name, order, rate):
    """h⁴ with quadratic elements and two-point shear, h² with linear ones and one-point shear."""
    exact = CASES[name][2].anti_oscillators(N)
    counts = (40, 80) if order == 2 else (80, 160)
    models = [meshed(name, count, order) for count in counts]
    for quantity in ("omega", "m"):
        found = np.array([errors(model, exact)[quantity] for model in models])
        rates = np.log2(found[-2] / found[-1])[1:4]  # the first mode reaches rounding
        assert rates.min() > rate - 0.25, (quantity, found)
        if quantity == "omega":  # the masses of some sites converge faster
            assert rates.max() < rate + 0.25, found


@pytest.mark.slow
def test_stiffness_of_the_article_supported_beam():
    """k0 = 48 EI/L³ with shear; five observable anti-oscillators hold 86 % (Article, Fig. 8)."""
    model = meshed("pinned-pinned, mid-span", 50, 1)
    bending = 48 * BEAM.E * SECTION.I / LENGTH**3
    assert model.k0 == pytest.approx(bending, rel=2e-3)
    assert model.m.sum() / model.m_st == pytest.approx(0.86, abs=0.01)
    assert model.info["modes_unobservable"] >= 4
    assert meshed("pinned-free, tip", 50, 1).m.sum() / meshed(
        "pinned-free, tip", 50, 1
    ).m_st == pytest.approx(0.89, abs=0.01)


@pytest.mark.slow
def test_a_beam_beside_its_line_is_the_same_beam():
    """Its modes and what the ground moves; at the line twist adds e²L/(GJ) to what gives way."""
    section, L, e = ao.Section.rectangle(0.03, 0.01), 0.5, 0.05
    beams = [
        ao.Structure(
            parts.line(L, 20, (1.0, 0.0, 0.0)),
            ao.Beam(**parts.STEEL, section=section, orientation=(0, 0, 1), offset=offset),
            [ao.Support("left")],
        )
        for offset in (0.0, e)
    ]
    plain, beside = (beam.natural_modes(6) for beam in beams)
    np.testing.assert_allclose(beside.omega, plain.omega, rtol=1e-9)
    np.testing.assert_allclose(beside.effective_mass, plain.effective_mass, atol=1e-9)
    side = ao.Site((L, 0, 0), (0, 1, 0))
    before, after = (1 / ao.extract(beam, side, 4).k0 for beam in beams)
    G = parts.STEEL["E"] / (2 * (1 + parts.STEEL["nu"]))
    assert after - before == pytest.approx(e**2 * L / (G * section.torsion), rel=1e-8)
    model = ao.extract(beams[1], side, 4)
    hit = ao.simulate(model, ao.RigidMass(1.0, 0.1), ao.Linear(1e4), 1e-3)
    held = ao.reactions(beams[1], hit, side, [1e-3])
    root = ao.probe(beams[1], hit, (0.0, 0, 0), "section_forces", [1e-3])[0]
    assert root[2] == pytest.approx(held.total[0, 1], rel=0.02)


#: slenderness L/h and elements: ε (L/r)² n² is 1e-9, 5e-5, 0.5, 50 and 5e3
SLENDER = [
    *((20, 40, method) for method in ("krylov", "modes")),
    *((250, 400, method) for method in ("krylov", "modes")),
    (1e4, 1000, "krylov"),
    pytest.param(1e4, 1000, "modes", marks=pytest.mark.slow),
    *(pytest.param(1e5, 1000, method, marks=pytest.mark.slow) for method in ("krylov", "modes")),
    pytest.param(1e6, 1000, "krylov", marks=pytest.mark.slow),
]


def uniform(section: ao.Section, length: float) -> closed_form.UniformBeam:
    return closed_form.UniformBeam.timoshenko(
        **parts.STEEL, area=section.A, inertia=section.I, length=length,
        shear_coefficient=section.shear,
    )  # fmt: skip


def compare(model: ao.AntiOscillators, exact: ao.AntiOscillators, tol: float) -> None:
    if exact.k0:
        assert model.k0 == pytest.approx(exact.k0, rel=1e-8)
    else:
        assert model.k0 == 0
    assert model.m_st == pytest.approx(exact.m_st, rel=1e-7)
    np.testing.assert_allclose(model.omega[:3], exact.omega, rtol=tol)
    np.testing.assert_allclose(model.m[:3], exact.m, rtol=2 * tol)


@pytest.mark.slow
@pytest.mark.parametrize("held", [True, False], ids=["cantilever", "free"])
@pytest.mark.parametrize(("slenderness", "elements", "method"), SLENDER)
def test_however_slender_and_fine(slenderness, elements, held, method):
    side = 1.0 / slenderness
    section = ao.Section.rectangle(side, side)
    structure = ao.Structure(
        parts.line(1.0, elements),
        ao.Beam(**parts.STEEL, section=section),
        [ao.Support("left")] if held else [],
    )
    model = ao.extract(structure, ao.Site((1.0, 0), (0, 1)), n=8, method=method)
    beam = uniform(section, 1.0)
    exact = closed_form.cantilever(beam) if held else free_free(beam, 1.0)
    compare(model, exact.anti_oscillators(3), 2e-5 if elements < 400 else 1e-8)
    assert model.info["converged"] >= 3


@pytest.mark.slow
@pytest.mark.parametrize("held", [True, False], ids=["held", "free"])
def test_far_beyond_sixteen_digits_is_refused(held):
    structure = ao.Structure(
        parts.line(1.0, 100),
        ao.Beam(**parts.STEEL, section=ao.Section.rectangle(1e-10, 1e-10)),
        [ao.Support("left")] if held else [],
    )
    with pytest.raises((ao.AccuracyError, ao.NotConvergedError), match="slender"):
        ao.extract(structure, ao.Site((1.0, 0), (0, 1)), n=4)


@pytest.mark.slow
@pytest.mark.parametrize("held", [True, False], ids=["cantilever", "free"])
@pytest.mark.parametrize("axis", [(1.0, 0.0), (1.0, 2.0, 2.0)], ids=["plane", "space"])
@pytest.mark.parametrize("side", [0.2, 1e-4], ids=["stocky", "slender"])
def test_a_beam_that_is_rigid_in_shear(side, axis, held):
    """Euler and Bernoulli's, whatever the section; Timoshenko's stocky one is 10 % off."""
    section = ao.Section.rectangle(side, side)
    along = np.array(axis) / np.linalg.norm(axis)
    structure = ao.Structure(
        parts.line(1.0, 60, axis),
        ao.Beam(**parts.STEEL, section=section, shear=False),
        [ao.Support("left")] if held else [],
    )
    across = (0, 1) if len(axis) == 2 else (0, 1, -1)
    model = ao.extract(structure, ao.Site(along, across), n=8)
    beam = closed_form.UniformBeam.euler_bernoulli(
        E=210e9, rho=7850.0, area=section.A, inertia=section.I, length=1.0
    )
    exact = closed_form.cantilever(beam) if held else free_free(beam, 1.0)
    compare(model, exact.anti_oscillators(3), 1e-5)
