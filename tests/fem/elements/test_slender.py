"""Slender beams on fine meshes: K's entries have lost what its strains still tell."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
import parts
from antiosc import closed_form
from antiosc.fem.linalg.algebra import multiply
from antiosc.fem.linalg.petsc_algebra import csr
from marks import FREE_ON_PURPOSE

pytestmark = [pytest.mark.slow, FREE_ON_PURPOSE]

#: slenderness L/h and elements: ε (L/r)² n² is 1e-9, 5e-5, 0.5, 50 and 5e3
CASES = [
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


@pytest.mark.sample
@pytest.mark.parametrize("held", [True, False], ids=["cantilever", "free"])
@pytest.mark.parametrize(("slenderness", "elements", "method"), CASES)
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
    exact = closed_form.cantilever(beam) if held else closed_form.free_free(beam, 1.0)
    compare(model, exact.anti_oscillators(3), 2e-5 if elements < 400 else 1e-8)
    assert model.info["converged"] >= 3


@pytest.mark.sample
@pytest.mark.parametrize("held", [True, False], ids=["held", "free"])
def test_far_beyond_sixteen_digits_is_refused(held):
    structure = ao.Structure(
        parts.line(1.0, 100),
        ao.Beam(**parts.STEEL, section=ao.Section.rectangle(1e-10, 1e-10)),
        [ao.Support("left")] if held else [],
    )
    with pytest.raises((ao.AccuracyError, ao.NotConvergedError), match="slender"):
        ao.extract(structure, ao.Site((1.0, 0), (0, 1)), n=4)


@pytest.mark.sample
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
    exact = closed_form.cantilever(beam) if held else closed_form.free_free(beam, 1.0)
    compare(model, exact.anti_oscillators(3), 1e-5)


def test_springs_and_masses_on_a_slender_beam():
    """k0 = 1/(L³/3EI + L/κGA) + k, exact also where the spring is far below K's rounding."""
    section = ao.Section.rectangle(1e-5, 1e-5)
    beam = ao.Beam(**parts.STEEL, section=section)
    alone = 1 / (1 / (3 * beam.E * section.I) + 1 / (beam.G * section.A * section.shear))
    structure = ao.Structure(
        parts.line(1.0, 400), beam, [ao.Support("left")],
        attached=[ao.Spring("right", {"y": 2 * alone}), ao.PointMass("right", 1e-3)],
    )  # fmt: skip
    model = ao.extract(structure, ao.Site((1.0, 0), (0, 1)), n=4)
    assert model.k0 == pytest.approx(3 * alone, rel=1e-9)


def test_products_by_strains_are_those_of_the_entries():
    """On a stocky frame with a spring, where the entries have lost nothing yet."""
    section = ao.Section.rectangle(0.02, 0.03)
    beam = ao.Beam(**parts.STEEL, section=section, orientation=(1, 1, 1), offset=0.01)
    mesh = parts.frame(
        [(0, 0, 0), (0, 0.5, 0.1), (0.4, 0.5, 0)], [(0, 1), (1, 2)], 5,
        groups={"foot": (0, lambda x: np.isclose(x[1], 0)), "tip": (0, lambda x: x[0] > 0.39)},
    )  # fmt: skip
    structure = ao.Structure(
        mesh, beam, [ao.Support("foot")], attached=[ao.Spring("tip", {"z": 1e6, "rx": 1e3})]
    )
    x = np.random.default_rng(0).standard_normal((structure.K.getLocalSize()[0], 5))
    entries = csr(structure.K) @ x
    for k in (1, 5):  # one by one, and as a block
        product = multiply(structure.K, x[:, :k])
        assert np.abs(product - entries[:, :k]).max() < 1e-12 * np.abs(entries).max()
